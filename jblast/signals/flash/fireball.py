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

(`waves.fireballs`). First light lies between the ends of the exposures of the last dark
frame, without light above noise at the later fireball, and of the next one. Without a
known exposure it lies between the time stamps of the last dark frame and of the first
silhouette. Its density there is that of the fit, plus a small uniform share $\epsilon$
for fireballs that do not follow the law:

$$p(t_0) \propto \frac{1 - \epsilon}{\Delta}\, N(t_0; \hat t_0, s) +
\frac{\epsilon}{\Delta^2}, \qquad t_0 \in [a, a + \Delta]$$

Its mean and standard deviation are reported. If the fit extrapolates to a time far
outside, growth is not identified and the density is uniform.

The burst is at the centre of the silhouette extrapolated to $R = 0$. The centre of a
half disc is $4R/3\pi$ above it, and the camera may move, so the centre is taken as
linear in $R$ and in time. The scene's camera turns the position into a direction.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.scene import Camera
from jblast.sensors.camera.geometry import unproject

SHRUNK_SHARE = 0.93
"""Ratio to the largest radius so far below which growth has ended: soot hides the fire,
or ground that it lit has become dark."""
LEAP_SHARE = 0.25
"""Largest growth in one frame, over the largest radius so far, plus one pixel: a larger
one means that another spot has merged with it."""
LEAST_GROWTH_FRAMES = 0.3
"""Smallest time constant of an identified growth, over the frame interval: a fireball
has reached 96 % of its radius after one interval then."""
LAW_FAILS = 0.003
"""Probability of growth that does not follow the law, epsilon: beyond three standard
deviations the law is rejected. The standard deviation of first light is then at least
0.016 of the interval in its middle, and 0.03 at its bounds."""
POSITION_ERROR_PX = 0.3
"""Smallest error of a position in the image [px]: about 1/sqrt(12), an edge anywhere in
a pixel."""
ASYMMETRY = 0.02
"""Error of a position due to asymmetry, over the largest radius: a fire is uneven, and
soot or light on the ground hides its sides unequally. With it 90 % intervals covered
the row of 93 % of 60 blasts, without it 83 %."""
MIN_SILHOUETTES = 4
"""Smallest number of silhouettes for a fit of three parameters."""
Image = Float[np.ndarray, "height width"]
COLUMN_SHARE = 0.3
"""Smallest height of a column, over the highest, $q$; ground lit by fire is lower."""
OTHER_COLUMN_SHARES = (0.15, 0.5)
"""Other values of $q$. Half the difference of the radius between them is an error."""
PIXEL_SHARE = 0.5
"""Share of the fireball's light from which on a pixel belongs to it: the middle of a
blurred edge."""
FAINTER_SHARE, BRIGHTER_SHARE = 0.3, 0.7
"""Other shares, between which the radius of a sharp edge hardly differs."""
GLOW_FACTOR = 3.0
"""Factor on the difference of the radius between those, as an error. Light on the
ground falls as the cube of the distance, so it is a third wider at 0.3 than at 0.7, and
all of it lies outside the fireball."""
RADIUS_ERROR_PX = 0.3
"""Error of a radius by the position of the edge in a pixel and by glare [px]."""
RELATIVE_ERROR = 0.02
"""Relative error of a silhouette's radius by the roughness of a fireball."""
MAX_RELATIVE_ERROR = 0.25
"""Largest relative error of a radius that is used. Ground that is lit as brightly as
the fire makes all radii of a film too large, while a fit would take their errors as
independent."""
Frames = Float[np.ndarray, "frame height width"]
FAINT_SHARE = 0.03
"""Largest share of the fireball's light in 3 x 3 pixels of a dark frame, at the later
first silhouette: compression and rounding to 8 bits give less."""
FAINT_NOISES = 2.0
"""The same over the largest of the frames before. A dark frame that is taken as lit, as
by a moving camera, widens the interval of first light."""
BACKGROUND_FRAMES = 8
"""Largest number of frames for the scene without the fireball: their median excludes
flicker, and the camera moves little in that time."""
LIGHT_QUANTILE = 0.5
"""Quantile of the light of the lit pixels that is taken as the fireball's own: pixels
at its edge are darker, glare is brighter."""


