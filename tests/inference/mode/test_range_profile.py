"""Range and bearing of a charge beside a small array, the range followed outwards."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import fit
from jblast.inference.mode.range_profile import STEP, RangeProfile, narrowest
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


def test_a_line_of_many_arrivals_is_narrowest_across_itself():
    # as many rows as a long log has: a matrix of their square has no memory
    along = np.random.default_rng(0).normal(size=(200_000, 1))
    across = narrowest(along * np.array([0.6, 0.8]))
    np.testing.assert_allclose(np.abs(across), [0.8, 0.6], rtol=1e-12)


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
def test_an_array_as_wide_as_the_range_places_the_charge():
    found = fit(ring_log(40.0, 123.0, width_m=60.0), free_scene())
    assert found.exit_code == 0
    assert "bearing_deg" not in found.summary.derived
    east = found.summary.estimates["charge_east_m"]
    assert east.q05 < 40.0 * math.sin(math.radians(123.0)) < east.q95


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
