"""Readings and their scatter are those of the laws, on the clocks of the sensors."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import LIGHT_SPEED
from jblast.errors import InputError
from jblast.observations.placement import resolve_positions
from jblast.scene import Air, Charge, Ground, Scene, Sensor, UncertainScene, with_values
from jblast.sensors import planned_layout, record, resolve_laws, simulate
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import loadings, written
from jblast.waves import (
    acoustic_arrival_time,
    kingery_bulmash_pressure,
    wu_hao_air_arrival_time,
    wu_hao_ground_arrival_time,
)
from jblast.waves.laws.wu_hao import wu_hao_ground_path_arrival_time

QUANTITIES = (
    "air_arrival_s",
    "ground_arrival_s",
    "arrival_difference_s",
    "flash_time_s",
    "peak_overpressure_pa",
)


def sensor_at(*position, records=QUANTITIES, **options):
    records = tuple((quantity, 0.01) for quantity in records)
    return Sensor("a", jnp.array(position), records=records, **options)


SCENE = with_values(
    Scene(
        sensors=(sensor_at(20.0, 0.0, 0.0, clock_offset_s=0.25),),
        law=(("air_arrival_s", "wu_hao"),),
    ),
    {
        "charge_mass_kg": 15.0,
        "origin_time_s": 2.0,
        "air_sound_speed_m_s": 340.0,
        "ground_p_speed_m_s": 6000.0,
    },
)
LAYOUT, _, _ = planned_layout(SCENE)
LAWS = law_names(resolve_laws(SCENE, LAYOUT))
AIR = float(wu_hao_air_arrival_time(20.0, 15.0, 340.0))
GROUND = float(wu_hao_ground_arrival_time(20.0, 15.0, 6000.0))


def recording(scene):
    layout, _, _ = planned_layout(scene)
    return record(scene, layout, law_names(resolve_laws(scene, layout))), layout


def test_readings_are_the_laws_on_the_sensor_clock_with_their_scatter():
    found = record(SCENE, LAYOUT, LAWS)
    peak = float(kingery_bulmash_pressure(20.0, 15.0))
    light = 20.0 / LIGHT_SPEED
    # a difference does not depend on the clock
    value = [2.25 + AIR, 2.25 + GROUND, AIR - GROUND, 2.25 + light, peak]
    np.testing.assert_allclose(found.value, value, rtol=1e-12)
    # the scatter of arrivals is a share of the travel time
    sd = [0.01 * AIR, 0.01 * GROUND, 0.01 * np.hypot(AIR, GROUND), 0.0, 0.10]
    np.testing.assert_allclose(found.record_sd, sd, rtol=1e-12)
    # air, ground and pressure; light is exact. A difference has the effects of both
    shared = 0.01 * np.array([[AIR, 0, AIR, 0, 0], [0, GROUND, -GROUND, 0, 0]])
    expected = np.vstack([shared, [0, 0, 0, 0, 0.1]]).T
    np.testing.assert_allclose(loadings(found, LAYOUT), expected, rtol=1e-12)
    exact = record(replace(SCENE, scatter=False), LAYOUT, LAWS)
    assert not exact.record_sd.any()
    assert loadings(exact, LAYOUT).shape == (5, 0)


def test_readings_have_the_derivatives_of_finite_differences():
    @jax.jit
    def readings(ln_mass, east, up):
        values = {
            "charge_mass_kg": jnp.exp(ln_mass),
            "charge_east_m": east,
            "charge_up_m": up,
        }
        return record(with_values(SCENE, values), LAYOUT, LAWS).value

    at = (jnp.log(15.0), jnp.asarray(1.0), jnp.asarray(2.0))
    slopes = jax.jit(jax.jacfwd(readings, argnums=(0, 1, 2)))(*at)
    for i, slope in enumerate(slopes):
        up = readings(*(x + 1e-6 * (i == j) for j, x in enumerate(at)))
        down = readings(*(x - 1e-6 * (i == j) for j, x in enumerate(at)))
        # differences of 1e-6 in float64 are good to 1e-8 of the reading
        np.testing.assert_allclose(
            slope, (up - down) / 2e-6, rtol=1e-5, atol=1e-8 * np.max(up)
        )


def test_ranges_and_ground_waves_follow_their_paths():
    high = sensor_at(3.0, 4.0, 30.0, records=("ground_arrival_s",))
    found, _ = recording(replace(SCENE, sensors=(high,)))
    along = wu_hao_ground_arrival_time(5.0, 15.0, 6000.0)
    np.testing.assert_allclose(found.value, [2.0 + along], rtol=1e-12)
    np.testing.assert_allclose(found.slant_range, [np.sqrt(925.0)], rtol=1e-12)
    ground = Ground(p_speed=6000.0, path="thesis")
    found, _ = recording(replace(SCENE, sensors=(high,), ground=ground))
    place = (np.sqrt(925.0), 5.0, 30.0)
    climbing = wu_hao_ground_path_arrival_time(*place, 15.0, 340.0, 6000.0, "thesis")
    np.testing.assert_allclose(found.value, [2.0 + climbing], rtol=1e-12)
    stated = record(with_values(SCENE, {"charge_range_m": 10.0}), LAYOUT, LAWS)
    np.testing.assert_allclose(stated.slant_range, 10.0)


def test_wind_adds_to_the_speed_of_sound_along_the_path():
    places = [(300.0, 0.0, 0.0), (0.0, 400.0, 0.0), (-300.0, -400.0, 0.0)]
    sensors = tuple(
        Sensor(f"s{i}", jnp.array(place), records=(("air_arrival_s", 1e-3),))
        for i, place in enumerate(places)
    )
    air = Air(sound_speed=340.0, wind_east=5.0, wind_north=-2.0)
    scene = Scene(sensors=sensors, air=air, law=(("air_arrival_s", "acoustic"),))
    along = np.array([5.0, -2.0, -5.0 * 0.6 + 2.0 * 0.8])
    expected = acoustic_arrival_time(np.array([300.0, 400.0, 500.0]), 340.0 + along)
    # roundings of float64
    np.testing.assert_allclose(recording(scene)[0].value, expected, rtol=1e-14)


def test_each_charge_has_its_own_tnt_mass_and_scatter():
    charges = (
        Charge(name="one", mass_kg=10.0, explosive="C4"),
        Charge(name="two", mass_kg=10.0, tnt_factor=0.5),
    )
    sensor = sensor_at(30.0, 0.0, 0.0, records=("peak_overpressure_pa",))
    got, layout = recording(Scene(charges=charges, sensors=(sensor,)))
    expected = [kingery_bulmash_pressure(30.0, mass) for mass in (13.7, 5.0)]
    np.testing.assert_allclose(got.value, expected, rtol=1e-12)
    assert layout.shot == (0, 1)
    np.testing.assert_allclose(loadings(got, layout), 0.1 * np.eye(2))


@pytest.mark.parametrize(
    ("growth", "share"), [(1e-3 * 15.0 ** (1 / 3), 1.0), (np.nan, np.nan)]
)
def test_an_invalid_growth_of_the_fireball_is_not_that_of_the_law(growth, share):
    """None leaves it to the law; a fit with an invalid number must not return to it."""
    sensor = sensor_at(20.0, 0, 0, records=("fireball_radius_m",), times_s=(2.001,))
    scene = replace(SCENE, sensors=(sensor,))
    own = recording(scene)[0].value[0]
    stated = recording(replace(scene, fireball_growth=growth))[0].value[0]
    assert float(own) > 0.0
    assert float(stated) == pytest.approx(share * float(own), rel=1e-12, nan_ok=True)


OF_NEVER = {
    "air_arrival_s": ("kingery_bulmash", np.inf),
    "arrival_difference_s": ("", np.nan),
    "ground_arrival_s": ("wu_hao", np.inf),
    "peak_overpressure_pa": ("kingery_bulmash", 0.0),
    "bearing_rad": ("line_of_sight", np.nan),
    "fireball_radius_m": ("fireball", 0.0),
}
"""Law of each quantity, and the reading of a charge that never detonates."""
NEVER_LAWS = {quantity: law for quantity, (law, _) in OF_NEVER.items() if law}
ABSENT = [absent for _, absent in OF_NEVER.values()]
SENSOR = Sensor(
    "a",
    jnp.array([20.0, 0.0, 1.0]),
    records=tuple((quantity, 0.01) for quantity in OF_NEVER),
    times_s=(2.001,),
)
ONE = Charge(mass_kg=15.0, time_s=2.0, name="one")
OTHER = Charge(mass_kg=3.0, position_m=(4.0, 0.0, 0.0), time_s=1.9, name="other")
NEVER = replace(OTHER, time_s=jnp.inf)
TWO = Scene(charges=(ONE, OTHER), sensors=(SENSOR,))
WITH_NEVER = replace(TWO, charges=(ONE, NEVER))
TWO_LAYOUT, SIGMA, NAMES = planned_layout(TWO)
MINE = np.array(TWO_LAYOUT.shot) == 0
WEIGHTS = np.random.default_rng(3).normal(size=len(TWO_LAYOUT.quantity))


@jax.jit
def recorded(one, other):
    return record(replace(TWO, charges=(one, other)), TWO_LAYOUT, NEVER_LAWS)


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
        np.column_stack([each.record_sd, loadings(each, TWO_LAYOUT)])
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


@pytest.mark.slow
def test_a_simulated_log_has_no_row_of_it():
    log = simulate(UncertainScene(WITH_NEVER, {}, "scene.toml"))
    assert set(log.shot) == {"one"}
    assert len(log) == len(OF_NEVER)
    none = replace(TWO, charges=(replace(ONE, time_s=jnp.inf), NEVER))
    with pytest.raises(InputError, match=r"no sensor records .* never happen"):
        simulate(UncertainScene(none, {}, "scene.toml"))
    log = written(TWO, TWO_LAYOUT, np.full(len(MINE), 2.5), np.asarray(SIGMA), NAMES)
    with pytest.raises(InputError, match=r"of 'other', which never happens .* is inf"):
        resolve_positions(log, WITH_NEVER)


@pytest.mark.parametrize("time", [np.nan, -np.inf])
def test_a_time_is_a_number_or_infinite(time):
    with pytest.raises(InputError, match="charge time_s: expected a number, or inf"):
        Charge(time_s=time)
