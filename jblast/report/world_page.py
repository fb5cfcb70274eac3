"""A world on one page.

The timeline has all records on one time axis, as figures 4.7 and 4.8 of the thesis:
path relative to the set point, path error, force, moment, samples of sensors, camera
events and a strip of frames; dashed lines are the blasts.
"""

import csv
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jblast.errors import InputError, argument
from jblast.files import save_text
from jblast.inference import fit_each
from jblast.inference.fitting.place import (
    ConfidenceEllipse,
    charge_ellipse,
)
from jblast.inference.fitting.summary import Estimate
from jblast.observations import read
from jblast.observations.grouping import by_shot
from jblast.report.estimates import printed_estimate
from jblast.report.figure_files import picture_of
from jblast.report.figures import (
    BLUE,
    COLOURS,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.fit.document import fits_answer
from jblast.report.pages import page
from jblast.report.provenance import provenance_of
from jblast.report.words import (
    aligned,
    capitalised,
    parameter_words,
    printed_number,
    unit_for,
)
from jblast.scene import Scene
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.world import read_run_scene, scene_to_fit

ALT_MAP = "Map of blasts, sensors and the vehicle's path."
ALT_TIMELINE = "Flight, samples and events against time on one axis."
MAX_WAVEFORMS, FRAMES = 6, 8
"""Numbers of drawn sensors and frames; their files have all of them."""
BINS = 400
"""Bins of the event rate over the whole run: about two pixels each."""
LOAD_PERCENTILE = 99.5
"""Percentile of loads that fills half of their plot: blasts would hide all else."""
Row = tuple[str, str, Callable[[Axes], None]]
COLUMNS_DRAWN = 2000
"""Columns of a waveform, of which the least and largest sample are drawn: about two a
pixel."""
KEY = "perceived"
"""Key by which run.json is recognised."""
UNITS = {"_m_s": "m/s", "_pa": "Pa"}
"""Units of samples, by the suffix of the column."""
TRUTH = {
    "charge_mass_kg": lambda blast: blast["mass_kg"],
    "charge_east_m": lambda blast: blast["position_m"][0],
    "charge_north_m": lambda blast: blast["position_m"][1],
    "charge_up_m": lambda blast: blast["position_m"][2],
    "origin_time_s": lambda blast: blast["time_s"],
}
"""True value of each fitted parameter, from the entry of a blast in run.json."""


@dataclass(frozen=True)
class Table:
    """A table of the page.

    Attributes:
        title: Title.
        head: Titles of the columns.
        rows: Cells.
        numbers: Columns that are aligned right.
        marked: Highlighted rows.
        lines: Text below the table.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()
    marked: Sequence[int] = ()
    lines: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Waveform:
    """Samples of one sensor, reduced to the columns of a figure.

    Attributes:
        sensor: Name of the sensor.
        column: Sampled quantity, with the unit.
        time_s: Time of each column.
        least: Smallest sample of each column.
        greatest: Largest sample of each column.
    """

    sensor: str
    column: str
    time_s: Float[np.ndarray, " column"]
    least: Float[np.ndarray, " column"]
    greatest: Float[np.ndarray, " column"]

    @property
    def title(self) -> str:
        """Sensor and quantity."""
        return f"{self.sensor}: {self._parts[0].replace('_', ' ')}"

    @property
    def unit(self) -> str:
        """Unit in brackets."""
        return f"[{self._parts[1]}]"

    @property
    def _parts(self) -> tuple[str, str]:
        for suffix, unit in UNITS.items():
            if self.column.endswith(suffix):
                return self.column.removesuffix(suffix), unit
        return self.column, "-"


@dataclass(frozen=True)
class RunFolder:
    """A world's folder.

    Attributes:
        path: Path of the folder.
        document: Contents of run.json.
        flight: Rows of flight.csv; None without a vehicle.
        waveforms: Waveforms of the sampling sensors.
        frames: Time of each stored frame [s] and its file.
        events_s: Times of the camera events [s]; empty without a camera.
    """

    path: Path
    document: dict[str, Any]
    flight: pd.DataFrame | None
    waveforms: tuple[Waveform, ...]
    frames: tuple[tuple[float, Path], ...]
    events_s: Float[np.ndarray, " event"]


@dataclass(frozen=True)
class ShotAnswer:
    """The answer from the readings of one blast.

    Attributes:
        shot: Name of the blast.
        rows: Parameter, truth, answer and 90 % interval as text, and whether the
            interval contains the truth; None for an unidentified parameter.
        ellipse: 90 % ellipse of the position; None if it was not identified.
        note: Reason for having no answer, or a warning; "" for a good answer.
    """

    shot: str
    rows: tuple[tuple[str, str, str, str, bool | None], ...]
    ellipse: ConfidenceEllipse | None
    note: str = ""


def world_page(run: RunFolder, scene: Scene, answers: Sequence[ShotAnswer] = ()) -> str:
    """Return the page.

    Args:
        run: The world.
        scene: The scene with its sensors.
        answers: Fits of the readings of each blast, if requested.
    """
    document = run.document
    count = len(document["blasts"])
    tables = [_blasts(document), _perceived(document)]
    tables += [_answers(answers)] if answers else []
    tables += [_recovery(document["flight"])] if document["flight"] else []
    tables += [_mission(document["mission"])] if document.get("mission") else []
    shown = [
        (timeline_figure(run), ALT_TIMELINE, "All recordings on the common clock."),
        (map_figure(run, scene, answers), ALT_MAP, "Seen from above; north is up."),
    ]
    versions = ", ".join(f"{name} {of}" for name, of in document["versions"].items())
    return page(
        "templates/world.html",
        title=f"{count} blast{'' if count == 1 else 's'} in {document['seconds']:g} s",
        subtitle=f"{document['scene']}, seed {document['seed']}",
        tables=tables,
        pictures=[_picture(*one) for one in shown if one[0] is not None],
        warnings=document["warnings"],
        made=[
            f"Command: {document['command']}",
            f"Made {document['date']} by {versions}.",
            f"Scene: SHA-256 {document['scene_sha256']}",
        ],
    )


def _blasts(document: dict[str, Any]) -> Table:
    rows = [
        [
            blast["shot"],
            f"{blast['time_s']:.4f}",
            *(f"{x:.2f}" for x in blast["position_m"]),
            f"{blast['mass_kg']:.4g}",
        ]
        for blast in document["blasts"]
    ]
    head = ["Blast", "Time [s]", "East [m]", "North [m]", "Up [m]", "Mass [kg]"]
    return Table("Blasts", head, rows, range(1, 6))


def _perceived(document: dict[str, Any]) -> Table:
    """Return a row for each sense of each entity, a column for each blast."""
    shots = [blast["shot"] for blast in document["blasts"]]
    times: dict[tuple[str, str], dict[str, float]] = {}
    for one in document["perceived"]:
        sense = times.setdefault((one["entity"], one["sense"]), {})
        sense[one["shot"]] = one["time_s"]
    rows = [
        [*sense, *(f"{of[shot]:.4f}" if shot in of else "-" for shot in shots)]
        for sense, of in sorted(times.items())
    ]
    head = ["Entity", "Sense", *(f"Blast {shot} [s]" for shot in shots)]
    return Table("Perceptions", head, rows, range(2, len(head)))


def _answers(answers: Sequence[ShotAnswer]) -> Table:
    rows = [
        [of.shot, name, truth, value, interval]
        for of in answers
        for name, truth, value, interval, _ in of.rows
    ]
    inside = [row[-1] for of in answers for row in of.rows]
    notes = [f"Blast {of.shot}: {of.note}" for of in answers if of.note]
    missed = [n for n, contains in enumerate(inside) if contains is False]
    count = len(inside) - inside.count(None)
    marked = "; the remaining ones are marked" if missed else ""
    if count:
        inside_of = f"{count - len(missed)} of {count} 90 % intervals"
        notes.append(f"{inside_of} contain the truth{marked}.")
    head = ["Blast", "Parameter", "Truth", "Answer", "90 % interval"]
    return Table("Fits of the readings", head, rows, (2, 3, 4), missed, notes)


def _recovery(flight: dict[str, Any]) -> Table:
    columns = {
        "Peak deviation": "peak_deviation_m",
        "Time of peak": "peak_time_s",
        "Recovery time": "recovery_time_s",
        "Peak overpressure": "peak_overpressure_pa",
    }
    rows = [
        [
            capitalised(name.replace("_", " ")),
            *(
                "-" if of[key] is None else printed_number(key, of[key], 3)
                for key in columns.values()
            ),
            "yes" if of["flies_on"] else "no",
        ]
        for name, of in flight["holds"].items()
    ]
    head = ["Controller", *columns, "Flies on"]
    tolerance = printed_number("tolerance_m", flight["tolerance_m"])
    lines = [
        "Times are measured from the first arrival at the vehicle. A dash means that "
        f"the path error exceeds {tolerance} at the end."
    ]
    title = f"The {flight['vehicle'].capitalize()}"
    return Table(title, head, rows, (1, 2, 3, 4), lines=lines)


def _mission(mission: dict[str, Any]) -> Table:
    columns = {
        "Error before": "error_before_m",
        "Peak deviation": "peak_deviation_m",
        "Time of peak": "peak_time_s",
        "Recovery time": "recovery_time_s",
    }
    rows = [
        [
            of["charge"],
            "-" if of["waypoint"] is None else str(of["waypoint"]),
            *(
                "-" if of[key] is None else printed_number(key, of[key], 3)
                for key in columns.values()
            ),
        ]
        for of in mission["disturbances"]
    ]
    reached = sum(one["reached"] for one in mission["waypoints"])
    lines = [
        f"{reached} of {len(mission['waypoints'])} waypoints reached; "
        + ("mission completed." if mission["completed"] else "mission not completed."),
        "Times are measured from the arrival of each blast. A dash means that it "
        "arrives before or after the flight, or that the vehicle does not recover.",
    ]
    title = f"The {mission['vehicle'].capitalize()} on its mission"
    head = ["Blast", "Flies to item", *columns]
    return Table(title, head, rows, range(1, 6), lines=lines)


def _picture(figure: Figure, alt: str, caption: str) -> dict[str, Any]:
    picture = picture_of(figure)
    own = {"source": picture.source, "width": picture.width}
    return own | {"alt": alt, "caption": caption}


def timeline_figure(run: RunFolder) -> Figure | None:
    """Draw all senses on one time axis; None without flight, samples and events."""
    rows = [*_flight_rows(run), *map(_sampled, run.waveforms[:MAX_WAVEFORMS])]
    if len(run.events_s):
        rows.append(("Events", "per second", lambda axes: _events(axes, run)))
    if not rows:
        return None
    figure = new_figure(10.5, 1.45 * (len(rows) + bool(run.frames)) + 0.4)
    heights = [len(rows), *([1.0] if run.frames else [])]
    parts = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)
    plots = parts[0, 0].subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, label, draw) in zip(plots, rows, strict=True):
        quiet(axes)
        draw(axes)
        axes.set_ylabel(label)
        titled(axes, title)
        for blast in run.document["blasts"]:
            axes.axvline(
                blast["time_s"], color=INK, linewidth=0.9, linestyle=(0, (4, 3))
            )
    plots[-1].set_xlim(0.0, run.document["seconds"])
    plots[-1].set_xlabel("time [s] on the common clock; dashed: a blast")
    if run.frames:
        _strip(parts[1, 0], run)
    return figure


def _flight_rows(run: RunFolder) -> list[Row]:
    table = run.flight
    if table is None:
        return []
    time = table["time_s"].to_numpy()
    world, body = ("east", "north", "up"), "xyz"
    aims = [f"set_point_{axis}_m" for axis in world]
    # a mission has set points that move
    target: Any = (
        run.document["flight"]["target_m"]
        if run.document["flight"]
        else table[aims].to_numpy()
    )
    away = table[[f"{axis}_m" for axis in world]].to_numpy() - target
    error = table["path_error_m"].to_numpy()
    unit = unit_for("path_error_m", float(error.max()))

    def path(axes: Axes) -> None:
        for part, axis, colour in zip(away.T, world, COLOURS, strict=False):
            axes.plot(time, part / unit.size, color=colour, label=axis)
        _key(axes)

    def distance(axes: Axes) -> None:
        axes.plot(time, error / unit.size, color=BLUE)
        axes.set_ylim(bottom=0.0)

    def loads(columns: list[str], names) -> Callable[[Axes], None]:
        def draw(axes: Axes) -> None:
            values = table[columns].to_numpy()
            for part, name, colour in zip(values.T, names, COLOURS, strict=False):
                axes.plot(time, part, color=colour, linewidth=1.0, label=name)
            most = 2.0 * float(np.percentile(np.abs(values), LOAD_PERCENTILE)) or 1.0
            axes.set_ylim(-most, most)
            _key(axes)

        return draw

    forces = [f"force_{axis}_n" for axis in world]
    moments = [f"moment_{axis}_n_m" for axis in body]
    return [
        ("Path relative to the set point", f"[{unit.symbol}]", path),
        ("Path error", f"[{unit.symbol}]", distance),
        ("All forces; blasts are cut off", "[N]", loads(forces, world)),
        ("All moments, body axes; blasts are cut off", "[N m]", loads(moments, body)),
    ]


def _sampled(wave: Waveform) -> Row:
    def draw(axes: Axes) -> None:
        axes.fill_between(
            wave.time_s, wave.least, wave.greatest, color=BLUE, linewidth=0.6
        )

    return wave.title, wave.unit, draw


def _events(axes: Axes, run: RunFolder) -> None:
    seconds = run.document["seconds"]
    count, edges = np.histogram(run.events_s, bins=BINS, range=(0.0, seconds))
    axes.stairs(count / np.diff(edges), edges, color=BLUE, fill=True)
    # most bins are empty between blasts, and a logarithm has no zero
    axes.set_yscale("symlog", linthresh=100.0)


def _strip(figure: SubFigure, run: RunFolder) -> None:
    """Draw frames in a row: the first, and those soon after each blast."""
    from matplotlib.image import imread

    times = np.array([time for time, _ in run.frames])
    bursts = [blast["time_s"] for blast in run.document["blasts"]]
    shown = max(FRAMES // max(len(bursts), 1), 1)
    numbers = [
        int(np.searchsorted(times, burst)) + step
        for burst in bursts
        # growing intervals, as a fireball changes fastest at first
        for step in np.unique(np.geomspace(1.0, 60.0, shown).astype(int)) - 1
    ]
    numbers = sorted({n for n in numbers if n < len(times)} or {0})[:FRAMES]
    plots = figure.subplots(1, len(numbers), squeeze=False)[0]
    for axes, number in zip(plots, numbers, strict=True):
        time, file = run.frames[number]
        axes.imshow(imread(file))
        axes.set_axis_off()
        axes.set_title(f"{time:.3f} s", fontsize=8.5, color=MUTED)


def _key(axes: Axes) -> None:
    axes.legend(
        frameon=False, fontsize=8.5, ncols=3, loc="upper right", labelcolor=MUTED
    )


def map_figure(run: RunFolder, scene: Scene, answers: Sequence[ShotAnswer]) -> Figure:
    """Draw all positions; the diameter of a blast's marker grows with its mass.

    Args:
        run: The world.
        scene: The scene with its sensors.
        answers: Fits whose ellipses are drawn.
    """
    figure = new_figure(7.2, 6.4)
    axes = figure.subplots()
    quiet(axes)
    for sensor in scene.sensors:
        if not sensor.mount:
            east, north = np.asarray(sensor.position_m)[:2]
            axes.plot(east, north, "^", color=INK, markersize=6)
            _named(axes, sensor.name, east, north, INK)
    if scene.camera is not None and not scene.camera.mount:
        east, north = np.asarray(scene.camera.position)[:2]
        axes.plot(east, north, "v", color=INK, markersize=6)
        _named(axes, "camera", east, north, INK, below=True)
    if run.flight is not None:
        path = run.flight[["east_m", "north_m"]].to_numpy()
        axes.plot(*path.T, color=BLUE, linewidth=1.4, label="path of the vehicle")
        axes.plot(*path[:1].T, "s", color=BLUE, markersize=5)
    label = "blast, and its mass"
    for blast in run.document["blasts"]:
        east, north, _ = blast["position_m"]
        # lengths of a blast grow with the cube root of the mass (Hopkinson-Cranz)
        size = 5.0 + 4.0 * blast["mass_kg"] ** (1.0 / 3.0)
        axes.plot(
            *(east, north, "o"), color=VERMILLION, markersize=min(size, 24.0),
            alpha=0.75, linestyle="", label=label,
        )  # fmt: skip
        label = None
        label_ = f"{blast['shot']}: {blast['mass_kg']:.3g} kg, {blast['time_s']:.2f} s"
        _named(axes, label_, east, north, VERMILLION)
    label = "90 % ellipse of the fit"
    for answer in answers:
        if answer.ellipse is not None:
            rim = answer.ellipse.outline()
            rim = np.vstack([rim, rim[:1]])
            axes.plot(*rim.T, color=MUTED, linewidth=1.3, label=label)
            label = None
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.12)
    axes.set(xlabel="east [m]", ylabel="north [m]")
    titled(axes, "Map", "triangles: sensors")
    axes.legend(frameon=False, fontsize=9, labelcolor=MUTED, loc="best")
    return figure


def _named(
    axes, words: str, east: float, north: float, colour: str, *, below: bool = False
) -> None:
    axes.annotate(
        words, (east, north), (7, -12 if below else 5), textcoords="offset points",
        fontsize=8.5, color=colour,
    )  # fmt: skip


def read_run(path: str | Path) -> RunFolder:
    """Read the output folder of `jblast world`.

    Raises:
        InputError: It is another folder, or a file is missing or broken.
    """
    path = Path(path)
    document = _document(path / "run.json")
    flight = None
    if document["flight"] or document.get("mission"):
        flight = _table(path / "flight.csv")
    sensors = (document["sound"] or {"sensors": {}})["sensors"]
    waves = (_waveform(path / "sound", name, of) for name, of in sensors.items())
    return RunFolder(
        path,
        document,
        flight,
        tuple(waves),
        *_film(path / "camera", document["camera"]),
    )


def _document(file: Path) -> dict[str, Any]:
    if not file.exists():
        raise InputError(
            f"{file}: no such file; expected the output folder of `jblast world --out`"
        )
    try:
        document = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{file}: expected the JSON of `jblast world --out`, got a file that "
            f"cannot be read ({error})"
        ) from None
    if not isinstance(document, dict) or KEY not in document:
        raise InputError(
            f"{file}: expected the JSON of `jblast world --out`, got one without {KEY}"
        )
    return document


def _table(file: Path) -> pd.DataFrame:
    """Return a CSV table without its leading comments."""
    try:
        with file.open(encoding="utf-8") as lines:
            # `comment="#"` of pandas would also cut cells that contain the character
            comments = next(n for n, line in enumerate(lines) if line[:1] != "#")
        return pd.read_csv(file, skiprows=comments)
    except (OSError, ValueError, StopIteration) as error:
        raise InputError(f"{file}: expected a table ({error})") from None


def _waveform(directory: Path, name: str, entry: dict[str, Any]) -> Waveform:
    kind = SENSOR_KINDS.named(entry["kind"])
    file, names = directory / entry["file"], kind.columns
    if kind.file == ".wav":
        import soundfile

        try:
            samples, rate = soundfile.read(file, dtype="float32")
        except (OSError, soundfile.LibsndfileError) as error:
            raise InputError(f"{file}: expected sound ({error})") from None
        time, samples = np.arange(len(samples)) / rate, samples * entry["full_scale_pa"]
    else:
        table = _table(file)
        time, samples = table["time_s"].to_numpy(), table[list(names)].to_numpy()
        # one curve a sensor: the component with the largest range
        part = int(np.argmax(np.ptp(samples, axis=0))) if len(samples) else 0
        samples, names = samples[:, part], (names[part],)
    # unique: a record can have fewer samples than columns
    edges = np.unique(np.linspace(0, len(samples), COLUMNS_DRAWN + 1).astype(int)[:-1])
    if not len(samples):
        return Waveform(name, names[0], *np.zeros((3, 0)))
    least = np.minimum.reduceat(samples, edges)
    return Waveform(
        name, names[0], time[edges], least, np.maximum.reduceat(samples, edges)
    )


def _film(
    directory: Path, camera: dict[str, Any] | None
) -> tuple[tuple[tuple[float, Path], ...], Float[np.ndarray, " event"]]:
    if camera is None:
        return (), np.zeros(0)
    from jblast.sensors.camera.files.event_files import read_events

    with (directory / "frames.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    frames = [(float(r["time_s"]), directory / "frames" / r["file"]) for r in rows]
    events = read_events(directory / "events.h5")
    return tuple(frames), (events.t + events.t_offset) * 1e-6


def answers_of(
    directory: Path, document: dict[str, Any], scene: str | Path
) -> tuple[ShotAnswer, ...]:
    """Fit the readings of each blast of a world separately, and write fits.json.

    Args:
        directory: Folder of the world.
        document: Contents of its run.json.
        scene: Scene of the world; [world] becomes the prior.

    Raises:
        InputError: The scene or the readings cannot be used.
    """
    uncertain = scene_to_fit(scene)
    logs = by_shot(read(directory / "observations.csv"))
    blasts = {blast["shot"]: blast for blast in document["blasts"]}
    found = fit_each(logs, uncertain)
    save_text(fits_answer(found).to_json(), directory / "fits.json")
    return tuple(
        _answer(shot, found[shot], blasts[shot]) for shot in logs if shot in blasts
    )


def write_page(
    folder: str | os.PathLike[str],
    scene: str | os.PathLike[str] | None = None,
    *,
    fit: bool = False,
    out: str | os.PathLike[str] | None = None,
    begin: Callable[[str], object] = lambda stage: None,
) -> tuple[Path, tuple[ShotAnswer, ...]]:
    """Write the page of a world's folder; return its path and the fits on it.

    Args:
        folder: The folder, of `jblast world`.
        scene: Scene file of the run; default: the path in run.json.
        fit: True to fit the readings of each blast.
        out: The page; default: report.html in the folder.
        begin: Called with the name of each stage.

    Raises:
        InputError: The folder is another one, or the scene has changed or cannot be
            read.
    """
    world = read_run(Path(folder))
    # The run stores the path only; the file may have been moved since.
    scene = Path(scene or world.document["scene"])
    if not scene.is_file():
        raise InputError(
            f"{scene}: no such file; expected the scene file of {folder}: give its "
            f"path by {argument('scene')}"
        )
    now = provenance_of((), os.fspath(scene)).scene
    # Another scene would be drawn and fitted with other priors than those of the run.
    if now and now.sha256 != world.document["scene_sha256"]:
        raise InputError(
            f"{scene}: has changed since {folder} was made; expected SHA-256 "
            f"{world.document['scene_sha256']}, got {now.sha256}"
        )
    uncertain, _ = read_run_scene(scene)
    answers = ()
    if fit:
        begin("fitting")
        answers = answers_of(world.path, world.document, scene)
    begin("drawing")
    file = Path(out) if out else world.path / "report.html"
    save_text(world_page(world, uncertain.scene, answers), file)
    return file, answers


def answers_text(answers: Sequence[ShotAnswer]) -> str:
    """Return the fits next to the truth, for the terminal; "" without any."""
    if not answers:
        return ""
    table = _answers(answers)
    rows = [[str(cell) for cell in row] for row in (table.head, *table.rows)]
    return "\n".join(["", *aligned(rows, right=(2, 3, 4)), *table.lines]) + "\n"


def _answer(shot: str, found: Any, blast: dict[str, Any]) -> ShotAnswer:
    if isinstance(found, InputError):
        return ShotAnswer(shot, (), None, str(found))
    rows = [
        _row(name, found.summary.estimates[name], TRUTH[name](blast))
        for name in found.summary.free
        if name in TRUTH
    ]
    note = "" if found.exit_code == 0 else "not reliable: see `jblast fit`"
    return ShotAnswer(shot, tuple(rows), charge_ellipse(found), note)


def _row(
    name: str, estimate: Estimate, truth: float
) -> tuple[str, str, str, str, bool | None]:
    printed = printed_estimate(name, estimate)
    contains = None
    if estimate.identified:
        contains = bool(estimate.q05 <= truth <= estimate.q95)
    words = capitalised(parameter_words(name))
    return words, f"{truth:.6g}", printed.value_and_beside, printed.interval, contains
