"""Moments of parts and shares: against NumPy and SciPy."""

import functools

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import binomtest

from jblast.study.statistics import (
    finish_moments,
    finish_share,
    merged_moments,
    moments,
    share_error,
    standard_error,
    wilson_interval,
)

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False, width=32)


def test_squares_are_taken_about_the_mean_and_lose_nothing_to_a_large_offset():
    # sum of squares less square of sums would keep no digit of a variance of 1
    values = 1e9 + np.random.default_rng(2).normal(size=20_000)
    parts = [moments(part) for part in np.split(values, 10)]
    found = finish_moments(functools.reduce(merged_moments, parts))
    assert found["variance"] == pytest.approx(np.var(values, ddof=1), rel=1e-6)


@pytest.mark.parametrize("array", [np.array, jnp.array])
def test_failed_and_infinite_samples_are_counted_and_left_out(array):
    state = moments(
        array([1.0, np.nan, 3.0, np.inf, np.nan, 9.0]), array([True] * 5 + [False])
    )
    found = finish_moments(state)
    assert (found["count"], found["infinite"], found["lost"]) == (2, 1, 2)
    assert found["mean"] == 2.0
    assert (found["minimum"], found["maximum"]) == (1.0, np.inf)
    # an infinite value does not hold up a target
    assert standard_error(state) == 1.0


def test_nothing_is_known_of_no_samples_and_no_error_of_one():
    none = finish_moments(moments(np.zeros(0)))
    assert none["count"] == 0
    assert np.isnan(none["mean"])
    assert np.isnan(none["minimum"])
    one = moments(np.array([7.0]))
    assert np.isnan(finish_moments(one)["standard_error"])
    assert standard_error(one) == np.inf


def test_a_share_of_nothing_yet_is_not_a_share_of_zero():
    none = moments(np.zeros(998, np.int8))
    assert standard_error(none) == 0.0
    # sqrt(p (1 - p) / n) with p = 1/1000 of 1,000 samples, two of which are added
    assert 9.99e-4 < share_error(none) < 1e-3


@settings(max_examples=60, deadline=None)
@given(
    st.lists(NUMBERS, min_size=2, max_size=40), st.integers(0, 40), st.integers(0, 40)
)
def test_any_cuts_end_in_the_moments_of_the_whole(values, one, other):
    low, high = sorted((min(one, len(values)), min(other, len(values))))
    parts = (values[:low], values[low:high], values[high:])
    states = [moments(np.array(part, float)) for part in parts]
    found = finish_moments(functools.reduce(merged_moments, states))
    scale = max(map(abs, values))
    assert found["mean"] == pytest.approx(np.mean(values), abs=1e-12 * scale + 1e-300)
    assert found["variance"] == pytest.approx(
        np.var(values, ddof=1), rel=1e-9, abs=1e-12 * scale**2 + 1e-300
    )


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from([-1, 0, 1]), min_size=1, max_size=50))
def test_a_share_has_the_interval_of_wilson(flags):
    found = finish_share(moments(np.array(flags, np.int8)))
    yes, known = flags.count(1), len(flags) - flags.count(-1)
    assert (found["yes"], found["count"]) == (yes, known)
    assert found["lost"] == flags.count(-1)
    if not known:
        assert np.isnan(found["share"])
        assert (found["low"], found["high"]) == (0.0, 1.0)
        return
    theirs = binomtest(yes, known).proportion_ci(0.90, method="wilson")
    assert found["share"] == yes / known
    assert found["low"] == pytest.approx(theirs.low, abs=1e-12)
    assert found["high"] == pytest.approx(theirs.high, abs=1e-12)


def test_ends_that_are_exact_stay_so():
    low, high = wilson_interval(np.array([0.0, 1.0]), np.array([10.0, 10.0]))
    assert low[0] == 0.0
    assert high[1] == 1.0
