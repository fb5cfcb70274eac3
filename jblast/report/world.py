"""The answers of `jblast world` and `jblast report`."""

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from jblast.errors import InputError, argument
from jblast.files import PAGE, check_out, save
from jblast.inference import Fit, fit_each
from jblast.inference.fitting.summary import Estimate
from jblast.observations import read
from jblast.observations.grouping import by_shot
from jblast.progress import stages
from jblast.report.estimates import printed_estimate
from jblast.report.fit_report import FitsAnswer, fits_answer
from jblast.report.flights import (
    FlightsAnswer,
    MissionAnswer,
    flights_answer,
    flights_view,
    mission_answer,
    mission_view,
)
from jblast.report.listen import (
    Recordings,
    recordings_answer,
    sensors_table,
)
from jblast.report.numbers import capitalised, parameter_words, printed_number
from jblast.report.provenance import provenance_of
from jblast.report.view import Block, Column, Facts, Lines, Picture, Table, View
from jblast.results import Document, filled, restored
from jblast.scene import Scene
from jblast.study.run_files import (
    BLASTS,
    FILM,
    PERCEIVED,
    READINGS,
    SOUND,
    BlastDrawn,
    Detections,
    FilmMade,
    ImuWritten,
    RecordedRun,
    drawn_blasts,
    earlier_tables,
    record_files,
)
from jblast.study.running import Run, Subscriber, prepare_run
from jblast.world import Perceived, read_run_scene, scene_to_fit

RUN, FITS = "run.json", "fits.json"
MAX_ROWS = 12
"""Largest number of printed blasts and senses: both tables fit one screen, and the
files have all rows."""
TRUTH: dict[str, Callable[[BlastDrawn], float]] = {
    "charge_mass_kg": lambda blast: blast.mass_kg,
    "charge_east_m": lambda blast: blast.position_m[0],
    "charge_north_m": lambda blast: blast.position_m[1],
    "charge_up_m": lambda blast: blast.position_m[2],
    "origin_time_s": lambda blast: blast.time_s,
}
"""True value of each fitted parameter."""


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
        fits: Answers from the readings of each blast; null without `--fit`.
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
    fits: FitsAnswer | None = None


@dataclass(frozen=True)
class WorldRun(RecordedRun):
    """A run of a world in its folder.

    Attributes:
        document: The answer, as in run.json.
    """

    document: WorldAnswer


def run_world(
    scene: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    seconds: float | None = None,
    seed: int = 0,
    estimator: str = "",
    controllers: Sequence[str] | None = None,
    detect: bool = False,
    every_frame: bool = False,
    watched: Callable[[Run], Sequence[Subscriber]] = lambda run: (),
    force: bool = False,
    command: Sequence[str] = (),
    begin: Callable[[str], object] | None = None,
) -> WorldRun:
    """Run a world of blasts, and write what its senses record of them.

    Args:
        scene: File of the scene, with [world] or [charge].
        out: Output directory.
        seconds: Duration; default: as in `study.running.prepare_run`.
        seed: Seed of all draws.
        estimator: "ekf" for control by a state estimate; "" for the true state.
        controllers: Names of controllers; the first one flies the recorded flight.
        detect: Whether detectors search sound and frames while they are recorded.
        every_frame: Whether frames without a fireball in view are stored, too.
        watched: Returns further subscribers of the packets, such as a viewer.
        force: Whether an earlier run in the directory may be overwritten.
        command: Words for the provenance.
        begin: Called with the name of each stage; default: progress is reported.

    Returns:
        The world with perceptions and readings; on an error written files stay.

    Raises:
        InputError: The scene, an argument or the directory cannot be used.

    Example:
        `jblast.report.run_world("scene.toml", "run", seed=3)`
    """
    directory, source = Path(out), os.fspath(scene)
    earlier = [file.name for file in earlier_tables(directory)]
    names = (RUN, FITS, BLASTS, PERCEIVED, SOUND, FILM, *earlier)
    check_out(directory, names, force=force)
    begin = begin or stages({"flying": 6.0, "recording": 9.0})
    made = provenance_of((), source, tuple(command))
    begin("flying")
    run = prepare_run(
        source,
        seconds=seconds,
        seed=seed,
        estimator=estimator,
        controllers=controllers,
    )
    begin("recording")
    for name in (RUN, FITS, PAGE):  # of an earlier run they would mislead
        (directory / name).unlink(missing_ok=True)
    recorded = record_files(
        run,
        directory,
        detect=detect,
        every_frame=every_frame,
        watched=watched(run),
    )
    sound, flown, options = None, run.flown, {"scene": source, "seed": seed}
    if run.listening is not None:
        sound = recordings_answer(run.listening, recorded.records)
    document = filled(
        WorldAnswer,
        recorded,
        made,
        run,
        scene=source,
        seed=seed,
        scene_sha256=None if made.scene is None else made.scene.sha256,
        laws=dict(run.world.scene.law),
        blasts=drawn_blasts(run.world),
        not_perceived=run.late,
        readings=0 if recorded.readings is None else len(recorded.readings),
        flight=flights_answer(flown, **options)
        if flown and not flown.mission
        else None,
        sound=sound,
        mission=mission_answer(flown, **options) if flown and flown.mission else None,
    )
    save(directory / RUN, document.to_json())
    return filled(WorldRun, recorded, document=document)


