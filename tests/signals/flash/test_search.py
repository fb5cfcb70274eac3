"""Films searched from end to end."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import genpareto

from jblast.errors import InputError
from jblast.sensors.camera.files.recorded_events import RecordedEvents
from jblast.signals.flash.search import (
    MEASURED,
    Tail,
    detect_flashes,
    event_changes,
    flash_threshold,
)
from tests.signals.flash.films import growing

HEIGHT = 4.5


def blocks(times, light, length=7):
    for first in range(0, len(times), length):
        yield times[first : first + length], light[first : first + length]


@pytest.mark.parametrize("half", [True, False])
def test_a_blast_is_seen_when_and_where_it_was(half):
    seen = detect_flashes(blocks(*growing(half=half)), 1000.0, HEIGHT)
    (flash,) = seen.flashes
    told = flash.growth
    assert flash.frame == 31
    assert abs(told.time_s - 0.0304) < 4 * told.sigma_s < 1e-3
    assert (told.x_px, told.y_px) == pytest.approx((41.0, 33.0), abs=1.0)
    # a pixel half covered shines more than half: up to 0.4 px too large
    assert told.radius_px == pytest.approx(15.0, abs=0.6)
    assert flash.alarm_s - 0.0304 < 0.02


def test_a_quiet_film_and_one_of_a_lamp_show_nothing():
    times, light = growing(burst_s=1.0)
    assert not detect_flashes(blocks(times, light), 1000.0, HEIGHT).flashes
    lit = light.copy()
    lit[40:, 20:35, 30:45] = 1.0  # at once, and it stays
    assert not detect_flashes(blocks(times, lit), 1000.0, HEIGHT).flashes
    lit[43:] = light[43:]  # a shot
    assert not detect_flashes(blocks(times, lit), 1000.0, HEIGHT).flashes


def test_a_blast_in_the_second_frame_is_seen():
    seen = detect_flashes(blocks(*growing(burst_s=0.0002)), 1000.0, HEIGHT)
    assert seen.flashes[0].frame == 1
    assert seen.flashes[0].growth.time_s == pytest.approx(0.0002, abs=4e-4)


@pytest.mark.slow
def test_fast_films_are_averaged_and_large_ones_binned():
    film = growing(frames=320, rate=4000.0)
    seen = detect_flashes(blocks(*film), 4000.0, HEIGHT)
    assert len(seen.times) == 80
    assert seen.flashes[0].growth.time_s == pytest.approx(0.0304, abs=3e-4)
    wide = growing(shape=(80, 400), at=(200.0, 40.0), last=24.0, frames=60)
    seen = detect_flashes(blocks(*wide), 1000.0, HEIGHT)
    assert seen.binned == 2
    told = seen.flashes[0].growth
    assert (told.x_px, told.y_px) == pytest.approx((200.0, 40.0), abs=1.5)
    assert told.radius_px == pytest.approx(24.0, abs=1.5)


def test_of_a_slow_film_only_the_frames_between_which_it_came_are_told():
    slow = growing(burst_s=1.01, frames=50, rate=30.0)
    (flash,) = detect_flashes(blocks(*slow), 30.0, 2.0).flashes
    assert flash.frame == 31
    assert flash.growth.time_s == pytest.approx(30.5 / 30)
    assert flash.growth.sigma_s == pytest.approx(1 / 30 / np.sqrt(12))
    assert flash.growth.growth_s is None


def test_a_fireball_first_seen_at_several_pixels_begins_after_the_dark_frame():
    times, light = growing(burst_s=2.0, frames=60, rate=30.0)
    _, lit = growing(burst_s=20.5 / 30, tau=0.12, frames=60, rate=30.0)
    _, fire = growing(burst_s=20.5 / 30, tau=1e-4, last=7.0, frames=60, rate=30.0)
    film = np.maximum(light, np.maximum(lit, fire))
    (flash,) = detect_flashes(blocks(times, film), 30.0, HEIGHT).flashes
    assert flash.frame == 21
    assert 20 / 30 < flash.growth.time_s < 21 / 30
    assert abs(flash.growth.time_s - 20.5 / 30) < 2 * flash.growth.sigma_s


def test_a_faint_frame_before_the_first_silhouette_is_not_dark():
    # two thirds of the exposure of frame 20 are over when the fire begins
    times, light = growing(burst_s=20.1 / 30, tau=1e-3, frames=60, rate=30.0)
    dark = light[10]
    film = np.concatenate([light[:20], [dark + 0.3 * (light[30] - dark)], light[21:]])
    seen = detect_flashes(blocks(times, film), 30.0, 2.0, exposure_s=1 / 30)
    (flash,) = seen.flashes
    assert flash.frame == 21
    # dark frame 19, centred on its time stamp
    assert flash.growth.time_s == pytest.approx(20.0 / 30, abs=1e-6)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_a_film_that_turns_black_or_white_at_once_shows_nothing(value):
    times, light = growing(burst_s=1.0)
    light[40:] = value
    assert not detect_flashes(blocks(times, light), 1000.0, 1.0).flashes


@pytest.mark.parametrize("shape", [0.0, 0.2])
def test_a_threshold_is_the_quantile_of_the_tail(shape):
    tail = Tail(0.5, 0.6, shape, 600.0, 1000, 1000.0)
    for rate in (0.01, 1.0, 500.0):
        excess = genpareto(shape, scale=0.6).isf(rate / 600.0)
        assert tail.threshold(rate) == pytest.approx(0.5 + excess)
    assert tail.threshold(1e4) == 0.5  # more than the tail knows of


def test_no_threshold_for_less_than_was_seen_lies_below_the_greatest():
    tail = Tail(0.5, 0.6, 0.0, 600.0, 1000, 0.1, greatest=9.0)
    assert tail.threshold(1.0) == pytest.approx(9.0 + 0.6 * np.log(10.0))
    assert tail.threshold(100.0) == pytest.approx(0.5 + 0.6 * np.log(6.0))


def test_the_tail_in_use_is_the_one_that_was_measured():
    kept = Path("calibration/results/visual_detector.txt").read_text()
    row = next(line for line in kept.splitlines() if line.startswith("growth (CUSUM)"))
    told = [float(word) for word in row.split()[2:]]
    one = (MEASURED.level, MEASURED.scale, MEASURED.shape, MEASURED.per_hour)
    assert told == pytest.approx([*one, MEASURED.greatest], rel=1e-3)


def test_fewer_false_alarms_want_a_higher_threshold():
    assert flash_threshold(0.1) > flash_threshold(1.0) > flash_threshold(10.0)
    with pytest.raises(InputError, match="false_alarms_per_hour"):
        flash_threshold(0.0)


def test_each_event_counts_once_in_its_millisecond():
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, 100_000, 5000)).astype(np.int64)
    x, y = rng.integers(0, 8, 5000), rng.integers(0, 6, 5000)
    p = rng.integers(0, 2, 5000).astype(np.uint8)
    events = RecordedEvents(x.astype(np.uint16), y.astype(np.uint16), t, p, 8, 6)
    blocks = list(event_changes(events, (0.2, 0.3)))
    times = np.concatenate([times for times, _ in blocks])
    changes = np.concatenate([images for _, images in blocks])
    np.testing.assert_allclose(times, np.arange(1, len(times) + 1) / 1000)
    by_hand = np.zeros_like(changes)
    for column, row, time, sign in zip(x, y, t, p, strict=True):
        by_hand[time // 1000, row, column] += 0.2 if sign else -0.3
    np.testing.assert_allclose(changes, by_hand, atol=1e-6)
