"""What a map of an answer shows, before anything is drawn or written."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.place.confidence_ellipse import (
    ConfidenceEllipse,
    confidence_ellipse,
    place_draws,
    rests_on_clocks,
)
from jblast.inference.fitting.place.credible_region import (
    CredibleRegion,
    credible_regions,
)
from jblast.inference.fitting.place.shock_rings import ShockRing, shock_rings
from jblast.inference.fitting.result import Fit
from jblast.observations.places.frame import Frame
from jblast.report.fit.reference_values import Accepted
from jblast.report.fit.rows import outlier_rows

SHARES = (0.5, 0.9)
"""Of the posterior, one ellipse each."""


@dataclass(frozen=True)
class Station:
    """A sensor on the map.

    Attributes:
        name: As in the log.
        position: East, north, up [m].
        residuals: Pairs of quantity and residual [sd], a row of the log each.
        suspected: Whether one of them is a suspected outlier.
    """

    name: str
    position: Float[np.ndarray, "3"]
    residuals: tuple[tuple[str, float], ...]
    suspected: bool = False

    @property
    def worst(self) -> float:
        """The residual that is furthest from 0 [sd]; NaN where there is none."""
        finite = [r for _, r in self.residuals if np.isfinite(r)]
        return max(finite, key=abs, default=float("nan"))


@dataclass(frozen=True)
class ChargePlace:
    """A charge on the map.

    Attributes:
        name: Of the charge; "" where there is one.
        shot: Which of the scene's charges.
        position: East, north, up at the answer [m].
        asked: Whether its place was sought, not given.
        draws: Of its place, (east, north) [m]; None where it was given.
        ellipses: One for each of `SHARES`; none where it was given.
        regions: Likewise where an ellipse would mislead.
        rings: Where its peak overpressure has fallen to some values.
        elsewhere: Other optima, (east, north) [m].
        accepted: Where it stood by a published value (east, north) [m], if known.
        rests_on_clocks: Whether the place is identified only if clocks agree that were
            taken to; then it has neither ellipses nor regions.
    """

    name: str
    shot: int
    position: Float[np.ndarray, "3"]
    asked: bool
    draws: Float[np.ndarray, "draw 2"] | None
    ellipses: tuple[ConfidenceEllipse, ...]
    regions: tuple[CredibleRegion, ...]
    rings: tuple[ShockRing, ...]
    elsewhere: tuple[tuple[float, float], ...] = ()
    accepted: tuple[float, float] | None = None
    rests_on_clocks: bool = False


@dataclass(frozen=True)
class GroundMap:
    """What a map shows.

    Attributes:
        stations: The sensors whose places are known.
        charges: Those whose places are.
        wind: Towards east and north [m/s].
        frame: Where on the Earth east, north, up are counted from; None if unknown.
    """

    stations: tuple[Station, ...]
    charges: tuple[ChargePlace, ...]
    wind: tuple[float, float]
    frame: Frame | None


def ground_map(fit: Fit, accepted: Accepted | None = None) -> GroundMap | None:
    """Return what a map of an answer shows; None where no sensor's place is known.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with where it comes from.
    """
    stations = _stations(fit)
    if not stations:
        return None
    found = (_charge(fit, shot, accepted) for shot in range(len(fit.scene.charges)))
    air = fit.scene.air
    return GroundMap(
        stations=stations,
        charges=tuple(charge for charge in found if charge is not None),
        wind=(float(air.wind_east), float(air.wind_north)),
        frame=fit.observations.frame,
    )


def _stations(fit: Fit) -> tuple[Station, ...]:
    table, suspected = fit.observations, set(outlier_rows(fit))
    ranged = np.isfinite(table.slant_range)  # stands for a place nobody noted
    rows: dict[tuple[str, tuple[float, ...]], list[int]] = {}
    for row in np.flatnonzero(np.isfinite(table.position).all(axis=1) & ~ranged):
        at = tuple(float(x) for x in table.position[row])
        rows.setdefault((table.sensor[row], at), []).append(int(row))
    return tuple(
        Station(
            name=name,
            position=np.array(at),
            residuals=tuple((table.quantity[i], float(fit.residual[i])) for i in of),
            suspected=not suspected.isdisjoint(of),
        )
        for (name, at), of in rows.items()
    )


def _charge(fit: Fit, shot: int, accepted: Accepted | None) -> ChargePlace | None:
    """Return one charge; None where the log cannot tell its place, or it never went."""
    charge = fit.scene.charges[shot]
    position = np.asarray(charge.position_m, float)
    names = [f"charge_{axis}_m{fit.scene.label(charge)}" for axis in ("east", "north")]
    asked = not set(names).isdisjoint(fit.summary.free)
    pair = place_draws(fit, shot)
    untold = asked and pair is None
    if untold or charge.range_m is not None or bool(np.isinf(charge.time_s)):
        return None
    rests = rests_on_clocks(fit, shot)
    pair = None if rests else pair
    draws = None if pair is None else np.stack(pair, axis=-1)
    ellipses, regions = (), ()
    if pair is not None:
        ellipses = tuple(confidence_ellipse(*pair, share) for share in SHARES)
        regions = credible_regions(*pair, SHARES)
    known = [accepted[name][0] for name in names if accepted and name in accepted]
    return ChargePlace(
        name=charge.name,
        shot=shot,
        position=position,
        asked=asked,
        rests_on_clocks=rests,
        draws=draws,
        ellipses=ellipses,
        regions=regions,
        rings=shock_rings(fit, shot),
        elsewhere=_elsewhere(fit, names, position),
        accepted=(float(known[0]), float(known[1])) if len(known) == 2 else None,
    )


def _elsewhere(
    fit: Fit, names: list[str], position: Float[np.ndarray, "3"]
) -> tuple[tuple[float, float], ...]:
    """Return where other optima put a charge, if elsewhere."""
    east, north = names
    places = [
        (float(of.parameters.get(east, here)), float(of.parameters.get(north, there)))
        for of in fit.summary.ambiguities
        for here, there in [position[:2]]
    ]
    return tuple(place for place in places if place != tuple(position[:2]))
