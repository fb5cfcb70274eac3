"""Answers on flights: `jblast fly`, hovering or on a mission, and `jblast serve`."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jblast.autopilot.estimator import Thrown
from jblast.missions.mission import geodetic
from jblast.quantities import QUANTITIES
from jblast.report.flight_figures import distribution_figure, mission_map, time_figure
from jblast.report.map_figures import map_figure
from jblast.report.maps import Map, map_files
from jblast.report.numbers import (
    capitalised,
    parameter_words,
    printed_number,
    significant,
    unit_for,
)
from jblast.report.output import PROBLEM, Answer
from jblast.report.view import (
    Column,
    Facts,
    Lines,
    Picture,
    Table,
    View,
)
from jblast.results import ABSENT, Document, among, filled
from jblast.study.flight_results import (
    EXPOSURES,
    METRICS,
    Encounter,
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
from jblast.study.flight_tables import flight_csv, flights_csv
from jblast.study.mavlink_servers import serve_autopilot, serve_ground_station
from jblast.study.missions import (
    WATCHED_S,
    Disturbance,
    MissionFlight,
    Waypoint,
)
from jblast.vehicle.metrics import THRESHOLDS, Threshold
from jblast.world.remote.serving import serve_world

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
MET = ("arrival_s", "distance_m", "scaled_distance", "overpressure_pa")
"""Numbers of an `Encounter` in the document."""
PARTS = {"place": "position", "moves": "velocity", "turn": "attitude"}
"""Words of the parts of a state, by the beginning of their names in `Thrown`."""
FLAGS = ("recovered", "settled", "crashed", "past_threshold", "in_range_share")
"""Flags, which are shares over several vehicles."""
NEGLIGIBLE = 1e-6
"""Rounding of the integration: far below what matters in any unit here."""
MAX_NAMED = 100
"""Largest number of lost vehicles listed in the JSON: the table has all of them."""
FILES = ("flight.csv", "flights.csv", "flight.png", "distribution.png", "map.png")
FILES += ("mission.geojson", "mission.kml")
"""Files besides document and page, of which each answer has some."""


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


Numbers = float | Quantiles
"""A number of one vehicle, or its quantiles over several."""
EastNorthUpM = tuple[float, float, float]


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
class BlastMet:
    """A blast at the vehicles.

    Attributes:
        charge: Name of the charge; "" for a single one.
        arrival_s: Arrival on the scene's clock.
        distance_m: Distance from the charge to the vehicle at the arrival.
        scaled_distance: Sachs-scaled distance [m/kg^(1/3)].
        overpressure_pa: Incident peak overpressure there.
        in_range: Whether its laws are valid there, for one vehicle.
        in_range_share: Share of several vehicles for which they are.
    """

    charge: str
    arrival_s: Numbers
    distance_m: Numbers
    scaled_distance: Numbers
    overpressure_pa: Numbers
    in_range: bool | None = field(default=None, metadata=ABSENT)
    in_range_share: float | None = field(default=None, metadata=ABSENT)


@dataclass(frozen=True)
class EstimateThrown:
    """Errors of the state estimate before and after a blast.

    Errors before are root mean squares over the second before the arrival. Errors after
    are the largest until the next blast, 10 s at most.

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
    place_before_m: Numbers
    place_m: Numbers
    moves_before_m_s: Numbers
    moves_m_s: Numbers
    turn_before_rad: Numbers
    turn_rad: Numbers


