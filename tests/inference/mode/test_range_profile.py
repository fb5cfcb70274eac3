"""Range and bearing of a charge beside a small array, the range followed outwards."""

import dataclasses
import json
import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.cli.main import main
from jblast.inference import fit
from jblast.inference.mode.range_profile import STEP, RangeProfile
from jblast.observations import observed
from jblast.scene import Scene, UncertainScene, freed
from jblast.waves import kingery_bulmash_arrival_time

LAW = ("air_arrival_s", "kingery_bulmash")
NAMES = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")


def profile_of(log_likelihood, bearing=0.5, *, bearing_sd=0.02):
    """A profile of one bearing, about sensors at the origin, of places alone."""
    count = len(log_likelihood)
    ranges = 10.0 * np.exp(STEP * np.arange(count))
    z = ranges[:, None] * np.array([math.sin(bearing), math.cos(bearing)])
    tangent = ranges[:, None] * np.array([math.cos(bearing), -math.sin(bearing)])
    return RangeProfile(
        10.0,
        np.array([0, 1]),
        np.zeros(2),
        np.arange(count),
        ranges,
        np.asarray(log_likelihood, float),
        np.full(count, bearing),
        np.full(count, bearing_sd),
        z,
        np.zeros(count, bool),
        np.arange(count),
        np.ones(count),
        np.zeros((count, 2)),
        np.stack([bearing_sd * tangent, np.zeros((count, 2))], axis=2),
    )


def test_a_likelihood_without_an_end_is_open_and_has_a_lower_bound():
    height = np.minimum(np.arange(15.0) - 5.0, 0.0)
    found = profile_of(height)
    assert found.is_open
    # it has fallen by 1.645^2 / 2 so many steps before the sixth range
    expected = 10.0 * math.exp(STEP * (5.0 - 0.5 * 1.6448536**2))
    assert found.least_range_m == pytest.approx(expected, rel=1e-6)


def test_a_range_known_within_a_step_is_not_open():
    assert not profile_of([-30.0, 0.0, -30.0]).is_open


def test_draws_have_the_moments_of_the_likelihood_and_of_the_bearing():
    middle, sd = math.log(100.0), 0.6
    ln = math.log(10.0) + STEP * np.arange(15)
    found = profile_of(-0.5 * ((ln - middle) / sd) ** 2)
    assert not found.is_open
    z = found.draws(40_000, np.random.default_rng(0))
    drawn = np.log(np.linalg.norm(z, axis=1))
    assert drawn.mean() == pytest.approx(middle, abs=0.02)
    # within a step places are drawn evenly, along the chord between two ranges
    assert drawn.std() == pytest.approx(math.hypot(sd, STEP / math.sqrt(12)), rel=0.02)
    bearing = found.bearings(z, found.best)
    assert bearing.std() == pytest.approx(0.02, rel=0.04)
    assert found.others() == []


def ring_log(range_m, bearing_deg, width_m=2.0, count=6, sd=2e-5):
    angle = 2 * np.pi * np.arange(count) / count
    places = 0.5 * width_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    charge = range_m * np.array(
        [math.sin(math.radians(bearing_deg)), math.cos(math.radians(bearing_deg))]
    )
    reach = np.linalg.norm(places - charge, axis=1)
    times = 1.0 + np.asarray(kingery_bulmash_arrival_time(jnp.asarray(reach), 8.0))
    noise = sd * np.random.default_rng(1).standard_normal(count)
    return observed(
        [f"m{i}" for i in range(count)],
        ["air_arrival_s"] * count,
        times + noise,
        [sd] * count,
        position=np.column_stack([places, 0 * reach]),
    )


def free_scene():
    return freed(UncertainScene(Scene(law=(LAW,))), list(NAMES))


@pytest.mark.slow
def test_a_small_ring_gives_the_bearing_and_no_place():
    found = fit(ring_log(40.0, 123.0), free_scene())
    summary = found.summary
    assert found.exit_code == 4
    assert not summary.identifiable
    assert {"charge_east_m", "charge_north_m", "origin_time_s"} <= {
        *summary.unidentified
    }
    bearing, distance = summary.derived["bearing_deg"], summary.derived["range_m"]
    assert bearing.q05 < 123.0 < bearing.q95
    assert bearing.sd < 5.0
    assert not distance.identified
    assert distance.q05 < 40.0
    assert math.isnan(distance.q95) or distance.q95 > 40.0


@pytest.mark.slow
def test_a_small_ring_answers_by_its_bearing_at_the_command_line(tmp_path, capsys):
    log = ring_log(40.0, 123.0)
    rows = ["sensor,quantity,value,sigma,east_m,north_m,up_m"]
    for i, time in enumerate(np.asarray(log.value)):
        east, north, up = np.asarray(log.position)[i]
        rows.append(f"m{i},air_arrival_s,{time:.7f},2e-05,{east},{north},{up}")
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "scene.toml").write_text(
        '[charge]\nmass_kg = "free"\nposition_m = ["free", "free", 0.0]\n'
        'time_s = "free"\n'
    )
    args = [str(tmp_path / "log.csv"), "--scene", str(tmp_path / "scene.toml")]
    assert main(["fit", *args, "--json", "--out", str(tmp_path / "out")]) == 4
    answer = json.loads(capsys.readouterr().out)
    derived = answer["derived"]
    assert derived["bearing_deg"]["q05"] < 123.0 < derived["bearing_deg"]["q95"]
    assert derived["range_m"]["value"] is None
    assert answer["estimates"]["charge_east_m"]["value"] is None


