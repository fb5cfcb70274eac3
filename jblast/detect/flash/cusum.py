r"""Page's test: evidence added up from frame to frame, never below zero.

$$S_t = \max(0,\ r_t\,(S_{t-1} + x_t) - k), \qquad
x_t = \ln\!\Big(1 + \frac{a_t}{\nu}\Big)$$

(Page 1954, Biometrika 41, 100, eq. 1, for $r_t = 1$), with the evidence $a_t$ of a tile
and $\nu$ what it has without a blast. The logarithm bounds what one frame can say: a
lamp that is there at once says it once, a fireball grows for many frames. Of the pixels
that were bright $r_t$ still are: a flash that falls takes all evidence with it, soot
that comes before a part of a fire that part. The statistic is the least sum of the last
frames: what was lit has to stay.
"""

import numpy as np
from jaxtyping import Float

DRIFT = 0.7
"""Of the sum a frame, $k$: the parts of a passing car say about as much for many
frames, a fireball four and more for a few, of which it has to last for the rest."""
LEAST = 2.0
"""Pixels that count as much as the noise of a tile, at least."""
NOISES = 3.0
"""Times the mean of the pixels lit without a blast."""
LEARNT = 100.0
"""Frames over which that mean is learnt."""
STAYS_S = 6e-3
"""What was lit has to stay for so long [s]."""
BOUND = 40.0
"""Of the sum."""


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
        """Whether there is no evidence anywhere, and was none of late."""
        return not self._kept.any()

    def forget(self) -> None:
        """Begin anew, but for what the noise is."""
        self._sum[:] = 0.0
        self._kept[:] = 0.0
        self.begun[:] = 0

    def rest(self) -> None:
        """Take in a frame that lit nothing while there is no evidence."""
        self._mean *= 1.0 - 1.0 / LEARNT
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
            lit: Pixels that were lit, whatever they say.
            left: Share of the bright pixels that did not fall.
        """
        usual = LEAST + NOISES * self._mean
        self._sum += np.log1p(evidence / usual)
        self._sum *= left
        self._sum -= DRIFT
        np.clip(self._sum, 0.0, BOUND, out=self._sum)
        self.begun = np.where(self._sum > 0.0, self.begun + 1, 0)
        # what may be a blast teaches nothing of the noise
        teaches = np.minimum(lit, 2.0 * usual) - self._mean
        self._mean += teaches * (1.0 / LEARNT) / (1.0 + self._sum)
        self._kept[self._frame % self._stays] = self._sum
        self._frame += 1
        self.statistic = self._kept.min(axis=0)
        return self.statistic


def stays_for(rate_hz: float) -> int:
    """Return for how many frames what was lit has to stay, at a frame rate [Hz]."""
    return max(2, round(STAYS_S * rate_hz))