@dataclass(frozen=True)
class Outcome:
    """Results of flights with one controller: of one flight, or of several.

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
        recovered_share: Share of several vehicles that recovered.
        settled_share: Share of the vehicles that were settled.
        crashed_share: Share of the vehicles that crashed.
        flies_on_share: Share of the vehicles that fly on, with its interval.
        past_threshold_share: Share above the threshold of each exposure; null if
            unknown.
        lost: Whether the integration diverged, or the number of flights that did.
        lost_vehicles: Numbers of these vehicles, the first hundred.
        flies_on: Whether it neither crashed nor diverged.
        past_threshold: Whether each exposure exceeds its threshold; null if unknown.
    """

    error_before_m: Numbers
    error_at_blast_m: Numbers
    error_after_m: Numbers
    peak_deviation_m: Numbers
    peak_time_s: Numbers
    recovery_time_s: Numbers
    peak_overpressure_pa: Numbers
    peak_acceleration_m_s2: Numbers
    fireball_time_s: Numbers
    recovered: bool | None = field(default=None, metadata=ABSENT)
    settled: bool | None = field(default=None, metadata=ABSENT)
    crashed: bool | None = field(default=None, metadata=ABSENT)
    recovered_share: float | None = field(default=None, metadata=ABSENT)
    settled_share: float | None = field(default=None, metadata=ABSENT)
    crashed_share: float | None = field(default=None, metadata=ABSENT)
    flies_on_share: Share | None = field(default=None, metadata=ABSENT)
    past_threshold_share: Mapping[str, float | None] | None = field(
        default=None, metadata=ABSENT
    )
    lost: bool | int = False
    lost_vehicles: tuple[int, ...] | None = field(default=None, metadata=ABSENT)
    flies_on: bool | None = field(default=None, metadata=ABSENT)
    past_threshold: Mapping[str, bool | None] | None = field(
        default=None, metadata=ABSENT
    )


@dataclass(frozen=True)
class FlownAnswer(Document):
    """The answer of `jblast fly`: options, blasts and limitations.

    Attributes:
        scene: The scene's file.
        seed: Seed of the priors.
        vehicle: Model of the vehicle.
        seconds: Length of the flight [s].
        step_s: Step of the integrator.
        integrator: Name of the integrator.
        backend: Backend of the computation.
        tolerance_m: Path error within which a vehicle has recovered.
        load: "laws", "custom profile" or the user's function.
        drawn: Values sampled from priors; quantiles of several.
        blasts: Each blast at the vehicles.
        thresholds: Thresholds by exposure.
        estimator: "ekf", or "" for flights with the true state.
        warnings: Limitations, as sentences.
    """

    scene: str
    seed: int
    vehicle: str
    seconds: float
    step_s: float
    integrator: str
    backend: str
    tolerance_m: float
    load: str
    drawn: Mapping[str, Numbers]
    blasts: tuple[BlastMet, ...]
    thresholds: Mapping[str, Threshold]
    estimator: str
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class FlightsAnswer(FlownAnswer):
    """The answer of `jblast fly` for one or several flights.

    Attributes:
        vehicles: Number of vehicles.
        position_m: Initial position: east, north, up.
        target_m: Target position.
        yaw_rad: Heading.
        scene_hold: Position controller of the scene; null if it has none.
        holds: Results by position controller.
        estimates: Errors of the estimate at each blast, by position controller.
    """

    vehicles: int
    position_m: EastNorthUpM
    target_m: EastNorthUpM
    yaw_rad: float
    scene_hold: str | None
    holds: Mapping[str, Outcome]
    estimates: Mapping[str, tuple[EstimateThrown, ...]]


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
class MissionAnswer(FlownAnswer):
    """The answer of `jblast fly` for a mission.

    Its length is from calibration until a second after the vehicle was disarmed.

    Attributes:
        mission: The plan's file.
        home: Latitude, longitude [degree] and height [m] of the home position.
        home_m: Home position: east, north, up.
        completed: Whether it ended without a crash, with each waypoint reached.
        disarmed_s: Time at which it was disarmed after landing; null if it was not.
        crashed: Whether it crashed.
        crash: Cause of the crash; "" without one.
        waypoints: Result of each item.
        disturbances: Effect of each blast.
        estimates: Errors of the estimate at each blast; none with the true state.
        peak_overpressure_pa: Incident peak overpressure of the strongest blast.
        peak_acceleration_m_s2: Largest acceleration by the blasts alone.
    """

    mission: str
    home: tuple[float, float, float]
    home_m: EastNorthUpM
    completed: bool
    disarmed_s: float
    crashed: bool
    crash: str
    waypoints: tuple[WaypointFlown, ...]
    disturbances: tuple[BlastFlownThrough, ...]
    estimates: tuple[EstimateThrown, ...]
    peak_overpressure_pa: float
    peak_acceleration_m_s2: float


