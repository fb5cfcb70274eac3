"""The answers of `jblast world` and `jblast serve`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from jblast.observations import Observations
from jblast.report.flights import (
    EastNorthUpM,
    FlightsAnswer,
    MissionAnswer,
    flights_answer,
    mission_answer,
)
from jblast.report.listen import Recordings
from jblast.report.provenance import Provenance
from jblast.report.words import aligned, comma_separated, commented
from jblast.results import AMONG, Document
from jblast.scene import Charge
from jblast.sensors.camera.files.event_files import Written
from jblast.study.flight_results import Flights
from jblast.study.missions import MissionFlight
from jblast.study.running import Run, RunDetection
from jblast.world import DrawnWorld, Perceived
from jblast.world.drawn import CAMERA

MAX_BLASTS, MAX_ENTITIES = 12, 12
"""Largest numbers of printed blasts and senses: both tables fit one screen, and the
files have all rows."""
BLASTS = ("shot", "time_s", "east_m", "north_m", "up_m", "mass_kg")
PERCEIVED = ("shot", "entity", "sense", "time_s")
DETECTED = (
    *("sensor", "kind", "shot", "time_s", "sigma_s", "reported_s", "latency_s"),
    "statistic",
)
SEARCHED = {("microphone", "sound"), (CAMERA, "flash")}
"""Kinds of sensors and senses that the detectors of a run search."""


@dataclass(frozen=True)
class BlastDrawn:
    """A blast of the world.

    Attributes:
        shot: Name of the charge; for a random one the number of its draw.
        time_s: Time of detonation on the common clock.
        position_m: East, north, up.
        mass_kg: Mass of the charge.
    """

    shot: str
    time_s: float
    position_m: EastNorthUpM
    mass_kg: float


@dataclass(frozen=True)
class ImuWritten:
    """Record of an inertial measurement unit.

    Attributes:
        file: Its table, in the folder of the run.
        rate_hz: Sampling rate [1/s].
        samples: Number of samples.
        clipped: Whether a sample is clipped.
    """

    file: str
    rate_hz: float
    samples: int
    clipped: bool


@dataclass(frozen=True)
class FilmMade:
    """Film of a world's camera.

    Attributes:
        frames: Number of frames.
        width: Width of a frame [px].
        height: Height of a frame [px].
        written: Numbers of events.
        stamps: Computation of the events' times.
        stamp_error_s: Bound of the times' error; if interpolated, of 99 % of them.
    """

    frames: int
    width: int
    height: int
    written: Written = field(metadata=AMONG)
    stamps: Literal["interpolated"]
    stamp_error_s: float


@dataclass(frozen=True)
class Detections:
    """Blasts that the detectors of a run reported while it was recorded.

    Attributes:
        detected: Number of detected waves and flashes.
        false_alarms: Number of detections without a wave or flash.
        missed: Number of perceived flashes and air shocks at searched sensors without a
            detection.
        median_latency_s: Median delay after the wave reached the sensor; null without a
            detection.
        max_latency_s: Longest such delay.
    """

    detected: int
    false_alarms: int
    missed: int
    median_latency_s: float | None
    max_latency_s: float | None


@dataclass(frozen=True)
class WorldAnswer(Document):
    """The answer of `jblast world`: blasts and perceptions.

    Attributes:
        scene: The scene's file.
        seed: Seed of all random draws.
        seconds: Duration of the world.
        command: The command.
        date: Date of the run.
        versions: Versions of jblast, jax and python.
        scene_sha256: SHA-256 of the scene's file.
        laws: Law of each quantity, for all senses.
        blasts: Blasts in order of time.
        perceived: Each first perception, in order of time.
        not_perceived: Number of arrivals after the end.
        readings: Number of rows of observations.csv.
        flight: Answer of `jblast fly`; null without a vehicle.
        sound: Answer of `jblast listen`; null without sampling sensors.
        imu: Record of each inertial measurement unit, by name; null without one.
        camera: Film of the camera; null without one.
        warnings: Warnings, as sentences.
        mission: Answer of `jblast fly` for a mission; null without one.
        detections: Result of the detectors; null without `--detect`.
    """

    scene: str
    seed: int
    seconds: float
    command: str
    date: str
    versions: Mapping[str, str]
    scene_sha256: str | None
    laws: Mapping[str, str]
    blasts: tuple[BlastDrawn, ...]
    perceived: tuple[Perceived, ...]
    not_perceived: int
    readings: int
    flight: FlightsAnswer | None
    sound: Recordings | None
    imu: Mapping[str, ImuWritten] | None
    camera: FilmMade | None
    warnings: tuple[str, ...]
    mission: MissionAnswer | None = None
    detections: Detections | None = None


@dataclass
class WorldRun:
    """Results of a world's run.

    Attributes:
        run: The run.
        readings: Readings of the sensors; None without any.
        late_readings: Number of waves at sensors after the end.
        made: Provenance.
        sound: The records of samples; None without any.
        imu: Record of each inertial measurement unit; None without one.
        film: Film of the camera; None without one.
        detections: Detections in order of their report; None without detectors.
        warnings: Further warnings.
    """

    run: Run
    readings: Observations | None
    late_readings: int
    made: Provenance
    sound: Recordings | None = None
    imu: Mapping[str, ImuWritten] | None = None
    film: FilmMade | None = None
    detections: tuple[RunDetection, ...] | None = None
    warnings: list[str] = field(default_factory=list)

    @property
    def world(self) -> DrawnWorld:
        """The sampled world."""
        return self.run.world

    @property
    def detected(self) -> Detections | None:
        """Summary of the detections; None without detectors."""
        if self.detections is None:
            return None
        return summary_of(self.run, self.detections)


def world_text(run: WorldRun) -> str:
    """Return the blasts, and a table of perception times by sense and blast."""
    charges = run.world.charges
    count = len(charges)
    lines = [f"{count} blast{'' if count == 1 else 's'} in {run.run.seconds:g} s", ""]
    if charges:
        lines += [*aligned(_blasts(run), right=range(1, 6)), ""]
        lines += aligned(_senses(run), right=range(2, 2 + MAX_BLASTS))
        lines += ["times on the common clock, in s", ""]
    lines += _detected_lines(run)
    lines += [f"Note: {warning}" for warning in warnings_of(run)]
    return "\n".join(lines).rstrip() + "\n"


def _detected_lines(run: WorldRun) -> list[str]:
    """Return the sentence on detections; none without detectors."""
    found = run.detected
    if found is None:
        return []
    words = (
        f"Detectors: {found.detected} detected, {found.missed} missed, "
        f"{found.false_alarms} false alarms"
    )
    if found.median_latency_s is not None and found.max_latency_s is not None:
        words += (
            f"; latency {found.median_latency_s:.2f} s (median), at most "
            f"{found.max_latency_s:.2f} s"
        )
    return [words, ""]


def detections_csv(found: Sequence[RunDetection], comments: Sequence[str]) -> str:
    """Return a row for each detection, in order of report, with 12 digits."""
    rows = [list(DETECTED)]
    for one in found:
        numbers = [one.time_s, one.sigma_s, one.reported_s, one.latency_s]
        cells = [f"{number:.12g}" for number in (*numbers, one.statistic)]
        rows.append([one.sensor, one.kind, one.shot, *cells])
    return commented(comments) + comma_separated(rows)


def _blasts(run: WorldRun) -> list[list[str]]:
    rows = [["blast", "time s", "east m", "north m", "up m", "mass kg"]]
    charges = run.world.charges
    for charge in charges[:MAX_BLASTS]:
        time, *others = blast_numbers(charge)
        rows.append([charge.name, f"{time:.4f}", *(f"{x:.4g}" for x in others)])
    return [*rows, *_more(len(charges), MAX_BLASTS, 6)]


def _senses(run: WorldRun) -> list[list[str]]:
    """Return a row for each sense of each entity, a column for each blast."""
    shots = run.world.shots[:MAX_BLASTS]
    began = {(p.entity, p.sense, p.shot): p.time_s for p in run.run.perceived}
    senses = list(dict.fromkeys((p.entity, p.sense) for p in run.run.perceived))
    senses.sort(key=lambda one: one[0])
    rows = [["entity", "sense", *(f"blast {shot}" for shot in shots)]]
    for who, sense in senses[:MAX_ENTITIES]:
        times = [began.get((who, sense, shot)) for shot in shots]
        rows.append([who, sense, *("-" if t is None else f"{t:.4f}" for t in times)])
    return [*rows, *_more(len(senses), MAX_ENTITIES, len(rows[0]))]


def _more(count: int, printed: int, columns: int) -> Sequence[list[str]]:
    if count <= printed:
        return []
    return [[f"and {count - printed} more", *[""] * (columns - 1)]]


def world_answer(run: WorldRun) -> WorldAnswer:
    """Return the answer on a world; null for what the scene does not contain."""
    made, flown = run.made, run.run.flown
    source, seed = run.world.source, run.world.seed
    return WorldAnswer(
        scene=run.world.source,
        seed=run.world.seed,
        seconds=run.run.seconds,
        command=made.command,
        date=made.date,
        versions=made.versions,
        scene_sha256=None if made.scene is None else made.scene.sha256,
        laws=dict(run.world.scene.law),
        blasts=tuple(
            BlastDrawn(charge.name, time, (east, north, up), mass)
            for charge in run.world.charges
            for time, east, north, up, mass in [blast_numbers(charge)]
        ),
        perceived=run.run.perceived,
        not_perceived=run.run.late,
        readings=0 if run.readings is None else len(run.readings),
        flight=flights_answer(flown, scene=source, seed=seed)
        if isinstance(flown, Flights)
        else None,
        sound=run.sound,
        imu=run.imu,
        camera=run.film,
        warnings=tuple(warnings_of(run)),
        mission=mission_answer(flown, scene=source, seed=seed)
        if isinstance(flown, MissionFlight)
        else None,
        detections=run.detected,
    )


def summary_of(run: Run, found: Sequence[RunDetection]) -> Detections:
    """Return the summary of the detections of a run."""
    real = [one for one in found if one.shot]
    known = {(one.sensor, one.shot) for one in real}
    # sensors that are searched: those of the microphones, and the camera
    kinds = {s.name: s.kind for s in run.world.scene.sensors} | {CAMERA: CAMERA}
    sought = {
        (one.entity, one.shot)
        for one in run.perceived
        if (kinds.get(one.entity), one.sense) in SEARCHED
    }
    delays = sorted(one.latency_s for one in real)
    return Detections(
        detected=len(known),
        false_alarms=len(found) - len(real),
        missed=len(sought - known),
        median_latency_s=float(np.median(delays)) if delays else None,
        max_latency_s=delays[-1] if delays else None,
    )


def warnings_of(run: WorldRun) -> list[str]:
    """Return warnings on the use of the run."""
    warnings = list(run.warnings)
    if not run.world.shots:
        warnings.append(
            "no blast was sampled: no perceptions"
            f"{'' if run.run.flown else ' and no flight'}"
        )
    if run.run.late:
        warnings.append(
            f"{run.run.late} perceptions after the end, {run.run.seconds:g} s, are not "
            "included"
        )
    if run.late_readings:
        warnings.append(
            f"{run.late_readings} waves at sensors after the end have no readings"
        )
    if run.readings is None and run.world.shots:
        warnings.append("no sensor has records, so there is no observations.csv")
    return warnings


def blast_numbers(charge: Charge) -> list[float]:
    """Return time, east, north, up and mass of a charge."""
    numbers = (charge.time_s, *charge.position_m, charge.mass_kg)
    return [float(np.asarray(number)) for number in numbers]


def blasts_csv(world: DrawnWorld, comments: Sequence[str]) -> str:
    """Return a row for each blast, in order of time, with 12 digits."""
    rows: list[list[Any]] = [list(BLASTS)]
    for charge in world.charges:
        numbers = [f"{number:.12g}" for number in blast_numbers(charge)]
        rows.append([charge.name, *numbers])
    return commented(comments) + comma_separated(rows)


def perceived_csv(perceived: Sequence[Perceived], comments: Sequence[str]) -> str:
    """Return a row for each sense and blast, in order of time, with 12 digits."""
    rows = [list(PERCEIVED)]
    rows += [[p.shot, p.entity, p.sense, f"{p.time_s:.12g}"] for p in perceived]
    return commented(comments) + comma_separated(rows)
