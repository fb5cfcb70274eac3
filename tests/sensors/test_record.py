import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import LIGHT_SPEED
from jblast.scene import Air, Charge, Ground, Scene, Sensor, with_values
from jblast.sensors import planned_layout, record, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import loadings
from jblast.waves import (
    acoustic_arrival_time,
    kingery_bulmash_pressure,
    wu_hao_air_arrival_time,
    wu_hao_ground_arrival_time,
)
from jblast.waves.laws.wu_hao import wu_hao_ground_path_arrival_time

SCENE = with_values(
    Scene(
        sensors=(
            Sensor(
                "a",
                jnp.array([20.0, 0.0, 0.0]),
                clock_offset_s=0.25,
                records=(
                    ("air_arrival_s", 1e-3),
                    ("ground_arrival_s", 1e-3),
                    ("arrival_difference_s", 1e-3),
                    ("flash_time_s", 1e-3),
                    ("peak_overpressure_pa", 0.1),
                ),
            ),
        ),
        law=(("air_arrival_s", "wu_hao"),),
    ),
    {
        "charge_mass_kg": 15.0,
        "origin_time_s": 2.0,
        "air_sound_speed_m_s": 340.0,
        "ground_p_speed_m_s": 6000.0,
    },
)


def recording(scene=SCENE):
    layout, _, _ = planned_layout(scene)
    return record(scene, layout, law_names(resolve_laws(scene, layout))), layout


def test_readings_are_the_laws_on_the_sensor_clock():
    air = wu_hao_air_arrival_time(20.0, 15.0, 340.0)
    ground = wu_hao_ground_arrival_time(20.0, 15.0, 6000.0)
    expected = [
        2.25 + air,
        2.25 + ground,
        air - ground,  # a difference knows no clock
        2.25 + 20.0 / LIGHT_SPEED,
        kingery_bulmash_pressure(20.0, 15.0),
    ]
    np.testing.assert_allclose(recording()[0].value, expected, rtol=1e-12)


def test_arrivals_scatter_with_the_travel_time_and_not_with_the_clock():
    found, _ = recording()
    air = wu_hao_air_arrival_time(20.0, 15.0, 340.0)
    ground = wu_hao_ground_arrival_time(20.0, 15.0, 6000.0)
    expected = [0.01 * air, 0.01 * ground, 0.01 * np.hypot(air, ground), 0.0, 0.10]
    np.testing.assert_allclose(found.record_sd, expected, rtol=1e-12)


def test_a_difference_of_arrivals_shares_the_shot_effects_of_both():
    found, layout = recording()
    loading = np.asarray(loadings(found, layout))
    air, ground = (
        found.shot_loading["air_arrival_s"],
        found.shot_loading["ground_arrival_s"],
    )
    assert air[2] == air[0] > 0
    assert ground[2] == -ground[1] < 0
    assert loading.shape == (5, 3)  # air, ground and pressure; light is exact


def test_exact_laws_have_no_scatter_at_all():
    found, layout = recording(dataclasses.replace(SCENE, scatter=False))
    assert not found.record_sd.any()
    assert loadings(found, layout).shape == (5, 0)


def test_ground_waves_run_along_the_ground():
    high = Sensor(
        "b", jnp.array([3.0, 4.0, 30.0]), records=(("ground_arrival_s", 1e-3),)
    )
    found, _ = recording(dataclasses.replace(SCENE, sensors=(high,)))
    expected = 2.0 + wu_hao_ground_arrival_time(5.0, 15.0, 6000.0)
    np.testing.assert_allclose(found.value, [expected], rtol=1e-12)
    np.testing.assert_allclose(found.slant_range, [np.sqrt(925.0)], rtol=1e-12)


def test_a_given_range_takes_the_place_of_positions():
    near = with_values(SCENE, {"charge_range_m": 10.0})
    found, _ = recording(near)
    np.testing.assert_allclose(found.slant_range, 10.0)