class Growth(NamedTuple):
    """Result of the fit of a fireball's growth.

    Attributes:
        time_s: First light [s].
        sigma_s: Its standard deviation [s].
        x_px: Column of the burst in the image [px].
        x_sigma_px: Its standard deviation [px].
        y_px: Row of the burst, down from the top [px].
        y_sigma_px: Its standard deviation [px].
        radius_px: Final radius of the fireball; null where not identified [px].
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
        time_s: Time [s].
        radius_px: Radius of the disc or half disc with the same spread of columns [px].
        x_px: Mean column [px].
        y_px: Mean row [px].
        area_px: Number of its pixels.
        cut: True if the left or right edge of the image cuts it.
        sigma_px: Standard deviation of the radius [px].
        reached_px: Radius of all that it has lit so far, with what soot hides now [px].
        lit_px: Area of that [px].
        beside: True if it touches what it had lit before.
    """

    time_s: float
    radius_px: float
    x_px: float
    y_px: float
    area_px: float
    cut: bool
    sigma_px: float = RADIUS_ERROR_PX
    reached_px: float = 0.0
    lit_px: float = 0.0
    beside: bool = True


def growth(
    seen: Sequence[Silhouette],
    earliest_s: float,
    shown_s: float | None = None,
    exposure_s: float = 0.0,
) -> Growth:
    """Return the growth of a fireball.

    Args:
        seen: Its silhouettes, in order of time, at least one.
        earliest_s: Time of the last dark frame, at the middle of its exposure [s].
        shown_s: The same of the first frame with light; by default, and for an unknown
            exposure, that of the first silhouette [s].
        exposure_s: Exposure of a frame, 0 if not known [s].
    """
    whole = growing(seen) or list(seen[:1])
    time, radius, error, x, y = (
        np.array([getattr(one, name) for one in whole])
        for name in ("time_s", "radius_px", "sigma_px", "x_px", "y_px")
    )
    # light after the end of an exposure is not in its frame; without a known exposure
    # a faint frame may be lit in its last part only, after its time stamp
    if shown_s is None or exposure_s == 0.0:
        shown_s = seen[0].time_s
    low, high = (float(at + 0.5 * exposure_s) for at in (earliest_s, shown_s))
    fit = None
    if len(whole) >= MIN_SILHOUETTES:
        fit = _fitted(time, radius, error, low, high)
    start, sigma, by_law = _first_light(low, high, fit)
    spread, grown = RADIUS_ERROR_PX, (None, None, None, None)
    if fit is not None and by_law:
        (_, last, tau), (_, last_sd, tau_sd), spread = fit
        grown = (float(last), float(last_sd), float(tau), float(tau_sd))
    since = time - start
    (x0, x_sd), (y0, y_sd) = (_at_zero(v, radius, since) for v in (x, y))
    return Growth(start, sigma, x0, x_sd, y0, y_sd, *grown, float(spread))


def _first_light(
    low: float, high: float, fit: tuple[np.ndarray, np.ndarray, float] | None
) -> tuple[float, float, bool]:
    """Return first light, its sigma, and True if the law of growth holds."""
    width = high - low
    middle, variance = 0.5 * (low + high), width**2 / 12.0
    if fit is None or width <= 0.0:
        return middle, math.sqrt(variance), False
    # imported here, as in `_fitted`
    from scipy.stats import norm, truncnorm

    at, sd = float(fit[0][0]), max(float(fit[1][0]), 1e-6 * width)
    bounds = (low - at) / sd, (high - at) / sd
    inside = float(norm.cdf(bounds[1]) - norm.cdf(bounds[0]))
    law = (1.0 - LAW_FAILS) * inside / ((1.0 - LAW_FAILS) * inside + LAW_FAILS)
    if law < 0.5:
        return middle, math.sqrt(variance), False
    by_law, by_law_variance = (
        float(v) for v in truncnorm.stats(*bounds, loc=at, scale=sd)
    )
    mean = law * by_law + (1.0 - law) * middle
    between = law * (1.0 - law) * (by_law - middle) ** 2
    variance = law * by_law_variance + (1.0 - law) * variance + between
    return mean, math.sqrt(variance), True


def growing(seen: Sequence[Silhouette]) -> list[Silhouette]:
    """Return the silhouettes before an edge cuts one or growth ends.

    Args:
        seen: Silhouettes of a fireball, in order of time.
    """
    out: list[Silhouette] = []
    most = 0.0
    for one in seen:
        leapt = (
            len(out) >= MIN_SILHOUETTES
            and one.radius_px > (1.0 + LEAP_SHARE) * most + 1.0
        )
        if one.cut or one.radius_px < SHRUNK_SHARE * most - 1.0 or leapt:
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
    """Return first light, final radius and time constant, their sigmas, the scatter.

    First light may lie outside its bounds: it is extrapolated from the best fit within
    them, to which the other results belong.
    """
    # imported here, like scipy.ndimage below: films without a flash need neither
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
    # the fireball had its final radius in the first frame that shows it
    if np.exp(found.x[2]) < LEAST_GROWTH_FRAMES * step:
        return None
    dof = max(len(time) - 3, 1)
    inflation = max(1.0, 2.0 * found.cost / dof)
    inverse = np.linalg.inv(square)
    sd = np.sqrt(np.diag(inverse) * inflation)
    # an error common to all radii shifts the time at which they are zero
    sd[0] = np.hypot(sd[0], sigma.min() * np.exp(found.x[2] - found.x[1]))
    # a Gauss-Newton step: zero unless a bound is reached
    free = found.x[0] - float(inverse[0] @ (found.jac.T @ found.fun))
    last, tau = np.exp(found.x[1:])
    spread = float(np.sqrt(np.mean((misfit(found.x) * sigma) ** 2)))
    return (
        np.array([free, last, tau]),
        np.array([sd[0], last * sd[1], tau * sd[2]]),
        spread,
    )


