r"""How much a bright spot grows, to both sides alike, in tiles of several sizes.

In each tile the pixels lit by a frame are counted left and right of the middle of those
that are bright already. A fireball grows to both sides, so the evidence is twice the
smaller count; a car's front or a shadow's edge moves to one side, and has none. What
share of the bright pixels is left is told with it: a shot's flash, a glint or a lamp
that flickers falls as it rose. What darkens without having been bright is no part of
it: the soot round an explosion is darker than what is behind it. Left and right only,
as the ground hides the lower half of most fireballs.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

SIDES = (12, 24, 48, 96)
"""Of the tiles [px]; each overlaps its neighbours by a half."""

Mask = Bool[np.ndarray, "height width"]


class Evidence(NamedTuple):
    """What a frame says of each tile.

    Attributes:
        both: Pixels by which it grew to both sides alike.
        lit: Pixels that were lit.
        left: Share of the bright pixels that did not fall; 1 where none were bright.
    """

    both: Float[np.ndarray, "..."]
    lit: Float[np.ndarray, "..."]
    left: Float[np.ndarray, "..."]


class Tiles:
    """Tiles of one size over an image.

    Attributes:
        side: Of a tile [px].
        tops: First row of each row of tiles [px].
        lefts: First column of each column of tiles [px].
    """

    def __init__(self, shape: tuple[int, int], side: int):
        """Lay tiles over images of a shape."""
        self.side = side
        self.tops, self.lefts = (_starts(size, side) for size in shape)
        self._bottoms = np.minimum(self.tops + side, shape[0])
        self._rights = np.minimum(self.lefts + side, shape[1])
        self._rows = np.arange(len(self.tops))[:, None]
        self._column = np.arange(shape[1], dtype=np.int32)

    def evidence(
        self,
        lit: Int[np.ndarray, "row width"],
        fallen: Int[np.ndarray, "row width"],
        bright: Int[np.ndarray, "row width"],
    ) -> Evidence:
        """Return the evidence for growth in each tile (down, across).

        Args:
            lit: Running sums down the columns, from a row of zeros on.
            fallen: Likewise.
            bright: Likewise.
        """
        new, lost, held = (self._banded(sums) for sums in (lit, fallen, bright))
        new_sums, lost_sums, held_sums = (_running(v) for v in (new, lost, held))
        first_sums = _running(held * self._column)
        count = self._within(held_sums)
        middle = self._within(first_sums) / np.maximum(count, 1)
        # the middle column's pixels belong half to either side
        at = np.clip(np.floor(middle + 0.5).astype(int), self.lefts, self._rights - 1)
        left = new_sums[self._rows, at] - new_sums[:, self.lefts]
        right = new_sums[:, self._rights] - new_sums[self._rows, at + 1]
        among = self._within(new_sums).astype(float)
        centre = among - left - right
        both = 2.0 * np.minimum(left + 0.5 * centre, right + 0.5 * centre)
        lost = self._within(lost_sums)
        return Evidence(both, among, 1.0 - lost / np.maximum(count + lost, 1))

    def _banded(self, sums: Int[np.ndarray, "row width"]) -> np.ndarray:
        return sums[self._bottoms] - sums[self.tops]

    def _within(self, sums: np.ndarray) -> np.ndarray:
        return sums[:, self._rights] - sums[:, self.lefts]


def tiles_of(shape: tuple[int, int]) -> list[Tiles]:
    """Return tiles of all sizes that an image of a shape has room for."""
    fitting = [side for side in SIDES if side <= max(shape)]
    return [Tiles(shape, side) for side in fitting or [max(shape)]]


def down_the_columns(mask: Mask) -> Int[np.ndarray, "row width"]:
    """Return running sums of a mask down its columns, from a row of zeros on."""
    out = np.zeros((mask.shape[0] + 1, mask.shape[1]), np.int32)
    np.cumsum(mask, axis=0, out=out[1:])
    return out


def _running(rows: np.ndarray) -> np.ndarray:
    """Return running sums along rows, from a column of zeros on."""
    out = np.zeros((rows.shape[0], rows.shape[1] + 1), np.int32)
    np.cumsum(rows, axis=1, out=out[:, 1:])
    return out


def _starts(size: int, side: int) -> Int[np.ndarray, " tile"]:
    last = max(size - side, 0)
    return np.unique(np.append(np.arange(0, last, max(side // 2, 1)), last))
