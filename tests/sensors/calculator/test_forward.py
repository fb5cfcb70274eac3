"""The calculator from a charge: numbers of the laws, in one order, with their burst."""

import numpy as np
import pytest

from jblast.registry import law_for
from jblast.sensors.calculator import (
    calculate,
    calculated_laws,
    charge_radius,
)
from jblast.waves import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
    kingery_bulmash_reflected_impulse,
    kingery_bulmash_reflected_pressure,
    wu_hao_air_arrival_time,
    wu_hao_ground_arrival_time,
)
from jblast.waves.waveform import friedlander_impulse
from tests.sensors.calculator.scenes import scene_with

RANGES, MASSES = np.array([2.0, 20.0, 2000.0]), np.array([15.0, 15.0, 40.0])


@pytest.mark.parametrize(
    "burst", ["surface", pytest.param("free-air", marks=pytest.mark.slow)]
)
def test_numbers_are_those_of_the_laws(burst):
    found = calculate(scene_with(burst=burst), RANGES, MASSES)
    air = (RANGES, MASSES, 9e4)
    for quantity, expected in {
        "peak_overpressure_pa": kingery_bulmash_pressure(*air, burst),
        "positive_impulse_pa_s": kingery_bulmash_impulse(*air, 330.0, burst),
        "air_arrival_s": kingery_bulmash_arrival_time(*air, 330.0, burst),
        "positive_duration_s": kingery_bulmash_duration(*air, 330.0, burst),
        "reflected_pressure_pa": kingery_bulmash_reflected_pressure(*air, burst),
        "reflected_impulse_pa_s": kingery_bulmash_reflected_impulse(*air, 330.0, burst),
    }.items():
        by_law = found[quantity]["kingery_bulmash"]
        np.testing.assert_allclose(by_law.value, expected, rtol=1e-12)
        assert by_law.valid.tolist() == [True, True, False]
        assert by_law.two_sets
    wu_hao = wu_hao_ground_arrival_time(RANGES, MASSES, 6000.0)
    ground = found["ground_arrival_s"]["wu_hao"]
    np.testing.assert_allclose(ground.value, wu_hao, rtol=1e-12)


def test_every_law_that_needs_no_time_answers_for_its_quantity():
    found = calculate(scene_with(), RANGES, MASSES)
    for law in calculated_laws():
        of_law = found[law.quantity][law.name]
        assert np.isfinite(of_law.value).all(), law
        assert of_law.range == law.range
    assert "shock_radius_m" not in found
    assert {law.quantity for law in calculated_laws("air_arrival_s")} == {
        "air_arrival_s"
    }


def test_the_arrival_difference_is_air_minus_ground():
    found = calculate(scene_with(), RANGES, MASSES)["arrival_difference_s"]["wu_hao"]
    air = wu_hao_air_arrival_time(RANGES, MASSES, 330.0)
    ground = wu_hao_ground_arrival_time(RANGES, MASSES, 6000.0)
    np.testing.assert_allclose(found.value, air - ground, rtol=1e-12)
    assert found.valid.tolist() == [True, True, False]  # 2 km is slower than sound


def test_the_friedlander_decay_gives_the_impulse_back():
    found = calculate(scene_with(), RANGES[:2], MASSES[:2])
    p, i, t, b = (
        found[q]["kingery_bulmash"].value
        for q in (
            "peak_overpressure_pa",
            "positive_impulse_pa_s",
            "positive_duration_s",
            "friedlander_decay",
        )
    )
    np.testing.assert_allclose(friedlander_impulse(p, t, b), i, rtol=1e-9)


def test_the_height_of_burst_reaches_the_law_that_takes_it():
    law = law_for("positive_impulse_pa_s", "ford_2021")
    assert "height_of_burst" in law.arguments()
    low, high = (
        calculate(
            scene_with(position_m=(0.0, 0.0, up), burst="surface"), RANGES, MASSES
        )["positive_impulse_pa_s"]
        for up in (0.0, 1.0)
    )
    assert (low["ford_2021"].value < high["ford_2021"].value).all()
    np.testing.assert_array_equal(
        low["kingery_bulmash"].value, high["kingery_bulmash"].value
    )


def test_a_kilogram_of_tnt_has_a_radius_of_53_mm():
    assert charge_radius(1.0) == pytest.approx(0.0527, abs=5e-5)
    assert charge_radius(8.0) == pytest.approx(2.0 * charge_radius(1.0), rel=1e-14)