def _at_zero(
    middle: Float[np.ndarray, " n"],
    radius: Float[np.ndarray, " n"],
    since: Float[np.ndarray, " n"],
) -> tuple[float, float]:
    """Return the middle extrapolated to radius 0, and its standard deviation [px]."""
    columns = [np.ones_like(radius)]
    # the centre of a half disc is 4/(3 pi) = 0.42 R above the burst: a slope, or an
    # error where few radii, or equal ones, do not give it
    offset = 0.42 * radius.max()
    if len(middle) > 3 and np.ptp(radius) > 1.0:
        columns.append(radius)
        offset = 0.0
    if len(middle) > 6:
        columns.append(since)
    design = np.stack(columns, axis=1)
    weight = 1.0 / (RADIUS_ERROR_PX + 0.05 * radius)
    found, *_ = np.linalg.lstsq(design * weight[:, None], middle * weight, rcond=None)
    left = (middle - design @ found) * weight
    square = (design * weight[:, None]).T @ (design * weight[:, None])
    inflation = float(left @ left) / max(len(middle) - len(columns), 1)
    sd = np.sqrt(np.linalg.pinv(square)[0, 0] * max(inflation, RADIUS_ERROR_PX**2))
    errors = sd, POSITION_ERROR_PX, ASYMMETRY * radius.max(), offset
    return float(found[0]), float(np.linalg.norm(errors))


def silhouette(
    time_s: float, share: Image, seed: Bool[np.ndarray, "height width"], lit: Image
) -> Silhouette | None:
    """Return the silhouette about a seed; None without one.

    Args:
        time_s: Time [s].
        share: Share of the fireball's light in each pixel, 0 to 1.
        seed: Pixels of which the silhouette must contain one; the largest connected
            spot of that kind is used.
        lit: Largest share of each pixel in its silhouettes so far, which is updated.
    """
    spot = _spot(share, PIXEL_SHARE, seed)
    if spot is None:
        return None
    weight = _within(spot, share)
    beside = bool((lit[weight > 0] > 0).any()) or not lit.any()
    np.maximum(lit, weight, out=lit)
    columns, rows = weight.sum(axis=0), weight.sum(axis=1)
    middle, radius = _spread(columns, COLUMN_SHARE)
    low, high = (_spread(columns, share)[1] for share in OTHER_COLUMN_SHARES)
    faint, bright = (
        radius
        if other is None
        else _spread(_within(other, share).sum(axis=0), COLUMN_SHARE)[1]
        for other in (
            _spot(share, level, seed) for level in (FAINTER_SHARE, BRIGHTER_SHARE)
        )
    )
    errors = (
        RADIUS_ERROR_PX,
        RELATIVE_ERROR * radius,
        0.5 * (high - low),
        GLOW_FACTOR * (faint - bright),
    )
    sigma = float(np.linalg.norm(errors))
    cut = bool(spot[:, 0].any() or spot[:, -1].any())
    row = float(rows @ np.arange(len(rows))) / float(weight.sum())
    area = float(spot.sum())
    reached = _spread(lit.sum(axis=0), COLUMN_SHARE)[1]
    return Silhouette(
        time_s, radius, middle, row, area, cut, sigma, reached, float(lit.sum()), beside
    )


