import numpy as np
import pytest

from jblast.verification.benchmark import BENCHMARKS, records
from jblast.verification.simulated_recordings import RATE


@pytest.mark.slow
def test_longer_templates_wait_longer_and_lack_less():
    points = records.latency_points()
    assert {point.panel for point in points} == {
        "waiting, wind and a rotor",
        "waiting, white noise",
    }
    for panel in {point.panel for point in points}:
        mine = [point for point in points if point.panel == panel]
        assert len(mine) == len(records.LENGTHS)
        assert (np.diff([point.cost_s for point in mine]) > 0).all()
        assert (np.diff([point.error for point in mine]) <= 0).all()
    # in white noise a Friedlander pulse has its energy over its length
    assert max(point.error for point in points) > 0.3


def test_a_template_is_the_beginning_of_the_blast():
    short, whole = records.beginning(0.02), records.beginning(0.2)
    assert short.size == round(0.02 * RATE)
    assert np.allclose(short[: short.size // 2], whole[: short.size // 2])
    assert abs(short[-1]) < 0.01 * short.max()


@pytest.mark.slow
def test_whitening_misses_least():
    found = {point.method: point.error for point in records.miss_points(repeats=1)}
    assert found["matched, whitened"] < 0.15
    assert found["plain normalised"] > 0.5


def test_it_is_entered_among_the_charts():
    assert BENCHMARKS["detector"].measure is not None
