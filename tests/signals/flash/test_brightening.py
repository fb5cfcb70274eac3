"""Which pixels became bright, and which of those fell again."""

import numpy as np

from jblast.signals.flash.watch import REMEMBERED, Brightening

SHAPE = 6, 8


def changed(*amounts):
    """What each of some changes of one pixel did to it."""
    pixels = Brightening(SHAPE)
    pixels.push(np.zeros(SHAPE, np.float32))
    out = []
    for amount in amounts:
        change = np.zeros(SHAPE, np.float32)
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
