"""The answer of `jblast fly`: effects on the vehicles, and the tables of their flights.

`jblast discover` reads the table of a flight. Besides position, velocity and attitude
it has the direction of the rotors' thrust (body z in world axes), because acceleration
by thrust is linear in this direction, and not in the quaternion.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from jblast.autopilot.estimator import Thrown
from jblast.quantities import QUANTITIES
from jblast.report.words import (
    aligned,
    capitalised,
    comma_separated,
    hanging,
    parameter_words,
    printed_number,
    significant,
)
from jblast.results import Document
from jblast.study.flight_results import (
    EXPOSURES,
    METRICS,
    Flights,
    Flown,
    flies_on,
    hold_words,
    metric,
    past_threshold,
    quantiles,
    share_interval,
    target_of,
    warnings_of,
)
from jblast.vehicle import Trajectory
from jblast.vehicle.metrics import THRESHOLDS, Threshold

WORLD, BODY, ROTORS = ("east", "north", "up"), "xyz", "1234"
COLUMNS = {
    "position_m": [f"{axis}_m" for axis in WORLD],
    "velocity_m_s": [f"velocity_{axis}_m_s" for axis in WORLD],
    "quaternion": [f"quaternion_{part}" for part in "ijkw"],
    "body_rate_rad_s": [f"body_rate_{axis}_rad_s" for axis in BODY],
    "rotor_speed_rad_s": [f"rotor_speed_{n}_rad_s" for n in ROTORS],
    "force_n": [f"force_{axis}_n" for axis in WORLD],
    "moment_n_m": [f"moment_{axis}_n_m" for axis in BODY],
}
"""Columns of the table, by part of the trajectory."""
PULL = [f"pull_{axis}" for axis in WORLD]
SET_POINT = [f"set_point_{axis}_m" for axis in WORLD]
WORDS = {
    "error_before_m": "path error before",
    "error_at_blast_m": "path error at arrival",
    "error_after_m": "path error after",
    "peak_deviation_m": "peak deviation",
    "peak_time_s": "  time after arrival",
    "recovery_time_s": "recovery time",
    "peak_overpressure_pa": QUANTITIES["peak_overpressure_pa"].words,
    "peak_acceleration_m_s2": "peak acceleration",
    "fireball_time_s": "time in a fireball",
}
THRESHOLD_WORDS = {
    "peak_overpressure_pa": "threshold of overpressure",
    "peak_acceleration_m_s2": "threshold of acceleration",
    "fireball_time_s": "threshold of time in a fireball",
}
MET = ("arrival_s", "distance_m", "scaled_distance", "overpressure_pa")
"""Numbers of an `Encounter` that are printed for each blast."""
MAX_NAMED = 100
"""Largest number of lost vehicles listed in the JSON: the table has all of them."""
PARTS = {"position": "place", "velocity": "moves", "attitude": "turn"}
"""Parts of a state, with the beginning of their names in `EstimateThrown`."""
UNITS = {"place": "_m", "moves": "_m_s", "turn": "_rad"}
EastNorthUpM = tuple[float, float, float]


def trajectory_csv(
    trajectory: Trajectory,
    path_error_m: Float[np.ndarray, " time"],
    comment: str,
    set_point_m: Float[np.ndarray, "time 3"] | None = None,
) -> str:
    """Return the rows of one flight, up to its divergence if it diverged.

    Args:
        trajectory: The flight.
        path_error_m: Path error of each row.
        comment: Text of the first line.
        set_point_m: Set point of each row, of a mission.
    """
    names = [name for part in COLUMNS.values() for name in part]
    parts = [np.asarray(trajectory.time_s)[:, None]]
    parts += [np.asarray(getattr(trajectory, name)) for name in COLUMNS]
    rows = np.hstack([*parts, path_error_m[:, None]])
    # the rows of a flight are not finite after its divergence
    known = np.isfinite(rows).all(axis=1)
    rows = rows[known]
    first = 1 + names.index("quaternion_i")
    # SciPy has the scalar last, as the columns have
    attitude = Rotation.from_quat(rows[:, first : first + 4]).as_matrix()
    rows = np.hstack([rows, attitude[:, :, 2]])
    columns = ["time_s", *names, "path_error_m", *PULL]
    if set_point_m is not None:
        rows = np.hstack([rows, set_point_m[known]])
        columns += SET_POINT
    numbers = ([f"{value:.12g}" for value in row] for row in rows)
    return f"# {comment}\n" + comma_separated([columns, *numbers])


def flights_text(flights: Flights) -> str:
    """Return results, blasts, sampled parameters and notes, for the terminal."""
    lines = [_title(flights), "", *aligned(_holds(flights))]
    estimates = [(hold_words(name), one.thrown) for name, one in flights.holds.items()]
    lines += estimate_lines(estimates, flights.blasts, number_words)
    lines += ["", *aligned(_blasts(flights)), ""]
    if flights.drawn:
        lines += [*aligned(_drawn(flights)), ""]
    lines += _notes(flights)
    return "\n".join(lines) + "\n"


def _title(flights: Flights) -> str:
    vehicle, options = flights.vehicle, flights.options
    place = ", ".join(f"{float(x):g}" for x in target_of(vehicle))
    who = vehicle.model.capitalize()
    if flights.count > 1:
        who = f"{flights.count:,} x {who}"
    return (
        f"{who} holding ({place}) m for {flights.seconds:g} s "
        f"(rk4, steps of {printed_number('step_s', options.step_s)})"
    )


def _drawn(flights: Flights) -> list[tuple[str, ...]]:
    head = "sampled, by --seed"
    if flights.count > 1:
        head += ": 5 %, 50 %, 95 %"
    return [
        (head, ""),
        *(
            (parameter_words(name), number_words(name, values))
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
                number_words("arrival_s", encounter.arrival_s[..., n]),
                number_words("distance_m", encounter.distance_m[..., n]),
                number_words("", encounter.scaled_distance[..., n]),
                number_words("overpressure_pa", encounter.overpressure_pa[..., n]),
                _yes(bool(inside))
                if flights.count == 1
                else f"{100 * np.mean(inside):.3g} %",
            )
        )
    return rows


def _holds(flights: Flights) -> list[tuple[str, ...]]:
    """Return a row for each metric, a column for each position controller."""
    holds = flights.holds
    several = flights.count > 1
    head = [
        hold_words(name) + (" (the scene's)" if name == flights.own else "")
        for name in holds
    ]
    rows = [("5 %, 50 %, 95 %" if several else "", *head)]
    for name in METRICS:
        cells = [number_words(name, metric(f, name)) for f in holds.values()]
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
    """Return rows on pressure, acceleration and fireball, with their thresholds."""
    model, rows = flights.vehicle.model, []
    for name in EXPOSURES:
        held = flights.holds.values()
        rows.append((WORDS[name], *(number_words(name, metric(f, name)) for f in held)))
        past = [past_threshold(model, f)[name] for f in held]
        cells = [
            "unknown"
            if each is None
            else _interval(each)
            if each.ndim
            else _yes(bool(each))
            for each in past
        ]
        limit = THRESHOLDS[model][name].value
        limit_words = "" if limit is None else f" {_one(name, limit, 3)}"
        rows.append((f"  above{limit_words or ' a threshold'}", *cells))
    return rows


def _notes(flights: Flights) -> list[str]:
    """Return definitions of the terms, sources of the thresholds, and warnings."""
    tolerance = printed_number("tolerance_m", flights.options.tolerance_m)
    notes = [
        f"Path errors are root mean squares. Recovery time: from the first blast's "
        f"arrival until the path error stays within {tolerance}; 0 if it never exceeds "
        "that. Flies on: did not hit the ground, turn over or diverge; structural "
        "damage is not included."
    ]
    for name, limit in THRESHOLDS[flights.vehicle.model].items():
        notes.append(f"{capitalised(THRESHOLD_WORDS[name])}: {limit.source}.")
    lines = ["Definitions and assumptions"]
    lines += [line for note in notes for line in hanging(note, 2)]
    if warnings := warnings_of(flights):
        lines += ["", "Warnings"]
        lines += [
            line
            for warning in warnings
            for line in hanging(f"{capitalised(warning)}.", 2)
        ]
    return lines


def _interval(flags: np.ndarray) -> str:
    low, high = (100 * share for share in share_interval(flags))
    return f"{100 * np.mean(flags):.4g} % [{low:.4g} to {high:.4g} %]"


def number_words(name: str, values: ArrayLike | float) -> str:
    """Return a number with its unit, or the quantiles of several."""
    known = np.asarray(values)
    if not known.ndim:
        return _one(name, float(known))
    return ", ".join(_one(name, value, 3) for value in quantiles(known))


def _one(name: str, value: float, digits: int = 4) -> str:
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return {"recovery_time_s": "not reached", "arrival_s": "never"}.get(name, "-")
    # rounding of the integration: 1e-6 of any unit here is far below what matters
    if 0 < abs(value) < 1e-6:
        return printed_number(name, 0.0)
    return printed_number(name, value, digits) if name else significant(value, digits)


def _yes(value: bool) -> str:
    return "yes" if value else "no"


@dataclass(frozen=True)
class BlastMet:
    """A blast at one vehicle.

    Attributes:
        charge: Name of the charge; "" for a single one.
        arrival_s: Arrival on the scene's clock.
        distance_m: Distance from the charge to the vehicle at the arrival.
        scaled_distance: Sachs-scaled distance [m/kg^(1/3)].
        overpressure_pa: Incident peak overpressure there.
        in_range: Whether its laws are valid there.
    """

    charge: str
    arrival_s: float
    distance_m: float
    scaled_distance: float
    overpressure_pa: float
    in_range: bool


@dataclass(frozen=True)
class Quantiles:
    """Quantiles of a number over the vehicles; some may be infinite.

    Attributes:
        q05: 5 % quantile.
        q50: Median.
        q95: 95 % quantile.
    """

    q05: float
    q50: float
    q95: float


@dataclass(frozen=True)
class BlastMetBySeveral:
    """A blast at several vehicles; attributes as in `BlastMet`.

    Attributes:
        charge: Name of the charge; "" for a single one.
        arrival_s: Arrival on the scene's clock.
        distance_m: Distance from the charge to the vehicle at the arrival.
        scaled_distance: Sachs-scaled distance [m/kg^(1/3)].
        overpressure_pa: Incident peak overpressure there.
        in_range_share: Share of the vehicles for which its laws are valid.
    """

    charge: str
    arrival_s: Quantiles
    distance_m: Quantiles
    scaled_distance: Quantiles
    overpressure_pa: Quantiles
    in_range_share: float


@dataclass(frozen=True)
class EstimateThrown:
    """Errors of the state estimate before and after a blast.

    Errors before are root mean squares over the second before the arrival. Errors after
    are the largest until the next blast, 10 s at most. Several vehicles have quantiles.

    Attributes:
        charge: Name of the charge; "" for a single one.
        place_before_m: Error of the position before.
        place_m: Error of the position after.
        moves_before_m_s: Error of the velocity before.
        moves_m_s: Error of the velocity after.
        turn_before_rad: Error of the attitude before.
        turn_rad: Error of the attitude after.
    """

    charge: str
    place_before_m: float | Quantiles
    place_m: float | Quantiles
    moves_before_m_s: float | Quantiles
    moves_m_s: float | Quantiles
    turn_before_rad: float | Quantiles
    turn_rad: float | Quantiles


@dataclass(frozen=True)
class Outcome:
    """Result of one flight.

    Attributes:
        error_before_m: Path error before the first blast.
        error_at_blast_m: Path error at its arrival.
        error_after_m: Path error after it.
        peak_deviation_m: Largest path error after it.
        peak_time_s: Time of that after the arrival.
        recovery_time_s: Time from the arrival until it stays within the tolerance.
        peak_overpressure_pa: Incident peak overpressure of the strongest blast.
        peak_acceleration_m_s2: Largest acceleration by the blasts alone.
        fireball_time_s: Time within a fireball while it is luminous.
        recovered: Whether it returned within the tolerance.
        settled: Whether it was within the tolerance before the blast.
        crashed: Whether it crashed.
        lost: Whether the integration diverged.
        flies_on: Whether it neither crashed nor diverged.
        past_threshold: Whether each exposure exceeds its threshold; null if unknown.
    """

    error_before_m: float
    error_at_blast_m: float
    error_after_m: float
    peak_deviation_m: float
    peak_time_s: float
    recovery_time_s: float
    peak_overpressure_pa: float
    peak_acceleration_m_s2: float
    fireball_time_s: float
    recovered: bool
    settled: bool
    crashed: bool
    lost: bool
    flies_on: bool
    past_threshold: Mapping[str, bool | None]


@dataclass(frozen=True)
class Share:
    """A share of the vehicles, with the interval of its probability.

    Attributes:
        value: The share.
        q05: Lower bound of the probability's 90 % interval.
        q95: Upper bound.
    """

    value: float
    q05: float
    q95: float


@dataclass(frozen=True)
class OutcomeOfSeveral:
    """Results of several flights; quantiles of the attributes of `Outcome`.

    Attributes:
        error_before_m: Path error before the first blast.
        error_at_blast_m: Path error at its arrival.
        error_after_m: Path error after it.
        peak_deviation_m: Largest path error after it.
        peak_time_s: Time of that after the arrival.
        recovery_time_s: Time from the arrival until it stays within the tolerance.
        peak_overpressure_pa: Incident peak overpressure of the strongest blast.
        peak_acceleration_m_s2: Largest acceleration by the blasts alone.
        fireball_time_s: Time within a fireball while it is luminous.
        recovered_share: Share of the vehicles that recovered.
        settled_share: Share of the vehicles that were settled.
        crashed_share: Share of the vehicles that crashed.
        flies_on_share: Share of the vehicles that fly on, with its interval.
        past_threshold_share: Share above the threshold of each exposure; null if
            unknown.
        lost: Number of flights that diverged.
        lost_vehicles: Numbers of these vehicles, the first hundred.
    """

    error_before_m: Quantiles
    error_at_blast_m: Quantiles
    error_after_m: Quantiles
    peak_deviation_m: Quantiles
    peak_time_s: Quantiles
    recovery_time_s: Quantiles
    peak_overpressure_pa: Quantiles
    peak_acceleration_m_s2: Quantiles
    fireball_time_s: Quantiles
    recovered_share: float
    settled_share: float
    crashed_share: float
    flies_on_share: Share
    past_threshold_share: Mapping[str, float | None]
    lost: int
    lost_vehicles: tuple[int, ...]


@dataclass(frozen=True)
class FlightsAnswer(Document):
    """The answer of `jblast fly`: options, blasts and results.

    Attributes:
        scene: The scene's file.
        seed: Seed of the priors.
        vehicle: Model of the vehicle.
        vehicles: Number of vehicles.
        position_m: Initial position: east, north, up.
        target_m: Target position.
        yaw_rad: Heading.
        seconds: Length of the flight [s].
        step_s: Step of the integrator.
        integrator: Name of the integrator.
        backend: Backend of the computation.
        tolerance_m: Path error within which a vehicle has recovered.
        load: "laws", "custom profile" or the user's function.
        drawn: Values sampled from priors; quantiles of several.
        blasts: Each blast at the vehicles.
        thresholds: Thresholds by exposure.
        scene_hold: Position controller of the scene; null if it has none.
        holds: Results by position controller.
        estimator: "ekf", or "" for flights with the true state.
        estimates: Errors of the estimate at each blast, by position controller.
        warnings: Limitations, as sentences.
    """

    scene: str
    seed: int
    vehicle: str
    vehicles: int
    position_m: EastNorthUpM
    target_m: EastNorthUpM
    yaw_rad: float
    seconds: float
    step_s: float
    integrator: str
    backend: str
    tolerance_m: float
    load: str
    drawn: Mapping[str, float | Quantiles]
    blasts: tuple[BlastMet | BlastMetBySeveral, ...]
    thresholds: Mapping[str, Threshold]
    scene_hold: str | None
    holds: Mapping[str, Outcome | OutcomeOfSeveral]
    estimator: str
    estimates: Mapping[str, tuple[EstimateThrown, ...]]
    warnings: tuple[str, ...]


def flights_answer(flights: Flights, *, scene: str, seed: int) -> FlightsAnswer:
    """Return the answer on flights.

    Args:
        flights: The flights.
        scene: The scene's file.
        seed: Seed of the sampled parameters.
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
        integrator="rk4",
        backend=options.backend,
        tolerance_m=options.tolerance_m,
        load=options.load_words,
        drawn={
            name: _spread(values) if several else float(values)
            for name, values in flights.drawn.items()
        },
        blasts=tuple(blast(flights, first, n) for n in range(len(flights.blasts))),
        thresholds=THRESHOLDS[vehicle.model],
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
    """Return a row for each vehicle and controller: sampled parameters and results."""
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
            cells = (
                ("true" if value else "false")
                if isinstance(value, np.bool_)
                else f"{value:.9g}"
                for value in row
            )
            table.append([str(lane), hold, *cells])
    return comma_separated(table)


