"""Flights as `jblast fly --json` prints them, and a row a flight as CSV."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jblast.json_values import plain
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

MOST_NAMED = 100
"""Lost vehicles that are named one by one."""


def flights_document(flights: Flights) -> dict[str, Any]:
    """Return what `--json` prints; infinite and unknown numbers are null."""
    options, vehicle = flights.options, flights.vehicle
    first = next(iter(flights.holds.values()))
    several = flights.count > 1
    return plain(
        {
            "vehicle": vehicle.model,
            "vehicles": flights.count,
            "position_m": vehicle.position,
            "target_m": target_of(vehicle),
            "yaw_rad": vehicle.yaw,
            "seconds": flights.seconds,
            "step_s": options.step_s,
            "integrator": options.integrator,
            "backend": options.backend,
            "tolerance_m": options.tolerance_m,
            "load": "laws" if options.profile is None else "custom profile",
            "drawn": {
                name: _spread(values) if several else values
                for name, values in flights.drawn.items()
            },
            "blasts": [
                _blast(flights, first, n, several) for n in range(len(flights.blasts))
            ],
            "thresholds": {
                name: {"value": limit.value, "source": limit.source}
                for name, limit in THRESHOLDS[vehicle.model].items()
            },
            "scene_hold": flights.own,
            "holds": {
                name: (_several if several else _single)(vehicle.model, flown)
                for name, flown in flights.holds.items()
            },
            "warnings": warnings_of(flights),
        }
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


def _single(model: str, flown: Flown) -> dict[str, Any]:
    """Return the metrics of one flight."""
    metrics = flown.metrics
    told = {name: metric(flown, name) for name in (*METRICS, *EXPOSURES)}
    return told | {
        "recovered": math.isfinite(float(metrics.recovery_time_s)),
        "settled": metrics.settled,
        "crashed": metrics.crashed,
        "lost": flown.lost,
        "flies_on": flies_on(flown),
        "past_threshold": past_threshold(model, flown),
    }


def _several(model: str, flown: Flown) -> dict[str, Any]:
    """Return the distribution of each metric, and shares of the vehicles."""
    metrics = flown.metrics
    on = flies_on(flown)
    low, high = share_interval(on)
    lost = np.flatnonzero(flown.lost)
    told: dict[str, Any] = {
        name: _spread(metric(flown, name)) for name in (*METRICS, *EXPOSURES)
    }
    return told | {
        "recovered_share": _share(np.isfinite(metrics.recovery_time_s)),
        "settled_share": _share(metrics.settled),
        "crashed_share": _share(metrics.crashed),
        "flies_on_share": {"value": _share(on), "q05": low, "q95": high},
        "past_threshold_share": {
            name: None if past is None else _share(past)
            for name, past in past_threshold(model, flown).items()
        },
        "lost": lost.size,
        "lost_vehicles": lost[:MOST_NAMED],
    }


def _blast(flights: Flights, flown: Flown, n: int, several: bool) -> dict[str, Any]:
    encounter = flown.encounter
    told: dict[str, Any] = {"charge": flights.blasts[n]}
    for name in ("arrival_s", "distance_m", "scaled_distance", "overpressure_pa"):
        values = getattr(encounter, name)[..., n]
        told[name] = _spread(values) if several else values
    inside = encounter.in_range[..., n]
    return told | (
        {"in_range_share": _share(inside)} if several else {"in_range": inside}
    )


def _share(flags: ArrayLike) -> float:
    return float(np.mean(np.asarray(flags)))


def _spread(values: ArrayLike) -> dict[str, float]:
    """Return quantiles of numbers, of which some may be infinite."""
    return dict(zip(("q05", "q50", "q95"), quantiles(np.asarray(values)), strict=True))
