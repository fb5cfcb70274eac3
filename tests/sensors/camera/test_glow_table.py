import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene
from jblast.sensors.camera.fireball_image import cloud, glow
from jblast.sensors.camera.glow_table import glow_table
from jblast.sensors.camera.look import Look

LOOK = Look(rim=0.8)


def test_the_table_is_planck_s_law_from_before_the_burst_to_its_end():
    charge = Charge(mass=15.0, up=1.0, time=2.0)
    scene = Scene(charge=charge)
    table = glow_table(scene, charge, LOOK, jnp.asarray(3.0))
    times = np.random.default_rng(0).uniform(2.0, 3.0, 300)
    times = jnp.asarray(np.r_[1.0, 2.0, 2.0 + 1e-6, times, 3.0])

    def both(lights):
        return jax.jit(jax.vmap(lambda t: jax.jvp(lights, (t,), (jnp.ones(()),))))

    ours = both(lambda t: jnp.stack(table.at(t)))(times)
    law = both(lambda t: jnp.stack(glow(cloud(scene, charge, t), LOOK)))(times)
    # h^4/384 of the fourth derivative; the slope loses a power of h
    np.testing.assert_allclose(ours[0], law[0], rtol=1e-9)
    np.testing.assert_allclose(ours[1][2:], law[1][2:], rtol=1e-6)
    np.testing.assert_array_equal(ours[1][0], 0.0)


def test_a_charge_that_has_not_gone_off_has_a_finite_glow():
    for time in (5.0, np.inf):
        charge = Charge(mass=15.0, up=1.0, time=time)
        table = glow_table(Scene(charge=charge), charge, LOOK, jnp.asarray(3.0))
        limb, middle = table.at(jnp.asarray(2.5))
        assert jnp.isfinite(limb).all()
        assert jnp.isfinite(middle).all()