def _outcome(model: str, flown: Flown) -> Outcome:
    """Return the result of one flight."""
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
        lost_vehicles=tuple(lost[:MAX_NAMED].tolist()),
    )


def _blast(flights: Flights, flown: Flown, n: int) -> BlastMet:
    """Return a blast at one vehicle."""
    encounter = flown.encounter
    return BlastMet(
        charge=flights.blasts[n],
        **{name: float(getattr(encounter, name)[n]) for name in MET},
        in_range=bool(encounter.in_range[n]),
    )


def _blast_of_several(flights: Flights, flown: Flown, n: int) -> BlastMetBySeveral:
    """Return a blast at several vehicles."""
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


def estimates_thrown(
    thrown: Thrown, blasts: Iterable[str], of: Callable[[Any], Any]
) -> tuple[EstimateThrown, ...]:
    """Return the errors of the estimate before and after each blast.

    Args:
        thrown: The errors; the last axis is that of the blasts.
        blasts: Names of the charges.
        of: Function that summarises the vehicles' numbers.
    """
    found = thrown._asdict()
    return tuple(
        EstimateThrown(charge=name, **{k: of(v[..., n]) for k, v in found.items()})
        for n, name in enumerate(blasts)
    )


def estimate_lines(
    estimates: Sequence[tuple[str, Thrown | None]],
    blasts: Sequence[str],
    number: Callable[[str, ArrayLike], str],
) -> list[str]:
    """Return lines on the estimates of flights; none if they used the true state.

    Args:
        estimates: Pairs of name and errors; None for flights with the true state.
        blasts: Names of the charges.
        number: Function that prints a number by the name of its unit.
    """
    rows = []
    for own, thrown in estimates:
        if thrown is None:
            continue
        found = thrown._asdict()
        for n, blast in enumerate(blasts):
            cells = []
            for part in PARTS.values():
                unit = UNITS[part]
                before = number(f"{part}{unit}", found[f"{part}_before{unit}"][..., n])
                after = number(f"{part}{unit}", found[f"{part}{unit}"][..., n])
                cells.append(f"{before} -> {after}")
            name = blast or "the charge"
            rows.append((f"{name}, {own}" if own else name, *cells))
    if not rows:
        return []
    head = ("error of the estimate", *PARTS)
    return [
        "",
        *aligned([head, *rows]),
        "Root mean square in the second before each blast -> largest until the next",
        "blast, 10 s at most.",
    ]
