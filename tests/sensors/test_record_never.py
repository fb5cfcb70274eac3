"""A charge whose time is infinite never happens: nothing of it is recorded."""

import dataclasses

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
    "arrival_difference_s": ("", np.nan),  # of two that never come there is none
    "ground_arrival_s": ("wu_hao", np.inf),
    "peak_overpressure_pa": ("kingery_bulmash", 0.0),
    "bearing_rad": ("line_of_sight", np.nan),
    "fireball_radius_m": ("fireball", 0.0),
}
"""What is recorded, by which law, and what is read of a charge that never happens."""
LAWS = {quantity: law for quantity, (law, _) in QUANTITIES.items() if law}
NOTHING = [nothing for _, nothing in QUANTITIES.values()]
SENSOR = Sensor(
    "a",
    jnp.array([20.0, 0.0, 1.0]),
    records=tuple((quantity, 0.01) for quantity in QUANTITIES),
    times_s=(2.001,),
)
ONE = Charge(mass_kg=15.0, time_s=2.0, name="one")
OTHER = Charge(mass_kg=3.0, position_m=(4.0, 0.0, 0.0), time_s=1.9, name="other")
NEVER = dataclasses.replace(OTHER, time_s=jnp.inf)
SCENE = Scene(charges=(ONE, OTHER), sensors=(SENSOR,))
LAYOUT, SIGMA, NAMES = planned_layout(SCENE)
MINE = np.array(LAYOUT.shot) == 0


@jax.jit
def recorded(mine, others):
    return record(dataclasses.replace(SCENE, charges=(mine, others)), LAYOUT, LAWS)


@pytest.mark.slow
def test_nothing_is_read_of_it_and_all_else_as_without_it():
    found, with_both = recorded(ONE, NEVER), recorded(ONE, OTHER)
    alone = dataclasses.replace(SCENE, charges=(dataclasses.replace(ONE, name=""),))
    expected = record(alone, planned_layout(alone)[0], LAWS)
    np.testing.assert_allclose(found.value[MINE], expected.value, rtol=1e-14)
    np.testing.assert_allclose(found.record_sd[MINE], expected.record_sd, rtol=1e-14)
    np.testing.assert_array_equal(found.value[~MINE], NOTHING)
    assert found.valid[~MINE].all()  # nothing is asked of a law
    scatter = np.column_stack([found.record_sd, loadings(found, LAYOUT)])
    assert (scatter[~MINE] == 0.0).all()
    assert np.isfinite(scatter).all()
    assert np.isfinite(with_both.value).all()


@pytest.mark.slow
def test_gradients_are_those_without_it_and_none_is_its_own():
    weights = np.random.default_rng(3).normal(size=len(LAYOUT.quantity))

    def told(mine, others):
        value = recorded(mine, others).value
        return jnp.sum(jnp.where(jnp.isfinite(value), weights * value, 0.0))

    of_one, of_never = jax.jit(jax.grad(told, (0, 1)))(ONE, NEVER)
    expected = jax.jit(
        jax.grad(lambda mine: jnp.sum((weights * recorded(mine, OTHER).value)[MINE]))
    )(ONE)
    for here, there in zip(*map(jax.tree.leaves, (of_one, expected)), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-12)
    assert all(float(x) == 0.0 for x in jax.tree.leaves(of_never))


def test_readings_with_errors_stay_what_they_are():
    never = dataclasses.replace(SCENE, charges=(ONE, NEVER))
    draw = jax.jit(lambda key: observe(key, never, LAYOUT, LAWS, SIGMA))
    read = draw(jax.random.key(1))
    np.testing.assert_array_equal(read[~MINE], NOTHING)
    assert np.isfinite(read[MINE]).all()


def test_a_simulated_log_has_no_row_of_it():
    never = dataclasses.replace(SCENE, charges=(ONE, NEVER))
    log = simulate(UncertainScene(never, {}, "scene.toml"))
    assert set(log.shot) == {"one"}
    assert len(log) == len(QUANTITIES)
    never_one = dataclasses.replace(ONE, time_s=jnp.inf)
    none = dataclasses.replace(never, charges=(never_one, NEVER))
    with pytest.raises(
        InputError, match=r"no sensor records anything: .* never happen"
    ):
        simulate(UncertainScene(none, {}, "scene.toml"))


def test_a_row_of_a_charge_that_never_happens_is_refused():
    log = written(SCENE, LAYOUT, np.full(len(MINE), 2.5), np.asarray(SIGMA), NAMES)
    never = dataclasses.replace(SCENE, charges=(ONE, NEVER))
    with pytest.raises(
        InputError, match=r"of 'other', which never happens .* time is inf"
    ):
        resolve_positions(log, never)


@pytest.mark.parametrize("time", [np.nan, -np.inf])
def test_a_charge_happens_at_a_time_or_never(time):
    with pytest.raises(InputError, match="charge time_s: expected a number, or inf"):
        Charge(time_s=time)