def fly_answer(
    flown: Flights | MissionFlight, *, scene: str = "", seed: int = 0
) -> Answer:
    """Return the answer on flights or on a mission: document, view and table.

    Args:
        flown: The flights.
        scene: The scene's file.
        seed: Seed of the sampled parameters.
    """
    if isinstance(flown, MissionFlight):
        mission = mission_answer(flown, scene=scene, seed=seed)
        shown = mission_map(flown)
        title = f"Mission: {mission.mission}"
        files = map_files("mission", shown.features, flown.mission.frame, title)
        view = mission_view(mission, flown, shown)
        return Answer(mission, view, {"flight.csv": flight_csv(flown), **files})
    document = flights_answer(flown, scene=scene, seed=seed)
    view = flights_view(document, flown)
    if flown.count > 1:
        return Answer(document, view, {"flights.csv": flights_csv(flown)})
    return Answer(document, view, {"flight.csv": flight_csv(flown)})


def flights_answer(
    flights: Flights, *, scene: str = "", seed: int = 0
) -> FlightsAnswer:
    """Return the document of flights; arguments as of `fly_answer`."""
    vehicle, held = flights.vehicle, flights.holds
    return filled(
        FlightsAnswer,
        flights,
        flights.options,
        scene=scene,
        seed=seed,
        vehicle=vehicle.model,
        vehicles=flights.count,
        position_m=_place(vehicle.position),
        target_m=_place(target_of(vehicle)),
        yaw_rad=float(vehicle.yaw),
        integrator="rk4",
        load=flights.options.load_words,
        drawn={name: _numbers(values) for name, values in flights.drawn.items()},
        blasts=_blasts(next(iter(held.values())).encounter, flights.blasts),
        thresholds=THRESHOLDS[vehicle.model],
        scene_hold=flights.own,
        holds={name: _outcome(vehicle.model, flown) for name, flown in held.items()},
        estimates={
            name: _estimates(flown.thrown, flights.blasts)
            for name, flown in held.items()
            if flown.thrown is not None
        },
        warnings=tuple(warnings_of(flights)),
    )


def mission_answer(
    flight: MissionFlight, *, scene: str = "", seed: int = 0
) -> MissionAnswer:
    """Return the document of a mission; arguments as of `fly_answer`."""
    mission, model = flight.mission, flight.vehicle.model
    charges = [one.charge for one in flight.disturbances]
    judged = EXPOSURES[:2]
    return filled(
        MissionAnswer,
        flight,
        flight.options,
        {name: float(getattr(flight.exposure, name)) for name in judged},
        scene=scene,
        mission=mission.plan.source,
        seed=seed,
        vehicle=model,
        home=_place(geodetic(mission.frame, mission.home_m)),
        home_m=_place(mission.home_m),
        integrator="rk4",
        load=flight.options.load_words,
        crashed=bool(flight.crash),
        waypoints=tuple(
            WaypointFlown(one.item.number, one.item.command, one)
            for one in flight.waypoints
        ),
        blasts=_blasts(flight.encounter, charges),
        disturbances=tuple(_through(flight, one) for one in flight.disturbances),
        estimates=_estimates(flight.thrown, charges) if flight.thrown else (),
        thresholds={name: THRESHOLDS[model][name] for name in judged},
        warnings=tuple(_limitations(flight)),
    )


def _limitations(flight: MissionFlight) -> Iterator[str]:
    yield from flight.notes
    if flight.mission.plan.ignored:
        yield flight.mission.plan.ignored
    if flight.crash:
        yield f"the vehicle {flight.crash}; results after that are not meaningful"
    elif math.isnan(flight.disarmed_s):
        yield "the flight reached the time limit before landing"
    by_law = flight.options.profile is None
    limit = "range of the laws" if by_law else "cases of the profile"
    for one, inside in zip(flight.disturbances, flight.encounter.in_range, strict=True):
        name = f"blast {one.charge}" if one.charge else "the blast"
        if one.waypoint < 0:
            yield f"{name} arrives before or after the flight"
        elif not inside:
            yield f"{name} lies outside the {limit}: its load is not reliable"


def _through(flight: MissionFlight, one: Disturbance) -> BlastFlownThrough:
    if one.waypoint < 0:
        return BlastFlownThrough(one, None, one, None)
    number = flight.waypoints[one.waypoint].item.number
    return BlastFlownThrough(one, number, one, math.isfinite(one.recovery_time_s))


def _place(at: ArrayLike) -> tuple[float, float, float]:
    first, second, third = np.asarray(at).tolist()
    return first, second, third


def _numbers(values: ArrayLike) -> Numbers:
    """Return a number, or the quantiles of several, of which some may be infinite."""
    known = np.asarray(values)
    return Quantiles(*quantiles(known)) if known.ndim else float(known)


