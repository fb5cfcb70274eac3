import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Air, Charge, Scene
from jblast.sensors.camera.fireball import Appearance, cloud, glow, glow_table
from jblast.sensors.camera.image import luminance
from jblast.waves.fireball import fireball_duration
from jblast.waves.propagation import ambient

LOOK = Appearance(rim=0.8)


@pytest.fixture(scope="module")
def lights():
    """The light by the table, and by the law itself; and the change of both."""

    def both(scene, times):
        table = glow_table(ambient(scene.air)[0], LOOK)
        ball = jax.tree_util.Partial(cloud, scene, scene.charge)

        def law(time):
            now = ball(time)
            return jnp.stack(glow(now.temperature, now.air, LOOK))

        def each(light):
            return jax.vmap(lambda t: jax.jvp(light, (t,), (jnp.ones(()),)))(times)

        return each(lambda t: jnp.stack(table(ball(t)))), each(law)

    return jax.jit(both)


@pytest.mark.parametrize("kelvin", [216.65, 288.15, 320.0])
def test_the_table_is_planck_s_law_from_before_the_burst_to_ten_minutes_after(
    lights, kelvin
):
    charge = Charge(mass_kg=1.0, position_m=(0.0, 0.0, 1.0), time_s=2.0)
    scene = Scene(charge, air=Air(temperature=kelvin))
    since = np.geomspace(1e-6, 600.0, 400)
    ours, law = lights(scene, jnp.asarray(2.0 + np.r_[-1.0, 0.0, since]))
    # h^4/384 of the fourth derivative, 24 c2 / (lambda T^5) of the logarithm's
    # c2 / (lambda T): 3e-10 at 217 K; the slope loses a power of h, which is 0.5 K
    for one, other, close in zip(ours, law, (1e-9, 1e-8), strict=True):
        one, other = luminance(one), luminance(other)
        np.testing.assert_allclose(one, other, rtol=close, atol=1e-300)
    np.testing.assert_array_equal(ours[1][0], 0.0)
    # and its colour, while there is something to see
    glows = np.r_[True, True, since < fireball_duration(1.0)]
    ours, law = (
        (light / luminance(light)[..., None])[glows] for light in (ours[0], law[0])
    )
    np.testing.assert_allclose(ours, law, rtol=0, atol=1e-9)


def test_a_charge_that_has_not_gone_off_has_a_finite_glow(lights):
    for time in (5.0, np.inf):
        scene = Scene(Charge(mass_kg=1.0, position_m=(0.0, 0.0, 1.0), time_s=time))
        (ours, _), _ = lights(scene, jnp.full(402, 2.5))
        assert jnp.isfinite(ours).all()
