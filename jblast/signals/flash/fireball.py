r"""Measurements of a fireball: silhouettes, growth, first light and direction.

The scene without the fireball is the median of the frames before. The share $s$ by
which a pixel shines is its light between that and the light of the fireball itself. The
radius of a silhouette follows from the spread of its columns,

$$R = c_q\,\sigma_x, \qquad \sigma_x^2 = \frac{\sum w\,(x - \bar x)^2}{\sum w} -
\frac{1}{12}, \qquad w = \max(h - q\,h_\mathrm{max},\ 0)$$

with $h$ the height of a column, the sum of $s$ over its pixels, and 1/12 the variance
of a pixel's width. $c_q$ is such that $R$ is the radius of a disc and also of the half
disc above the ground; $c_0 = 2$. Columns lower than a share $q$ of the highest are left
out, because ground lit by the fire is a wide and low strip. The error of $R$ contains
its dependence on $q$ and on the brightness from which a pixel belongs to the fireball:
the edge of a fireball is sharp, that of its light on the ground is not.

The radii are fitted by least squares with

$$R(t) = R_\infty \left(1 - e^{-(t - t_0)/\tau}\right)$$

(`waves.fireball`), $t_0$ between the last frame without the fireball and the first one
with it. The burst is at the centre of the silhouette extrapolated to $R = 0$. The
centre of a half disc is $4R/3\pi$ above it, and the camera may move, so the centre is
taken as linear in $R$ and in time. The scene's camera turns the position into a
direction.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.scene import Camera
from jblast.sensors.camera.geometry import unproject

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
MIN_SILHOUETTES = 4
"""Smallest number of silhouettes for a fit of three parameters."""
Image = Float[np.ndarray, "height width"]
LOW = 0.3
"""Columns lower than this share of the highest are left out, $q$."""
OTHERS = (0.15, 0.5)
"""Shares beside it. Half of what the radius differs between them is an error of it."""
SHINES = 0.5
"""Share of the light of a fireball from which on a pixel is a part of it."""
FAINTER, BRIGHTER = 0.3, 0.7
"""Likewise, beside it."""
GLOW = 3.0
"""Times what the radius differs between those is an error, too: light on the ground,
which falls as the distance's cube, is a third wider where it is so much fainter, and
is no part of the fireball."""
PIXEL = 0.3
"""Error of a radius: of where an edge stands in a pixel, and of a glare [px]."""
RELATIVE_ERROR = 0.02
"""Relative error of a silhouette's radius, because a fireball is rough."""
UNSURE = 0.25
"""Error, as a share of the radius, from which on a radius is not used: ground that the
fire lights as brightly as itself makes all radii of a film too large, and a fit would
take them for so many independent ones."""
Frames = Float[np.ndarray, "frame height width"]
BEFORE = 8
"""Most frames from which the scene without it is taken."""
BRIGHT = 0.5
"""Quantile of the light of what became bright that is the fireball's own."""


