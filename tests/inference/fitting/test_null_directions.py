"""What a log leaves open: null directions, mirror images, groups that contradict."""

import dataclasses

import numpy as np
import pytest

from jblast.inference import fit
from jblast.inference.posterior.parameters import Estimate
from jblast.report.fit_report import cure_words, datum_words
from jblast.scene import Free, LogNormal, UncertainScene, freed, with_laws, with_values
from jblast.waves import (
    sedov_taylor_shock_radius,
    shock_kinematics_arrival_time,
    wu_hao_air_arrival_time,
)
from tests.catalogue import (
    EXACT,
    LINE,
    MASS_FREE,
    PLACE_FREE,
    TRIANGLE,
    WU_HAO,
    arrivals,
    pressures,
    wu_hao_arrivals,
)
from tests.inference.logs import log


@pytest.mark.parametrize(
    "ranges",
    [
        [20.0] * 4,
        [15.0, 20.0, 30.0, 50.0],
        pytest.param([20.0], marks=pytest.mark.slow),  # compiles for itself
    ],
)
def test_wu_hao_arrivals_cannot_tell_mass_from_speeds(ranges):
    result = fit(wu_hao_arrivals(ranges), WU_HAO)
    answer = result.summary
    (null,) = answer.null_directions
    assert null.parameters["charge_mass_kg"] == 1.0
    assert null.parameters["air_sound_speed_m_s"] == pytest.approx(-0.2, abs=1e-6)
    assert null.parameters["ground_p_speed_m_s"] == pytest.approx(-0.02, abs=1e-6)
    assert null.space == "ln"
    assert "peak overpressure" in cure_words(null.cure)
    assert "air arrival" not in cure_words(null.cure)
    assert not answer.identifiable
    assert result.exit_code == 4
    for name in answer.free:
        assert answer.estimates[name] == Estimate()
    told = {c.combination: c.value for c in answer.determined}
    expected = {
        "charge_mass_kg^0.2 * air_sound_speed_m_s": 15**0.2 * 340,
        "charge_mass_kg^0.02 * ground_p_speed_m_s": 15**0.02 * 6000,
    }
    assert told == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_a_prior_on_the_sound_speed_cures_the_null_direction():
    r = 20.0
    air = float(wu_hao_air_arrival_time(r, 15.0, 340.0))
    beliefs = {
        "charge_mass_kg": Free(positive=True),
        "air_sound_speed_m_s": LogNormal(340.0, 1.01),
    }
    scene = with_values(EXACT, {"air_sound_speed_m_s": 340.0})
    uncertain = with_laws(UncertainScene(scene, beliefs), {"air_arrival_s": "wu_hao"})
    answer = fit(log(("a", "air_arrival_s", air, 1e-5, r), at_range=True), uncertain)
    mass = answer.summary.estimates["charge_mass_kg"]
    assert answer.summary.identifiable
    # d ln Q = -5 d ln c, so ln 1.01 in the speed is 5 times that in the mass
    assert mass.log_sd == pytest.approx(5 * np.log(1.01), rel=0.02)
    assert mass.value == pytest.approx(15.0, rel=1e-4)


@pytest.mark.slow  # compiles for itself
def test_one_datum_tells_one_combination_of_two_unknowns():
    air = float(shock_kinematics_arrival_time(50.0, 10.0, 101325.0, 340.0))
    uncertain = freed(MASS_FREE, ["origin_time_s"])
    result = fit(log(("a", "air_arrival_s", air, 1e-4, 50.0), at_range=True), uncertain)
    assert result.exit_code == 4
    assert result.summary.dof == 0
    assert len(result.summary.null_directions) == 1
    assert result.summary.null_directions[0].space == "mixed"
    (told,) = result.summary.determined
    assert "ln(charge_mass_kg)" in told.combination
    assert "origin_time_s" in told.combination
    assert told.sd > 0
    assert told.is_local  # arrival is no power of the mass


@pytest.mark.slow
def test_sensors_in_a_line_leave_a_mirror_image_of_the_place():
    answer = fit(arrivals(LINE, 30.0, 60.0), PLACE_FREE).summary
    (other,) = answer.ambiguities
    norths = {
        round(answer.estimates["charge_north_m"].value, 3),
        round(other.parameters["charge_north_m"], 3),
    }
    assert norths == {60.0, -60.0}
    assert "off the sensors' line" in datum_words(other.cure)
    assert not answer.identifiable
    assert answer.null_directions == ()


@pytest.mark.parametrize("times", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_one_place_leaves_the_charge_anywhere_on_a_circle(times):
    result = fit(arrivals([(0.0, 0.0)] * times, 30.0, 40.0), PLACE_FREE)
    assert result.exit_code == 4
    assert len(result.summary.null_directions) == 1
    assert result.summary.null_directions[0].space == "linear"


@pytest.mark.slow
@pytest.mark.parametrize(
    "ranges",
    [
        (10.0, 12.0, 10.0, 12.0, 11.0),  # ten rows, as `TEN` has
        pytest.param((10.0, 12.0), marks=pytest.mark.slow),
    ],
)
def test_two_groups_that_contradict_one_another_are_two_answers(ranges):
    # Student-t errors believe either group; midway between them is a minimum
    masses = np.repeat([1.0, 100.0], len(ranges))
    answer = fit(pressures(masses, 2 * ranges, sigma=0.05), MASS_FREE).summary
    assert not answer.identifiable
    masses = {
        round(answer.estimates["charge_mass_kg"].value),
        *(round(a.parameters["charge_mass_kg"]) for a in answer.ambiguities),
    }
    assert masses == {1, 100}


@pytest.mark.slow
def test_a_height_that_no_reading_tells_by_symmetry_has_its_own_width():
    # sensors and charge at one height: every slope in it vanishes, yet a charge that
    # were far higher would arrive late everywhere
    sensors = arrivals((*TRIANGLE, (-80.0, 90.0)), 30.0, 20.0)
    uncertain = freed(PLACE_FREE, ["charge_up_m"])
    answer = fit(sensors, uncertain).summary
    up = answer.estimates["charge_up_m"]
    assert answer.converged
    assert up.value == pytest.approx(0.0, abs=0.5)
    # 1e-4 s is 3.4 cm of slant range: h^2 / 2R = 3.4 cm at R = 130 m gives 3 m
    assert 0.5 < up.sd < 10


@pytest.mark.slow
def test_a_sedov_log_cannot_tell_energy_from_gamma():
    times = np.array([1e-3, 3e-3, 1e-2])
    radii = np.asarray(sedov_taylor_shock_radius(times, 2e7, 1.0, 1.3))
    observed = dataclasses.replace(
        log(*(("p", "shock_radius_m", r, 0.01 * r, 1.0) for r in radii), at_range=True),
        slant_range=np.full(3, np.nan),
        time=times,
    )
    answer = fit(observed, freed(MASS_FREE, ["sedov_gamma"])).summary
    (null,) = answer.null_directions
    assert set(null.parameters) == {"charge_mass_kg", "sedov_gamma"}
    assert not answer.estimates["charge_mass_kg"].identified
