"""Flights through blasts, in words."""

import math
import textwrap

import numpy as np
from numpy.typing import ArrayLike

from jblast.quantity_table import QUANTITIES
from jblast.report.flights.estimates import estimate_lines
from jblast.report.lines import WIDTH
from jblast.report.numbers import printed_number, significant
from jblast.report.tables import aligned
from jblast.report.words import capitalised, parameter_words
from jblast.study.flights.records import Flights
from jblast.study.flights.statistics import (
    EXPOSURES,
    METRICS,
    flies_on,
    hold_words,
    metric,
    past_threshold,
    quantiles,
    share_interval,
    target_of,
    warnings_of,
)
from jblast.vehicle.thresholds import THRESHOLDS

WORDS = {
    "error_before_m": "path error before",
    "error_at_blast_m": "path error as it comes",
    "error_after_m": "path error after",
    "peak_deviation_m": "peak deviation",
    "peak_time_s": "  after the blast",
    "recovery_time_s": "recovery time",
    "peak_overpressure_pa": QUANTITIES["peak_overpressure_pa"].words,
    "peak_acceleration_m_s2": "peak acceleration",
    "fireball_time_s": "in a fireball for",
}
THRESHOLD_WORDS = {
    "peak_overpressure_pa": "threshold of overpressure",
    "peak_acceleration_m_s2": "threshold of acceleration",
    "fireball_time_s": "threshold of time in a fireball",
}


def flights_text(flights: Flights) -> str:
    """Return what the terminal shows."""
    lines = [_title(flights), ""]
    if flights.drawn:
        lines += [*aligned(_drawn(flights)), ""]
    lines += [*aligned(_blasts(flights)), ""]
    lines += aligned(_holds(flights))
    estimates = [(hold_words(name), one.thrown) for name, one in flights.holds.items()]
    lines += estimate_lines(estimates, flights.blasts, _number)
    lines += ["", *_notes(flights)]
    return "\n".join(lines) + "\n"


def _title(flights: Flights) -> str:
    vehicle, options = flights.vehicle, flights.options
    place = ", ".join(f"{float(x):g}" for x in target_of(vehicle))
    who = vehicle.model.capitalize()
    if flights.count > 1:
        who = f"{flights.count:,} x {who}"
    return (
        f"{who} holding ({place}) m for {flights.seconds:g} s "
        f"({options.integrator}, steps of {printed_number('step_s', options.step_s)})"
    )


def _drawn(flights: Flights) -> list[tuple[str, ...]]:
    head = "drawn, by --seed"
    if flights.count > 1:
        head += ": 5 %, 50 %, 95 %"
    return [
        (head, ""),
        *(
            (parameter_words(name), _number(name, values))
            for name, values in flights.drawn.items()
        ),
    ]


def _blasts(flights: Flights) -> list[tuple[str, ...]]:
    """Return a row for each blast."""
    encounter = next(iter(flights.holds.values())).encounter
    by_law = flights.options.profile is None
    rows = [("blast", "arrives", "distance", "scaled [m/kg^(1/3)]", "peak", "in range")]
    if flights.count > 1:
        rows[0] = (*rows[0][:-1], "in range of its laws" if by_law else "in its cases")
    for n, name in enumerate(flights.blasts):
        inside = encounter.in_range[..., n]
        rows.append(
            (
                name or "the charge",
                _number("arrival_s", encounter.arrival_s[..., n]),
                _number("distance_m", encounter.distance_m[..., n]),
                _number("", encounter.scaled_distance[..., n]),
                _number("overpressure_pa", encounter.overpressure_pa[..., n]),
                _yes(bool(inside))
                if flights.count == 1
                else f"{100 * np.mean(inside):.3g} %",
            )
        )
    return rows


def _holds(flights: Flights) -> list[tuple[str, ...]]:
    """Return a row for each metric, a column for each hold."""
    holds = flights.holds
    several = flights.count > 1
    head = [
        hold_words(name) + (" (the scene's)" if name == flights.own else "")
        for name in holds
    ]
    rows = [("5 %, 50 %, 95 %" if several else "", *head)]
    for name in METRICS:
        cells = [_number(name, metric(f, name)) for f in holds.values()]
        rows.append((WORDS[name], *cells))
    if several:
        shares = {
            "recovered": lambda f: np.isfinite(f.metrics.recovery_time_s),
            "settled": lambda f: f.metrics.settled,
            "crashed": lambda f: f.metrics.crashed,
        }
        for word, of in shares.items():
            cells = [f"{100 * np.mean(of(f)):.4g} %" for f in holds.values()]
            rows.append((word, *cells))
        rows.append(("flies on", *(_interval(flies_on(f)) for f in holds.values())))
        return rows + _exposures(flights)
    for word in ("settled", "crashed"):
        flags = [bool(getattr(f.metrics, word)) for f in holds.values()]
        rows.append((word, *map(_yes, flags)))
    rows.append(("flies on", *(_yes(bool(flies_on(f))) for f in holds.values())))
    return rows + _exposures(flights)


def _exposures(flights: Flights) -> list[tuple[str, ...]]:
    """Return what the blasts did beside moving it, and who is past a threshold."""
    model, rows = flights.vehicle.model, []
    for name in EXPOSURES:
        held = flights.holds.values()
        rows.append((WORDS[name], *(_number(name, metric(f, name)) for f in held)))
        past = [past_threshold(model, f)[name] for f in held]
        cells = ["not known" if each is None else _past(each) for each in past]
        limit = THRESHOLDS[model][name].value
        limit_words = "" if limit is None else f" {_one(name, limit, 3)}"
        rows.append((f"  past{limit_words or ' a threshold'}", *cells))
    return rows


def _past(flags: np.ndarray) -> str:
    return _interval(flags) if flags.ndim else _yes(bool(flags))


def _notes(flights: Flights) -> list[str]:
    """Return what the words above mean, and what to beware of."""
    tolerance = printed_number("tolerance_m", flights.options.tolerance_m)
    notes = [
        f"Path errors are root mean squares. Recovery: from the first blast's arrival "
        f"until the path error stays within {tolerance}; 0 where it never left. "
        "Flies on: never hit the ground, turned over or diverged, and came back or "
        "not; whether the blast broke it is not judged by that."
    ]
    for name, limit in THRESHOLDS[flights.vehicle.model].items():
        notes.append(f"{capitalised(THRESHOLD_WORDS[name])}: {limit.source}.")
    notes += [f"{capitalised(warning)}." for warning in warnings_of(flights)]
    return [line for note in notes for line in textwrap.wrap(note, WIDTH)]


def _interval(flags: np.ndarray) -> str:
    low, high = (100 * share for share in share_interval(flags))
    return f"{100 * np.mean(flags):.4g} % [{low:.4g} to {high:.4g} %]"


def _number(name: str, values: ArrayLike) -> str:
    """Return a number with its unit, or the quantiles of several."""
    known = np.asarray(values)
    if not known.ndim:
        return _one(name, float(known))
    return ", ".join(_one(name, value, 3) for value in quantiles(known))


def _one(name: str, value: float, digits: int = 4) -> str:
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return {"recovery_time_s": "never here", "arrival_s": "never"}.get(name, "-")
    if 0 < abs(value) < 1e-6:
        return printed_number(name, 0.0)
    return printed_number(name, value, digits) if name else significant(value, digits)


def _yes(value: bool) -> str:
    return "yes" if value else "no"
