import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jblast.inference.many.fold import CannotFoldError, fold, over_cells
from jblast.registry import LAWS, call
from jblast.waves.paths import Path

LANE = jnp.linspace(0.5, 2.0, 5)[None, :]
ROW = np.linspace(1.0, 3.0, 3)[:, None]
ONE = np.full((3, 1), 7.0)


def program(x, row, one):
    place = jnp.stack([x, row, one])
    turn = jnp.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    turned = turn @ place
    chosen = turned[np.array([2, 0])].at[1].add(x**1.4)
    far = jnp.where(one > 3, jnp.sum(chosen), jnp.nan)
    return [far * 0.0 + jnp.linalg.norm(turned), chosen[1], jnp.max(place[None, :])]


def expected(function, *cells):
    shape = np.broadcast_shapes(*(c.shape for c in cells))
    full = [jnp.broadcast_to(c, shape) for c in cells]
    return jax.vmap(jax.vmap(function))(*full)


def test_a_folded_program_is_the_program():
    for got, want in zip(
        fold(program, [LANE, ROW, ONE]), expected(program, LANE, ROW, ONE), strict=True
    ):
        np.testing.assert_allclose(jnp.broadcast_to(got, want.shape), want, rtol=1e-14)


def test_a_loop_cannot_be_taken_apart_and_is_batched_instead():
    def program(x, row):
        return [lax.fori_loop(0, 3, lambda _, v: v * row, x)]

    with pytest.raises(CannotFoldError, match=r"scan|while"):
        fold(program, [LANE, ROW])
    (got,) = over_cells(program, [LANE, ROW])
    np.testing.assert_allclose(got, LANE * ROW**3, rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("quantity", "name"),
    [
        k
        for k in LAWS
        if k[1]
        in {"kingery_bulmash", "wu_hao", "shock_kinematics", "sadovsky", "ford_2021"}
    ],
)
def test_laws_over_cells_are_the_laws(quantity, name):
    law = LAWS[quantity, name]

    def program(mass, distance):
        path = Path(
            slant_range=distance,
            ground_range=distance,
            charge_mass=mass,
            height_of_burst=jnp.zeros(()),
            ambient_pressure=jnp.asarray(101325.0),
            sound_speed=jnp.asarray(340.0),
            air_density=jnp.asarray(1.2),
            p_speed=jnp.asarray(5660.0),
            sedov_gamma=jnp.asarray(1.4),
            time_since_detonation=jnp.asarray(0.01),
            sensor_height=jnp.zeros(()),
            temperature=jnp.asarray(280.0),
            relative_humidity=jnp.asarray(0.5),
            burst="surface",
            ground_path="head",
        )
        return [call(law.function, path)]

    distance = np.geomspace(5.0, 300.0, 4)[:, None]
    (got,) = over_cells(program, [LANE, distance])
    (want,) = expected(program, LANE, distance)
    np.testing.assert_allclose(jnp.broadcast_to(got, want.shape), want, rtol=1e-12)
