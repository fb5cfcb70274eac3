r"""From where a front came: the plane wave that fits the times of an array best.

A plane wave from the unit direction $n$ passes the microphone at $r_i$ at
$t_i = t_0 - n\cdot r_i/c$. Weighted least squares give the slowness $p = n/c$ with its
covariance in as many dimensions as the microphones span, and of all directions the one
nearest to it is taken, $c$ being known to some extent:

$$Q(n, \ln c) = (n/c - p)^T K\,(n/c - p) + (\ln c - \ln c_0)^2/\sigma_{\ln c}^2.$$

$K$, the information, has as many directions as the microphones span, so two of them, or
several in a line, tell an angle from that line alone, and those in a plane cannot tell
its two sides apart. What is not told has a name in the answer.

The front is taken to be flat. At the range $R$ an array as wide as $D$ sees it bent by
$D^2/8Rc$ [s], which an array that is alike on both sides takes for no turn.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.detect.array.plane_wave import Front, PlaneWave, angles_of
from jblast.detect.array.relative_times import RelativeTimes
from jblast.errors import InputError

FLAT = 1e-6
"""Microphones span no dimension in which they are nearer than this share of the
farthest."""
TOLD = 0.5
"""An angle with a larger standard deviation is not told [rad]."""
AS_GOOD = 6.0
"""Another direction whose chi-squared is greater by less than this is as good."""
ANGLES = ("bearing_rad", "elevation_rad")
APART = 2.0
"""Two directions are one where they are nearer than so many standard deviations."""


class Direction(NamedTuple):
    """From where a front came.

    Attributes:
        bearing: Of the source, clockwise from north [rad]; NaN where not told.
        elevation: Of the source, above the horizon [rad]; NaN where not told.
        covariance: Of bearing and elevation [rad^2]; NaN where not told.
        mirror: Bearing and elevation of the other direction from which it may have come
            as well: the other side of the plane of the microphones.
        undetermined: What these microphones do not tell: `bearing_rad`,
            `elevation_rad`.
        layout: How they stand: `two`, `collinear`, `coplanar` or `spatial`.
        chi2: Of the times about the plane wave.
        dof: Its degrees of freedom: zero where nothing is left to contradict it.
    """

    bearing: float
    elevation: float
    covariance: Float[np.ndarray, "2 2"]
    mirror: tuple[float, float] | None
    undetermined: tuple[str, ...]
    layout: str
    chi2: float
    dof: int


def direction(
    positions: Float[ArrayLike, "channel 3"],
    times: RelativeTimes,
    sound_speed: float,
    sound_speed_sigma: float = 0.0,
) -> Direction:
    """Return from where a front came.

    Args:
        positions: East, north, up of the microphones [m].
        times: When it passed each of them.
        sound_speed: Speed of the front over the ground [m/s]: that of sound, if weak.
        sound_speed_sigma: Its standard deviation [m/s]; wind counts, too.

    Raises:
        InputError: Microphones that stand at one place, or a time of one is not told.
    """
    positions = np.asarray(positions, float)
    if positions.shape != (len(times.time), 3):
        raise InputError(
            f"positions: expected {len(times.time)} rows of east, north, up; got "
            f"shape {positions.shape}"
        )
    if not times.complete:
        raise InputError("times: expected one of each microphone, got NaN")
    apart = positions - positions.mean(axis=0)
    _, sizes, axes = np.linalg.svd(apart, full_matrices=False)
    span = int((sizes > FLAT * sizes[0]).sum()) if sizes[0] > 0 else 0
    if span == 0:
        raise InputError("positions: expected microphones apart, got one place")
    basis = axes[:span].T
    design = -apart @ basis
    weight = np.linalg.pinv(times.covariance, rcond=1e-9, hermitian=True)
    inside = design.T @ weight @ design
    slowness = basis @ np.linalg.solve(inside, design.T @ weight @ times.time)
    left = times.time + apart @ slowness
    wave = PlaneWave(
        basis @ inside @ basis.T, slowness, sound_speed, sound_speed_sigma / sound_speed
    )
    found = wave.nearest(wave.start())
    other = wave.nearest(wave.mirrored(found))
    if wave.misfit(other) < wave.misfit(found):
        found, other = other, found
    resolved, covariance, mirror = _resolved_angles(wave, found, other, span)
    hidden = ~resolved
    values = np.where(resolved, angles_of(found.toward), np.nan)
    names = {1: "two" if len(positions) == 2 else "collinear", 2: "coplanar"}
    return Direction(
        bearing=float(values[0]),
        elevation=float(values[1]),
        covariance=np.where(hidden[:, None] | hidden, np.nan, covariance),
        mirror=mirror,
        undetermined=tuple(name for name, lost in zip(ANGLES, hidden) if lost),  # noqa: B905
        layout=names.get(span, "spatial"),
        chi2=float(left @ weight @ left) + wave.misfit(found),
        dof=len(positions) - 1 - min(span, 2),
    )


def _resolved_angles(
    wave: PlaneWave, found: Front, other: Front, span: int
) -> tuple[np.ndarray, np.ndarray, tuple[float, float] | None]:
    """Return which angles are told, their covariance, and the other direction."""
    if span == 1:  # a cone about the line of the microphones
        upright = abs(float(wave.axis()[2])) > 1 - FLAT
        covariance = np.diag([np.inf, wave.covariance(found)[1, 1]])
        resolved = np.array([False, upright and covariance[1, 1] < TOLD**2])
        return resolved, covariance, None
    covariance = wave.covariance(found)
    sd = np.sqrt(np.diag(covariance))
    mirrored = angles_of(other.toward)
    turned = (mirrored - angles_of(found.toward) + np.pi) % (2 * np.pi) - np.pi
    as_good = wave.misfit(other) - wave.misfit(found) < AS_GOOD
    # one side of a plane is never told from the other, however near to it
    differ = as_good & (np.abs(turned) > (FLAT if span == 2 else APART * sd))
    mirror = (float(mirrored[0]), float(mirrored[1])) if differ.any() else None
    return (sd < TOLD) & ~differ, covariance, mirror
