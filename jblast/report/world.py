"""The answers of `jblast world` and `jblast serve`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from jblast.observations import Observations
from jblast.report.flights import EastNorthUpM, FlightsAnswer
from jblast.report.provenance import Provenance
from jblast.report.words import aligned, comma_separated, commented
from jblast.results import AMONG, Document
from jblast.scene import Charge
from jblast.sensors.camera.files.event_files import Written
from jblast.study.flight_results import Flights
from jblast.world import DrawnWorld, Perceived, Preset
from jblast.world.remote.serving import Options, Serving

MAX_BLASTS, MOST_ENTITIES = 20, 12
"""Blasts and senses printed one by one; the tables have all of them."""
BLASTS = ("shot", "time_s", "east_m", "north_m", "up_m", "mass_kg")
PERCEIVED = ("shot", "entity", "sense", "time_s")
MARK = "as the thesis computes it, not as blasts are"


@dataclass(frozen=True)
class DroppedClient:
    """A client that was dropped.

    Attributes:
        entity: Name it had registered; "" if it had not.
        peer: Where it spoke from.
        why: What it did.
    """

    entity: str
    peer: str
    why: str


@dataclass(frozen=True)
class ServedAnswer(Document):
    """What came of a server, when it was stopped.

    Attributes:
        scene: The scene's file.
        seed: Of all that is drawn.
        address: HOST:PORT that it listened on.
        blasts: Of the world, with those that clients announced.
        packets: That were sent.
        late: Packets in real time that were made after their time was over.
        dropped: Clients that were dropped, the latest 1,000.
        dropped_count: How many were dropped.
    """

    scene: str
    seed: int
    address: str
    blasts: int
    packets: int
    late: int
    dropped: tuple[DroppedClient, ...]
    dropped_count: int


def served_answer(server: Serving) -> ServedAnswer:
    """Return what came of a server."""
    table = server.table
    return ServedAnswer(
        scene=table.world.drawn.source,
        seed=table.world.drawn.seed,
        address=server.address,
        blasts=len(table.world.schedule.charges),
        packets=table.sent,
        late=table.late,
        dropped=tuple(DroppedClient(*one) for one in table.registry.dropped),
        dropped_count=table.registry.dropped_count,
    )


def serving_line(world: DrawnWorld, address: str, options: Options) -> str:
    """Return the line printed when clients can connect."""
    count = len(world.charges)
    pace = "in lockstep"
    if options.speed is not None:
        pace = f"at {options.speed:g} times real time"
    return (
        f"{world.source} with {count} blast{'' if count == 1 else 's'} on {address}, "
        f"{options.packets_hz:g} packets a second, {pace}"
    )


def served_text(answer: ServedAnswer) -> str:
    """Return the same for a terminal."""
    lines = [f"{answer.packets:,} packets sent, {answer.late:,} of them late"]
    lines += [f"dropped {one.entity or one.peer}: {one.why}" for one in answer.dropped]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class BlastDrawn:
    """A blast that happens.

    Attributes:
        shot: Its name: of a random one the number that it was drawn by.
        time_s: When, on the common clock.
        position_m: East, north, up.
        mass_kg: Of the charge.
    """

    shot: str
    time_s: float
    position_m: EastNorthUpM
    mass_kg: float


@dataclass(frozen=True)
class ImuWritten:
    """What an inertial measurement unit wrote.

    Attributes:
        file: Its table, in the folder of the run.
        rate_hz: Samples a second.
        samples: How many.
        clipped: Whether one stands at the end of its range.
    """

    file: str
    rate_hz: float
    samples: int
    clipped: bool


@dataclass(frozen=True)
class FilmMade:
    """What a world's camera wrote.

    Attributes:
        frames: How many.
        width: Of each [px].
        height: Of each [px].
        written: Numbers of events.
        stamps: How their times were found.
        stamp_error_s: Bound of the times' error; of 99 in 100 where interpolated.
    """

    frames: int
    width: int
    height: int
    written: Written = field(metadata=AMONG)
    stamps: Literal["solved for", "interpolated", "of the frame"]
    stamp_error_s: float


@dataclass(frozen=True)
class PresetTaken:
    """By which preset blasts act other than they do.

    Attributes:
        name: As it was asked for.
        mark: What such a run is.
        source: Where the preset comes from.
    """

    name: str
    mark: str
    source: str


@dataclass(frozen=True)
class WorldAnswer(Document):
    """What was drawn, and what was perceived of it.

    Attributes:
        scene: The scene's file.
        seed: Of all that is drawn.
        seconds: When the world ended.
        command: What was typed.
        date: When it ran.
        versions: Of jblast, jax and python.
        scene_sha256: Of the scene's file.
        preset: By which blasts act other than they do; null: none.
        laws: By which law every quantity is made, for all senses alike.
        blasts: Those that happen, in order of time.
        perceived: Each first perception, in order of time.
        not_perceived: How many come after the end.
        readings: Rows of observations.csv.
        flight: As of `jblast fly`; null where nothing flies.
        sound: As of `jblast listen`; null where no sensor samples.
        imu: By name, what each inertial measurement unit wrote; null where none flies.
        camera: What it wrote; null where there is none.
        warnings: Warnings, a sentence each.
    """

    scene: str
    seed: int
    seconds: float
    command: str
    date: str
    versions: Mapping[str, str]
    scene_sha256: str | None
    preset: PresetTaken | None
    laws: Mapping[str, str]
    blasts: tuple[BlastDrawn, ...]
    perceived: tuple[Perceived, ...]
    not_perceived: int
    readings: int
    flight: FlightsAnswer | None
    sound: Mapping[str, Any] | None
    imu: Mapping[str, ImuWritten] | None
    camera: FilmMade | None
    warnings: tuple[str, ...]


@dataclass
class WorldRun:
    """A world that ran.

    Attributes:
        world: What was drawn.
        seconds: When it ended.
        perceived: Who perceived what and when, in order of time.
        late: What came after the end, and was not perceived.
        readings: What sensors wrote down; None: nothing.
        late_readings: Waves that came after the end, and were not written down.
        flights: Of the vehicle; None where nothing flew.
        made: What it is made of.
        flight: The answer on the flights; None where nothing flew.
        sound: The document of the records of samples; None where there are none.
        imu: What each inertial measurement unit wrote; None where there is none.
        film: What the camera wrote; None where there is none.
        warnings: Further warnings.
    """

    world: DrawnWorld
    seconds: float
    perceived: tuple[Perceived, ...]
    late: int
    readings: Observations | None
    late_readings: int
    flights: Flights | None
    made: Provenance
    flight: FlightsAnswer | None = None
    sound: dict[str, Any] | None = None
    imu: Mapping[str, ImuWritten] | None = None
    film: FilmMade | None = None
    warnings: list[str] = field(default_factory=list)


def world_text(run: WorldRun) -> str:
    """Return the blasts, and a table of senses by blast: when each began."""
    charges = run.world.charges
    count = len(charges)
    lines = [f"{count} blast{'' if count == 1 else 's'} in {run.seconds:g} s", ""]
    if run.world.preset is not None:
        lines[:0] = [preset_words(run.world.preset), ""]
    if charges:
        lines += [*aligned(_blasts(run), right=range(1, 6)), ""]
        lines += aligned(_senses(run), right=range(2, 2 + MAX_BLASTS))
        lines += ["times on the common clock, in s", ""]
    lines += [f"Note: {warning}" for warning in warnings_of(run)]
    return "\n".join(lines) + "\n"


def _blasts(run: WorldRun) -> list[list[str]]:
    rows = [["blast", "time s", "east m", "north m", "up m", "mass kg"]]
    charges = run.world.charges
    for charge in charges[:MAX_BLASTS]:
        time, *others = blast_numbers(charge)
        rows.append([charge.name, f"{time:.4f}", *(f"{x:.4g}" for x in others)])
    return [*rows, *_more(len(charges), MAX_BLASTS, 6)]


def _senses(run: WorldRun) -> list[list[str]]:
    """Return a row for each sense of everyone, a column for each blast."""
    shots = run.world.shots[:MAX_BLASTS]
    began = {(p.entity, p.sense, p.shot): p.time_s for p in run.perceived}
    senses = list(dict.fromkeys((p.entity, p.sense) for p in run.perceived))
    senses.sort(key=lambda one: one[0])
    rows = [["who", "perceived", *(f"blast {shot}" for shot in shots)]]
    for who, sense in senses[:MOST_ENTITIES]:
        times = [began.get((who, sense, shot)) for shot in shots]
        rows.append([who, sense, *("-" if t is None else f"{t:.4f}" for t in times)])
    return [*rows, *_more(len(senses), MOST_ENTITIES, len(rows[0]))]


def _more(count: int, printed: int, columns: int) -> Sequence[list[str]]:
    if count <= printed:
        return []
    return [[f"and {count - printed} more", *[""] * (columns - 1)]]


def world_answer(run: WorldRun) -> WorldAnswer:
    """Return the answer on a world; what nobody has is null."""
    made, preset = run.made, run.world.preset
    return WorldAnswer(
        scene=run.world.source,
        seed=run.world.seed,
        seconds=run.seconds,
        command=made.command,
        date=made.date,
        versions=made.versions,
        scene_sha256=None if made.scene is None else made.scene.sha256,
        preset=None
        if preset is None
        else PresetTaken(preset.name, MARK, preset.source),
        laws=dict(run.world.scene.law),
        blasts=tuple(
            BlastDrawn(charge.name, time, (east, north, up), mass)
            for charge in run.world.charges
            for time, east, north, up, mass in [blast_numbers(charge)]
        ),
        perceived=run.perceived,
        not_perceived=run.late,
        readings=0 if run.readings is None else len(run.readings),
        flight=run.flight,
        sound=run.sound,
        imu=run.imu,
        camera=run.film,
        warnings=tuple(warnings_of(run)),
    )


def warnings_of(run: WorldRun) -> list[str]:
    """Return warnings on the use of the run."""
    said = [] if run.world.preset is None else preset_notes(run.world.preset)
    said += run.warnings
    if not run.world.shots:
        said.append("no blast was drawn: nobody perceives one, and nothing flew")
    if run.late:
        said.append(
            f"{run.late} times a blast comes to somebody after the end, at "
            f"{run.seconds:g} s: it is not among what was perceived"
        )
    if run.late_readings:
        said.append(
            f"{run.late_readings} waves come to sensors after the end: no reading "
            "of them was written"
        )
    if run.readings is None and run.world.shots:
        said.append("no sensor says what it records, so there is no observations.csv")
    return said


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


def preset_words(preset: Preset) -> str:
    """Return the mark of a run by a preset: on all that it prints and writes."""
    return f"preset {preset.name}: {MARK}"


def preset_notes(preset: Preset) -> list[str]:
    """Return warnings on the use of a run with a preset."""
    notes = [
        f"{preset_words(preset)} ({preset.source}); the scene's own laws, by which "
        "jblast fit goes, are others"
    ]
    if preset.pressure_speed_m_s is not None:
        notes.append(
            f"pressure and force travel at {preset.pressure_speed_m_s:g} m/s, the "
            "sound by eq. 3.4: one blast comes at two times, as it does there"
        )
    return notes
