"""What a log leaves open: null directions, mirror images, a mass without a value."""

import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.under_determined import KINDS, ended, fault, logs
from jblast.errors import InputError
from jblast.inference import fit
from jblast.inference.posterior.parameters import Estimate
from jblast.observations import read
from jblast.report.fit_report import cure_words, datum_words
from jblast.scene import (
    Charge,
    Free,
    LogNormal,
    Scene,
    UncertainScene,
    freed,
    with_laws,
    with_values,
)
from jblast.waves import (
    kingery_bulmash_arrival_time,
    sedov_taylor_shock_radius,
    shock_kinematics_arrival_time,
    wu_hao_air_arrival_time,
)
from tests.catalogue import (
    AROUND,
    EXACT,
    KNOWN_MASS as MASS,
    LINE,
    MASS_FREE,
    PLACE,
    PLACE_FREE,
    TIMED as SCENE,
    TRIANGLE,
    WU_HAO,
    arrivals,
    pressures,
    wu_hao_arrivals,
)
from tests.inference.logs import log


@pytest.mark.parametrize("ranges", [[20.0] * 4, [15.0, 20.0, 30.0, 50.0]])
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


@pytest.mark.slow
def test_one_place_leaves_the_charge_anywhere_on_a_circle():
    result = fit(arrivals([(0.0, 0.0)] * 3, 30.0, 40.0), PLACE_FREE)
    assert result.exit_code == 4
    assert len(result.summary.null_directions) == 1
    assert result.summary.null_directions[0].space == "linear"


@pytest.mark.slow
def test_two_groups_that_contradict_one_another_are_two_answers():
    # Student-t errors believe either group; midway between them is a minimum
    ranges = (10.0, 12.0, 10.0, 12.0, 11.0)  # ten rows, as `TEN` has
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


RING = AROUND[:4]
CASES = sorted((Path(__file__).parent / "arrays" / "line_end").glob("*.csv"))


@pytest.mark.slow
def test_three_sensors_with_the_charge_outside_their_triangle_leave_a_second_place():
    triangle = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)]
    free = [*PLACE, "origin_time_s"]
    uncertain = freed(UncertainScene(SCENE), free)
    found = fit(arrivals(triangle, -20.0, -20.0, 1.0), uncertain)
    (other,) = found.summary.ambiguities
    both = [
        {name: of.value for name, of in found.summary.estimates.items()},
        other.parameters,
    ]
    one, two = sorted(both, key=lambda values: values["origin_time_s"])
    for name, true in zip(free, (-20.0, -20.0, 1.0), strict=True):
        assert one[name] == pytest.approx(true, abs=1e-2)
    # the second explains the arrivals as well, to a hundredth of their sigma
    again = arrivals(triangle, *(two[name] for name in free))
    np.testing.assert_allclose(again.value, found.observations.value, atol=1e-6)
    assert found.exit_code == 4
    assert fit(arrivals(triangle, 30.0, 30.0, 1.0), uncertain).exit_code == 0


@pytest.mark.parametrize(
    ("places", "clocks", "words"),
    [
        (RING, "abcd", r"4 clock times .* 5 unknown.*flash_time_s"),
        (RING[:1], "a", "1 clock times and 0 other readings cannot"),
    ],
)
def test_clocks_all_unknown_are_refused_with_what_would_help(places, clocks, words):
    free = ["origin_time_s", *(f"clock_offset_s.{name}" for name in clocks)]
    made = arrivals(places, 5.0, 10.0)
    with pytest.raises(InputError, match=words):
        fit(made, freed(UncertainScene(SCENE), free))


@pytest.mark.slow
def test_a_mass_told_by_arrivals_alone_has_an_interval_and_no_value():
    scene = replace(SCENE, law=(), scatter=True)
    free = ["charge_mass_kg", *PLACE, "origin_time_s"]
    made = arrivals(RING, 5.0, 10.0)
    found = fit(made, freed(UncertainScene(scene), free))
    mass = found.summary.estimates["charge_mass_kg"]
    assert np.isnan(mass.q05)  # a smaller charge would be heard like sound
    assert mass.q95 > MASS
    assert not mass.identified
    assert np.isnan([mass.value, mass.sd, mass.log_sd]).all()
    for name, true in zip(PLACE, (5.0, 10.0), strict=True):
        place = found.summary.estimates[name]
        assert place.identified
        assert place.q05 < true < place.q95
    assert not found.summary.derived["charge_energy_j"].identified
    # the law was chosen again at the answer, where it holds
    assert found.summary.law_valid
    assert found.exit_code == 0


@pytest.mark.slow
@pytest.mark.parametrize("explosive", ["TNT", "nuclear"])
def test_a_fit_of_tnt_by_a_law_of_a_point_source_has_a_warning(explosive):
    # photographs of 15 kg of TNT, at Z = 0.2 to 0.5: the mass comes out a fifth
    radius = np.array([0.2, 0.3, 0.4, 0.5]) * 15.0 ** (1.0 / 3.0)
    time = np.asarray(kingery_bulmash_arrival_time(radius, 15.0, burst="free-air"))
    rows = (("camera", "shock_radius_m", r, 0.01 * r, np.nan) for r in radius)
    made = replace(log(*rows, at_range=True), time=time)
    law = (("shock_radius_m", "sedov_taylor"),)
    scene = Scene(Charge(explosive=explosive), law=law)
    uncertain = UncertainScene(scene, {"charge_mass_kg": Free(positive=True)})
    answer = fit(made, uncertain, noise="gaussian").summary
    warned = any(one.kind == "no_point_source" for one in answer.warnings)
    assert warned == (explosive == "TNT")
    if warned:
        assert answer.estimates["charge_mass_kg"].value < 5.0


@pytest.mark.slow
def test_under_determined_logs_of_every_kind_end_with_a_sentence():
    every = len(KINDS)
    made = logs(10 * every, every, seed=1)
    ends = [(kind, fault(ended(one))) for kind, one in made]
    assert [end for end in ends if end[1]] == []


@pytest.mark.slow
@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_a_place_beside_the_line_is_no_answer(path):
    # six microphones on the east axis, 20 kg at 200 or 500 m; times exact to 0.1 us
    scene = path.with_name(f"{path.stem.rpartition('_')[2]}.toml")
    made = read(path)
    moved = np.random.default_rng(1).choice([-1e-7, 0.0, 1e-7], len(made))
    made = replace(made, value=made.value + moved)
    assert fit(made, scene).exit_code == 4
