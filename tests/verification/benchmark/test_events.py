import numpy as np
import pytest

from jblast.sensors.camera.events.noise import IDEAL
from jblast.verification.benchmark import cameras
from jblast.verification.benchmark.cameras import Sent, stamp_errors, unlike
from jblast.verification.benchmark.chart import on_pareto_front


def error_us(found):
    off, pixels, wrong = stamp_errors(found)
    assert pixels > 500
    assert wrong == 0
    return float(off.mean()) * 1e6


def test_each_way_has_the_error_it_is_known_for():
    # second order in the frame interval: a ninth at 3,000/s
    coarse, fine = (error_us(cameras.of_frames(fps)) for fps in (1000, 3000))
    assert coarse < 12.0
    assert coarse / fine == pytest.approx(9.0, rel=0.1)
    assert error_us(cameras.of_bytes(1000)) < 60.0
    # half a frame on average, and a little for the 8 bits
    assert error_us(cameras.of_bytes_stamped(1000)) == pytest.approx(500.0, rel=0.15)
    for fps in (30, 1000):
        assert error_us(cameras.of_functions(fps)) < 1e-3


def test_a_pixel_with_another_count_is_left_out_and_told():
    found = cameras.of_frames(1000)
    whole = np.flatnonzero(cameras.passed_wholly())[0]
    gone = np.flatnonzero(found.pixel == whole)[0]
    less = Sent(*(np.delete(field, gone) for field in found))
    off, _, wrong = stamp_errors(less)
    assert wrong == 1
    assert off.max() < 1e-4


def test_events_without_a_partner_are_counted_on_both_sides():
    known = Sent(np.array([0, 0, 5]), np.array([0.1, 0.5, 0.9]), np.array([1, 1, -1]))
    near = known._replace(time=known.time + 0.5 * cameras.SAME_EVENT_S)
    assert unlike(near, known) == (0, 0)
    other = known._replace(sign=np.array([1, -1, -1]))
    assert unlike(other, known) == (1, 1)
    few = Sent(*(field[:1] for field in known))
    assert unlike(few, known) == (2, 0)
    assert unlike(Sent(*(field[:0] for field in known)), known) == (3, 0)


@pytest.mark.slow
def test_a_camera_with_all_effects_is_like_itself_and_unlike_an_ideal_one():
    full = cameras.noisy_events(cameras.USUAL)
    assert unlike(full, full) == (0, 0)
    missing, extra = unlike(cameras.noisy_events(IDEAL), full)
    assert missing + extra > 0.5 * full.time.size


@pytest.mark.slow
def test_every_way_is_measured_and_only_frameless_is_solved():
    stamps = cameras.stamp_points(1)
    assert len(stamps) == len(cameras.METHODS)
    solved = {p.method for p in stamps if p.error == pytest.approx(1e-3)}
    assert solved == {"frameless from 30/s", "frameless from 1,000/s"}
    effects = cameras.effect_points(1)
    assert len(effects) == len(cameras.EFFECTS) + 1
    assert [p.is_reference for p in effects] == [False] * len(cameras.EFFECTS) + [True]
    assert all(0 < p.error <= 1 and p.cost_s > 0 for p in effects)
    assert on_pareto_front(effects)[-1]
