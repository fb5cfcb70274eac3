"""The answer of `jblast fly` for a mission."""

import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from jblast.missions.mission import geodetic
from jblast.missions.plan import COMMANDS
from jblast.report.flights import (
    MET,
    BlastMet,
    EastNorthUpM,
    EstimateThrown,
    estimate_lines,
    estimates_thrown,
    number_words,
)
from jblast.report.words import (
    WIDTH,
    aligned,
    capitalised,
    parameter_words,
    printed_number,
)
from jblast.results import Document, among
from jblast.study.missions import WATCHED_S, Disturbance, MissionFlight, Waypoint
from jblast.vehicle.metrics import THRESHOLDS, Threshold


def mission_text(flight: MissionFlight) -> str:
    """Return waypoints, blasts, sampled parameters and notes, for the terminal."""
    lines = [*_title(flight), "", *aligned(_waypoints(flight)), ""]
    lines += aligned(_blasts(flight)) if flight.disturbances else ["no blasts"]
    names = [one.charge for one in flight.disturbances]
    lines += estimate_lines([("", flight.thrown)], names, number_words)
    if flight.drawn:
        drawn = [
            (parameter_words(name), number_words(name, value))
            for name, value in flight.drawn.items()
        ]
        lines += ["", *aligned([("sampled, by --seed", ""), *drawn])]
    lines += ["", *_notes(flight)]
    return "\n".join(lines) + "\n"


def _title(flight: MissionFlight) -> list[str]:
    reached = sum(one.reached for one in flight.waypoints)
    options = flight.options
    who = f"{flight.vehicle.model.capitalize()} on {flight.mission.plan.source}"
    length = printed_number("step_s", options.step_s)
    step = f"(rk4, steps of {length})"
    if flight.crash:
        end = f"crashed ({flight.crash})"
    elif math.isfinite(flight.disarmed_s):
        end = f"landed, disarmed after {flight.disarmed_s:.4g} s"
    else:
        end = f"still in flight at the time limit, {flight.seconds:.4g} s"
    return [
        f"{who} {step}:",
        f"{end}; {reached} of {len(flight.waypoints)} waypoints reached",
    ]


def _waypoints(flight: MissionFlight) -> list[tuple[str, ...]]:
    rows = [("waypoint", "reached", "closest", "path error rms", "largest")]
    for one in flight.waypoints:
        rows.append(
            (
                f"{one.item.number} {COMMANDS[one.item.command].name}",
                f"{one.time_s:.2f} s" if one.reached else "no",
                number_words("path_error_m", one.error_m),
                number_words("path_error_m", one.path_error_rms_m),
                number_words("path_error_m", one.path_error_max_m),
            )
        )
    return rows


def _blasts(flight: MissionFlight) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (
            *("blast", "arrives", "leg to", "distance", "peak"),
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
                number_words("arrival_s", float(came.arrival_s[n])),
                to,
                number_words("distance_m", float(came.distance_m[n])),
                number_words("overpressure_pa", float(came.overpressure_pa[n])),
                number_words("path_error_m", one.error_before_m),
                number_words("path_error_m", one.peak_deviation_m),
                number_words("recovery_time_s", one.recovery_time_s),
            )
        )
    return rows


def _notes(flight: MissionFlight) -> list[str]:
    tolerance = printed_number("tolerance_m", flight.options.tolerance_m)
    notes = [
        "A waypoint is reached within its acceptance radius. Closest: least distance "
        "from it. Path error: distance from the set point, which moves along the "
        "plan's legs. Deviation and recovery are measured over the "
        f"{WATCHED_S:g} s after a blast, or up to the next one; recovered: the path "
        f"error stays within {tolerance}."
    ]
    notes += [f"{capitalised(warning)}." for warning in mission_warnings(flight)]
    return [line for note in notes for line in textwrap.wrap(note, WIDTH)]


@dataclass(frozen=True)
class BlastFlownThrough:
    """Effect of one blast; null if it arrives before or after the flight.

    Attributes:
        of: Name of the charge.
        waypoint: Number of the next item at its arrival.
        rest: Path errors.
        recovered: Whether the path error returned within the tolerance.
    """

    of: Disturbance = field(metadata=among("charge"))
    waypoint: int | None
    rest: Disturbance = field(
        metadata=among(
            *("error_before_m", "peak_deviation_m", "peak_time_s", "recovery_time_s")
        )
    )
    recovered: bool | None


@dataclass(frozen=True)
class WaypointFlown:
    """One item of the flight; an item that is flown again has another entry.

    Attributes:
        index: Number of the item in its plan.
        command: MAVLink number of the command.
        flown: Errors, and the time of arrival.
    """

    index: int
    command: int
    flown: Waypoint = field(
        metadata=among(
            *("reached", "time_s", "error_m", "path_error_rms_m", "path_error_max_m")
        )
    )