class ShotFit(NamedTuple):
    """The answer from the readings of one blast.

    Attributes:
        blast: The blast.
        found: Its fit, or the reason for having none.
    """

    blast: BlastDrawn
    found: Fit | InputError

    @property
    def problem(self) -> str:
        """Reason not to use it; "" for a good answer."""
        why = str(self.found)
        if isinstance(self.found, Fit):
            if self.found.exit_code == 0:
                return ""
            why = "not reliable: see `jblast fit`"
        return f"Blast {self.blast.shot}: {why}"


class FitRow(NamedTuple):
    """A fitted parameter beside its true value.

    Attributes:
        shot: Name of the blast.
        name: Name of the parameter.
        truth: True value.
        estimates: Estimate in each region of the position, the most probable first.
    """

    shot: str
    name: str
    truth: float
    estimates: tuple[Estimate, ...]

    @property
    def contains(self) -> bool | None:
        """True if a 90 % interval contains the truth; None if not identified."""
        if not all(one.identified for one in self.estimates):
            return None
        return any(bool(one.q05 <= self.truth <= one.q95) for one in self.estimates)


def fit_rows(fits: Sequence[ShotFit]) -> list[FitRow]:
    """Return a row for each fitted parameter of each blast."""
    return [
        FitRow(
            blast.shot,
            name,
            TRUTH[name](blast),
            tuple(one.estimates[name] for one in found.summary.regions)
            or (found.summary.estimates[name],),
        )
        for blast, found in fits
        if isinstance(found, Fit)
        for name in found.summary.free
        if name in TRUTH
    ]


def fits_of(
    directory: Path, document: WorldAnswer, scene: str | Path
) -> tuple[FitsAnswer, list[ShotFit]]:
    """Fit the readings of each blast of a world separately.

    Args:
        directory: Folder of the world.
        document: Its answer.
        scene: Scene of the world; [world] becomes the prior.

    Raises:
        InputError: The scene or the readings cannot be used.
    """
    logs = by_shot(read(directory / READINGS))
    found = fit_each(logs, scene_to_fit(scene))
    blasts = {blast.shot: blast for blast in document.blasts}
    shots = [ShotFit(blasts[shot], found[shot]) for shot in logs if shot in blasts]
    return fits_answer(found), shots


def run_view(
    document: WorldAnswer,
    fits: Sequence[ShotFit] = (),
    pictures: Iterable[Picture] = (),
) -> View:
    """Return what a run shows.

    Args:
        document: The answer on the run.
        fits: Fits of the readings of each blast.
        pictures: Its figures.
    """
    count = len(document.blasts)
    versions = ", ".join(f"{name} {of}" for name, of in document.versions.items())
    blocks: list[Block] = [
        blasts_table(document),
        _perceived_table(document),
        _fits_table(fits),
    ]
    if document.detections is not None:
        blocks.append(Lines("Detectors", [_detected(document.detections)]))
    if document.camera is not None:
        blocks.append(Lines("Film", [_filmed(document.camera)]))
    if document.flight is not None:
        blocks += _flight_blocks(flights_view(document.flight))
    if document.mission is not None:
        blocks += _flight_blocks(mission_view(document.mission))
    if document.sound is not None:
        blocks.append(replace(sensors_table(document.sound), where="page"))
    blocks.append(Lines("Notes", document.warnings))
    blocks += pictures
    facts = [("command", document.command), ("date", document.date)]
    facts += [("versions", versions), ("scene, SHA-256", document.scene_sha256 or "")]
    blocks.append(Facts(facts, "Provenance", where="page"))
    return View(
        f"{count} blast{'' if count == 1 else 's'} in {document.seconds:g} s",
        blocks,
        subtitle=f"{document.scene}, seed {document.seed}",
        problems=[one.problem for one in fits if one.problem],
        footer="SIMULATED, not measured. No clearance, and no safety distance, "
        "follows from it.",
    )


def blasts_table(document: WorldAnswer) -> Table:
    """Return a row for each blast."""

    def number(head: str, of: Callable[[BlastDrawn], float], form: str) -> Column:
        return Column(head, lambda blast: format(of(blast), form), right=True)

    return Table(
        [
            Column("blast", lambda blast: blast.shot),
            number("time [s]", lambda blast: blast.time_s, ".4f"),
            number("east [m]", lambda blast: blast.position_m[0], ".2f"),
            number("north [m]", lambda blast: blast.position_m[1], ".2f"),
            number("up [m]", lambda blast: blast.position_m[2], ".2f"),
            number("mass [kg]", lambda blast: blast.mass_kg, ".4g"),
        ],
        document.blasts,
        "Blasts",
        most=MAX_ROWS,
    )


