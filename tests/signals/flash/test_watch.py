"""Page's test, tile by tile."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.signals.flash.watch import (
    BOUND,
    DRIFT,
    MIN_PIXELS,
    REMEMBERED,
    Brightening,
    Cusum,
    EgoMotion,
    Tiles,
    running_sums,
    tiles_of,
)
from tests.signals.flash.films import SHAPE, disc


def page(evidence, left):
    """The sum of one tile by its equation, no noise learnt."""
    total, out = 0.0, []
    for a, share in zip(evidence, left, strict=True):
        said = np.log(1 + a / MIN_PIXELS)
        total = min(max(0.0, share * (total + said) - DRIFT), BOUND)
        out.append(total)
    return np.array(out)


def pushed(test, evidence, left=1.0):
    """What a test of one tile says after a frame in which nothing counts as noise."""
    return float(test.push(np.array([evidence]), np.zeros(1), np.array([left]))[0])


def test_the_statistic_is_the_least_of_the_last_sums():
    rng = np.random.default_rng(0)
    evidence = np.maximum(rng.normal(0.0, 6.0, (60, 3)), 0.0).round()
    left = np.where(rng.random((60, 3)) < 0.3, rng.random((60, 3)), 1.0)
    test = Cusum(3, stays=4)
    told = np.array(
        [
            test.push(a, np.zeros(3), share).copy()
            for a, share in zip(evidence, left, strict=True)
        ]
    )
    for tile in range(3):
        sums = np.append(np.zeros(3), page(evidence[:, tile], left[:, tile]))
        least = np.lib.stride_tricks.sliding_window_view(sums, 4).min(axis=1)
        np.testing.assert_allclose(told[:, tile], least, rtol=1e-12)


def test_a_flash_that_falls_before_it_has_stayed_says_nothing():
    test = Cusum(1, stays=6)
    shot = [*([(400.0, 1.0)] * 3), (0.0, 0.0), *([(0.0, 1.0)] * 20)]
    assert max(pushed(test, *frame) for frame in shot) == 0.0


def test_a_fire_that_soot_covers_in_part_is_still_one():
    whole, sooty = Cusum(1), Cusum(1)
    grows = [1900.0, 900.0, 80.0]
    told = [pushed(whole, a) for a in [*grows, *([0.0] * 6)]]
    left = [1.0, 0.9, *([0.95] * 7)]
    less = [
        pushed(sooty, *frame)
        for frame in zip([*grows, *([0.0] * 6)], left, strict=True)
    ]
    assert 0.4 * max(told) < max(less) < max(told)


def test_pixels_that_are_lit_all_the_time_are_learnt_as_noise():
    quiet, noisy = Cusum(1), Cusum(1)
    for _ in range(300):
        noisy.push(np.zeros(1), np.array([20.0]), np.array([0.5]))
    told = [max(pushed(test, 15.0) for _ in range(12)) for test in (quiet, noisy)]
    assert told[1] < 0.3 * told[0]


PIXELS = 6, 8


def changed(*amounts):
    """What each of some changes of one pixel did to it."""
    pixels = Brightening(PIXELS)
    pixels.push(np.zeros(PIXELS, np.float32))
    out = []
    for amount in amounts:
        change = np.zeros(PIXELS, np.float32)
        change[2, 3] = amount
        out.append([bool(mask[2, 3]) for mask in pixels.push(change)])
    return np.array(out).T


def test_what_flickers_is_lit_once_and_falls():
    lit, fallen, bright = changed(1.5, -1.5, 0.0, 0.0, 1.5)
    assert lit.tolist() == [True, False, False, False, False]
    assert fallen.tolist() == [False, True, False, False, False]
    assert bright.tolist() == [True, False, False, False, True]


def test_soot_before_a_wall_has_not_fallen_and_may_burn_after():
    lit, fallen, _ = changed(-1.0, 0.0, 0.0, 2.0)
    assert not fallen.any()
    assert lit.tolist() == [False, False, False, True]


def test_what_was_bright_long_ago_does_not_fall():
    _, fallen, bright = changed(1.5, *[0.0] * (REMEMBERED + 8), -1.5)
    assert not bright[-2]
    assert not fallen.any()


def evidence(lit, fallen, bright, side=24):
    tiles = Tiles(lit.shape, side)
    return tiles, tiles.evidence(*(running_sums(m, 0) for m in (lit, fallen, bright)))


def by_hand(lit, fallen, bright):
    count = bright.sum()
    middle = (bright.sum(axis=0) @ np.arange(lit.shape[1])) / max(count, 1)
    at = int(np.clip(np.floor(middle + 0.5), 0, lit.shape[1] - 1))
    columns = lit.sum(axis=0)
    centre = 0.5 * columns[at]
    both = 2 * min(columns[:at].sum() + centre, columns[at + 1 :].sum() + centre)
    return both, 1.0 - fallen.sum() / max(count + fallen.sum(), 1)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.4))
@settings(max_examples=25, deadline=None)
def test_running_sums_count_what_pixels_do(seed, share):
    rng = np.random.default_rng(seed)
    lit, fallen, bright = rng.random((3, 30, 50)) < share
    held = (bright | lit) & ~fallen
    tiles, told = evidence(lit, fallen, held)
    for i, top in enumerate(tiles.tops):
        for j, left in enumerate(tiles.lefts):
            part = np.s_[top : top + 24, left : left + 24]
            both, left = by_hand(*(m[part] for m in (lit, fallen, held)))
            assert told.both[i, j] == pytest.approx(both, abs=1e-9)
            assert told.left[i, j] == pytest.approx(left, abs=1e-9)
            assert told.lit[i, j] == lit[part].sum()


def test_growth_to_both_sides_is_evidence_and_a_front_is_none():
    before, after = (disc(25, 20, r, (40, 50)) > 0.5 for r in (5, 7))
    new = after & ~before
    _, told = evidence(new, np.zeros_like(new), after, side=40)
    assert told.both.max() == pytest.approx(
        new.sum(), abs=8
    )  # a column more on one side
    front = np.zeros_like(new)
    front[10:30, 30] = True
    body = np.zeros_like(new)
    body[10:30, 10:31] = True
    _, told = evidence(front, np.zeros_like(new), body, side=40)
    assert told.both.max() == 0.0


def test_of_what_falls_nothing_is_left():
    fallen = np.ones((40, 50), bool)
    none = np.zeros_like(fallen)
    _, told = evidence(none, fallen, none)
    assert (told.left == 0.0).all()
    _, told = evidence(none, none, none)
    assert (told.left == 1.0).all()


@pytest.mark.parametrize("shape", [(1, 1), (5, 200), (120, 160), (97, 97)])
def test_tiles_cover_every_pixel(shape):
    for tiles in tiles_of(shape):
        covered = np.zeros(shape, bool)
        for top in tiles.tops:
            for left in tiles.lefts:
                covered[top : top + tiles.side, left : left + tiles.side] = True
        assert covered.all()


def texture(dx=0.0, dy=0.0, turn=0.0, zoom=1.0):
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    x, y = x - 40.0, y - 30.0
    x, y = zoom * (x - turn * y) - dx, zoom * (y + turn * x) - dy
    wave = np.sin(0.3 * x + 0.1 * y) + np.cos(0.17 * x - 0.23 * y) + np.sin(0.21 * y)
    return (0.2 * wave).astype(np.float32)


def left(after, before=None):
    before = texture() if before is None else before
    rest = EgoMotion(SHAPE).rest(before, after)[3:-3, 3:-3]
    return np.abs(rest).mean() / np.abs((after - before)[3:-3, 3:-3]).mean()


def test_a_camera_that_moves_turns_or_closes_in_explains_its_changes():
    # second order is left: 0.3 px of waves of 20 px, of the size of (0.3 k)^2 / 2
    assert left(texture(0.3, -0.2)) < 0.05
    assert left(texture(turn=0.004)) < 0.05
    assert left(texture(zoom=1.004)) < 0.05


def test_light_on_all_of_the_scene_is_taken_away():
    assert left(texture() + np.float32(0.4)) < 1e-3


def test_a_spot_that_lights_up_stays():
    spot = disc(40, 30, 6).astype(np.float32)
    rest = EgoMotion(SHAPE).rest(texture(), texture(0.2, 0.1) + 1.5 * spot)
    assert np.abs(rest[spot == 1] - 1.5).max() < 0.15


def test_a_scene_without_texture_is_no_error():
    flat = np.zeros(SHAPE, np.float32)
    assert not EgoMotion(SHAPE).rest(flat, flat).any()
    assert np.isfinite(EgoMotion((1, 3)).rest(flat[:1, :3], flat[:1, :3] + 1)).all()
