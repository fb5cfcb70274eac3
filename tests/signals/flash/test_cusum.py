"""Page's test, tile by tile."""

import numpy as np

from jblast.signals.flash.watch import BOUND, DRIFT, MIN_PIXELS, Cusum


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
