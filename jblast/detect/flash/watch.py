"""A detector of blasts that watches for ever: frame by frame, in constant memory."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.detect.flash.brightening import Brightened, Brightening
from jblast.detect.flash.cusum import Cusum
from jblast.detect.flash.ego_motion import EgoMotion
from jblast.detect.flash.expansion import Tiles, down_the_columns, tiles_of
from jblast.detect.flash.own_change import own_change

FAINT = 0.05
"""Light below which a logarithm is of noise more than of light, full scale 1."""


class Seen(NamedTuple):
    """What the test says after a frame.

    Attributes:
        statistic: The greatest of all tiles.
        frames: So many frames ago did the evidence for it begin.
        box: Tile it comes from: left, top, right, bottom [px].
    """

    statistic: float
    frames: int
    box: tuple[int, int, int, int]


class Watch:
    """The test of one camera.

    Attributes:
        shape: Height and width of its images [px].
        last: What the last frame lit; None before the second.
    """

    last: Brightened | None = None

    def __init__(self, shape: tuple[int, int], *, stays: int = 6):
        """Get ready for images of a shape.

        Args:
            shape: Height and width [px].
            stays: Frames for which what was lit has to stay (`cusum.stays_for`).
        """
        self.shape = shape
        self._ego = EgoMotion(shape)
        self._pixels = Brightening(shape)
        self._tiles = tiles_of(shape)
        self._counts = [len(t.tops) * len(t.lefts) for t in self._tiles]
        self._cusum = Cusum(sum(self._counts), stays)
        self._before: np.ndarray | None = None
        self._nothing = Seen(0.0, 0, (0, 0, shape[1], shape[0]))

    def frame(self, light: Float[np.ndarray, "height width"]) -> Seen:
        """Take in a frame of linear light, full scale 1."""
        log = np.log(np.asarray(light, np.float32) + np.float32(FAINT))
        before, self._before = self._before, log
        if before is None:
            return self._nothing
        return self.change(self._ego.rest(before, log))

    def change(self, change: Float[np.ndarray, "height width"]) -> Seen:
        """Take in a change of the logarithm of light, as events tell it."""
        self.last = self._pixels.push(own_change(change))
        if self._cusum.idle and not self.last.lit.any():
            self._cusum.rest()
            return self._nothing
        sums = [down_the_columns(mask) for mask in self.last]
        evidence = [tiles.evidence(*sums) for tiles in self._tiles]
        whole = (
            np.concatenate([v.ravel() for v in some])
            for some in zip(*evidence, strict=True)
        )
        statistic = self._cusum.push(*whole)
        best = int(np.argmax(statistic))
        begun = int(self._cusum.begun[best])
        return Seen(float(statistic[best]), begun, self._box(best))

    def forget(self) -> None:
        """Begin anew, but for what is known of the scene and its noise."""
        self._cusum.forget()

    def _box(self, number: int) -> tuple[int, int, int, int]:
        for tiles, count in zip(self._tiles, self._counts, strict=True):
            if number < count:
                row, column = divmod(number, len(tiles.lefts))
                return _box_of(tiles, row, column, self.shape)
            number -= count
        raise AssertionError


def _box_of(
    tiles: Tiles, row: int, column: int, shape: tuple[int, int]
) -> tuple[int, int, int, int]:
    left, top = int(tiles.lefts[column]), int(tiles.tops[row])
    right, bottom = left + tiles.side, top + tiles.side
    return left, top, min(right, shape[1]), min(bottom, shape[0])
