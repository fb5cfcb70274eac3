import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.study.statistics import (
    BINS,
    NUMBER,
    RELATIVE_ERROR,
    bin_edges,
    bin_of,
    counted_bin,
    origin_of,
)

SHARES = (0.0, 0.01, 0.3, 0.5, 0.9, 0.999, 1.0)


def quantiles(values, shares=SHARES, origin=0.0):
    state = NUMBER.add(NUMBER.empty((), origin), values)
    return NUMBER.finish(state, shares)["quantiles"]


def test_a_bin_holds_the_numbers_between_its_edges():
    edges = bin_edges()
    assert edges.size == BINS + 1
    assert (np.diff(edges) > 0).all()
    sizes = np.geomspace(1e-11, 1e11, 5001)
    for values in (sizes, -sizes, np.zeros(1)):
        at = bin_of(values)
        assert (edges[at] <= values).all()
        assert (values <= edges[at + 1]).all()
    assert (counted_bin(sizes) == bin_of(sizes)).all()


def test_a_middle_is_within_the_relative_error_of_all_a_bin_holds():
    edges = bin_edges()
    low, high = edges[BINS // 2 + 1 : -2], edges[BINS // 2 + 2 : -1]
    assert ((high - low) / (2 * low) <= RELATIVE_ERROR).all()


@settings(max_examples=80, deadline=None)
@given(
    st.lists(st.floats(1e-9, 1e9), min_size=1, max_size=60),
    st.sampled_from([1.0, -1.0]),
)
def test_a_quantile_lies_within_the_bin_of_the_true_one(values, sign):
    values = sign * np.array(values)
    true = np.quantile(values, SHARES, method="inverted_cdf")
    assert quantiles(values) == pytest.approx(true, rel=2 * RELATIVE_ERROR)


def test_of_many_values_a_quantile_is_closer_than_its_bin():
    values = np.random.default_rng(1).lognormal(sigma=2.0, size=400_000)
    shares = (0.05, 0.5, 0.95)
    assert quantiles(values, shares) == pytest.approx(
        np.quantile(values, shares), rel=5e-4
    )


def test_values_close_together_far_from_zero_are_told_apart_from_their_origin():
    # arrivals after 1 s, alike to a millisecond: all of one bin if counted from zero
    values = 1.0005 + 1e-3 * np.random.default_rng(2).normal(size=100_000)
    origin = float(origin_of(values[:1000]))
    assert origin == pytest.approx(1.0005, abs=1e-3)
    shares = (0.05, 0.5, 0.95)
    found = quantiles(values, shares, origin)
    assert found == pytest.approx(np.quantile(values, shares), abs=1e-5)
    assert abs(quantiles(values, shares) - np.quantile(values, shares)).max() > 1e-4


def test_an_origin_is_zero_where_values_spread_over_more_than_a_factor_of_two():
    spread = np.random.default_rng(3).lognormal(size=(1000, 2))
    spread[:, 1] = 7.0
    assert origin_of(spread).tolist() == [0.0, 7.0]
    assert origin_of(np.full((3,), np.nan)) == 0.0


def test_infinite_values_are_quantiles_too_and_failed_ones_are_none():
    values = np.array([1.0, np.inf, np.inf, np.nan, 2.0])
    found = quantiles(values, (0.25, 0.9))
    assert found[0] == pytest.approx(1.0, rel=2 * RELATIVE_ERROR)
    assert found[1] == np.inf


def test_sketches_of_two_origins_do_not_merge():
    with pytest.raises(ValueError, match="one origin"):
        NUMBER.merge(NUMBER.empty(origin=0.0), NUMBER.empty(origin=1.0))


def test_a_block_is_reduced_by_jax_as_by_numpy():
    rng = np.random.default_rng(5)
    values = rng.normal(size=(257, 2))
    values[3, 1], values[4, 0] = np.nan, np.inf
    here = NUMBER.of(values)
    there = jax.jit(NUMBER.of)(jnp.asarray(values))
    for one, other in zip(here.moments, there.moments, strict=True):
        assert np.asarray(other) == pytest.approx(one, rel=1e-13)
    assert (np.asarray(there.sketch.counts) == here.sketch.counts).all()
