"""Evidence of growth in tiles, against counting pixel by pixel."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.signals.flash.watch import Tiles, down_the_columns, tiles_of
from tests.signals.flash.films import disc


def evidence(lit, fallen, bright, side=24):
    tiles = Tiles(lit.shape, side)
    return tiles, tiles.evidence(*(down_the_columns(m) for m in (lit, fallen, bright)))


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