class Growth(NamedTuple):
    """Result of the fit of a fireball's growth.

    Attributes:
        time_s: First light [s].
        sigma_s: Its standard deviation [s].
        x_px: The burst in the image.
        x_sigma_px: Its standard deviation [px].
        y_px: Likewise, down from the top.
        y_sigma_px: Its standard deviation [px].
        radius_px: Of the fireball when it has grown; null where not identified [px].
        radius_sigma_px: Its standard deviation [px].
        growth_s: Time constant; null where not identified [s].
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


class Silhouette(NamedTuple):
    """A fireball at an instant, in the image.

    Attributes:
        time_s: When [s].
        radius_px: Of the disc or half disc whose columns spread as much [px].
        x_px: Mean column [px].
        y_px: Mean row [px].
        area_px: Pixels that shine.
        cut: Whether an edge of the image cuts it left or right.
        sigma_px: Standard deviation of the radius [px].
    """

    time_s: float
    radius_px: float
    x_px: float
    y_px: float
    area_px: float
    cut: bool
    sigma_px: float = PIXEL


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
    if len(whole) >= MIN_SILHOUETTES:
        # of less than a pixel nothing may be seen, so it may be a frame earlier still
        fit = _fitted(time, radius, error, 2.0 * earliest_s - latest, latest)
    if fit is not None:
        (start, last, tau), (sigma, last_sd, tau_sd), spread = fit
        # all that is certain is that it lies between two frames
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
        leapt = (
            len(out) >= MIN_SILHOUETTES and one.radius_px > (1.0 + LEAP) * most + 1.0
        )
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
    # imported here, as are images below: films without a flash do without
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


def silhouette(
    time_s: float, share: Image, seed: Bool[np.ndarray, "height width"]
) -> Silhouette | None:
    """Return the bright spot about a seed; None if there is none.

    Args:
        time_s: When [s].
        share: How much of each pixel shines, 0 to 1.
        seed: Where it is to be: of the connected spots that touch it the largest.
    """
    spot = _spot(share, SHINES, seed)
    if spot is None:
        return None
    weight = _within(spot, share)
    columns, rows = weight.sum(axis=0), weight.sum(axis=1)
    middle, radius = _spread(columns, LOW)
    low, high = (_spread(columns, share)[1] for share in OTHERS)
    faint, bright = (
        radius if other is None else _spread(_within(other, share).sum(axis=0), LOW)[1]
        for other in (_spot(share, level, seed) for level in (FAINTER, BRIGHTER))
    )
    errors = PIXEL, RELATIVE_ERROR * radius, 0.5 * (high - low), GLOW * (faint - bright)
    sigma = float(np.linalg.norm(errors))
    cut = bool(spot[:, 0].any() or spot[:, -1].any())
    row = float(rows @ np.arange(len(rows))) / float(weight.sum())
    area = float(spot.sum())
    return Silhouette(time_s, radius, middle, row, area, cut, sigma)


def _spot(
    share: Image, level: float, seed: Bool[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"] | None:
    """Return the largest spot brighter than a level that touches a seed, if any."""
    from scipy import ndimage

    names = np.zeros(share.shape, np.int32)
    ndimage.label(share > level, np.ones((3, 3)), output=names)
    sizes = np.bincount(names.ravel())
    touched = np.unique(names[seed])
    touched = touched[touched > 0]
    if not len(touched):
        return None
    return names == touched[np.argmax(sizes[touched])]


def _within(spot: Bool[np.ndarray, "height width"], share: Image) -> Image:
    """Return how much shines of a spot and of the pixels at its edge."""
    from scipy import ndimage

    return np.where(ndimage.binary_dilation(spot), share, 0.0)


def _spread(columns: Float[np.ndarray, " width"], low: float) -> tuple[float, float]:
    """Return the middle of what is higher than a share, and the radius [px]."""
    weight = np.maximum(columns - low * columns.max(), 0.0)
    x = np.arange(len(columns))
    middle = float(weight @ x) / float(weight.sum())
    variance = float(weight @ (x - middle) ** 2) / float(weight.sum()) - 1.0 / 12.0
    return middle, _over_deviation(low) * float(np.sqrt(max(variance, 0.0)))


@cache
def _over_deviation(low: float) -> float:
    """Return a disc's radius over the standard deviation of its columns, $c_q$."""
    x = np.linspace(-1.0, 1.0, 20_001)
    weight = np.maximum(np.sqrt(1.0 - x**2) - low, 0.0)
    return float(np.sqrt(weight.sum() / (weight @ x**2)))


