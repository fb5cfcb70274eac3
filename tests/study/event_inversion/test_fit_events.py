import numpy as np
import pytest

from jblast.sensors.camera.events.ideal import Events
from jblast.study.event_inversion import (
    MASS,
    START,
    THRESHOLDS,
    TIMES,
    coordinates,
    event_counts,
    fit_events,
    log_frames,
    true_counts,
)


@pytest.fixture(scope="module")
def counts():
    counts = true_counts()
    # none of some 6,400 was lost
    assert 5000 < np.abs(counts).sum() < 1 << 14
    return counts


@pytest.mark.slow
@pytest.mark.parametrize(("size", "late"), [(1.2, 0.05), (0.8, -0.05), (1.2, -0.05)])
def test_size_and_start_are_recovered_from_events_alone(counts, size, late):
    start = coordinates(MASS * size**3, START + late)
    found = fit_events(log_frames, start, counts, TIMES, THRESHOLDS)
    mass, begin = np.exp(found.values[0]), 0.1 * found.values[1]
    # the bias of the smooth counts at the last temperature
    assert np.cbrt(mass / MASS) == pytest.approx(1.0, abs=1e-3)
    assert begin == pytest.approx(START, abs=0.1e-3)
    assert found.converged
    assert found.misfit < 0.5


@pytest.mark.slow
def test_a_fit_that_runs_out_of_steps_says_so(counts):
    start = coordinates(1.2**3 * MASS, START)
    given = log_frames, start, counts, TIMES, THRESHOLDS
    found = fit_events(*given, stages=((0.3, 5e-3),), max_steps=3)
    assert not found.converged
    assert found.steps == 3


def test_counts_are_those_of_the_interval_and_pixel():
    time = np.array([0.0, 0.4, 1.0, 1.5, 1.9, 2.5])
    events = Events(
        x=np.array([0, 1, 1, 1, 2, 0]),
        y=np.array([0, 0, 1, 1, 1, 0]),
        time=time,
        polarity=np.array([1, 1, 1, -1, -1, 1]),
        count=np.asarray(6),
        lost=np.asarray(0),
    )
    counts = event_counts(events, np.array([0.0, 1.0, 2.0]), (2, 3))
    # an event at a frame's instant belongs to what led up to it
    first = [[0, 1, 0], [0, 1, 0]]
    second = [[0, 0, 0], [0, -1, -1]]
    np.testing.assert_array_equal(counts, [first, second])
