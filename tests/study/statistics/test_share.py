import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import binomtest

from jblast.study.statistics import finish_share, moments, wilson_interval


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
