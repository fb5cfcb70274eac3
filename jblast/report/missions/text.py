"""A mission through blasts, in words."""

import math
import textwrap

import numpy as np
from numpy.typing import ArrayLike

from jblast.missions.plan.commands import COMMANDS
from jblast.report.flights.estimates import estimate_lines
from jblast.report.lines import WIDTH
from jblast.report.missions.document import mission_warnings
from jblast.report.numbers import printed_number, significant
from jblast.report.tables import aligned
from jblast.report.words import capitalised, parameter_words
from jblast.study.missions.outcome import WATCHED_S
from jblast.study.missions.records import MissionFlight


def mission_text(flight: MissionFlight) -> str:
    """Return what the terminal shows."""
    lines = [*_title(flight), ""]
    if flight.drawn:
        drawn = [
            (parameter_words(name), _number(name, value))
            for name, value in flight.drawn.items()
        ]
        lines += [*aligned([("drawn, by --seed", ""), *drawn]), ""]
    lines += [*aligned(_waypoints(flight)), ""]
    lines += aligned(_blasts(flight))
    names = [one.charge for one in flight.disturbances]
    lines += estimate_lines([("", flight.thrown)], names, _any_number)
    lines += ["", *_notes(flight)]
    return "\n".join(lines) + "\n"


def _title(flight: MissionFlight) -> list[str]:
    reached = sum(one.reached for one in flight.waypoints)
    options = flight.options
    who = f"{flight.vehicle.model.capitalize()} on {flight.mission.plan.source}"
    how = f"({options.integrator}, steps of {printed_number('step_s', options.step_s)})"
    if flight.crash:
        end = f"{flight.crash}: a crash"
    elif math.isfinite(flight.disarmed_s):
        end = f"landed, disarmed after {flight.disarmed_s:.4g} s"
    else:
        end = f"cut off after {flight.seconds:.4g} s, in flight"
    return [
        f"{who} {how}:",
        f"{end}; {reached} of {len(flight.waypoints)} waypoints reached",
    ]


def _waypoints(flight: MissionFlight) -> list[tuple[str, ...]]:
    rows = [("waypoint", "reached", "missed by", "path error rms", "greatest")]
    for one in flight.waypoints:
        rows.append(
            (
                f"{one.item.number} {COMMANDS[one.item.command].name}",
                f"{one.time_s:.2f} s" if one.reached else "no",
                _number("path_error_m", one.error_m),
                _number("path_error_m", one.path_error_rms_m),
                _number("path_error_m", one.path_error_max_m),
            )
        )
    return rows


def _blasts(flight: MissionFlight) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (
            *("blast", "arrives", "on the way to", "distance", "peak"),
            *("path error before", "peak deviation", "recovery"),
        )
    ]
    came = flight.encounter
    for n, one in enumerate(flight.disturbances):
        flown = one.waypoint >= 0
        to = str(flight.waypoints[one.waypoint].item.number) if flown else "-"
        rows.append(
            (
                one.charge or "the charge",
                _number("arrival_s", float(came.arrival_s[n])),
                to,
                _number("distance_m", float(came.distance_m[n])),
                _number("overpressure_pa", float(came.overpressure_pa[n])),
                _number("path_error_m", one.error_before_m),
                _number("path_error_m", one.peak_deviation_m),
                _number("recovery_time_s", one.recovery_time_s),
            )
        )
    return rows


def _notes(flight: MissionFlight) -> list[str]:
    tolerance = printed_number("tolerance_m", flight.options.tolerance_m)
    notes = [
        "A waypoint is reached within its acceptance radius; missed by: the least "
        "distance from it. Path error: distance from the set point, which moves along "
        "the plan's legs. Deviation and recovery: of the "
        f"{WATCHED_S:g} s after a blast, or up to the next one; recovered is who stays "
        f"within {tolerance}."
    ]
    notes += [f"{capitalised(warning)}." for warning in mission_warnings(flight)]
    return [line for note in notes for line in textwrap.wrap(note, WIDTH)]


def _any_number(name: str, value: ArrayLike) -> str:
    return _number(name, float(np.asarray(value)))


def _number(name: str, value: float) -> str:
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return {"recovery_time_s": "not yet", "arrival_s": "never"}.get(name, "-")
    if 0 < abs(value) < 1e-6:
        return printed_number(name, 0.0)
    return printed_number(name, value, 4) if name else significant(value, 4)