def _perceived_table(document: WorldAnswer) -> Table:
    """Return a row for each sense of each entity, a column for each blast."""
    times: dict[tuple[str, str], dict[str, float]] = {}
    for one in document.perceived:
        times.setdefault((one.entity, one.sense), {})[one.shot] = one.time_s

    def time_of(shot: str, row: tuple[str, str]) -> str:
        return f"{times[row][shot]:.4f}" if shot in times[row] else "-"

    return Table(
        [
            Column("entity", lambda row: row[0]),
            Column("sense", lambda row: row[1]),
            *(
                Column(
                    f"blast {blast.shot} [s]", partial(time_of, blast.shot), right=True
                )
                for blast in document.blasts[:MAX_ROWS]
            ),
        ],
        sorted(times, key=lambda row: row[0]),
        "Perceptions",
        most=MAX_ROWS,
        caption="Times on the common clock." if times else "",
    )


def _fits_table(fits: Sequence[ShotFit]) -> Table:
    """Return a row for each fitted parameter of each blast."""
    rows = fit_rows(fits)
    known = [row.contains for row in rows if row.contains is not None]
    caption = f"{sum(known)} of {len(known)} 90 % intervals contain the truth."

    def printed(row: FitRow) -> list[Any]:
        return [printed_estimate(row.name, one) for one in row.estimates]

    def intervals(row: FitRow) -> str:
        return " or ".join(one.interval for one in printed(row))

    return Table(
        [
            Column("blast", lambda row: row.shot),
            Column("parameter", lambda row: capitalised(parameter_words(row.name))),
            Column(
                "truth", lambda row: printed_number(row.name, row.truth, 6), right=True
            ),
            Column("value", lambda row: printed(row)[0].value_and_beside, right=True),
            Column("90 % interval", intervals, right=True),
            Column("", lambda row: "misses" if row.contains is False else ""),
        ],
        rows,
        "Fits of the readings",
        marked=lambda row: row.contains is False,
        caption=caption if known else "",
    )


def _filmed(film: FilmMade) -> str:
    words = f"{film.frames:,} of {film.filmed:,} frames stored"
    if film.frames < film.filmed:
        words += ", those with a fireball in view"
    return words


def _detected(found: Detections) -> str:
    words = (
        f"{found.detected} detected, {found.missed} missed, "
        f"{found.false_alarms} false alarms"
    )
    if found.median_latency_s is not None and found.max_latency_s is not None:
        words += (
            f"; latency {found.median_latency_s:.2f} s (median), at most "
            f"{found.max_latency_s:.2f} s"
        )
    return words


def _flight_blocks(view: View) -> list[Block]:
    """Return the tables of `jblast fly`, for the page."""
    title = "; ".join(filter(None, [view.title, view.subtitle]))
    return [
        replace(
            block,
            where="page",
            title=f"{block.title} at the vehicle" if block.title else title,
        )
        for block in view.blocks
        if isinstance(block, Table)
    ]


def read_run(folder: str | os.PathLike[str]) -> WorldAnswer:
    """Read the answer in the output folder of `jblast world`.

    Raises:
        InputError: It is another folder, or the file is broken.
    """
    file = Path(folder) / RUN
    expected = "expected the output folder of `jblast world --out`"
    if not file.exists():
        raise InputError(f"{file}: no such file; {expected}")
    try:
        return restored(WorldAnswer, json.loads(file.read_text("utf-8")))
    except (OSError, ValueError, TypeError, AttributeError, StopIteration) as error:
        raise InputError(
            f"{file}: {expected}, got a file that does not fit ({error})"
        ) from None


def scene_of_run(
    folder: str | os.PathLike[str], document: WorldAnswer, scene: str | Path | None
) -> tuple[Path, Scene]:
    """Return path and contents of the scene of a run.

    Args:
        folder: Folder of the run.
        document: Its answer.
        scene: Scene file; default: the path in run.json.

    Raises:
        InputError: The scene has changed or cannot be read.
    """
    # the run stores the path only; the file may have been moved since
    path = Path(scene or document.scene)
    if not path.is_file():
        raise InputError(
            f"{path}: no such file; expected the scene file of {folder}: give its path "
            f"by {argument('scene')}"
        )
    now = provenance_of((), path).scene
    # another scene would be drawn and fitted with other priors than those of the run
    if now and now.sha256 != document.scene_sha256:
        raise InputError(
            f"{path}: has changed since {folder} was made; expected SHA-256 "
            f"{document.scene_sha256}, got {now.sha256}"
        )
    return path, read_run_scene(path)[0].scene
