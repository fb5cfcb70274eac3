r"""How a fireball grew: first light, last radius and time constant by its silhouettes.

$$R(t) = R_\infty \left(1 - e^{-(t - t_0)/\tau}\right)$$

(`waves.fireball`) by least squares, $t_0$ no later than the first frame that shows it
and no earlier than the last that does not. The burst is where the middle of the
silhouette is at $R = 0$: of a half disc it is above it by $4R/3\pi$, and the camera may
move, so the middle is taken to be linear in $R$ and in time.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.detect.flash.silhouette import PIXEL, Silhouette

SHRUNK = 0.93
"""Of the largest radius so far: below it is no growth any more. Soot has come before
the fire, or what it lit has fallen dark."""
LEAP = 0.25
"""Share of a radius, and a pixel, by which it does not grow in a frame once it is
known: another spot has been joined."""
SLOW = 0.3
"""Time constant over the time between frames below which no growth is seen."""
PLACE = 0.3
"""Least error of a place in the image [px]."""
LEANS = 0.02
"""And, as a share of the largest radius: a fire is not even, and what is hidden of it
by soot or by its own light on the ground is not on both sides alike. (With it the
interval of 90 % held the row of 93 % of 60 blasts, without it that of 83 %.)"""
FEWEST = 4
"""Silhouettes that three numbers are fitted to."""


class Growth(NamedTuple):
    """What was fitted.

    Attributes:
        time_s: First light [s].
        sigma_s: Its standard deviation [s].
        x_px: The burst in the image.
        x_sigma_px: Its standard deviation [px].
        y_px: Likewise, down from the top.
        y_sigma_px: Likewise.
        radius_px: Of the fireball when it has grown; None where it is not told [px].
        radius_sigma_px: Its standard deviation [px].
        growth_s: Time constant; None where it is not told [s].
        growth_sigma_s: Its standard deviation [s].
        spread_px: Scatter of the radii about the fit [px].
    """

    time_s: float
    sigma_s: float
    x_px: float
    x_sigma_px: float
    y_px: float
    y_sigma_px: float
    radius_px: float | None
    radius_sigma_px: float | None
    growth_s: float | None
    growth_sigma_s: float | None
    spread_px: float


def growth(seen: Sequence[Silhouette], earliest_s: float) -> Growth:
    """Return how a fireball grew.

    Args:
        seen: Its silhouettes, in order of time, at least one.
        earliest_s: The last instant that does not show it [s].
    """
    whole = growing(seen) or list(seen[:1])
    time, radius, error, x, y = (
        np.array([getattr(one, name) for one in whole])
        for name in ("time_s", "radius_px", "sigma_px", "x_px", "y_px")
    )
    latest = seen[0].time_s
    start, even = 0.5 * (earliest_s + latest), (latest - earliest_s) / np.sqrt(12.0)
    fit = None
    if len(whole) >= FEWEST:
        # of less than a pixel nothing may be seen, so it may be a frame earlier still
        fit = _fitted(time, radius, error, 2.0 * earliest_s - latest, latest)
    if fit is not None:
        (start, last, tau), (sigma, last_sd, tau_sd), spread = fit
        # the fit knows no more than that it lies between two frames
        sigma = min(max(sigma, 0.03 * (latest - earliest_s)), even)
        grown = (float(last), float(last_sd), float(tau), float(tau_sd))
    else:
        sigma, spread, grown = even, PIXEL, (None, None, None, None)
    since = time - start
    (x0, x_sd), (y0, y_sd) = (_at_zero(v, radius, since) for v in (x, y))
    return Growth(float(start), float(sigma), x0, x_sd, y0, y_sd, *grown, float(spread))


def growing(seen: Sequence[Silhouette]) -> list[Silhouette]:
    """Return the silhouettes up to where an edge cuts it or it does not grow on.

    Args:
        seen: Of a fireball, in order of time.
    """
    out: list[Silhouette] = []
    most = 0.0
    for one in seen:
        leapt = len(out) >= FEWEST and one.radius_px > (1.0 + LEAP) * most + 1.0
        if one.cut or one.radius_px < SHRUNK * most - 1.0 or leapt:
            break
        out.append(one)
        most = max(most, one.radius_px)
    return out


def _fitted(
    time: Float[np.ndarray, " n"],
    radius: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " n"],
    earliest: float,
    latest: float,
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return first light, last radius and time constant, their sigmas, the scatter."""
    from scipy.optimize import least_squares

    def misfit(p: np.ndarray) -> np.ndarray:
        last, tau = np.exp(p[1:])
        return (-last * np.expm1(-np.maximum(time - p[0], 0.0) / tau) - radius) / sigma

    span = time[-1] - time[0]
    start = [0.5 * (earliest + latest), np.log(radius.max() + 0.5), np.log(0.2 * span)]
    step = max(latest - earliest, 1e-9)
    low = [earliest - 1e-3 * step, start[1] - 1.0, np.log(1e-3 * span)]
    high = [latest + 1e-3 * step, start[1] + 3.0, np.log(30.0 * span)]
    found = least_squares(misfit, start, bounds=(low, high), x_scale=[step, 0.1, 0.3])
    square = found.jac.T @ found.jac
    if not found.success or np.linalg.cond(square) > 1e18:
        return None
    if np.exp(found.x[2]) < SLOW * step:
        return None  # it had grown before the first frame that shows it
    dof = max(len(time) - 3, 1)
    inflation = max(1.0, 2.0 * found.cost / dof)
    sd = np.sqrt(np.diag(np.linalg.inv(square)) * inflation)
    last, tau = np.exp(found.x[1:])
    spread = float(np.sqrt(np.mean((misfit(found.x) * sigma) ** 2)))
    return (
        np.array([found.x[0], last, tau]),
        np.array([sd[0], last * sd[1], tau * sd[2]]),
        spread,
    )


def _at_zero(
    middle: Float[np.ndarray, " n"],
    radius: Float[np.ndarray, " n"],
    since: Float[np.ndarray, " n"],
) -> tuple[float, float]:
    """Return where the middle is at radius 0, and its standard deviation [px]."""
    if len(middle) == 1:  # of a half disc it is up to 0.42 R off
        return float(middle[0]), float(np.hypot(0.42 * radius[0], PLACE))
    columns = [np.ones_like(radius)]
    if len(middle) > 3 and np.ptp(radius) > 1.0:
        columns.append(radius)
    if len(middle) > 6:
        columns.append(since)
    design = np.stack(columns, axis=1)
    weight = 1.0 / (PIXEL + 0.05 * radius)
    found, *_ = np.linalg.lstsq(design * weight[:, None], middle * weight, rcond=None)
    left = (middle - design @ found) * weight
    square = (design * weight[:, None]).T @ (design * weight[:, None])
    inflation = float(left @ left) / max(len(middle) - len(columns), 1)
    sd = np.sqrt(np.linalg.pinv(square)[0, 0] * max(inflation, PIXEL**2))
    errors = sd, PLACE, LEANS * radius.max()
    return float(found[0]), float(np.linalg.norm(errors))