@dataclass(frozen=True)
class MissionAnswer(Document):
    """The answer of `jblast fly` for a mission: options, blasts and results.

    Attributes:
        scene: The scene's file.
        mission: The plan's file.
        seed: Seed of the priors.
        vehicle: Model of the vehicle.
        home: Latitude, longitude [degree] and height [m] of the home position.
        home_m: Home position: east, north, up.
        seconds: Time from calibration until a second after it was disarmed [s].
        step_s: Step of the integrator and of the controller.
        integrator: Name of the integrator.
        backend: Backend of the computation.
        tolerance_m: Path error within which a vehicle has recovered.
        load: "laws", "custom profile" or the user's function.
        drawn: Values sampled from priors.
        completed: Whether it ended without a crash, with each waypoint reached.
        disarmed_s: Time at which it was disarmed after landing; null if it was not.
        crashed: Whether it crashed.
        crash: Cause of the crash; "" without one.
        waypoints: Result of each item.
        blasts: Each blast at the vehicle.
        disturbances: Effect of each blast.
        estimator: "ekf", or "" for a flight with the true state.
        estimates: Errors of the estimate at each blast; none with the true state.
        peak_overpressure_pa: Incident peak overpressure of the strongest blast.
        peak_acceleration_m_s2: Largest acceleration by the blasts alone.
        thresholds: Thresholds of these two, by exposure.
        warnings: Limitations, as sentences.
    """

    scene: str
    mission: str
    seed: int
    vehicle: str
    home: tuple[float, float, float]
    home_m: EastNorthUpM
    seconds: float
    step_s: float
    integrator: str
    backend: str
    tolerance_m: float
    load: str
    drawn: Mapping[str, float]
    completed: bool
    disarmed_s: float
    crashed: bool
    crash: str
    waypoints: tuple[WaypointFlown, ...]
    blasts: tuple[BlastMet, ...]
    disturbances: tuple[BlastFlownThrough, ...]
    estimator: str
    estimates: tuple[EstimateThrown, ...]
    peak_overpressure_pa: float
    peak_acceleration_m_s2: float
    thresholds: Mapping[str, Threshold]
    warnings: tuple[str, ...]


def mission_answer(flight: MissionFlight, *, scene: str, seed: int) -> MissionAnswer:
    """Return the answer on a mission.

    Args:
        flight: The flight.
        scene: The scene's file.
        seed: Seed of the sampled parameters.
    """
    options, mission = flight.options, flight.mission
    limits = THRESHOLDS[flight.vehicle.model]
    judged = ("peak_overpressure_pa", "peak_acceleration_m_s2")
    lat, lon, alt = geodetic(mission.frame, mission.home_m).tolist()
    east, north, up = mission.home_m.tolist()
    charges = [one.charge for one in flight.disturbances]
    return MissionAnswer(
        scene=scene,
        mission=mission.plan.source,
        seed=seed,
        vehicle=flight.vehicle.model,
        home=(lat, lon, alt),
        home_m=(east, north, up),
        seconds=flight.seconds,
        step_s=options.step_s,
        integrator="rk4",
        backend=options.backend,
        tolerance_m=options.tolerance_m,
        load=options.load_words,
        drawn=flight.drawn,
        completed=flight.completed,
        disarmed_s=flight.disarmed_s,
        crashed=bool(flight.crash),
        crash=flight.crash,
        waypoints=tuple(
            WaypointFlown(one.item.number, one.item.command, one)
            for one in flight.waypoints
        ),
        blasts=tuple(
            BlastMet(
                charge=charge,
                **{name: float(getattr(flight.encounter, name)[n]) for name in MET},
                in_range=bool(flight.encounter.in_range[n]),
            )
            for n, charge in enumerate(charges)
        ),
        disturbances=tuple(_through(flight, one) for one in flight.disturbances),
        estimator=options.estimator,
        estimates=()
        if flight.thrown is None
        else estimates_thrown(flight.thrown, charges, float),
        peak_overpressure_pa=float(flight.exposure.peak_overpressure_pa),
        peak_acceleration_m_s2=float(flight.exposure.peak_acceleration_m_s2),
        thresholds={name: limits[name] for name in judged},
        warnings=tuple(mission_warnings(flight)),
    )


def mission_warnings(flight: MissionFlight) -> list[str]:
    """Return the limitations of a mission, as sentences."""
    warnings = list(flight.notes)
    plan = flight.mission.plan
    warnings += [plan.ignored] if plan.ignored else []
    if flight.crash:
        warnings.append(
            f"the vehicle {flight.crash}; results after that are not meaningful"
        )
    elif math.isnan(flight.disarmed_s):
        warnings.append("the flight reached the time limit before landing")
    outside = ~np.asarray(flight.encounter.in_range)
    for one, away in zip(flight.disturbances, outside, strict=True):
        name = f"blast {one.charge}" if one.charge else "the blast"
        if one.waypoint < 0:
            warnings.append(f"{name} arrives before or after the flight")
        elif away:
            by_law = flight.options.profile is None
            limit = "range of the laws" if by_law else "cases of the profile"
            warnings.append(
                f"{name} lies outside the {limit}: its load is not reliable"
            )
    return warnings


def _through(flight: MissionFlight, one: Disturbance) -> BlastFlownThrough:
    flown = one.waypoint >= 0
    return BlastFlownThrough(
        one,
        flight.waypoints[one.waypoint].item.number if flown else None,
        one,
        math.isfinite(one.recovery_time_s) if flown else None,
    )