def _flag(flags: ArrayLike) -> bool | float:
    """Return a flag, or the share of several."""
    known = np.asarray(flags)
    return float(np.mean(known)) if known.ndim else bool(known)


def _blasts(met: Encounter, charges: Sequence[str]) -> tuple[BlastMet, ...]:
    flag = "in_range_share" if np.ndim(met.in_range) > 1 else "in_range"
    found = []
    for n, charge in enumerate(charges):
        values: dict[str, Any] = {x: _numbers(getattr(met, x)[..., n]) for x in MET}
        values[flag] = _flag(met.in_range[..., n])
        found.append(filled(BlastMet, values, charge=charge))
    return tuple(found)


def _estimates(thrown: Thrown, charges: Iterable[str]) -> tuple[EstimateThrown, ...]:
    return tuple(
        EstimateThrown(charge, *(_numbers(values[..., n]) for values in thrown))
        for n, charge in enumerate(charges)
    )


def _outcome(model: str, flown: Flown) -> Outcome:
    on, lost = flies_on(flown), np.flatnonzero(flown.lost)
    values = {name: _numbers(metric(flown, name)) for name in (*METRICS, *EXPOSURES)}
    flags: dict[str, Any] = {
        "recovered": _flag(np.isfinite(flown.metrics.recovery_time_s)),
        "settled": _flag(flown.metrics.settled),
        "crashed": _flag(flown.metrics.crashed),
        "flies_on": _flag(on),
        "past_threshold": {
            name: None if past is None else _flag(past)
            for name, past in past_threshold(model, flown).items()
        },
    }
    if not on.ndim:
        return Outcome(**values, **flags, lost=bool(lost.size))
    flags["flies_on"] = Share(flags["flies_on"], *share_interval(on))
    flags = {f"{name}_share": value for name, value in flags.items()}
    few = tuple(lost[:MAX_NAMED].tolist())
    return Outcome(**values, **flags, lost=lost.size, lost_vehicles=few)


def flights_view(answer: FlightsAnswer, flights: Flights | None = None) -> View:
    """Return results, blasts, sampled parameters, notes and figures of flights.

    Args:
        answer: The document.
        flights: The flights; None for no figure.
    """
    several = answer.vehicles > 1
    place = ", ".join(f"{x:g}" for x in answer.target_m)
    tolerance = printed_number("tolerance_m", answer.tolerance_m)
    spread = "5 %, 50 %, 95 %" if several else ""
    name, draw = ("flight.png", time_figure)
    if several:
        name, draw = ("distribution.png", distribution_figure)
    notes = [
        "Path errors are root mean squares. Recovery time: from the first blast's "
        f"arrival until the path error stays within {tolerance}; 0 if it never exceeds "
        "that. Flies on: did not hit the ground, turn over or diverge; structural "
        "damage is not included.",
        *(
            f"Threshold of {WORDS[n]}: {x.source}."
            for n, x in answer.thresholds.items()
        ),
    ]
    results = Table(
        [
            Column(spread, lambda row: row[0]),
            *(_results_of(hold, answer) for hold in answer.holds),
        ],
        [*_result_rows(answer)],
    )
    blasts = Table(
        [
            Column("blast", lambda one: one.charge),
            *_columns(arrival_s="arrives", distance_m="distance"),
            *_columns(scaled_distance="scaled [m/kg^(1/3)]", overpressure_pa="peak"),
            *_columns(in_range="in range", in_range_share="in range"),
        ],
        answer.blasts,
        f"Blasts{f': {spread}' if several else ''}",
    )
    errors = [
        (f"{_charge(one)}, {hold_words(hold)}", one)
        for hold, found in answer.estimates.items()
        for one in found
    ]
    return View(
        f"{f'{answer.vehicles:,} x ' if several else ''}{answer.vehicle.capitalize()} "
        f"holding ({place}) m for {answer.seconds:g} s {_steps(answer)}",
        [
            results,
            *_estimate_blocks(errors),
            blasts,
            _drawn(answer, f": {spread}" if several else ""),
            *([Picture(name, partial(draw, flights))] if flights else []),
            Lines("Definitions and assumptions", notes),
            _warnings(answer),
        ],
    )


