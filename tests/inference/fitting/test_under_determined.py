import pytest

from tests.inference.fitting.under_determined import KINDS, fault, logs


def test_a_dozen_under_determined_logs_end_with_a_sentence():
    # arrivals at two sensors, pressures at two: one in four was a crash
    ends = [(kind, fault(found)) for kind, found in logs(12, kinds=2, seed=0)]
    assert [end for end in ends if end[1]] == []


@pytest.mark.slow
def test_under_determined_logs_of_every_kind_end_with_a_sentence():
    every = len(KINDS)
    ends = [(kind, fault(found)) for kind, found in logs(10 * every, every, seed=1)]
    assert [end for end in ends if end[1]] == []
