import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.study.statistics import BLOCK, NUMBER

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False, width=32)


def state_of(values):
    return NUMBER.add(NUMBER.empty(np.shape(values)[1:]), np.asarray(values, float))


def test_a_stream_has_the_moments_of_the_whole_array():
    values = np.random.default_rng(1).lognormal(size=(3 * BLOCK + 77, 2))
    found = NUMBER.finish(state_of(values))
    # sums of 25k values, each rounded: a few hundred units in the last place at most
    assert found["mean"] == pytest.approx(values.mean(axis=0), rel=1e-13)
    assert found["variance"] == pytest.approx(values.var(axis=0, ddof=1), rel=1e-12)
    error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
    assert found["standard_error"] == pytest.approx(error, rel=1e-12)
    assert found["minimum"].tolist() == values.min(axis=0).tolist()
    assert found["maximum"].tolist() == values.max(axis=0).tolist()


def test_squares_are_taken_about_the_mean_and_lose_nothing_to_a_large_offset():
    # sum of squares less square of sums would keep no digit of a variance of 1
    values = 1e9 + np.random.default_rng(2).normal(size=20_000)
    found = NUMBER.finish(state_of(values))
    assert found["variance"] == pytest.approx(np.var(values, ddof=1), rel=1e-6)


def test_a_stream_cut_at_blocks_is_the_same_to_the_last_bit():
    values = np.random.default_rng(3).normal(size=(4 * BLOCK + 5, 3))
    whole, parts = state_of(values), NUMBER.empty((3,))
    for start, stop in ((0, BLOCK), (BLOCK, 3 * BLOCK), (3 * BLOCK, len(values))):
        parts = NUMBER.add(parts, values[start:stop])
    for one, other in zip(whole.moments, parts.moments, strict=True):
        assert one.tobytes() == other.tobytes()
    assert (whole.sketch.counts == parts.sketch.counts).all()


def test_lanes_that_failed_and_infinite_ones_are_counted_and_left_out():
    found = NUMBER.finish(state_of([1.0, np.nan, 3.0, np.inf, np.nan]))
    assert (found["count"], found["infinite"], found["lost"]) == (2, 1, 2)
    assert found["mean"] == 2.0
    assert (found["minimum"], found["maximum"]) == (1.0, np.inf)


def test_nothing_is_known_of_no_samples_and_no_error_of_one():
    none = NUMBER.finish(NUMBER.empty())
    assert none["count"] == 0
    assert np.isnan(none["mean"])
    assert np.isnan(none["minimum"])
    assert np.isnan(none["quantiles"]).all()
    one = NUMBER.finish(state_of([7.0]))
    assert one["mean"] == 7.0
    assert np.isnan(one["variance"])
    assert np.isnan(one["standard_error"])
    assert one["quantiles"].tolist() == [7.0] * 7


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(NUMBERS, max_size=12), min_size=3, max_size=3))
def test_merging_is_associative_within_rounding(parts):
    a, b, c = (state_of(np.array(part)) for part in parts)
    left = NUMBER.merge(NUMBER.merge(a, b), c)
    right = NUMBER.merge(a, NUMBER.merge(b, c))
    scale = max((abs(x) for part in parts for x in part), default=0.0)
    one, other = NUMBER.finish(left), NUMBER.finish(right)
    assert one["count"] == other["count"]
    assert (left.sketch.counts == right.sketch.counts).all()
    for name, unit in (("mean", scale), ("variance", scale**2)):
        assert one[name] == pytest.approx(
            other[name], rel=1e-12, abs=1e-12 * unit + 1e-300, nan_ok=True
        )


@settings(max_examples=60, deadline=None)
@given(
    st.lists(NUMBERS, min_size=2, max_size=40), st.integers(0, 40), st.integers(0, 40)
)
def test_any_cuts_end_in_the_moments_of_the_whole(values, one, other):
    low, high = sorted((min(one, len(values)), min(other, len(values))))
    state = NUMBER.empty()
    for part in (values[:low], values[low:high], values[high:]):
        state = NUMBER.merge(state, NUMBER.of(np.array(part, float)))
    found, scale = NUMBER.finish(state), max(map(abs, values))
    assert found["mean"] == pytest.approx(np.mean(values), abs=1e-12 * scale + 1e-300)
    assert found["variance"] == pytest.approx(
        np.var(values, ddof=1), rel=1e-9, abs=1e-12 * scale**2 + 1e-300
    )