def mission_view(answer: MissionAnswer, flight: MissionFlight, shown: Map) -> View:
    """Return waypoints, blasts, sampled parameters, notes and figures of a mission."""
    reached = sum(one.reached for one in flight.waypoints)
    end = f"still in flight at the time limit, {answer.seconds:.4g} s"
    if answer.crashed:
        end = f"crashed ({answer.crash})"
    elif math.isfinite(answer.disarmed_s):
        end = f"landed, disarmed after {answer.disarmed_s:.4g} s"
    tolerance = printed_number("tolerance_m", answer.tolerance_m)
    waypoints = Table(
        [
            Column("waypoint", lambda one: one.item.words.removeprefix("item ")),
            Column(
                "reached", lambda one: f"{one.time_s:.2f} s" if one.reached else "no"
            ),
            *_columns(error_m="closest", path_error_rms_m="path error rms"),
            *_columns(path_error_max_m="largest"),
        ],
        flight.waypoints,
        marked=lambda one: not one.reached,
    )
    through = [(one.waypoint, one.rest) for one in answer.disturbances]
    blasts = Table(
        [
            Column("blast", lambda row: _charge(row[0])),
            *_columns(0, arrival_s="arrives"),
            Column("leg to", lambda row: "-" if row[1] is None else f"{row[1]}"),
            *_columns(0, distance_m="distance", overpressure_pa="peak"),
            *_columns(2, error_before_m="path error before"),
            *_columns(2, peak_deviation_m="peak deviation", recovery_time_s="recovery"),
        ],
        [(met, *one) for met, one in zip(answer.blasts, through, strict=True)],
        caption="" if answer.blasts else "no blasts",
    )
    notes = (
        "A waypoint is reached within its acceptance radius. Closest: least distance "
        "from it. Path error: distance from the set point, which moves along the "
        "plan's legs. Deviation and recovery are measured over the "
        f"{WATCHED_S:g} s after a blast, or up to the next one; recovered: the path "
        f"error stays within {tolerance}."
    )
    return View(
        f"{answer.vehicle.capitalize()} on {answer.mission} {_steps(answer)}",
        [
            waypoints,
            blasts,
            *_estimate_blocks([(_charge(one), one) for one in answer.estimates]),
            _drawn(answer),
            Picture("map.png", partial(map_figure, shown)),
            Picture("flight.png", partial(time_figure, flight)),
            Lines("Definitions", [notes]),
            _warnings(answer),
        ],
        subtitle=f"{end}; {reached} of {len(flight.waypoints)} waypoints reached",
    )


def served(server: str, scene: str, *, seconds: float | None, **options: Any) -> Answer:
    """Serve a scene until interrupted, and return the answer.

    Args:
        server: "mavlink" for an autopilot, "ground_station", or "listen" for simulators
            over gRPC.
        scene: The scene's file.
        seconds: Duration; None: unlimited.
        options: Options of the server.
    """
    if server == "mavlink":
        flown = serve_autopilot(scene, seconds=seconds, **options)
        place = ", ".join(f"{x:.3g}" for x in flown.position_m)
        # a millisecond of tolerance: the time is a sum of periods in floating point
        short = seconds is not None and flown.seconds < seconds - 1e-3
        view = View(
            f"{flown.vehicle.capitalize()} flown by an autopilot for "
            f"{flown.seconds:g} s to ({place}) m: {flown.ended}",
            [Lines("", [f"Written: {name}" for name in flown.files])],
            subtitle=f"{flown.turns:,} steps, {flown.flown:,} of them in flight; late "
            f"answers {flown.late:,}, lost messages {flown.lost:,}, damaged messages "
            f"{flown.damaged:,}",
        )
        return Answer(flown, view, code=PROBLEM if short else 0)
    if server == "ground_station":
        watched = serve_ground_station(scene, seconds=seconds, **options)
        view = View(
            f"{watched.vehicle.capitalize()} for a ground station on "
            f"{watched.address}: {watched.ended}",
            subtitle=f"flights {watched.flights}, mission items {watched.items}, lost "
            f"messages {watched.lost}, damaged messages {watched.damaged}",
        )
        return Answer(watched, view)
    sent = serve_world(
        scene, ends_s=math.inf if seconds is None else seconds, **options
    )
    lost = [f"disconnected {one.entity or one.peer}: {one.why}" for one in sent.dropped]
    title = f"{sent.packets:,} packets sent, {sent.late:,} of them late"
    return Answer(sent, View(title, [Lines("", lost)]))


