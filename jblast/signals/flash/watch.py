r"""The sequential test of one camera: a bright spot that grows to both sides.

It takes frame by frame, in constant memory. From each change of the logarithm of light
three effects are removed first.

Motion of the camera, and light on the whole scene. To first order the change of a scene
at rest before a moving camera is

$$\Delta L = -(u\,\partial_x L + v\,\partial_y L) + g$$

(Horn and Schunck 1981, eq. 1) with a flow $(u, v)$ that is affine in the position, and
a gain $g$. The seven numbers are fitted by least squares to changes clipped at a few
times their mean size, as in Huber's estimate, so that objects that move have little
weight.

Light of a lamp, of lightning or of the fireball on its surroundings. It is smooth over
tens of pixels, the edge of a fireball is not: the local mean is subtracted.

Noise of each pixel, estimated as the mean size of its changes (texture before a moving
camera and lamps on the mains included). A pixel's changes are summed over some
milliseconds. It is lit when the sum exceeds a threshold in the logarithm of light and
in its own noise. A lit pixel does not count again for a while, so that a lamp that
flickers counts once.

In tiles of several sizes the newly lit pixels are counted left and right of the centre
of those that are bright. A fireball grows to both sides: the evidence $a$ is twice the
smaller count. The front of a car or the edge of a shadow moves to one side and has
none. Up and down are not compared, because the ground hides the lower half of most
fireballs. The evidence is summed by Page's test,

$$S_t = \max(0,\ r_t\,(S_{t-1} + x_t) - k), \qquad
x_t = \ln\!\Big(1 + \frac{a_t}{\nu}\Big)$$

(Page 1954, Biometrika 41, 100, eq. 1, for $r_t = 1$), with $\nu$ the evidence of a tile
without a blast. The logarithm limits the weight of one frame: a lamp lights up in one
frame, a fireball grows for many. $r_t$ is the share of the bright pixels that are still
bright: the flash of a shot, a glint or a flickering lamp loses all its evidence as it
falls, and soot in front of a part of the fire that part. Pixels that darken without
having been bright are ignored, because soot around an explosion is darker than its
background. The statistic is the least sum of the last frames: what was lit has to stay.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

FAINT = 0.05
"""Light below which a logarithm is of noise more than of light, full scale 1."""
GATHERED = 0.6
"""Share of the sum of changes that is left after a frame."""
BRIGHTER = 0.25
"""Change of the logarithm of light that lights a pixel, at least."""
PIXEL_NOISES = 6.0
"""And so many times the mean size of the pixel's changes."""
PIXEL_LEARNT = 100.0
"""Frames over which a pixel's noise is learnt; at first the mean of all there were."""
FIRST = 2.0
"""So many frames the first guess counts as, the median of the first change."""
REMEMBERED = 60
"""Frames for which a pixel that was lit does not count again."""
Image = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
SIDES = (12, 24, 48, 96)
"""Sides of the tiles [px]; each overlaps its neighbours by a half."""
DRIFT = 0.7
"""Taken off the sum of a tile in each frame, $k$: the parts of a passing car say about
as much for many frames, a fireball four and more for a few, of which it has to last for
the rest."""
MIN_PIXELS = 2.0
"""Smallest number of pixels that count as much as the noise of a tile."""
TILE_NOISES = 3.0
"""Times the mean of the pixels lit without a blast."""
TILE_LEARNT = 100.0
"""Frames over which that mean is learnt."""
STAYS_S = 6e-3
"""Time for which lit pixels have to stay bright [s]."""
BOUND = 40.0
"""Largest sum of a tile."""
SIDE = 17
"""Side of the square of the local mean [px]."""
MAX_LOG_CHANGE = 0.3
"""Changes of the logarithm are clipped to this before that mean is taken."""
FROM = 0.1
"""Where no more than `FEW_PIXELS` changes are as large, nothing is done."""
FEW_PIXELS = 20
"""A local mean, over 289 pixels, hardly moves by so few changes in a whole image."""
CLIP = 3.0
"""For the camera's motion changes are clipped at so many times their mean size."""
EVERY = 2
"""Every so many rows and columns one is used for the motion."""
DAMPING = 1e-6
"""Of the normal equations, a share of their trace: a scene without texture has none."""


class Seen(NamedTuple):
    """Result of the test after a frame.

    Attributes:
        statistic: The greatest of all tiles.
        frames: Number of frames since its evidence began.
        box: Tile it comes from: left, top, right, bottom [px].
    """

    statistic: float
    frames: int
    box: tuple[int, int, int, int]


