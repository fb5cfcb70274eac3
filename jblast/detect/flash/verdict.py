r"""Checks of an alarm by the frames that follow it.

An alarm is raised within milliseconds. What follows separates a fireball from two
things that look like one at first.

Sparkle. Sun on waves lights pixels all the time. At the beginning of a film the test
has not learnt that yet. Pixels that light up as often after an alarm as before it are
no onset.

Growth. The logarithmic slope of a radius that grows by a power law of time, as that of
a balloon does, is constant, $d\ln R / d\ln t = p$: 1/3 for an even flow, 1 for an even
speed. A fireball, $R = R_\infty (1 - e^{-t/\tau})$, slows down:

$$\frac{d\ln R}{d\ln t} = \frac{t/\tau}{e^{t/\tau} - 1}$$

The slope of the later half of the radii is compared with that of the slowest fireball.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jblast.detect.flash.brightening import BRIGHTER, NOISES
from jblast.detect.flash.cusum import LEAST
from jblast.detect.flash.growth import growing
from jblast.detect.flash.silhouette import UNSURE, Silhouette

SETTLED = 20
"""Frames after an alarm from which on a fireball lights few more pixels: two time
constants of 1 t at 1,000 frames a second."""
ENOUGH = 10
"""Frames or radii that a rate or a slope is taken from, at least."""
CONTINUES = 0.5
"""Pixels lit a frame after an alarm over those before it from which on it is sparkle.
Half way: stationary sparkle has 1, a growth that has ended 0."""
NORMAL = 1.4826
"""Standard deviation of normal noise over its median size."""
SLOWEST_S = 0.02
"""Time constant of the slowest fireball: twice that of 1 t by the law, which is known
to a factor of two (`waves.fireball`). The test was set for up to 1 t [s]."""

SPARKLE = "pixels went on lighting up as before it, as on glittering water"
GROWS_ON = "its growth did not slow down as a fireball's of up to 1 t does"
SAME = "it belongs to what had been rejected there before"


def sparkles(
    changes: Float[np.ndarray, "frame row column"], begun: int, at: int
) -> bool:
    """Return whether pixels go on lighting up as they did before an alarm.

    A pixel is lit by a change that is large for its own noise, as in `Brightening`: in
    the dark the logarithm of light is noisy all the time.

    Args:
        changes: Of the logarithm of light, from frame to frame, about the alarm.
        begun: Number of the frame in which its evidence began.
        at: Number of the frame of the alarm.
    """
    noise = NORMAL * np.median(np.abs(changes), axis=0)
    least = np.maximum(BRIGHTER, NOISES * noise)
    lit = np.count_nonzero(changes > least, axis=(1, 2))
    before, after = lit[begun : at + 1].mean(), lit[at + SETTLED :]
    # of fewer pixels a rate is not known
    if len(after) < ENOUGH or before < LEAST:
        return False
    return bool(after.mean() > CONTINUES * before)


def grows_on(seen: Sequence[Silhouette], earliest_s: float) -> bool:
    """Return whether a spot grew on when the slowest fireball slows down.

    Args:
        seen: Its silhouettes in order of time. Those after a cut or a leap, and those
            whose radius is not trusted, are left out.
        earliest_s: The last instant that does not show it [s].
    """
    whole = [one for one in growing(seen) if one.sigma_px <= UNSURE * one.radius_px]
    time, radius, error = (
        np.array([getattr(one, name) for one in whole])
        for name in ("time_s", "radius_px", "sigma_px")
    )
    if len(time) < 2 * ENOUGH:
        return False
    since = time - 0.5 * (earliest_s + seen[0].time_s)
    late = since > 0.5 * since[-1]
    if np.count_nonzero(late) < ENOUGH:
        return False
    since, radius, error = since[late], radius[late], error[late]
    slope, sigma = _slope(np.log(since), np.log(radius))
    fireball, _ = _slope(np.log(since), np.log(-np.expm1(-since / SLOWEST_S)))
    # errors of silhouettes are shared by neighbours: they do not average out
    shared = float(np.mean(error / radius)) / float(np.log(since[-1] / since[0]))
    return slope - 2.0 * float(np.hypot(sigma, shared)) > fireball


def _slope(
    x: Float[np.ndarray, " n"], y: Float[np.ndarray, " n"]
) -> tuple[float, float]:
    """Return the slope of a line by least squares, and its standard deviation."""
    x, y = x - x.mean(), y - y.mean()
    square = float(x @ x)
    slope = float(x @ y) / square
    left = y - slope * x
    return slope, float(np.sqrt(left @ left / (len(x) - 2) / square))
