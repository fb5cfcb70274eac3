r"""The sequential test of one camera for a bright spot that grows to both sides.

Frames are processed one by one in constant memory. From each change of the logarithm of
light three effects are removed first.

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
background. The statistic is the smallest sum of the last frames: lit pixels must stay.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

LIGHT_OFFSET = 0.05
"""Light that is added before the logarithm [full scale 1]: below it, changes are noise
more than light."""
SUM_MEMORY = 0.6
"""Share of a pixel's sum of changes that remains after a frame: the sum has a memory of
2.5 frames, as an edge crosses a pixel of a growing fireball in several frames."""
LIT_LOG_CHANGE = 0.25
"""Smallest sum of changes of the logarithm of light that lights a pixel: 28 % brighter,
above the texture that the fit of the camera's motion leaves."""
PIXEL_NOISES = 6.0
"""Smallest such sum, over the mean absolute change of the pixel. For white noise, whose
changes are anticorrelated, it is six standard deviations of the sum."""
PIXEL_MEMORY_FRAMES = 100.0
"""Frames over which a pixel's noise is averaged; before that, over all frames."""
INITIAL_FRAMES = 2.0
"""Weight of the first estimate, the median of the first change, in frames."""
REMEMBERED = 60
"""Frames in which a lit pixel does not count again: longer than the period of lamps on
the mains (10 ms) and of most flicker, at 1,000 frames a second."""
Image = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
SIDES = (12, 24, 48, 96)
"""Sides of the tiles [px], for fireballs of 10 to 50 px; neighbouring tiles overlap by
half."""
DRIFT = 0.7
"""Evidence $k$ subtracted from the sum of a tile in each frame. The parts of a passing
car give about as much in many frames, so that their sum stays near zero. A fireball
gives four and more in a few frames, which must last for the rest."""
MIN_PIXELS = 2.0
"""Smallest evidence $\nu$ of a tile without a blast [px]: single pixels give little."""
TILE_NOISES = 3.0
"""Ratio of that evidence to the mean number of pixels lit without a blast."""
TILE_MEMORY_FRAMES = 100.0
"""Frames over which that mean is averaged."""
STAYS_S = 6e-3
"""Time for which lit pixels must stay bright [s]: longer than the flash of a shot or a
glint, and a part of the detection delay (median 7.7 ms at one false alarm an hour,
`calibration/results/visual_detector.txt`)."""
BOUND = 40.0
"""Largest sum of a tile, five times the threshold for one false alarm an hour: without
it the sum of a large fireball would take a second to return to zero."""
MEAN_SIDE = 17
"""Side of the square of the local mean [px]: larger than the edge of a fireball,
smaller than the light that it casts around."""
MAX_LOG_CHANGE = 0.3
"""Largest change of the logarithm in that mean: otherwise a fireball would darken its
own surroundings."""
LEAST_CHANGE = 0.1
"""Change from which on a pixel counts for `FEW_PIXELS`."""
FEW_PIXELS = 20
"""Number of changed pixels up to which the local mean is not subtracted: over 289
pixels it hardly changes, and its computation is saved in most frames."""
MOTION_CLIP = 3.0
"""Limit of changes in the fit of the camera's motion, over their mean absolute value:
normal changes are hardly clipped, those of moving objects are."""
MOTION_STRIDE = 2
"""Step in rows and columns of the pixels used for the motion: seven numbers do not need
more than a quarter of them."""
MOTION_DAMPING = 1e-6
"""Damping of the normal equations, over their trace: without texture these are
singular."""


class Seen(NamedTuple):
    """Result of the test after a frame.

    Attributes:
        statistic: Largest statistic of all tiles.
        frames: Number of frames since its evidence began.
        box: Its tile: left, top, right, bottom [px].
    """

    statistic: float
    frames: int
    box: tuple[int, int, int, int]


class Brightened(NamedTuple):
    """Pixels that a frame changed.

    Attributes:
        lit: Pixels that became bright and were not lit recently.
        fallen: Pixels that were bright and darkened. Pixels that darken without having
            been bright, as by soot in front of a wall, do not count.
        bright: Pixels that were lit recently and have not darkened since.
    """

    lit: Mask
    fallen: Mask
    bright: Mask