def _result_rows(answer: FlightsAnswer) -> Iterator[tuple[str, str, str]]:
    """Yield words, field and entry of each result."""
    for name in METRICS:
        yield WORDS[name], name, ""
    for name in ("recovered", "settled", "crashed", "flies_on"):
        yield name.replace("_", " "), name, ""
    for name in EXPOSURES:
        limit = answer.thresholds[name].value
        yield WORDS[name], name, ""
        words = "a threshold" if limit is None else printed(name, limit, 3)
        yield f"  above {words}", "past_threshold", name


def _results_of(name: str, answer: FlightsAnswer) -> Column:
    """Return the column of a position controller."""
    outcome = answer.holds[name]

    def cell(row: tuple[str, str, str]) -> str:
        _, field_name, entry = row
        value = getattr(outcome, field_name)
        if value is None:
            value = getattr(outcome, f"{field_name}_share")
        return printed(field_name, value[entry] if entry else value)

    own = " (the scene's)" if name == answer.scene_hold else ""
    return Column(hold_words(name) + own, cell)


def _columns(part: int | None = None, **heads: str) -> list[Column]:
    """Return columns of fields of the rows, or of one part of each row, by field."""

    def column(name: str, head: str) -> Column:
        def cell(row: Any) -> str:
            value = getattr(row if part is None else row[part], name)
            # a flag of one vehicle, or a share of several, whose column is dropped
            return "" if value is None else printed(name, value)

        return Column(head, cell)

    return [column(name, head) for name, head in heads.items()]


def _estimate_blocks(estimates: Sequence[tuple[str, EstimateThrown]]) -> list[Table]:
    """Return the errors of the estimate; none for flights with the true state."""
    parts = [*zip(PARTS.items(), ("_m", "_m_s", "_rad"), strict=True)]
    rows = [
        (name, words, *(f"{part}{when}{unit}" for when in ("_before", "")), one)
        for name, one in estimates
        for (part, words), unit in parts
    ]
    columns = [
        Column("error of the estimate", lambda row: row[0]),
        Column("", lambda row: row[1]),
        Column("before", lambda row: printed(row[2], getattr(row[4], row[2]))),
        Column("after", lambda row: printed(row[3], getattr(row[4], row[3]))),
    ]
    caption = (
        "Before: root mean square in the second before the blast. After: largest until "
        "the next blast, 10 s at most."
    )
    return [Table(columns, rows, caption=caption)] if rows else []


def _drawn(answer: FlownAnswer, spread: str = "") -> Facts:
    words = [(parameter_words(n), printed(n, x)) for n, x in answer.drawn.items()]
    return Facts(words, f"Sampled, by --seed{spread}")


def _warnings(answer: FlownAnswer) -> Lines:
    return Lines("Warnings", [f"{capitalised(one)}." for one in answer.warnings])


def _steps(answer: FlownAnswer) -> str:
    return f"(rk4, steps of {printed_number('step_s', answer.step_s)})"


def _charge(one: BlastMet | EstimateThrown) -> str:
    return one.charge or "the charge"


def printed(name: str, value: Numbers | Share | bool | None, digits: int = 4) -> str:
    """Return a result as text: a flag, a share, a number or its quantiles."""
    if value is None or isinstance(value, bool):
        return {True: "yes", False: "no", None: "unknown"}[value]
    if isinstance(value, Share):
        low, high = 100 * value.q05, 100 * value.q95
        return f"{100 * value.value:.4g} % [{low:.4g} to {high:.4g} %]"
    if isinstance(value, Quantiles):
        each = [0.0 if abs(x) < NEGLIGIBLE else x for x in astuple(value)]
        if not all(map(math.isfinite, each)):
            words = [printed(name, one, 3) for one in each]
            return ", ".join(words if len({*words}) > 1 else words[:1])
        unit = unit_for(name, *each)
        numbers = ", ".join(significant(one / unit.size, 3) for one in each)
        return f"{numbers} {unit.symbol}".rstrip()
    if name in FLAGS:
        return f"{100 * value:.4g} %"
    if not math.isfinite(value):
        never = {"recovery_time_s": "not reached", "arrival_s": "never"}
        return "-" if math.isnan(value) else never.get(name, "-")
    return printed_number(name, 0.0 if abs(value) < NEGLIGIBLE else value, digits)
