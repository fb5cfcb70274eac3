"""Answers on flights: `jblast fly`, hovering or on a mission, and `jblast serve`."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from jblast.autopilot.estimator import Thrown
from jblast.missions.plan import COMMANDS
from jblast.missions.route import geodetic
from jblast.report.maps import Feature, Map, map_files, point
from jblast.report.messages import sentence, sentences_of
from jblast.report.numbers import capitalised, parameter_words, printed_number
from jblast.report.output import PROBLEM, Answer
from jblast.report.view import (
    Block,
    Column,
    Facts,
    Lines,
    Picture,
    Table,
    View,
    drawn_by,
)
from jblast.results import ABSENT, Document, entries, filled
from jblast.study.flight_results import (
    EXPOSURES,
    METRICS,
    Encounter,
    Flights,
    Flown,
    flies_on,
    flight_notes,
    hold_words,
    metric,
    past_threshold,
    quantiles,
    share_interval,
)
from jblast.study.flight_tables import flight_csv, flights_csv
from jblast.study.mavlink_servers import serve_autopilot, serve_ground_station
from jblast.study.missions import (
    WATCHED_S,
    Disturbance,
    Waypoint,
)
from jblast.vehicle.metrics import THRESHOLDS, Threshold
from jblast.world.serve.service import serve_world

T = TypeVar("T")
ESTIMATED = {
    "position": ("place_before_m", "place_m"),
    "velocity": ("moves_before_m_s", "moves_m_s"),
    "attitude": ("turn_before_rad", "turn_rad"),
}
"""Errors of the estimate before and after a blast, by part of the state."""
NEGLIGIBLE = 1e-6
"""Rounding of the integration: far below what matters in any unit here."""
MAX_POINTS = 4000
"""Largest number of points of a plot: about two for each pixel."""
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
    blasts: Sequence[BlastMet]
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
    estimates: Mapping[str, Sequence[EstimateThrown]]


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
    waypoints: tuple[Waypoint, ...]
    disturbances: tuple[Disturbance, ...]
    estimates: Sequence[EstimateThrown]
    peak_overpressure_pa: float
    peak_acceleration_m_s2: float


def fly_answer(flown: Flights, *, scene: str = "", seed: int = 0) -> Answer:
    """Return the answer on flights or on a mission: document, view and table.

    Args:
        flown: The flights.
        scene: The scene's file.
        seed: Seed of the sampled parameters.
    """
    over_time = Picture("flight.png", drawn_by("flight_figures.time_figure", flown))
    if flown.mission is not None:
        mission = mission_answer(flown, scene=scene, seed=seed)
        shown = mission_map(flown)
        title = f"Mission: {mission.mission}"
        files = map_files("mission", shown.features, flown.mission.frame, title)
        pictures = [
            Picture("map.png", drawn_by("map_figures.map_figure", shown)),
            over_time,
        ]
        view = mission_view(mission, pictures)
        return Answer(mission, view, {"flight.csv": flight_csv(flown), **files})
    document = flights_answer(flown, scene=scene, seed=seed)
    if flown.count == 1:
        view = flights_view(document, [over_time])
        return Answer(document, view, {"flight.csv": flight_csv(flown)})
    shares = Picture(
        "distribution.png", drawn_by("flight_figures.distribution_figure", flown)
    )
    view = flights_view(document, [shares])
    return Answer(document, view, {"flights.csv": flights_csv(flown)})


def mission_map(flown: Flights) -> Map:
    """Return the map of a mission: plan, flown path, waypoints, home and blasts."""
    mission, outcome, flight = flown.mission, flown.outcome, flown.trajectory
    assert mission is not None
    assert outcome is not None
    place = np.asarray(flight.position_m)
    # up to a divergence
    planned = np.asarray(flight.set_point_m)
    paths = {"planned": planned, "flown": place[np.isfinite(place[:, 0])]}
    features = [
        Feature(kind, kind, [[path[:: max(1, len(path) // MAX_POINTS)]]])
        for kind, path in paths.items()
    ]
    features.append(point("home", "home", mission.home_m))
    # one mark for an item that is flown again
    for number, one in {one.item.number: one for one in outcome.waypoints}.items():
        kind, words = ("waypoint", "reached") if one.reached else ("missed", "missed")
        # the label of one at home would hide it
        label = str(number) * bool(np.hypot(*one.goal_m[:2]) > 0.5)
        name = f"{one.item.words}: {words}"
        features.append(point(kind, name, one.goal_m, label=label))
    for name, place in zip(flown.blasts, flown.places_m, strict=True):
        features.append(point("blast", name or "blast", place, label=name))
    title = f"Mission of the {flown.vehicle.model.capitalize()}"
    return Map(features, mission.frame, title, outcome.crash)


def flights_answer(flown: Flights, *, scene: str = "", seed: int = 0) -> FlightsAnswer:
    """Return the document of flights; arguments as of `fly_answer`."""
    vehicle, held = flown.vehicle, flown.holds
    return filled(
        FlightsAnswer,
        _common(flown, scene, seed),
        flown,
        flown.options,
        vehicles=flown.count,
        position_m=_place(vehicle.position),
        target_m=_place(vehicle.held),
        yaw_rad=float(vehicle.yaw),
        thresholds=THRESHOLDS[vehicle.model],
        scene_hold=flown.own,
        holds={name: _outcome(vehicle.model, one) for name, one in held.items()},
        estimates={
            name: _each(EstimateThrown, one.thrown, flown.blasts)
            for name, one in held.items()
            if one.thrown is not None
        },
    )


def mission_answer(flown: Flights, *, scene: str = "", seed: int = 0) -> MissionAnswer:
    """Return the document of a mission; arguments as of `fly_answer`."""
    mission, outcome, judged = flown.mission, flown.outcome, EXPOSURES[:2]
    assert mission is not None
    assert outcome is not None
    thrown, limits = flown.first.thrown, THRESHOLDS[flown.vehicle.model]
    return filled(
        MissionAnswer,
        _common(flown, scene, seed),
        {name: float(metric(flown.first, name)) for name in judged},
        outcome,
        flown,
        flown.options,
        mission=mission.plan.source,
        home=_place(geodetic(mission.frame, mission.home_m)),
        home_m=_place(mission.home_m),
        crashed=bool(outcome.crash),
        estimates=_each(EstimateThrown, thrown, flown.blasts) if thrown else (),
        thresholds={name: limits[name] for name in judged},
    )


def _common(flown: Flights, scene: str, seed: int) -> dict[str, Any]:
    """Return the fields that flights and missions have in common."""
    return {
        "scene": scene,
        "seed": seed,
        "vehicle": flown.vehicle.model,
        "integrator": "rk4",
        "load": flown.options.load_words,
        "drawn": {name: _summary(values) for name, values in flown.drawn.items()},
        "blasts": _each(BlastMet, flown.first.encounter, flown.blasts),
        "warnings": tuple(sentences_of(flight_notes(flown))),
    }


def _place(at: ArrayLike) -> tuple[float, float, float]:
    first, second, third = np.asarray(at).tolist()
    return first, second, third


def _summary(values: ArrayLike) -> Any:
    """Return a number or flag, or of several the quantiles or share."""
    known = np.asarray(values)
    if not known.ndim:
        return known.item()
    return float(known.mean()) if known.dtype == bool else Quantiles(*quantiles(known))


def _summaries(values: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """Return the summary of each field; a share has a field of its own."""
    found = {name: np.asarray(one) for name, one in values.items()}
    return {
        name + "_share" * (one.dtype == bool and one.ndim > 0): _summary(one)
        for name, one in found.items()
    }


def _each(
    cls: Callable[..., T], found: Encounter | Thrown, charges: Iterable[str]
) -> list[T]:
    """Return a result for each blast, which are along the last axis."""
    return [
        cls(charge, **_summaries({k: x[..., n] for k, x in found._asdict().items()}))
        for n, charge in enumerate(charges)
    ]


def _outcome(model: str, flown: Flown) -> Outcome:
    on, lost = flies_on(flown), np.flatnonzero(flown.lost)
    past = {
        name: None if values is None else _summary(values)
        for name, values in past_threshold(model, flown).items()
    }
    found = {name: metric(flown, name) for name in (*METRICS, *EXPOSURES)}
    found = _summaries(
        found
        | {
            "recovered": np.isfinite(found["recovery_time_s"]),
            "settled": flown.metrics.settled,
            "crashed": flown.metrics.crashed,
            "flies_on": on,
        }
    )
    if not on.ndim:
        return Outcome(**found, past_threshold=past, lost=bool(lost.size))
    found["flies_on_share"] = Share(found["flies_on_share"], *share_interval(on))
    few = tuple(lost[:MAX_NAMED].tolist())
    return Outcome(
        **found, past_threshold_share=past, lost=lost.size, lost_vehicles=few
    )


def flights_view(answer: FlightsAnswer, pictures: Sequence[Picture] = ()) -> View:
    """Return results, blasts, sampled parameters, figures and notes of flights."""
    place = ", ".join(f"{x:g}" for x in answer.target_m)
    spread, number = ("", "")
    if answer.vehicles > 1:
        spread, number = ("5 %, 50 %, 95 %", f"{answer.vehicles:,} x ")
    notes = [sentence(DEFINITIONS, answer)]
    notes += [
        f"Threshold of {parameter_words(name)}: {one.source}."
        for name, one in answer.thresholds.items()
    ]
    results = {
        hold_words(name) + " (the scene's)" * (name == answer.scene_hold): _results(
            outcome, answer.thresholds
        )
        for name, outcome in answer.holds.items()
    }
    columns = [Column(spread, str)]
    columns += [Column(name, found.__getitem__) for name, found in results.items()]
    met = [*BLAST, "scaled_distance", "overpressure_pa", "in_range", "in_range_share"]
    errors = [
        (f"{one.charge} {hold_words(hold)}".lstrip(), one)
        for hold, found in answer.estimates.items()
        for one in found
    ]
    return View(
        f"{number}{answer.vehicle.capitalize()} holding ({place}) m for "
        f"{answer.seconds:g} s {_steps(answer)}",
        [
            Table(columns, [*next(iter(results.values()))]),
            _estimate_table(errors),
            Table(_columns(*met), [*map(vars, answer.blasts)], "Blasts"),
            *_ending(answer, pictures, notes),
        ],
    )


def mission_view(answer: MissionAnswer, pictures: Sequence[Picture] = ()) -> View:
    """Return waypoints, blasts, sampled parameters, figures and notes of a mission."""
    flown = answer.waypoints
    reached = f"{sum(one.reached for one in flown)} of {len(flown)} waypoints reached"
    end = f"still in flight at the time limit, {answer.seconds:.4g} s"
    if answer.crashed:
        end = f"crashed ({answer.crash})"
    elif math.isfinite(answer.disarmed_s):
        end = f"landed, disarmed after {answer.disarmed_s:.4g} s"
    items = [entries(one) for one in flown]
    errors = ("error_m", "path_error_rms_m", "path_error_max_m")
    effect = ("overpressure_pa", "error_before_m", "peak_deviation_m")
    pairs = zip(answer.blasts, answer.disturbances, strict=True)
    blasts = [vars(met) | vars(through) for met, through in pairs]
    return View(
        f"{answer.vehicle.capitalize()} on {answer.mission} {_steps(answer)}",
        [
            Table(
                [
                    Column("item", lambda row: str(row["index"])),
                    Column("command", lambda row: COMMANDS[row["command"]].name),
                    *_columns("reached", "time_s", *errors),
                ],
                items,
                marked=lambda row: not row["reached"],
            ),
            Table(
                _columns(*BLAST, "waypoint", *effect, "recovery_time_s"),
                blasts,
                "Blasts",
            ),
            _estimate_table([(one.charge, one) for one in answer.estimates]),
            *_ending(answer, pictures, [sentence(OF_MISSIONS, answer)]),
        ],
        subtitle=f"{end}; {reached}",
    )


DEFINITIONS = (
    "Path errors are root mean squares. Recovery time: from the first blast's arrival "
    "until the path error stays within {tolerance_m}; 0 if it never exceeds that. "
    "Flies on: did not hit the ground, turn over or diverge; structural damage is not "
    "included. Scaled distances are in m/kg^(1/3)."
)
OF_MISSIONS = (
    "A waypoint is reached within its acceptance radius. Error: least distance from "
    "it. Path error: distance from the set point, which moves along the plan's legs. "
    f"Deviation and recovery are measured over the {WATCHED_S:g} s after a blast, or "
    "up to the next one, until the path error stays within {tolerance_m}."
)
BLAST = ("charge", "arrival_s", "distance_m")
"""First columns of a table of blasts."""


def _results(outcome: Outcome, thresholds: Mapping[str, Threshold]) -> dict[str, str]:
    """Return the results with one controller as text, by their words."""
    found = {}
    for name, value in vars(outcome).items():
        if isinstance(value, Mapping):
            for exposure, past in value.items():
                limit = thresholds[exposure].value
                if limit is not None and past is not None:
                    words = f"above {printed(exposure, limit, 3)}"
                    found[f"{parameter_words(exposure)} {words}"] = printed(name, past)
        elif value is not None and not name.startswith("lost"):
            found[parameter_words(name.removesuffix("_share"))] = printed(name, value)
    return found


def _columns(*names: str) -> list[Column]:
    """Return columns of rows that are mappings."""

    def column(name: str) -> Column:
        return Column(parameter_words(name), lambda row: printed(name, row[name]))

    return [*map(column, names)]


def _estimate_table(estimates: Iterable[tuple[str, EstimateThrown]]) -> Table:
    """Return the errors of the estimate; none for flights with the true state."""
    heads = ("", "part", "rms in 1 s before", "largest in 10 s after")
    columns = [Column(head, itemgetter(n)) for n, head in enumerate(heads)]
    rows = [
        (label, part, *(printed(name, getattr(one, name)) for name in names))
        for label, one in estimates
        for part, names in ESTIMATED.items()
    ]
    return Table(columns, rows, "Error of the estimate")


def _ending(
    answer: FlownAnswer, pictures: Sequence[Picture], notes: Sequence[str]
) -> list[Block]:
    """Return the last blocks of all flights."""
    drawn = [(parameter_words(n), printed(n, x)) for n, x in answer.drawn.items()]
    return [
        Facts(drawn, "Sampled, by --seed"),
        *pictures,
        Lines("Definitions and assumptions", notes),
        Lines("Warnings", [f"{capitalised(one)}." for one in answer.warnings]),
    ]


def _steps(answer: FlownAnswer) -> str:
    return f"(rk4, steps of {printed_number('step_s', answer.step_s)})"


def printed(name: str, value: Any, digits: int = 4) -> str:
    """Return a result as text: a flag, a share, a number or its quantiles."""
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Share):
        low, high = 100 * value.q05, 100 * value.q95
        return f"{100 * value.value:.4g} % [{low:.4g} to {high:.4g} %]"
    if isinstance(value, Quantiles):
        words = [printed(name, one, 3) for one in astuple(value)]
        return ", ".join(words if len({*words}) > 1 else words[:1])
    if name.endswith("_share"):
        return f"{100 * value:.4g} %"
    if not math.isfinite(value):
        return "-" if math.isnan(value) else "never"
    return printed_number(name, 0.0 if abs(value) < NEGLIGIBLE else value, digits)


def served(server: str, scene: str, *, seconds: float | None, **options: Any) -> Answer:
    """Serve a scene until interrupted, and return the answer.

    Args:
        server: "mavlink" for an autopilot, "ground_station", or "listen" for simulators
            over gRPC.
        scene: The scene's file.
        seconds: Duration; None: unlimited.
        options: Options of the server.
    """
    serve, title, counts = SERVERS[server]
    answer = serve(scene, seconds=seconds, **options)
    lines = [f"Written: {name}" for name in getattr(answer, "files", ())]
    lines += [
        f"disconnected {one.entity or one.peer}: {one.why}"
        for one in getattr(answer, "dropped", ())
    ]
    view = View(
        capitalised(sentence(title, answer)),
        [Lines("", lines)],
        subtitle=sentence(counts, answer),
    )
    # a millisecond of tolerance: the time is a sum of periods in floating point
    flown = getattr(answer, "seconds", math.inf)
    is_short = seconds is not None and flown < seconds - 1e-3
    return Answer(answer, view, code=PROBLEM if is_short else 0)


SERVERS = {
    "mavlink": (
        serve_autopilot,
        "{vehicle} flown by an autopilot for {seconds:g} s: {ended}",
        "{turns:step}, {flown:,} of them in flight; {late:,} late answers, {lost:,} "
        "messages lost, {damaged:,} damaged",
    ),
    "ground_station": (
        serve_ground_station,
        "{vehicle} for a ground station on {address}: {ended}",
        "{flights:flight}, {items} mission items, {lost:,} messages lost, {damaged:,} "
        "damaged",
    ),
    "listen": (serve_world, "{packets:packet} sent, {late:,} of them late", ""),
}
"""Function, title and counts of each server."""