def silhouettes(
    times: Float[np.ndarray, " frame"],
    light: Frames,
    begun: int,
    seed: Bool[np.ndarray, "height width"],
) -> tuple[list[Silhouette], float]:
    """Return the silhouettes of a fireball, and the last instant without it [s].

    Args:
        times: Of the frames [s].
        light: Linear light, full scale 1.
        begun: Number of the frame that shows it first, or one nearby.
        seed: Where pixels were lit.
    """
    quiet = max(begun - 2, 1)
    behind = np.median(light[max(quiet - BEFORE, 0) : quiet], axis=0)
    rise = light[quiet:] - behind
    peak = float(np.quantile(rise.max(axis=0)[seed], BRIGHT)) if seed.any() else 0.0
    if peak <= 0.0:
        return [], float(times[quiet - 1])
    full = behind + peak
    shares = np.clip(rise / np.maximum(full - behind, 1e-6), 0.0, 1.0)
    return joined(times[quiet:], shares, seed, float(times[quiet - 1]))


def joined(
    times: Float[np.ndarray, " frame"],
    shares: Frames,
    seed: Bool[np.ndarray, "height width"],
    before: float,
) -> tuple[list[Silhouette], float]:
    """Return the silhouettes from the first frame that has one, without a gap.

    Args:
        times: Of the frames [s].
        shares: How much of each pixel shines.
        seed: Where it is.
        before: The instant before the first of them [s].
    """
    seen: list[Silhouette] = []
    for time, share in zip(times, shares, strict=True):
        one = silhouette(float(time), share, seed)
        if one is None:
            if len(seen) >= 3:
                break  # it is over, or hidden
            seen, before = [], float(time)
        else:
            seen.append(one)
    return seen, before


def seed_of(
    lit: Sequence[Bool[np.ndarray, "height width"]], box: tuple[int, int, int, int]
) -> Bool[np.ndarray, "height width"]:
    """Return where pixels were lit in a tile.

    Args:
        lit: Of each frame since the evidence began.
        box: The tile: left, top, right, bottom [px].
    """
    left, top, right, bottom = box
    out = np.zeros_like(lit[0])
    inside = np.logical_or.reduce([one[top:bottom, left:right] for one in lit])
    out[top:bottom, left:right] = inside
    return out


class Direction(NamedTuple):
    """From the camera to the burst.

    Attributes:
        bearing_rad: Clockwise from north [rad].
        bearing_sd_rad: Its standard deviation, of the place in the image alone [rad].
        elevation_rad: Above the horizon [rad].
        elevation_sd_rad: Its standard deviation, likewise [rad].
    """

    bearing_rad: float
    bearing_sd_rad: float
    elevation_rad: float
    elevation_sd_rad: float


def direction_of(camera: Camera, grown: Growth) -> Direction:
    """Return the direction of a burst.

    Args:
        camera: Who looked.
        grown: Where it is in the image.
    """
    x, y = grown.x_px, grown.y_px
    pixels = np.array([[x, y], [x + 1.0, y], [x, y + 1.0]])
    east, north, up = np.asarray(unproject(camera, pixels)).T
    bearing, elevation = np.arctan2(east, north), np.arctan2(up, np.hypot(east, north))
    by_pixel = np.angle(np.exp(1j * (bearing[1:] - bearing[0])))
    sigma = np.array([grown.x_sigma_px, grown.y_sigma_px])
    return Direction(
        float(bearing[0] % (2.0 * np.pi)),
        float(np.linalg.norm(by_pixel * sigma)),
        float(elevation[0]),
        float(np.linalg.norm((elevation[1:] - elevation[0]) * sigma)),
    )


def radius_in_middle(camera: Camera, seen: Silhouette) -> float:
    """Return the radius that the sphere would have in the middle of the image [px].

    Elsewhere, and through a lens that distorts, it is another; `fireball_radius_px` is
    f tan(a) with a the half-angle that it spans.

    Args:
        camera: Who looked.
        seen: Its silhouette.
    """
    x, y, radius = seen.x_px, seen.y_px, seen.radius_px
    left, right = np.asarray(
        unproject(camera, np.array([[x - radius, y], [x + radius, y]]))
    )
    half = 0.5 * np.arctan2(np.linalg.norm(np.cross(left, right)), left @ right)
    return float(np.sqrt(np.prod(camera.focal)) * np.tan(half))
