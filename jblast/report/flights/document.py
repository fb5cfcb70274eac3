"""What is to be told of flights, and a row a flight as CSV."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jblast.report.flights.answer import (
    BlastMet,
    BlastMetBySeveral,
    EastNorthUpM,
    FlightsAnswer,
    Limit,
    Outcome,
    OutcomeOfSeveral,
    Quantiles,
    Share,
)
from jblast.report.flights.estimates import estimates_thrown
from jblast.report.tables import comma_separated
from jblast.study.flights.records import Flights, Flown
from jblast.study.flights.statistics import (
    EXPOSURES,
    METRICS,
    flies_on,
    metric,
    past_threshold,
    quantiles,
    share_interval,
    target_of,
    warnings_of,
)
from jblast.vehicle.thresholds import THRESHOLDS

MET = ("arrival_s", "distance_m", "scaled_distance", "overpressure_pa")
"""Numbers of an `Encounter` that are told of each blast."""
MOST_NAMED = 100
"""Lost vehicles that are named one by one."""


def flights_answer(flights: Flights, *, scene: str, seed: int) -> FlightsAnswer:
    """Return what is to be told of flights.

    Args:
        flights: What was flown.
        scene: The file that says through what.
        seed: Of what was drawn.
    """
    options, vehicle = flights.options, flights.vehicle
    first = next(iter(flights.holds.values()))
    several = flights.count > 1
    blast = _blast_of_several if several else _blast
    return FlightsAnswer(
        scene=scene,
        seed=seed,
        vehicle=vehicle.model,
        vehicles=flights.count,
        position_m=_place(vehicle.position),
        target_m=_place(target_of(vehicle)),
        yaw_rad=float(vehicle.yaw),
        seconds=flights.seconds,
        step_s=options.step_s,
        integrator=options.integrator,
        backend=options.backend,
        tolerance_m=options.tolerance_m,
        load=options.load if options.profile is None else "custom profile",
        drawn={
            name: _spread(values) if several else float(values)
            for name, values in flights.drawn.items()
        },
        blasts=tuple(blast(flights, first, n) for n in range(len(flights.blasts))),
        thresholds={
            name: Limit(limit.value, limit.source)
            for name, limit in THRESHOLDS[vehicle.model].items()
        },
        scene_hold=flights.own,
        holds={
            name: (_outcome_of_several if several else _outcome)(vehicle.model, flown)
            for name, flown in flights.holds.items()
        },
        estimator=options.estimator,
        estimates={
            name: estimates_thrown(
                flown.thrown, flights.blasts, _spread if several else float
            )
            for name, flown in flights.holds.items()
            if flown.thrown is not None
        },
        warnings=tuple(warnings_of(flights)),
    )


def flights_csv(flights: Flights) -> str:
    """Return a row for each vehicle and hold: what was drawn, and what became of it."""
    blasts = [f".{name}" if name else "" for name in flights.blasts]
    met = ("arrival_s", "distance_m", "scaled_distance", "in_range")
    names = ["vehicle", "hold", *flights.drawn]
    names += [f"{column}{blast}" for blast in blasts for column in met]
    table = [[*names, *METRICS, *EXPOSURES, "settled", "crashed", "lost"]]
    for hold, flown in flights.holds.items():
        columns: list[Any] = list(flights.drawn.values())
        for n in range(len(blasts)):
            columns += [getattr(flown.encounter, name)[:, n] for name in met]
        columns += [metric(flown, name) for name in (*METRICS, *EXPOSURES)]
        columns += [flown.metrics.settled, flown.metrics.crashed, flown.lost]
        rows = zip(*map(np.asarray, columns), strict=True)
        for lane, row in enumerate(rows):
            table.append([str(lane), hold, *map(_field, row)])
    return comma_separated(table)


def _field(value: Any) -> str:
    if isinstance(value, np.bool_):
        return "true" if value else "false"
    return f"{value:.9g}"


def _outcome(model: str, flown: Flown) -> Outcome:
    """Return what became of one flight."""
    metrics = flown.metrics
    return Outcome(
        **{name: float(metric(flown, name)) for name in (*METRICS, *EXPOSURES)},
        recovered=math.isfinite(float(metrics.recovery_time_s)),
        settled=bool(metrics.settled),
        crashed=bool(metrics.crashed),
        lost=bool(flown.lost),
        flies_on=bool(flies_on(flown)),
        past_threshold={
            name: None if past is None else bool(past)
            for name, past in past_threshold(model, flown).items()
        },
    )


def _outcome_of_several(model: str, flown: Flown) -> OutcomeOfSeveral:
    """Return the distribution of each metric, and shares of the vehicles."""
    metrics = flown.metrics
    on = flies_on(flown)
    lost = np.flatnonzero(flown.lost)
    return OutcomeOfSeveral(
        **{name: _spread(metric(flown, name)) for name in (*METRICS, *EXPOSURES)},
        recovered_share=_share(np.isfinite(metrics.recovery_time_s)),
        settled_share=_share(metrics.settled),
        crashed_share=_share(metrics.crashed),
        flies_on_share=Share(_share(on), *share_interval(on)),
        past_threshold_share={
            name: None if past is None else _share(past)
            for name, past in past_threshold(model, flown).items()
        },
        lost=lost.size,
        lost_vehicles=tuple(lost[:MOST_NAMED].tolist()),
    )


def _blast(flights: Flights, flown: Flown, n: int) -> BlastMet:
    """Return a blast as it came to one vehicle."""
    encounter = flown.encounter
    return BlastMet(
        charge=flights.blasts[n],
        **{name: float(getattr(encounter, name)[n]) for name in MET},
        in_range=bool(encounter.in_range[n]),
    )


def _blast_of_several(flights: Flights, flown: Flown, n: int) -> BlastMetBySeveral:
    """Return a blast as it came to several vehicles."""
    encounter = flown.encounter
    return BlastMetBySeveral(
        charge=flights.blasts[n],
        **{name: _spread(getattr(encounter, name)[..., n]) for name in MET},
        in_range_share=_share(encounter.in_range[..., n]),
    )


def _place(at: ArrayLike) -> EastNorthUpM:
    east, north, up = np.asarray(at).tolist()
    return east, north, up


def _share(flags: ArrayLike) -> float:
    return float(np.mean(np.asarray(flags)))


def _spread(values: ArrayLike) -> Quantiles:
    """Return quantiles of numbers, of which some may be infinite."""
    return Quantiles(*quantiles(np.asarray(values)))
