"""Nothing is recorded of a charge whose time is infinite: it never detonates."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.placement import resolve_positions
from jblast.scene import Charge, Scene, Sensor, UncertainScene
from jblast.sensors import planned_layout, record, simulate
from jblast.sensors.simulated_readings import loadings, observe, written

QUANTITIES = {
    "air_arrival_s": ("kingery_bulmash", np.inf),
    "arrival_difference_s": ("", np.nan),
    "ground_arrival_s": ("wu_hao", np.inf),
    "peak_overpressure_pa": ("kingery_bulmash", 0.0),
    "bearing_rad": ("line_of_sight", np.nan),
    "fireball_radius_m": ("fireball", 0.0),
}
"""Law of each quantity, and the reading of a charge that never detonates."""
LAWS = {quantity: law for quantity, (law, _) in QUANTITIES.items() if law}
ABSENT = [absent for _, absent in QUANTITIES.values()]
SENSOR = Sensor(
    "a",
    jnp.array([20.0, 0.0, 1.0]),
    records=tuple((quantity, 0.01) for quantity in QUANTITIES),
    times_s=(2.001,),
)
ONE = Charge(mass_kg=15.0, time_s=2.0, name="one")
OTHER = Charge(mass_kg=3.0, position_m=(4.0, 0.0, 0.0), time_s=1.9, name="other")
NEVER = replace(OTHER, time_s=jnp.inf)
SCENE = Scene(charges=(ONE, OTHER), sensors=(SENSOR,))
WITH_NEVER = replace(SCENE, charges=(ONE, NEVER))
LAYOUT, SIGMA, NAMES = planned_layout(SCENE)
MINE = np.array(LAYOUT.shot) == 0
WEIGHTS = np.random.default_rng(3).normal(size=len(LAYOUT.quantity))


@jax.jit
def recorded(one, other):
    return record(replace(SCENE, charges=(one, other)), LAYOUT, LAWS)


@jax.jit
def slopes(one, other):
    def total(one, other):
        value = recorded(one, other).value
        return jnp.sum(jnp.where(jnp.isfinite(value) & MINE, WEIGHTS * value, 0.0))

    return jax.grad(total, (0, 1))(one, other)


@pytest.mark.slow
def test_readings_and_slopes_of_the_other_charge_are_unchanged():
    found, both = recorded(ONE, NEVER), recorded(ONE, OTHER)
    np.testing.assert_array_equal(found.value[MINE], both.value[MINE])
    np.testing.assert_array_equal(found.value[~MINE], ABSENT)
    assert found.valid[~MINE].all()  # there is no prediction to flag
    scatter, expected = (
        np.column_stack([each.record_sd, loadings(each, LAYOUT)])
        for each in (found, both)
    )
    np.testing.assert_array_equal(scatter[MINE], expected[MINE])
    assert (scatter[~MINE] == 0.0).all()
    assert np.isfinite(both.value).all()
    of_one, of_never = slopes(ONE, NEVER)
    expected, _ = slopes(ONE, OTHER)
    for here, there in zip(*map(jax.tree.leaves, (of_one, expected)), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-12)
    assert all(float(x) == 0.0 for x in jax.tree.leaves(of_never))


def test_simulated_readings_stay_absent():
    draw = jax.jit(lambda key: observe(key, WITH_NEVER, LAYOUT, LAWS, SIGMA))
    read = draw(jax.random.key(1))
    np.testing.assert_array_equal(read[~MINE], ABSENT)
    assert np.isfinite(read[MINE]).all()


def test_a_simulated_log_has_no_row_of_it():
    log = simulate(UncertainScene(WITH_NEVER, {}, "scene.toml"))
    assert set(log.shot) == {"one"}
    assert len(log) == len(QUANTITIES)
    none = replace(SCENE, charges=(replace(ONE, time_s=jnp.inf), NEVER))
    with pytest.raises(InputError, match=r"no sensor records .* never happen"):
        simulate(UncertainScene(none, {}, "scene.toml"))
    log = written(SCENE, LAYOUT, np.full(len(MINE), 2.5), np.asarray(SIGMA), NAMES)
    with pytest.raises(InputError, match=r"of 'other', which never happens .* is inf"):
        resolve_positions(log, WITH_NEVER)


@pytest.mark.parametrize("time", [np.nan, -np.inf])
def test_a_time_is_a_number_or_infinite(time):
    with pytest.raises(InputError, match="charge time_s: expected a number, or inf"):
        Charge(time_s=time)