class Brightened(NamedTuple):
    """Pixels that a frame changed.

    Attributes:
        lit: Pixels that became bright, and had not of late.
        fallen: Pixels that were bright and fell. What was not and darkens, as soot
            does before a wall, is no part of it.
        bright: Pixels that are lit now, or were a moment ago, and did not fall since.
    """

    lit: Mask
    fallen: Mask
    bright: Mask


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
            stays: Frames for which what was lit has to stay (`stays_for`).
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
        """Take in a change of the logarithm of light, as from events."""
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
        """Reset the evidence; the estimates of scene and noise stay."""
        self._cusum.forget()

    def _box(self, number: int) -> tuple[int, int, int, int]:
        for tiles, count in zip(self._tiles, self._counts, strict=True):
            if number < count:
                row, column = divmod(number, len(tiles.lefts))
                left, top = int(tiles.lefts[column]), int(tiles.tops[row])
                right, bottom = left + tiles.side, top + tiles.side
                return left, top, min(right, self.shape[1]), min(bottom, self.shape[0])
            number -= count
        raise AssertionError


class Evidence(NamedTuple):
    """Evidence of a frame in each tile.

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
        # half a side apart, and one at the far edge
        lasts = [max(size - side, 0) for size in shape]
        self.tops, self.lefts = (
            np.unique(np.append(np.arange(0, last, max(side // 2, 1)), last))
            for last in lasts
        )
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
        # running sums: a tile costs four values, whatever its size
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


class Brightening:
    """Follows each pixel from frame to frame."""

    def __init__(self, shape: tuple[int, int]):
        """Get ready for images of a shape."""
        self._sum = np.zeros(shape, np.float32)
        self._noise = np.zeros(shape, np.float32)
        self._left = np.zeros(shape, np.int16)
        self._bright = np.zeros(shape, bool)
        self._frames = 0

    def push(self, change: Image) -> Brightened:
        """Take in what a frame changed; return what it lit.

        Args:
            change: Of the logarithm of light, without that of the camera's motion.
        """
        size = np.abs(change)
        if not self._frames:
            # nearly the deviation of normal noise, 1.48 medians of absolute values; the
            # least is for a film that begins with a still
            self._noise += max(1.4 * float(np.median(size)), 1e-3)
        self._frames += 1
        total = self._sum
        total *= np.float32(GATHERED)
        total += change
        least = np.maximum(np.float32(PIXEL_NOISES) * self._noise, np.float32(BRIGHTER))
        up, down = total > least, total < -least
        lit = up & (self._left == 0)
        fallen = down & self._bright
        self._left -= self._left > 0
        self._left[up] = REMEMBERED
        self._bright |= up
        self._bright &= ~down
        self._bright &= self._left > 0
        # what just became bright teaches nothing of the noise
        size[self._left > 0] = 0.0
        # clipped: one flicker does not blind a pixel for a second
        np.minimum(size, 3.0 * self._noise + 0.02, out=size)
        learnt = np.float32(1.0 / min(self._frames + FIRST, PIXEL_LEARNT))
        self._noise += learnt * np.where(self._left > 0, 0.0, size - self._noise)
        return Brightened(lit, fallen, self._bright)


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


class Cusum:
    """The test of many tiles side by side.

    Attributes:
        statistic: Of each tile, after the last frame.
        begun: Frames since the sum of each tile was zero.
    """

    def __init__(self, tiles: int, stays: int = 6):
        """Begin with no evidence.

        Args:
            tiles: How many there are.
            stays: Frames for which what was lit has to stay.
        """
        self._stays = stays
        self._sum = np.zeros(tiles)
        self._mean = np.zeros(tiles)
        self._kept = np.zeros((stays, tiles))
        self._frame = 0
        self.begun = np.zeros(tiles, int)
        self.statistic: Float[np.ndarray, " tile"] = np.zeros(tiles)

    @property
    def idle(self) -> bool:
        """Whether there is no evidence anywhere, and was none lately."""
        return not self._kept.any()

    def forget(self) -> None:
        """Reset the evidence; the estimate of the noise stays."""
        self._sum[:] = 0.0
        self._kept[:] = 0.0
        self.begun[:] = 0

    def rest(self) -> None:
        """Take in a frame that lit nothing while there is no evidence."""
        self._mean *= 1.0 - 1.0 / TILE_LEARNT
        self._frame += 1
        self.statistic = np.zeros_like(self._sum)

    def push(
        self,
        evidence: Float[np.ndarray, " tile"],
        lit: Float[np.ndarray, " tile"],
        left: Float[np.ndarray, " tile"],
    ) -> Float[np.ndarray, " tile"]:
        """Take in the evidence of a frame; return the statistic of each tile.

        Args:
            evidence: Pixels for a blast.
            lit: All pixels that were lit.
            left: Share of the bright pixels that did not fall.
        """
        usual = MIN_PIXELS + TILE_NOISES * self._mean
        self._sum += np.log1p(evidence / usual)
        self._sum *= left
        self._sum -= DRIFT
        np.clip(self._sum, 0.0, BOUND, out=self._sum)
        self.begun = np.where(self._sum > 0.0, self.begun + 1, 0)
        # what may be a blast teaches nothing of the noise
        teaches = np.minimum(lit, 2.0 * usual) - self._mean
        # the more evidence, the slower the noise is learnt
        self._mean += teaches * (1.0 / TILE_LEARNT) / (1.0 + self._sum)
        self._kept[self._frame % self._stays] = self._sum
        self._frame += 1
        # the least of the last frames: a light that goes out at once is no fireball
        self.statistic = self._kept.min(axis=0)
        return self.statistic


def stays_for(rate_hz: float) -> int:
    """Return for how many frames what was lit has to stay, at a frame rate [Hz]."""
    return max(2, round(STAYS_S * rate_hz))


def own_change(change: Image) -> Image:
    """Return a change without the mean of what is round about.

    Args:
        change: Of the logarithm of light.
    """
    if np.count_nonzero(change > FROM) <= FEW_PIXELS:
        return change
    clipped = np.clip(change, np.float32(-MAX_LOG_CHANGE), np.float32(MAX_LOG_CHANGE))
    return change - _mean(_mean(clipped, 0), 1)


def _mean(image: Image, axis: int) -> Image:
    """Return the mean of `SIDE` neighbours along an axis, of fewer at the edges."""
    size = image.shape[axis]
    sums = np.insert(np.cumsum(image, axis=axis, dtype=np.float64), 0, 0.0, axis=axis)
    at = np.arange(size)
    first, last = np.maximum(at - SIDE // 2, 0), np.minimum(at + SIDE // 2 + 1, size)
    count = np.expand_dims(last - first, 1 - axis).astype(np.float32)
    total = np.take(sums, last, axis) - np.take(sums, first, axis)
    return total.astype(np.float32) / count


class EgoMotion:
    """Takes away what camera and light do to all of an image.

    Attributes:
        shape: Height and width [px].
    """

    def __init__(self, shape: tuple[int, int]):
        """Get ready for images of a shape."""
        self.shape = shape
        height, width = shape
        x = np.linspace(-1.0, 1.0, width, dtype=np.float32)
        y = np.linspace(-1.0, 1.0, height, dtype=np.float32)[:, None]
        self._x, self._y = x, y
        step = EVERY if min(shape) >= 8 * EVERY else 1
        self._some = np.s_[::step, ::step]
        size = np.ones(shape, np.float32)[self._some].shape
        self._few = (np.broadcast_to(v, shape)[self._some] for v in (x, y))
        self._few = tuple(v.ravel() for v in self._few)
        self._rows = np.ones((7, size[0] * size[1]), np.float32)
        self._across, self._down = (np.zeros(shape, np.float32) for _ in range(2))

    def rest(self, before: Image, after: Image) -> Image:
        """Return the change that neither explains.

        Args:
            before: Logarithm of the light.
            after: The same a frame later.
        """
        change, both = after - before, before + after
        across, down = self._across, self._down
        if self.shape[1] > 2:
            np.subtract(both[:, 2:], both[:, :-2], out=across[:, 1:-1])
        if self.shape[0] > 2:
            np.subtract(both[2:], both[:-2], out=down[1:-1])
        # an affine motion and a gain: shake, turn and zoom of a camera, and clouds
        rows = self._rows
        for i, gradient in enumerate((across, down)):
            rows[i] = gradient[self._some].ravel()
            for j, place in enumerate(self._few):
                np.multiply(rows[i], place, out=rows[2 + 2 * i + j])
        few = change[self._some].ravel()
        # a bright flash is not motion, and would turn the whole image
        most = CLIP * float(np.abs(few).mean()) + 1e-6
        clipped = np.clip(few, -most, most)
        square = (rows @ rows.T).astype(float)
        square.flat[::8] += DAMPING * np.trace(square) + 1e-9
        found = np.linalg.solve(square, (rows @ clipped).astype(float))
        a, d, ax, ay, dx, dy, gain = (np.float32(v) for v in found)
        change -= gain
        change -= across * ((a + ax * self._x) + ay * self._y)
        change -= down * ((d + dx * self._x) + dy * self._y)
        return change