class Watch:
    """The test of one camera.

    Attributes:
        shape: Height and width of its images [px].
        last: Pixels that the last frame changed; None before the second, and after a
            step without change or evidence.
    """

    last: Brightened | None = None

    def __init__(self, shape: tuple[int, int], *, stays: int = 6):
        """Create the test for images of a shape.

        Args:
            shape: Height and width [px].
            stays: Frames for which lit pixels must stay bright (`stays_for`).
        """
        self.shape = shape
        self._ego = EgoMotion(shape)
        self._pixels = Brightening(shape)
        self._tiles = tiles_of(shape)
        height, width = shape
        self._boxes = [
            (left, top, min(left + tiles.side, width), min(top + tiles.side, height))
            for tiles in self._tiles
            for top in tiles.tops.tolist()
            for left in tiles.lefts.tolist()
        ]
        self._cusum = Cusum(len(self._boxes), stays)
        self._before: np.ndarray | None = None
        self._rested = 0
        self._nothing = Seen(0.0, 0, (0, 0, width, height))

    def frame(self, light: Float[np.ndarray, "height width"]) -> Seen:
        """Process a frame of linear light, full scale 1."""
        # single precision: half the time of double, and far finer than any camera
        log = np.log(np.asarray(light, np.float32) + np.float32(LIGHT_OFFSET))
        before, self._before = self._before, log
        if before is None:
            return self._nothing
        return self.change(self._ego.rest(before, log))

    def rest(self) -> Seen:
        """Process a step without any change, as between events.

        The work of consecutive steps without evidence is done once, at the next change.
        """
        if not (self._cusum.idle and self._pixels.idle):
            return self.change(np.zeros(self.shape, np.float32))
        self._rested += 1
        self.last = None
        return self._nothing

    def change(self, change: Float[np.ndarray, "height width"]) -> Seen:
        """Process a change of the logarithm of light, as from events."""
        if self._rested:
            self._pixels.rest(self._rested)
            self._cusum.rest(self._rested)
            self._rested = 0
        self.last = self._pixels.push(own_change(change))
        # most frames light no pixel: without evidence all tiles are skipped
        if self._cusum.idle and not self.last.lit.any():
            self._cusum.rest()
            return self._nothing
        sums = [running_sums(mask, 0) for mask in self.last]
        evidence = [tiles.evidence(*sums) for tiles in self._tiles]
        whole = (
            np.concatenate([v.ravel() for v in some])
            for some in zip(*evidence, strict=True)
        )
        self._cusum.push(*whole)
        return next(self.above(-1.0))

    def above(self, level: float) -> Iterator[Seen]:
        """Yield the tiles above a level after the last frame, the largest first."""
        statistic = self._cusum.statistic
        for tile in np.argsort(-statistic)[: np.count_nonzero(statistic > level)]:
            begun = int(self._cusum.begun[tile])
            yield Seen(float(statistic[tile]), begun, self._boxes[tile])


class Evidence(NamedTuple):
    """Evidence of a frame in each tile.

    Attributes:
        both: Twice the smaller count of newly lit pixels on either side.
        lit: Number of newly lit pixels.
        left: Share of the bright pixels that did not darken; 1 without bright pixels.
    """

    both: Float[np.ndarray, "..."]
    lit: Float[np.ndarray, "..."]
    left: Float[np.ndarray, "..."]


