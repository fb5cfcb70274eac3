"""Against events whose probability is known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import chi2, kstest

from jblast.study.rare import (
    design_points,
    mixture_about,
    outside_sphere,
    parts_of,
    placed,
    rare_probability,
    weights_of,
)
from jblast.verification.sampling_cases import (
    CASE,
    RareRegion,
    any_of,
    curved,
    island,
    margin,
    probability_above,
    shell,
    tail,
)

TRUE = 1e-6
DISTANCE = float(-ndtri(TRUE))
ALONG = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)


def flat(u):
    """An edge that is a plane, so that the first-order answer is exact."""
    return jnp.sum(u * ALONG) - DISTANCE


def two_sided(u):
    return jnp.maximum(u[0] - DISTANCE, -u[1] - DISTANCE - 0.2)


@pytest.fixture(scope="module")
def plane():
    return design_points(flat, 3)


def test_the_design_point_of_a_plane_is_its_foot(plane):
    assert plane.points.shape == (1, 3)
    assert plane.points[0] == pytest.approx(DISTANCE * ALONG, rel=1e-9)
    assert plane.distance[0] == pytest.approx(DISTANCE, rel=1e-9)


def test_both_sides_of_an_event_are_found_and_counted():
    found = rare_probability(two_sided, 2, 20_000)
    assert len(found.design.points) == 2
    true = TRUE + float(ndtr(-DISTANCE - 0.2))
    assert found.probability == pytest.approx(true, abs=4 * found.standard_error)
    assert found.standard_error < 0.03 * true


@pytest.mark.parametrize("points", ["random", "sobol"])
def test_one_in_a_million_is_known_to_a_tenth_by_a_thousand_samples(plane, points):
    """Unbiased over 200 repetitions; plain draws would need 100 million samples."""
    samples = 1024
    found = [
        rare_probability(flat, 3, samples, seed=seed, points=points, design=plane)
        for seed in range(200 if points == "random" else 40)
    ]
    values = np.array([one.probability for one in found])
    scatter = values.std(ddof=1)
    assert scatter < 0.1 * TRUE
    # bias: four standard errors of the mean of the repetitions
    assert values.mean() == pytest.approx(TRUE, abs=4 * scatter / np.sqrt(len(values)))
    errors = np.array([one.standard_error for one in found])
    # the scatter of 40 is known to 1 / sqrt(80), 11 %
    assert errors.mean() == pytest.approx(scatter, rel=0.45)
    inside = np.mean([one.low <= TRUE <= one.high for one in found])
    # 0.90, binomial of 40: standard deviation 0.047; four of these
    assert inside > 0.71
    # a hundred times fewer than plain draws, the search counted
    plain = (1 - TRUE) / TRUE / (scatter / TRUE) ** 2
    assert plain > 100 * (samples + plane.evaluations)


def test_a_pressure_past_a_threshold_is_as_rare_as_the_prior_says():
    found = rare_probability(margin, 3, 4096, seed=3)
    true = probability_above(CASE.threshold_pa)
    assert 1e-7 < true < 1e-5
    assert found.probability == pytest.approx(true, abs=4 * found.standard_error)
    assert found.standard_error < 0.06 * true
    assert found.effective_size > 100


def test_the_first_samples_are_the_same_of_any_number():
    index = np.arange(1000)
    mixture = mixture_about(np.array([[3.0, 0.0]]))
    assert (parts_of(index, mixture)[:10] == parts_of(index[:10], mixture)).all()
    counts = np.bincount(parts_of(index, mixture), minlength=2)
    assert counts[0] == pytest.approx(100, abs=2)


def test_no_weight_is_above_one_over_the_share_of_the_prior():
    mixture = mixture_about(np.array([[5.0, 0.0]]), 0.25)
    scores = np.random.default_rng(1).normal(size=(4000, 2)) * 3
    weights = weights_of(scores, parts_of(np.arange(4000), mixture), mixture)
    assert weights.max() <= 1 / 0.2499
    # and where the densities underflow they are still numbers
    far = np.full((4000, 2), 60.0)
    assert np.isfinite(
        weights_of(far, parts_of(np.arange(4000), mixture), mixture)
    ).all()


def test_what_went_wrong_is_named():
    with pytest.raises(ValueError, match="the event is impossible"):
        design_points(lambda u: -1.0 - 0.0 * u[0], 2)
    with pytest.raises(ValueError, match="expected 32 or more, got 3"):
        rare_probability(flat, 3, 3)
    with pytest.raises(ValueError, match="above 0 and at most 1, got 0"):
        rare_probability(flat, 3, defensive=0.0, design=design_points(flat, 3))
    with pytest.raises(ValueError, match="expected finite numbers, got nan"):
        weights_of(
            np.full((40, 1), np.nan), np.zeros(40, int), mixture_about(np.ones((1, 1)))
        )


def test_margins_that_are_nan_are_counted():
    holed = lambda u: jnp.where(u[1] > 2.0, jnp.nan, u[0] - 3.0)  # noqa: E731
    found = rare_probability(holed, 2, 2000)
    assert found.lost > 0


def test_the_design_point_of_a_pressure_is_on_its_edge():
    points = design_points(margin, 3)
    value = float(jax.jit(margin)(jnp.asarray(points.points[0])))
    assert value == pytest.approx(0.0, abs=1e-6)


EIGHT = RareRegion(
    "8 equal half-spaces",
    lambda u: jnp.max(jnp.abs(u)) - 4.5,
    4,
    any_of(*[2 * tail(4.5)] * 4),
)
SCALES = RareRegion(
    "2 scales of margin",
    lambda u: jnp.maximum(u[0] - 4.2, 0.01 * (u[1] - 4.0)),
    2,
    any_of(tail(4.2), tail(4.0)),
)
FLAT = RareRegion("flat", lambda u: jnp.where(u[0] > 4.0, 1.0, -1.0), 2, tail(4.0))


@pytest.mark.parametrize(
    "case",
    [
        EIGHT,
        SCALES,
        island(),
        shell(2, 1e-5),
        shell(8, 1e-6),
        curved("wrapped", 3, 4.0, -0.2),
    ],
    ids=lambda case: f"{case.name} {case.dimensions}",
)
def test_intervals_hold_the_truth_of_several_regions_and_of_shells(case):
    found = [rare_probability(case.margin, case.dimensions, seed=n) for n in range(6)]
    inside = [one.low <= case.probability <= one.high for one in found]
    # 0.90 each: three or more of six miss in 1.6 % of cases
    assert sum(inside) >= 4
    for one in found:
        assert one.complete
        # the standard error of a search that missed a region is too small
        assert one.probability == pytest.approx(
            case.probability, abs=5 * one.standard_error
        )


def test_all_of_eight_equal_regions_are_found():
    points = design_points(EIGHT.margin, 4)
    assert len(points.points) == 8
    assert points.complete


def test_a_continuum_of_design_points_is_an_incomplete_search():
    case = shell(8, 1e-6)
    assert not design_points(case.margin, 8).complete


def test_an_event_without_slope_is_reported_as_an_incomplete_search():
    found = rare_probability(FLAT.margin, 2)
    assert not found.complete
    assert found.low <= FLAT.probability <= found.high
    assert found.high >= found.check_high
    assert not len(found.design.points)
    assert np.isnan(found.first_order)


def test_an_event_that_plain_draws_meet_needs_no_search():
    truth = tail(2.0)
    found = rare_probability(lambda u: jnp.where(u[0] > 2.0, 1.0, -1.0), 2)
    assert found.complete
    assert found.low <= truth <= found.high
    common = rare_probability(lambda u: u[0] + 4.0, 2)
    assert common.complete
    assert common.low <= tail(-4.0) <= common.high


def test_one_region_costs_no_more_than_before_the_search_went_on(plane):
    """8,416 calls for 4096 samples by eight searches of sixty steps."""
    for case, dimensions in ((flat, 3), (curved("away", 3, 4.0, 0.2).margin, 3)):
        found = rare_probability(case, dimensions)
        assert found.samples + found.design.evaluations < 1.2 * 8416


def test_samples_outside_a_sphere_have_the_density_of_the_prior_there():
    mixture = mixture_about(np.array([[0.0, 3.0, 0.0]]), radius=3.0, exterior=0.5)
    scores = np.random.default_rng(2).normal(size=(4000, 3))
    beyond = placed(scores, np.full(4000, 2), mixture)
    square = np.sum(beyond**2, axis=1)
    assert square.min() > 9.0
    outside = outside_sphere(3.0, 3)
    assert outside == pytest.approx(chi2.sf(9.0, 3), rel=1e-12)
    assert kstest(1.0 - chi2.sf(square, 3) / outside, "uniform").pvalue > 0.01
    # the mean weight of a mixture is one
    parts = parts_of(np.arange(4000), mixture)
    weights = weights_of(placed(scores, parts, mixture), parts, mixture)
    error = weights.std() / np.sqrt(4000)
    assert weights.mean() == pytest.approx(1.0, abs=4 * error)


def test_a_region_without_slope_does_not_bias_the_estimate():
    """Half of the event has no slope, so only samples can find it."""
    truth = any_of(tail(4.0), tail(4.05))

    def one_side_without_slope(u):
        return jnp.where(u[1] < -4.05, 1.0, u[0] - 4.0)

    known = design_points(one_side_without_slope, 4)
    assert len(known.points) == 1
    found = [
        rare_probability(one_side_without_slope, 4, 256, seed=seed, design=known)
        for seed in range(200)
    ]
    values = np.array([one.probability for one in found])
    # drawing again after a hit far from the design point gave 0.68 of the truth, with
    # a standard error of 0.03; here that of the mean is 0.07
    error = values.std(ddof=1) / np.sqrt(len(values))
    assert values.mean() == pytest.approx(truth, abs=3 * error)
    assert error < 0.1 * truth