def test_readings_have_the_derivatives_of_finite_differences():
    layout, _, _ = planned_layout(SCENE)
    laws = law_names(resolve_laws(SCENE, layout))

    @jax.jit
    def readings(ln_mass, east, up):
        values = {
            "charge_mass_kg": jnp.exp(ln_mass),
            "charge_east_m": east,
            "charge_up_m": up,
        }
        return record(with_values(SCENE, values), layout, laws).value

    at = (jnp.log(15.0), jnp.asarray(1.0), jnp.asarray(2.0))
    slopes = jax.jit(jax.jacfwd(readings, argnums=(0, 1, 2)))(*at)
    for i, slope in enumerate(slopes):
        up = readings(*(x + 1e-6 * (i == j) for j, x in enumerate(at)))
        down = readings(*(x - 1e-6 * (i == j) for j, x in enumerate(at)))
        # differences of 1e-6 in float64 are good to 1e-8 of the reading
        np.testing.assert_allclose(
            slope, (up - down) / 2e-6, rtol=1e-5, atol=1e-8 * np.max(up)
        )


def test_wind_adds_to_the_speed_of_sound_along_the_path():
    places = [(300.0, 0.0, 0.0), (0.0, 400.0, 0.0), (-300.0, -400.0, 0.0)]
    sensors = tuple(
        Sensor(f"s{i}", jnp.array(place), records=(("air_arrival_s", 1e-3),))
        for i, place in enumerate(places)
    )
    scene = Scene(
        sensors=sensors,
        air=Air(sound_speed=340.0, wind_east=5.0, wind_north=-2.0),
        law=(("air_arrival_s", "acoustic"),),
    )
    along = np.array([5.0, -2.0, -5.0 * 0.6 + 2.0 * 0.8])
    expected = acoustic_arrival_time(np.array([300.0, 400.0, 500.0]), 340.0 + along)
    # np.array / np.array in float64: roundings
    np.testing.assert_allclose(recording(scene)[0].value, expected, rtol=1e-14)


def test_the_thesis_path_climbs_to_the_sensor_and_the_head_wave_does_not():
    sensor = Sensor(
        "a", jnp.array([20.0, 0.0, 1.5]), records=(("ground_arrival_s", 1e-3),)
    )
    head = Scene(
        Charge(mass_kg=15.0),
        sensors=(sensor,),
        air=Air(sound_speed=340.0),
        ground=Ground(p_speed=6000.0),
    )
    thesis = dataclasses.replace(head, ground=Ground(p_speed=6000.0, path="thesis"))
    along = wu_hao_ground_arrival_time(20.0, 15.0, 6000.0)
    slant = float(np.hypot(20.0, 1.5))
    climbing = wu_hao_ground_path_arrival_time(
        slant, 20.0, 1.5, 15.0, 340.0, 6000.0, "thesis"
    )
    assert recording(head)[0].value[0] == pytest.approx(float(along), rel=1e-14)
    assert recording(thesis)[0].value[0] == pytest.approx(float(climbing), rel=1e-14)


def test_each_charge_is_worth_its_own_tnt():
    sensor = Sensor(
        "a", jnp.array([30.0, 0.0, 0.0]), records=(("peak_overpressure_pa", 0.1),)
    )
    scene = Scene(
        charges=(
            Charge(name="one", mass_kg=10.0, explosive="C4"),
            Charge(name="two", mass_kg=10.0, tnt_factor=0.5),
        ),
        sensors=(sensor,),
    )
    expected = [kingery_bulmash_pressure(30.0, mass) for mass in (13.7, 5.0)]
    got, layout = recording(scene)
    np.testing.assert_allclose(got.value, expected, rtol=1e-12)
    assert layout.shot == (0, 1)
    # each shot has a scatter of its own: one column and one row a charge
    np.testing.assert_allclose(loadings(got, layout), 0.1 * np.eye(2))


def test_a_growth_that_is_no_number_is_not_the_laws_own():
    """None leaves it to the law; a fit that goes astray must not come back by that."""
    sensor = Sensor(
        "a",
        jnp.array([20.0, 0.0, 0.0]),
        records=(("fireball_radius_m", 0.1),),
        times_s=(2.001,),
    )
    scene = dataclasses.replace(SCENE, sensors=(sensor,))

    def radius(growth):
        return float(
            recording(dataclasses.replace(scene, fireball_growth=growth))[0].value[0]
        )

    own = radius(None)
    assert own > 0.0
    assert radius(1e-3 * 15.0 ** (1 / 3)) == pytest.approx(own, rel=1e-12)
    assert np.isnan(radius(np.nan))