class Tiles:
    """Tiles of one size over an image.

    Attributes:
        side: Side of a tile [px].
        tops: First row of each row of tiles [px].
        lefts: First column of each column of tiles [px].
    """

    def __init__(self, shape: tuple[int, int], side: int):
        """Divide images of a shape into tiles."""
        self.side = side
        # half a side apart, so that any fireball lies well inside one; the last tile is
        # at the far edge
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
            lit: Running sums of the newly lit pixels down the columns, from a row of
                zeros on.
            fallen: The same of the darkened ones.
            bright: The same of the bright ones.
        """
        # by running sums a tile of any size costs four values
        new, lost, lasting = (self._banded(sums) for sums in (lit, fallen, bright))
        every = new, lost, lasting, lasting * self._column
        new_sums, lost_sums, lasting_sums, first_sums = (
            running_sums(rows, 1) for rows in every
        )
        count = self._within(lasting_sums)
        middle = self._within(first_sums) / np.maximum(count, 1)
        # pixels of the middle column count half to either side, so that growth by one
        # column to both sides is symmetric whatever the parity
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
    """State of each pixel between frames.

    Attributes:
        idle: True if no pixel is lit or darkened, nor would be without a change.
    """

    idle = False

    def __init__(self, shape: tuple[int, int]):
        """Create the state for images of a shape."""
        self._sum = np.zeros(shape, np.float32)
        self._noise = np.zeros(shape, np.float32)
        self._left = np.zeros(shape, np.int16)
        self._bright = np.zeros(shape, bool)
        self._frames = 0

    def push(self, change: Image) -> Brightened:
        """Process the changes of a frame; return the pixels that they light.

        Args:
            change: Change of the logarithm of light, without the camera's motion.
        """
        size = np.abs(change)
        if not self._frames:
            # about the standard deviation of normal noise, 1.48 medians of the absolute
            # values; the lower bound is for films that begin with repeated frames
            self._noise += max(1.4 * float(np.median(size)), 1e-3)
        self._frames += 1
        total = self._sum
        total *= np.float32(SUM_MEMORY)
        total += change
        least = np.maximum(
            np.float32(PIXEL_NOISES) * self._noise, np.float32(LIT_LOG_CHANGE)
        )
        up, down = total > least, total < -least
        # sums fall faster than thresholds
        self.idle = not (up.any() or down.any())
        lit = up & (self._left == 0)
        fallen = down & self._bright
        self._left -= self._left > 0
        self._left[up] = REMEMBERED
        self._bright |= up
        self._bright &= ~down
        self._bright &= self._left > 0
        # changes of a lit pixel are signal, and do not enter its noise
        size[self._left > 0] = 0.0
        # clipped, or one flicker would raise the threshold of a pixel for 100 frames
        np.minimum(size, 3.0 * self._noise + 0.02, out=size)
        learnt = np.float32(
            1.0 / min(self._frames + INITIAL_FRAMES, PIXEL_MEMORY_FRAMES)
        )
        self._noise += learnt * np.where(self._left > 0, 0.0, size - self._noise)
        return Brightened(lit, fallen, self._bright)

    def rest(self, frames: int) -> None:
        """Process frames without any change while the pixels are idle."""
        self._sum *= np.float32(SUM_MEMORY**frames)
        numbers = self._frames + 1 + np.arange(frames) + INITIAL_FRAMES
        kept = 1.0 - 1.0 / np.minimum(numbers, PIXEL_MEMORY_FRAMES)
        # the share of its noise that a pixel keeps, by the first frame that counts:
        # not before it is forgotten that the pixel was lit
        shares = np.append(np.cumprod(kept[::-1])[::-1], 1.0).astype(np.float32)
        first = np.clip(self._left - 1, 0, frames) if self._left.any() else 0
        self._noise *= shares[first]
        self._left = np.maximum(self._left - min(frames, REMEMBERED), 0).astype(
            np.int16
        )
        self._bright &= self._left > 0
        self._frames += frames


def tiles_of(shape: tuple[int, int]) -> list[Tiles]:
    """Return tiles of all sizes that fit into images of a shape."""
    fitting = [side for side in SIDES if side <= max(shape)]
    return [Tiles(shape, side) for side in fitting or [max(shape)]]


def running_sums(values: np.ndarray, axis: int) -> Int[np.ndarray, "row column"]:
    """Return running sums along an axis, from zeros on."""
    before = [(int(axis == 0), 0), (int(axis == 1), 0)]
    return np.pad(np.cumsum(values, axis=axis, dtype=np.int32), before)


class Cusum:
    """Page's test of many tiles.

    Attributes:
        statistic: Statistic of each tile after the last frame.
        begun: Number of frames since the sum of each tile was zero.
    """

    def __init__(self, tiles: int, stays: int = 6):
        """Create the test without evidence.

        Args:
            tiles: Number of tiles.
            stays: Frames for which lit pixels must stay bright.
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
        """True if no tile has evidence now or in the last frames."""
        return not self._kept.any()

    def rest(self, frames: int = 1) -> None:
        """Process frames that light no pixel while there is no evidence."""
        self._mean *= (1.0 - 1.0 / TILE_MEMORY_FRAMES) ** frames
        self._frame += frames
        self.statistic = np.zeros_like(self._sum)

    def push(
        self,
        evidence: Float[np.ndarray, " tile"],
        lit: Float[np.ndarray, " tile"],
        left: Float[np.ndarray, " tile"],
    ) -> Float[np.ndarray, " tile"]:
        """Process the evidence of a frame; return the statistic of each tile.

        Args:
            evidence: Evidence for a blast [px].
            lit: Number of newly lit pixels.
            left: Share of the bright pixels that did not darken.
        """
        usual = MIN_PIXELS + TILE_NOISES * self._mean
        self._sum += np.log1p(evidence / usual)
        self._sum *= left
        self._sum -= DRIFT
        np.clip(self._sum, 0.0, BOUND, out=self._sum)
        self.begun = np.where(self._sum > 0.0, self.begun + 1, 0)
        # pixels of a possible blast must not enter the noise: the count is clipped, and
        # its weight falls with the evidence
        excess = np.minimum(lit, 2.0 * usual) - self._mean
        self._mean += excess * (1.0 / TILE_MEMORY_FRAMES) / (1.0 + self._sum)
        self._kept[self._frame % self._stays] = self._sum
        self._frame += 1
        # the minimum over the last frames: a fireball stays bright, a glint does not
        self.statistic = self._kept.min(axis=0)
        return self.statistic