@pytest.mark.slow
def test_an_array_as_wide_as_the_range_places_the_charge():
    found = fit(ring_log(40.0, 123.0, width_m=60.0), free_scene())
    assert found.exit_code == 0
    assert "bearing_deg" not in found.summary.derived
    east = found.summary.estimates["charge_east_m"]
    assert east.q05 < 40.0 * math.sin(math.radians(123.0)) < east.q95


@pytest.mark.slow
def test_a_range_known_better_than_a_step_is_a_place():
    # its time known, a charge of free mass beside a ring a third as wide as the range
    timed = freed(UncertainScene(Scene(law=(LAW,))), list(NAMES[:3]))
    log = dataclasses.replace(
        (drawn := ring_log(60.0, 90.0, width_m=20.0, count=8)),
        value=drawn.value - 1.0,
    )
    found = fit(log, timed)
    assert found.exit_code == 0
    east = found.summary.estimates["charge_east_m"]
    assert east.q05 < 60.0 < east.q95


CLUSTERS = [
    *([-0.1826, 0.1085], [0.0155, -0.2355], [0.1255, 0.1406], [-0.1805, 0.1348]),
    *([0.0178, -0.266], [0.1533, 0.137], [-0.159, 0.1209], [0.0413, -0.2746]),
    *([0.1633, 0.1217], [-0.1681, 0.1172], [0.0453, -0.2487], [0.1282, 0.1441]),
]
CLUSTERED_TIMES = [
    *(1.095902, 1.095604, 1.095119, 1.095882, 1.095678, 1.095035),
    *(1.095845, 1.095633, 1.095055, 1.095868, 1.095578, 1.095136),
]
"""Layout 6 of `calibration.array_coverage`: three clusters 0.5 m apart and 7.8 t at
70 m, with errors of 1 % of the travel time whose correlation is exponential."""


@pytest.mark.slow
def test_a_small_charge_among_the_sensors_is_not_taken_for_a_large_one_far_away():
    # 0.5 g at 0.4 m has a density e^12 times that of the truth, with exit code 0
    count = len(CLUSTERED_TIMES)
    log = observed(
        [f"m{i}" for i in range(count)],
        ["air_arrival_s"] * count,
        CLUSTERED_TIMES,
        [2e-5] * count,
        position=np.column_stack([CLUSTERS, np.zeros(count)]),
    )
    found = fit(log, free_scene())
    assert found.exit_code == 4
    assert {"charge_east_m", "charge_north_m"} <= {*found.summary.unidentified}
    distance = found.summary.derived["range_m"]
    assert distance.q05 < 70.4
    assert math.isnan(distance.q95) or distance.q95 > 70.4


RING = ((60, 0), (-70, 30), (0, 90), (20, -80), (120, 100), (-110, -60))
RING_TIMES = (2.1735, 2.1801, 2.2273, 2.236, 2.4361, 2.3318)
"""Of 20 kg at (-6.8, 4.3) m, with errors of 1 % of the travel time."""


@pytest.mark.slow
def test_a_place_among_the_sensors_between_two_ranges_is_not_lost():
    # at the ranges beside it the times are off by ten standard deviations, more than
    # at places 10 km away
    log = observed(
        list("abcdef"),
        ["air_arrival_s"] * 6,
        RING_TIMES,
        [1e-3] * 6,
        position=np.array([(*place, 0.0) for place in RING]),
    )
    found = fit(log, free_scene())
    assert "bearing_deg" not in found.summary.derived
    east = found.summary.estimates["charge_east_m"]
    north = found.summary.estimates["charge_north_m"]
    assert east.q05 < -6.8 < east.q95
    assert north.q05 < 4.3 < north.q95


def test_a_peak_suffices_unless_other_places_are_probable():
    found = profile_of([-4.0, 0.0, -4.0])
    peak = found._replace(is_peak=np.array([False, True, False]))
    assert peak.peaks_suffice
    assert not found.peaks_suffice
    assert not peak._replace(log_likelihood=np.array([-3.0, 0.0, -3.0])).peaks_suffice


def test_draws_follow_the_shares_of_normal_approximations():
    # of one place a narrow part and a wide one that is moved
    one = profile_of([0.0], bearing_sd=0.01)
    two = one._replace(
        part=np.array([0, 0]),
        share=np.array([0.75, 0.25]),
        offset=np.array([[0.0, 0.0], [3.0, 0.0]]),
        spread=np.concatenate([one.spread, 4 * one.spread]),
    )
    z = two.draws(40_000, np.random.default_rng(0))
    assert z[:, 0].mean() == pytest.approx(one.z[0, 0] + 0.75, abs=0.03)
    sd = 0.01 * 10.0 * math.cos(0.5)
    expected = math.sqrt(0.75 * sd**2 + 0.25 * 16 * sd**2 + 0.75 * 0.25 * 9)
    assert z[:, 0].std() == pytest.approx(expected, rel=0.02)
    assert two.sds(0)[0] == pytest.approx(
        math.sqrt(0.75 * sd**2 + 0.25 * (16 * sd**2 + 9)), rel=1e-9
    )