def _spot(
    share: Image, level: float, seed: Bool[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"] | None:
    """Return the largest spot brighter than a level that touches a seed, or None."""
    from scipy import ndimage

    names = np.zeros(share.shape, np.int32)
    # pixels that touch at a corner are connected, too
    ndimage.label(share > level, np.ones((3, 3)), output=names)
    sizes = np.bincount(names.ravel())
    touched = np.unique(names[seed])
    touched = touched[touched > 0]
    if not len(touched):
        return None
    return names == touched[np.argmax(sizes[touched])]


def _within(spot: Bool[np.ndarray, "height width"], share: Image) -> Image:
    """Return the shares in a spot and in the pixels at its edge, else zero."""
    from scipy import ndimage

    # a spot is a small part of most images: only its surroundings are looked at
    rows, columns = np.nonzero(spot)
    about = np.s_[
        max(rows.min() - 1, 0) : rows.max() + 2,
        max(columns.min() - 1, 0) : columns.max() + 2,
    ]
    within = np.zeros_like(share)
    # the pixels around a spot contain the rest of its edge, to a fraction of a pixel
    within[about] = np.where(ndimage.binary_dilation(spot[about]), share[about], 0.0)
    return within


def _spread(columns: Float[np.ndarray, " width"], low: float) -> tuple[float, float]:
    """Return middle and radius by the columns above a share of the highest [px]."""
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
) -> tuple[list[Silhouette], float, float]:
    """Return the silhouettes, the time of the last dark frame, and of the next [s].

    Args:
        times: Times of the frames [s].
        light: Linear light, full scale 1.
        begun: Number of the frame that shows it first, or one nearby.
        seed: Pixels that were lit.
    """
    from scipy import ndimage

    # two frames before the evidence, as a faint start lights no pixel
    quiet = max(begun - 2, 1)
    behind = np.median(light[max(quiet - BACKGROUND_FRAMES, 0) : quiet], axis=0)
    rise = light[quiet:] - behind
    peak = 0.0
    if seed.any():
        peak = float(np.quantile(rise.max(axis=0)[seed], LIGHT_QUANTILE))
    # single precision resolves no less of full scale
    if peak < 1e-6:
        return [], float(times[quiet - 1]), float(times[quiet])
    shares = np.clip(rise / peak, 0.0, 1.0)
    seen, before = joined(times[quiet:], shares, seed, float(times[quiet - 1]))
    if not seen:
        return seen, before, float(times[-1])
    # the start of a fireball is too small or too faint for a silhouette
    first = quiet + int(np.searchsorted(times[quiet:], seen[0].time_s))
    spot = _spot(shares[first - quiet], PIXEL_SHARE, seed)
    assert spot is not None
    earlier = slice(max(quiet - BACKGROUND_FRAMES, 0), first)
    means = ndimage.uniform_filter((light[earlier] - behind) / peak, 3, axes=(1, 2))
    faint = means[:, spot].max(axis=1)
    noise = float(faint[: quiet - earlier.start].max())
    dark = faint <= max(FAINT_SHARE, FAINT_NOISES * noise)
    # at the latest the background, which is dark by definition
    dark[: quiet - earlier.start] = True
    last_dark = earlier.start + int(np.flatnonzero(dark)[-1])
    return seen, float(times[last_dark]), float(times[last_dark + 1])


def joined(
    times: Float[np.ndarray, " frame"],
    shares: Frames,
    seed: Bool[np.ndarray, "height width"],
    before: float,
) -> tuple[list[Silhouette], float]:
    """Return consecutive silhouettes from the first frame that has one.

    Args:
        times: Times of the frames [s].
        shares: Share of the fireball's light in each pixel.
        seed: Pixels of the fireball.
        before: Time of the frame before the first of them [s].
    """
    seen: list[Silhouette] = []
    lit = np.zeros(seed.shape, np.float32)
    for time, share in zip(times, shares, strict=True):
        one = silhouette(float(time), share, seed, lit)
        if one is None:
            # after three silhouettes it is over or hidden; before, it was noise
            if len(seen) >= 3:
                break
            seen, before = [], float(time)
            lit[:] = 0.0
        else:
            seen.append(one)
    return seen, before


class Direction(NamedTuple):
    """Direction from the camera to the burst.

    Attributes:
        bearing_rad: Bearing, clockwise from north [rad].
        bearing_sd_rad: Its standard deviation by the position in the image alone [rad].
        elevation_rad: Elevation above the horizon [rad].
        elevation_sd_rad: Its standard deviation, likewise [rad].
    """

    bearing_rad: float
    bearing_sd_rad: float
    elevation_rad: float
    elevation_sd_rad: float


def direction_of(camera: Camera, grown: Growth) -> Direction:
    """Return the direction of a burst.

    Args:
        camera: The camera.
        grown: Growth with the position in the image.
    """
    x, y = grown.x_px, grown.y_px
    pixels = np.array([[x, y], [x + 1.0, y], [x, y + 1.0]])
    east, north, up = np.asarray(unproject(camera, pixels)).T
    bearing, elevation = np.arctan2(east, north), np.arctan2(up, np.hypot(east, north))
    # differences modulo a turn: a burst may lie due north
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

    The quantity `fireball_radius_px` is f tan(a) with a the half-angle of the sphere;
    off the middle and with lens distortion a silhouette has another radius.

    Args:
        camera: The camera.
        seen: A silhouette.
    """
    x, y, radius = seen.x_px, seen.y_px, seen.radius_px
    left, right = np.asarray(
        unproject(camera, np.array([[x - radius, y], [x + radius, y]]))
    )
    half = 0.5 * np.arctan2(np.linalg.norm(np.cross(left, right)), left @ right)
    return float(np.sqrt(np.prod(camera.focal)) * np.tan(half))
