"""Files of `jblast tune --out`: the tuned scene, the answer and a figure."""

import copy
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import jblast
from jblast.files import write_text
from jblast.inference.tuning.result import Tuned
from jblast.inference.tuning.sound import SoundEvidence
from jblast.inference.tuning.tune_sight import EventsEvidence, FramesEvidence, camera_of
from jblast.inference.tuning.unknowns import row_named, tuned_value
from jblast.parameters import CLOCK_OFFSET
from jblast.report.figure_files import write_drawn
from jblast.report.figures import (
    BLUE,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.tune import tune_answer
from jblast.results import Document
from jblast.scene.reader.tables import LISTS

GREY = "#b0b0b0"
SHOWN = 4
"""Number of frames in the figure."""
BEFORE_PART, AFTER_PART = 0.5, 3.0
"""Drawn interval before and after the blast's first energy, in units of the time in
which 98 % of its energy arrives."""
SCENE, JSON, FIGURE = "scene.toml", "tune.json", "tune.png"
NEUTRAL = {"filter_hz": "none", "threshold": 0.2}
"""Other entries of a list in the scene file, if only one of them is tuned."""


def frames_figure(tuned: Tuned, evidence: FramesEvidence) -> Figure:
    """Draw some frames, their residuals before and after tuning, and means."""
    camera = camera_of(tuned.scene)
    size = camera.height, camera.width
    seen = np.asarray(evidence.values)
    expected = [np.asarray(evidence.predicted(s)) for s in (tuned.before, tuned.scene)]
    times = 1e3 * np.asarray(evidence.times)
    chosen = np.linspace(0, len(times) - 1, min(SHOWN, len(times))).round().astype(int)
    figure = new_figure(11.0, 6.8)
    grid = figure.subplots(3, len(chosen) + 1, squeeze=False)
    rows = (
        ("recorded", seen, "gray"),
        ("residual before", seen - expected[0], "RdBu"),
        ("residual after", seen - expected[1], "RdBu"),
    )
    for axes_row, (name, values, colours) in zip(grid, rows, strict=True):
        low, high, scale = 0.0, 255.0, ""
        if name != "recorded":
            high = max(float(np.abs(values[chosen]).max()), 1.0)
            # symmetric about 0, so that no residual is white
            low, scale = -high, f"colours to ±{high:.2g}"
        for axes, number in zip(axes_row, chosen, strict=False):
            image = np.full(size, np.nan).ravel()
            image[np.asarray(evidence.pixels)] = values[number]
            # unused pixels are NaN, and show this colour, which no grey frame contains
            axes.imshow(np.ones(size), cmap="Pastel1", vmin=0.0, vmax=8.0)
            axes.imshow(image.reshape(size), cmap=colours, vmin=low, vmax=high)
            axes.set_axis_off()
            titled(axes, f"{name}, {times[number]:.3g} ms")
        below: dict[str, Any] = {
            "transform": axes_row[0].transAxes,
            "fontsize": 8,
            "color": MUTED,
        }
        axes_row[0].text(0.0, -0.04, scale, va="top", **below)
    top, *rest = grid[:, -1]
    for values, colour, width in (
        (seen, GREY, 4.0),
        (expected[0], VERMILLION, 1.0),
        (expected[1], BLUE, 1.2),
    ):
        top.plot(times, values.mean(axis=1), color=colour, linewidth=width)
    titled(top, "mean grey value")
    for axes, values, colour in zip(rest, expected, (VERMILLION, BLUE), strict=True):
        rms = np.sqrt(np.square(seen - values).mean(axis=1))
        axes.plot(times, rms, color=colour, linewidth=1.2)
        axes.set_ylim(0.0)
        titled(axes, "rms of the residual")
    for axes in grid[:, -1]:
        quiet(axes)
        axes.set_xlabel("time [ms]")
    return figure


def events_figure(tuned: Tuned, evidence: EventsEvidence) -> Figure:
    """Draw the change of light between events, and the residuals of the thresholds."""
    sign = np.asarray(evidence.events.sign)
    time = 1e3 * np.asarray(evidence.events.time)
    figure = new_figure(11.0, 6.4)
    grid = figure.subplots(2, 2)
    drawn = ((tuned.before, VERMILLION, "before"), (tuned.scene, BLUE, "after"))
    for (left, right), (scene, colour, name) in zip(grid, drawn, strict=True):
        change = np.asarray(evidence.changes(scene))
        threshold = np.asarray(camera_of(scene).threshold)
        limit = 2.5 * float(threshold.max())
        left.hist(change, np.linspace(-limit, limit, 161), color=colour, alpha=0.7)
        for one in (threshold[0], -threshold[1]):
            left.axvline(float(one), color=GREY, linewidth=1.0)
        left.set_xlabel("change of the logarithm of light")
        titled(left, f"From event to event, {name}", "grey: thresholds")
        rest = np.clip(np.asarray(evidence.left(scene)), -1.0, 1.0)
        right.plot(time, rest, ".", color=colour, markersize=2.0, alpha=0.4)
        right.set_ylim(-1.05, 1.05)
        right.set_xlabel("time [ms]")
        right.set_ylabel("thresholds, at most 1")
        titled(right, f"Residuals, {name}", f"{sign.size:,} events")
    for axes in grid.ravel():
        quiet(axes)
    return figure


def tune_figure(tuned: Tuned) -> Figure:
    """Draw a record, its prediction before and after tuning, and the residuals."""
    evidence = tuned.problem.evidence
    if isinstance(evidence, SoundEvidence):
        return sound_figure(tuned, evidence)
    if isinstance(evidence, FramesEvidence):
        return frames_figure(tuned, evidence)
    return events_figure(tuned, evidence)


def sound_figure(tuned: Tuned, evidence: SoundEvidence) -> Figure:
    """Draw the waveform around the blast, the spectrum, and residuals over time."""
    before, after = tuned.before, tuned.scene
    unit = float(evidence.unit(after))
    record = unit * np.asarray(evidence.samples)
    expected = [
        float(evidence.unit(scene)) * np.asarray(evidence.predicted(scene))
        for scene in (before, after)
    ]
    instrument = after.sensors[evidence.index].instrument
    assert instrument is not None
    rate = instrument.rate
    figure = new_figure(11.0, 7.6)
    (wave, spectrum), (left, rest) = figure.subplots(2, 2)
    near = _near(expected[1], record.size)
    time = np.arange(record.size) / rate
    # a near blast has tens of kPa, and far ones a few Pa
    scale, symbol = (1e-3, "kPa") if np.abs(record[near]).max() > 2e3 else (1.0, "Pa")
    drawn = (
        (record, GREY, 3.0),
        (expected[0], VERMILLION, 1.0),
        (expected[1], BLUE, 1.2),
    )
    for samples, colour, width in drawn:
        wave.plot(time[near], scale * samples[near], color=colour, linewidth=width)
    titled(wave, "The blast", "record, expected before and after")
    for samples, colour in zip(expected, (VERMILLION, BLUE), strict=True):
        left.plot(
            time[near], scale * (record - samples)[near], color=colour, linewidth=0.9
        )
    titled(left, "Residual", "record minus expected")
    for axes in (wave, left):
        axes.set_ylabel(f"overpressure [{symbol}]")
        axes.set_xlabel("time by the sensor's clock [s]")
        axes.set_xlim(time[near][0], time[near][-1])
    _spectra(spectrum, evidence, tuned, rate)
    white = np.asarray(evidence.time_residuals(after))
    _envelope(rest, time, white)
    titled(rest, "Residual of the whole record", "in standard deviations of the noise")
    rest.set_xlabel("time by the sensor's clock [s]")
    for axes in (wave, spectrum, left, rest):
        quiet(axes)
    names = {"record": GREY, "expected before": VERMILLION, "after": BLUE}
    lines = [Line2D([], [], color=colour, linewidth=2.0) for colour in names.values()]
    place = {"loc": "outside lower center", "ncols": 3, "frameon": False}
    figure.legend(lines, [*names], fontsize=9, **place)
    return figure


def _near(expected: Float[np.ndarray, " sample"], count: int) -> slice:
    """Return the samples around the expected blast; all samples without one."""
    energy = np.cumsum(np.square(expected))
    if not energy[-1] > 0:
        return slice(0, count)
    # the last 2 % of the energy arrive in a long, flat tail
    first, last = np.searchsorted(energy, np.array([1e-4, 0.98]) * energy[-1])
    # a pulse of a few samples needs some more around it to be seen
    length = max(int(last - first), 32)
    start = max(int(first - BEFORE_PART * length), 0)
    return slice(start, min(int(first + AFTER_PART * length), count))


def _spectra(axes: Axes, evidence: SoundEvidence, tuned: Tuned, rate: float) -> None:
    """Draw the power of the residuals, and the noise before and after tuning."""
    bands, scale = np.asarray(evidence.bands), np.asarray(evidence.counts)
    frequency = np.linspace(0.0, 0.5 * rate, bands.size)
    middle = np.array(
        [np.exp(np.log(frequency[bands == one]).mean()) for one in range(scale.size)]
    )
    used = bands >= 0
    power = np.asarray(evidence.weights(tuned.scene).power)
    unit = float(evidence.unit(tuned.scene))
    # one-sided density: 2 |X|^2 over the sample rate and the energy of the taper
    weight = float(np.square(np.asarray(evidence._taper())).sum()) * 0.5 * rate

    def level(values: Any, one: float) -> Float[np.ndarray, " band"]:
        total = np.bincount(bands[used], np.asarray(values)[used], scale.size)
        return 10.0 * np.log10(one**2 * total / scale / weight / (20e-6) ** 2)

    axes.plot(middle, level(power, unit), "o", color=GREY, markersize=5.0)
    for scene, colour in ((tuned.before, VERMILLION), (tuned.scene, BLUE)):
        one = float(evidence.unit(scene))
        axes.plot(
            middle, level(evidence.noise(scene), one), color=colour, linewidth=1.2
        )
    axes.set_xscale("log")
    axes.set_xlim(middle[0], middle[-1])
    log_ticks(axes.xaxis, axes.get_xlim())
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("dB re (20 µPa)²/Hz")
    titled(axes, "Noise", "power of the residual, expected before and after")


def _envelope(
    axes: Axes,
    time: Float[np.ndarray, " sample"],
    white: Float[np.ndarray, " sample"],
) -> None:
    """Draw the smallest and largest sample of each column."""
    # about a column a pixel: a line through all samples is slow to draw and looks the
    # same
    columns = min(white.size, 800)
    edges = np.linspace(0, white.size, columns + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(white, edges), np.maximum.reduceat(white, edges)
    axes.fill_between(time[edges], low, high, color=BLUE, alpha=0.5, linewidth=0.0)
    axes.set_xlim(0.0, float(time[-1]))
    axes.set_ylabel("standard deviations")


def write_tuned(
    tuned: Tuned, directory: Path, scene: str, recorded: str
) -> tuple[str, ...]:
    """Write the tuned scene, the answer and a figure; return the file names.

    A figure that cannot be drawn is left out, with a warning.

    Args:
        tuned: The tuned parameters.
        directory: Output directory; created if missing.
        scene: File of the scene, which is read again.
        recorded: The record.

    Raises:
        OSError: It cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    document = moved(tomllib.loads(Path(scene).read_text("utf-8")), scene, directory)
    index = tuned.problem.evidence.index
    sensor = tuned.scene.sensors[index].name if index >= 0 else None
    values = {
        name: float(np.asarray(tuned_value(tuned.scene, index, name)))
        for name in tuned.numbers
    }
    unknown = [name for name, one in tuned.numbers.items() if not one.identified]
    comments = [
        f"tuned by jblast {jblast.__version__}: {', '.join(values)} of "
        f"{Path(scene).name} to {Path(recorded).name}",
    ]
    if unknown:
        comments.append(f"not identified by the record: {', '.join(unknown)}")
    text = scene_text(tuned_document(document, values, sensor), comments)
    return write_scene_and_answer(
        directory,
        text,
        partial(tune_figure, tuned),
        partial(tune_answer, tuned, scene, recorded),
    )


def write_scene_and_answer(
    directory: Path,
    scene: str,
    draw: Callable[[], Figure],
    answer: Callable[[tuple[str, ...]], Document],
) -> tuple[str, ...]:
    """Write a tuned scene, its figure and the answer; return the file names.

    Args:
        directory: Output directory, which exists.
        scene: The scene as TOML.
        draw: Function that draws the figure.
        answer: Function that returns the answer, which lists the written files.
    """
    # files of an earlier run go first: a figure that fails must not leave an old one
    for name in (SCENE, JSON, FIGURE):
        (directory / name).unlink(missing_ok=True)
    write_text(directory / SCENE, scene)
    names = [SCENE, JSON]
    if write_drawn(draw, directory / FIGURE) is not None:
        names.append(FIGURE)
    write_text(directory / JSON, answer(tuple(names)).to_json())
    return tuple(names)


def tuned_document(
    document: Mapping[str, Any], values: Mapping[str, float], sensor: str | None
) -> dict[str, Any]:
    """Return the tables of a scene with some numbers replaced.

    Args:
        document: The tables.
        values: New values, by names as in `--free`.
        sensor: Name of the recording sensor.
    """
    tuned = copy.deepcopy(dict(document))
    for name, value in values.items():
        key, label = row_named(name).key, name.partition(".")[2]
        written = key.name
        if name.startswith(CLOCK_OFFSET):
            named = [one for one in tuned.get("sensor", []) if one["name"] == label]
            entry = named[0] if named else _named(tuned, "clock", label)
            # the clock of a single sensor is an entry of the sensor; a clock that
            # several share has a table of its own
            written = "clock_offset_s" if named else "offset_s"
        elif key.table == "sensor":
            entry = _named(tuned, "sensor", sensor or "")
        elif key.table == "charge":
            entry = _charge(tuned, label)
        else:
            entry = tuned.setdefault(key.table, {})
        if key.index is None:
            entry[written] = value
            continue
        count = LISTS[written].count(",") + 1
        old = entry.get(written, NEUTRAL.get(written, 0.0))
        # a scene may have one number for both entries of a list
        parts = list(old) if isinstance(old, list) else [old] * count
        parts[key.index] = value
        entry[written] = parts
    return tuned


def scene_text(document: Mapping[str, Any], comments: Sequence[str] = ()) -> str:
    """Return the tables of a scene as TOML."""
    lines = [f"# {line}" for line in comments]
    tables, arrays = [], []
    for key, value in document.items():
        if isinstance(value, Mapping):
            tables.append((key, value))
        elif isinstance(value, list):
            arrays.append((key, value))
        else:
            # plain keys come first: after a header they would belong to its table
            lines.append(f"{_word(key)} = {_value(value)}")
    for key, entry in tables:
        lines += ["", f"[{_word(key)}]", *_entries(entry)]
    for key, entries in arrays:
        for entry in entries:
            lines += ["", f"[[{_word(key)}]]", *_entries(entry)]
    return "\n".join(lines) + "\n"


def moved(document: Mapping[str, Any], source: str, directory: Path) -> dict[str, Any]:
    """Return the tables of a scene with file names relative to another folder."""
    tuned = copy.deepcopy(dict(document))
    ambient = tuned.get("ambient", {})
    if "file" in ambient:
        file = Path(source).parent / ambient["file"]
        ambient["file"] = Path(os.path.relpath(file, directory)).as_posix()
    return tuned


def _named(document: dict[str, Any], table: str, name: str) -> dict[str, Any]:
    entries = document.setdefault(table, [])
    for entry in entries:
        if entry["name"].strip() == name:
            return entry
    entries.append({"name": name})
    return entries[-1]


def _charge(document: dict[str, Any], name: str) -> dict[str, Any]:
    charges = document.setdefault("charge", {})
    # one [charge] is a table, several [[charge]] are a list
    if isinstance(charges, dict):
        return charges
    if not name:
        return charges[0]
    return next(one for one in charges if one["name"].strip() == name)


def _entries(entry: Mapping[str, Any]) -> list[str]:
    return [f"{_word(key)} = {_value(value)}" for key, value in entry.items()]


def _word(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    return key if plain.isascii() and plain.isalnum() else _quoted(key)


def _value(value: Any) -> str:
    """Return a value as TOML."""
    # before numbers: True is an int, and TOML has true
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_word(k)} = {_value(v)}" for k, v in value.items())
        return f"{{ {inner} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    # ten digits are finer than any uncertainty, and hide rounding errors
    return repr(float(f"{value:.10g}")) if isinstance(value, float) else str(value)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    shown = "".join(
        char if char >= " " and char != "\x7f" else f"\\u{ord(char):04x}"
        for char in escaped
    )
    return f'"{shown}"'
