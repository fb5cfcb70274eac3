r"""The ellipse on the ground that holds a share of a posterior's draws.

Its shape is that of the draws' covariance $\Sigma$, its size the share's quantile of
$d^2 = (x - \bar x)^T \Sigma^{-1} (x - \bar x)$ among the draws themselves. Of normal
draws that is $\chi^2_2$, 4.605 for 90 %, that is $-2 \ln(1 - \mathrm{share})$; of
others the ellipse is wider or narrower, and still holds the share.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.fitting.findings import ClocksTakenToAgree
from jblast.inference.fitting.result import Fit

THIN = 1e-12
"""A variance so small beside the other is rounding: the place is known along it."""


@dataclass(frozen=True)
class ConfidenceEllipse:
    """An ellipse about the most probable places of a charge.

    Attributes:
        share: Of the draws inside, 0 to 1.
        east: Its centre, the draws' mean [m].
        north: Likewise.
        major: Its longer half axis [m].
        minor: Its shorter one [m]; 0 where one coordinate alone was asked for.
        azimuth_deg: Direction of the longer axis, clockwise from north, 0 to 180.
    """

    share: float
    east: float
    north: float
    major: float
    minor: float
    azimuth_deg: float

    def axes(self) -> Float[np.ndarray, "2 2"]:
        """Return the half axes as vectors (east, north) [m], a row each."""
        along = np.deg2rad(self.azimuth_deg)
        unit = np.array([np.sin(along), np.cos(along)])
        return np.stack([self.major * unit, self.minor * np.array([-unit[1], unit[0]])])

    def outline(self, points: int = 72) -> Float[np.ndarray, "point 2"]:
        """Return places (east, north) on it, anticlockwise, the first one once [m]."""
        turn = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
        major, minor = self.axes()
        ring = np.cos(turn)[:, None] * major + np.sin(turn)[:, None] * minor
        return np.array([self.east, self.north]) + ring

    def holds(
        self, east: Float[np.ndarray, "..."], north: Float[np.ndarray, "..."]
    ) -> Bool[np.ndarray, "..."]:
        """Return whether places lie inside; on an ellipse without width, along it."""
        away = np.stack([east - self.east, north - self.north], axis=-1)
        length = np.array([self.major, self.minor])
        unit = self.axes() / np.where(length > 0.0, length, 1.0)[:, None]
        scaled = (away @ unit.T) / np.where(length > 0.0, length, 1.0)
        # what stands on the rim was left there by rounding
        return np.sum(scaled**2, axis=-1) <= 1.0 + 1e-9


def confidence_ellipse(
    east: Float[np.ndarray, " draw"],
    north: Float[np.ndarray, " draw"],
    share: float = 0.9,
) -> ConfidenceEllipse:
    """Return the ellipse of the draws' covariance that holds a share of them.

    Args:
        east: Draws of the place [m]; all equal where it is known.
        north: Likewise.
        share: Of the draws to be held, between 0 and 1.
    """
    draws = np.stack([east, north], axis=-1)
    centre = draws.mean(axis=0)
    away = draws - centre
    variances, vectors = np.linalg.eigh(away.T @ away / len(draws))
    wide = variances > THIN * variances[1]  # ascending: of two, the second
    scale = np.sqrt(np.where(wide, variances, 1.0))
    distance = np.sqrt(np.sum(np.where(wide, away @ vectors / scale, 0.0) ** 2, -1))
    # a step up, so that the draw at the rim is inside
    size = float(np.quantile(distance, share, method="higher"))
    minor, major = np.where(wide, size * scale, 0.0)
    azimuth = float(np.rad2deg(np.arctan2(vectors[0, 1], vectors[1, 1])))
    return ConfidenceEllipse(
        share=share,
        east=float(centre[0]),
        north=float(centre[1]),
        major=float(major),
        minor=float(minor),
        azimuth_deg=azimuth % 180.0,
    )


def place_draws(
    fit: Fit, shot: int = 0
) -> tuple[Float[np.ndarray, " draw"], Float[np.ndarray, " draw"]] | None:
    """Return draws of where a charge stood, east and north [m].

    None where nothing was asked of its place, or the log cannot tell it: a coordinate
    is not identified, or a range was sought.

    Args:
        fit: The fit.
        shot: Which of the scene's charges.
    """
    charge = fit.scene.charges[shot]
    label = fit.scene.label(charge)
    asked = [f"charge_{axis}_m{label}" for axis in ("east", "north")]
    free = [name for name in asked if name in fit.summary.free]
    unknown = fit.summary.unidentified
    drawn = [name for name in free if name in fit.draws and name not in unknown]
    if not drawn or len(drawn) < len(free) or not _finite(fit.draws, drawn):
        return None
    count = len(fit.draws[drawn[0]])
    east, north = (
        fit.draws[name] if name in drawn else np.full(count, float(known))
        for name, known in zip(asked, np.asarray(charge.position_m)[:2], strict=True)
    )
    return east, north


def charge_ellipse(
    fit: Fit, share: float = 0.9, shot: int = 0
) -> ConfidenceEllipse | None:
    """Return the ellipse that holds a share of where a charge may have stood.

    None where `place_draws` has none, and where the place rests on clocks that were
    taken to agree: such an ellipse is far too small if they do not.
    """
    draws = place_draws(fit, shot)
    if draws is None or rests_on_clocks(fit, shot):
        return None
    return confidence_ellipse(*draws, share)


def rests_on_clocks(fit: Fit, shot: int = 0) -> bool:
    """Return whether a place is identified only if clocks agree that nobody compared.

    Args:
        fit: The fit.
        shot: Which of the scene's charges.
    """
    label = fit.scene.label(fit.scene.charges[shot])
    place = {f"charge_east_m{label}", f"charge_north_m{label}"}
    return any(
        not place.isdisjoint(finding.resting)
        for finding in fit.summary.warnings
        if isinstance(finding, ClocksTakenToAgree)
    )


def _finite(draws: Mapping[str, Float[np.ndarray, " draw"]], names: list[str]) -> bool:
    return all(len(draws[name]) and np.isfinite(draws[name]).all() for name in names)