def stays_for(rate_hz: float) -> int:
    """Return the frames for which lit pixels must stay, at a frame rate [Hz]."""
    return max(2, round(STAYS_S * rate_hz))


def own_change(change: Image) -> Image:
    """Return a change without its local mean.

    Args:
        change: Change of the logarithm of light.
    """
    if np.count_nonzero(change > LEAST_CHANGE) <= FEW_PIXELS:
        return change
    # imported here: films without changes do not need it
    from scipy.ndimage import uniform_filter

    clipped = np.clip(change, np.float32(-MAX_LOG_CHANGE), np.float32(MAX_LOG_CHANGE))
    # squares are cut at the edges of the image
    share = uniform_filter(np.ones_like(change), MEAN_SIDE, mode="constant")
    return change - uniform_filter(clipped, MEAN_SIDE, mode="constant") / share


class EgoMotion:
    """Removal of the changes by motion of the camera and by light on the whole image.

    Attributes:
        shape: Height and width [px].
    """

    def __init__(self, shape: tuple[int, int]):
        """Create the state for images of a shape."""
        self.shape = shape
        height, width = shape
        x = np.linspace(-1.0, 1.0, width, dtype=np.float32)
        y = np.linspace(-1.0, 1.0, height, dtype=np.float32)[:, None]
        self._x, self._y = x, y
        step = MOTION_STRIDE if min(shape) >= 8 * MOTION_STRIDE else 1
        self._some = np.s_[::step, ::step]
        size = np.ones(shape, np.float32)[self._some].shape
        self._few = (np.broadcast_to(v, shape)[self._some] for v in (x, y))
        self._few = tuple(v.ravel() for v in self._few)
        self._rows = np.ones((7, size[0] * size[1]), np.float32)
        self._across, self._down = (np.zeros(shape, np.float32) for _ in range(2))

    def rest(self, before: Image, after: Image) -> Image:
        """Return the change that neither of them explains.

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
        # an affine flow is shake, rotation and zoom; the gain is clouds and exposure
        rows = self._rows
        for i, gradient in enumerate((across, down)):
            rows[i] = gradient[self._some].ravel()
            for j, place in enumerate(self._few):
                np.multiply(rows[i], place, out=rows[2 + 2 * i + j])
        few = change[self._some].ravel()
        # unclipped, a bright flash would be fitted as motion of the whole image
        most = MOTION_CLIP * float(np.abs(few).mean()) + 1e-6
        clipped = np.clip(few, -most, most)
        square = (rows @ rows.T).astype(float)
        square.flat[::8] += MOTION_DAMPING * np.trace(square) + 1e-9
        found = np.linalg.solve(square, (rows @ clipped).astype(float))
        a, d, ax, ay, dx, dy, gain = (np.float32(v) for v in found)
        change -= gain
        change -= across * ((a + ax * self._x) + ay * self._y)
        change -= down * ((d + dx * self._x) + dy * self._y)
        return change
