"""Answers of `jblast tune`: sensors and media by a record, or gains by blasts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import compress
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tomlkit

from jblast.files import PAGE
from jblast.inference.posterior.parameters import Estimate
from jblast.inference.tuning.result import POOR, Explained, NotIdentified, Tuned
from jblast.inference.tuning.scene_file import put_values, tuned_scene
from jblast.inference.tuning.unknowns import (
    IDENTIFIED_BY,
    TUNABLES,
    row_named,
    tuned_value,
)
from jblast.parameters import CLOCK, CLOCK_OFFSET, PARAMETERS, Key
from jblast.report.estimates import printed_estimate
from jblast.report.messages import sentence, sentences_of
from jblast.report.numbers import capitalised, printed_number
from jblast.report.output import Answer
from jblast.report.view import (
    Block,
    Column,
    Facts,
    Lines,
    Picture,
    Table,
    Text,
    View,
    drawn_by,
)
from jblast.results import AMONG, Document, Note, among, filled, problem, warning
from jblast.study.gains import (
    EvaluatedGains,
    TunedGains,
    keys_of_gains,
    known_peaks,
)
from jblast.vehicle import STEP_S, vehicle_of
from jblast.vehicle.control.stability import LOOPS

TESTS = {
    "spectrum": "noise in frequency bands",
    "whiteness": "serial correlation of the residuals",
    "blast": "residuals during the blast",
    "error": "size of the residuals",
}
"""Names of the tests of the residuals."""
FILES = ("scene.toml", "tune.png")
"""Files besides document and page."""
WRITTEN = ("scene.toml", "tune.json", "tune.png", PAGE)
GAINS = {
    "kp_pos": "position [1/s2]",
    "kd_pos": "velocity [1/s]",
    "ki_pos": "integral [1/s3]",
    "kp_att": "attitude [1/s2]",
    "kd_att": "body rate [1/s]",
}


@dataclass(frozen=True)
class TunedEstimate:
    """A tuned parameter.

    Attributes:
        found: Its value with an interval.
        before: Value in the scene, or start of the search.
        fitted: Value in the tuned scene, identified or not.
        unit: Unit of these numbers.
        key: Its key in a scene file.
    """

    found: Estimate = field(metadata=among("value", "sd", "q05", "q95"))
    before: float
    fitted: float
    unit: str
    key: str


@dataclass(frozen=True)
class TuneAnswer(Document):
    """An answer of jblast tune.

    Attributes:
        scene: The scene's file.
        recorded: The record: a file or a folder.
        kind: Kind of the record.
        sensor: Name of the sensor; null for the camera.
        estimates: Tuned parameters, by name.
        free: Names of the tuned parameters.
        fixed: Other parameters that such a record can constrain, which were fixed at
            the scene's values, by name; null if the scene has none.
        identifiable: Whether the record identifies all tuned parameters.
        null_directions: Combinations that it does not constrain.
        explained: Tests of the residuals; the fit is poor if one of `tests` is below
            0.001.
        converged: Whether the search converged.
        warnings: Warnings, as sentences.
        files: Files that were written.
    """

    scene: str
    recorded: str
    kind: Literal["sound", "frames", "events"]
    sensor: str | None
    estimates: Mapping[str, TunedEstimate]
    free: tuple[str, ...]
    fixed: Mapping[str, float | None]
    identifiable: bool
    null_directions: tuple[NotIdentified, ...]
    explained: Explained = field(metadata=AMONG)
    converged: bool
    warnings: tuple[str, ...]
    files: tuple[str, ...]


@dataclass(frozen=True)
class LoopMargins:
    """Stability margins of one loop; null is an infinite margin.

    Attributes:
        gain_up_db: Largest increase of the rotors' gain.
        gain_down_db: Largest decrease of the rotors' gain.
        phase_deg: Largest additional phase lag.
        distance: Least distance of the loop's frequency response from -1.
    """

    gain_up_db: float
    gain_down_db: float
    phase_deg: float
    distance: float


@dataclass(frozen=True)
class Peaks:
    """Peak deviations from the target over the unseen blasts [m]; null is infinite.

    Attributes:
        q50: Median.
        q90: 90 % quantile.
        worst: The largest.
    """

    q50: float
    q90: float
    worst: float


@dataclass(frozen=True)
class TriedGains:
    """A position controller with some gains.

    Attributes:
        gains: Gains by the names of `[vehicle] control`.
        gain_margin_db: Least gain margin of all loops, upwards and downwards.
        phase_margin_deg: Least phase margin of all loops.
        margins: Margins by loop.
        peak_deviation_m: Peak deviations over the unseen blasts.
        error_after_m: Root mean square of the path error from the first blast to the
            end of the flight; median over the unseen blasts.
        flies_on_share: Share of the unseen blasts after which the vehicle flies on.
    """

    gains: Mapping[str, float | tuple[float, ...]]
    gain_margin_db: float
    phase_margin_deg: float
    margins: Mapping[str, LoopMargins]
    peak_deviation_m: Peaks
    error_after_m: float
    flies_on_share: float


@dataclass(frozen=True)
class GainsAnswer(Document):
    """The answer of `jblast tune --gains`.

    Attributes:
        scene: The scene's file.
        vehicle: Model of the vehicle.
        seed: Seed of the blasts.
        vehicles: Number of blasts for tuning.
        unseen: Number of blasts for validation.
        margin_db: Required gain margin.
        margin_deg: Required phase margin.
        motor_lag_s: Time constant of the motors.
        dead_time_s: Dead time of the loops, included in the margins.
        before: Gains of the scene.
        after: Tuned gains.
        cut: Relative reduction of the median peak deviation.
        flights_of_the_search: Number of times all blasts were flown, with derivatives.
        converged: Whether the search converged.
        warnings: Warnings, as sentences.
        files: Files that were written.
    """

    scene: str
    vehicle: str
    seed: int
    vehicles: int
    unseen: int
    margin_db: float
    margin_deg: float
    motor_lag_s: float
    dead_time_s: float
    before: TriedGains
    after: TriedGains
    cut: float
    flights_of_the_search: int
    converged: bool
    warnings: tuple[str, ...]
    files: tuple[str, ...]


def tune_answer(
    tuned: Tuned, scene: str, recorded: str, out: str | None = None
) -> Answer:
    """Return the answer on tuned parameters.

    Args:
        tuned: The tuned parameters.
        scene: The scene's file.
        recorded: The record.
        out: Output folder; None: no files.
    """
    index = tuned.problem.evidence.index
    sensor = tuned.scene.sensors[index].name if index >= 0 else None
    estimates = {
        name: TunedEstimate(
            one,
            before=float(np.asarray(tuned_value(tuned.before, index, name))),
            fitted=float(np.asarray(tuned_value(tuned.scene, index, name))),
            unit=row_named(name).unit,
            key=key_words(name, sensor),
        )
        for name, one in tuned.numbers.items()
    }
    fixed = {
        name: tuned_value(tuned.before, index, name)
        for name, kinds in IDENTIFIED_BY.items()
        if tuned.kind in kinds and name not in tuned.numbers
    }
    notes, record = notes_of(tuned), Path(recorded).name
    document = filled(
        TuneAnswer,
        tuned,
        scene=scene,
        recorded=record,
        sensor=sensor,
        estimates=estimates,
        free=tuple(tuned.numbers),
        fixed={n: None if x is None else float(x) for n, x in fixed.items()},
        identifiable=tuned.is_identifiable,
        warnings=tuple(sentences_of(notes)),
        files=WRITTEN if out else (),
    )
    of = "the camera" if sensor is None else f"sensor {sensor!r}"
    blocks = [
        Table(ESTIMATES, [*estimates.items()]),
        Facts([*_facts(document)]),
        Picture("tune.png", drawn_by("tune_figures.tune_figure", tuned)),
    ]
    view = _view(f"{record}: {tuned.kind} of {of} of {scene}", blocks, notes)
    unknown = [name for name, one in tuned.numbers.items() if not one.identified]
    comments = [f"{', '.join(estimates)} of {Path(scene).name} to {record}"]
    if unknown:
        comments.append(f"not identified by the record: {', '.join(unknown)}")
    values = {name: one.fitted for name, one in estimates.items()}
    change = partial(put_values, values=values, sensor=sensor)
    return Answer(document, view, _written(scene, out, change, comments))


def gains_answer(tuned: TunedGains, scene: str, out: str | None = None) -> Answer:
    """Return the answer on tuned gains; arguments as of `tune_answer`."""
    settings, notes = tuned.settings, gain_notes(tuned)
    document = filled(
        GainsAnswer,
        settings,
        tuned,
        scene=scene,
        vehicle=tuned.vehicle.model,
        motor_lag_s=float(vehicle_of(tuned.vehicle).motor_lag_s),
        # a command is held for a whole step: it is half a step late on average
        dead_time_s=STEP_S / 2 + settings.delay_s,
        before=_tried(tuned.before),
        after=_tried(tuned.after),
        cut=tuned.cut(),
        flights_of_the_search=len(tuned.ln_peaks),
        warnings=tuple(sentences_of(notes)),
        files=WRITTEN if out else (),
    )
    gains = document.after.gains
    entries: dict[str, Any] = {"integral": "ki_pos" in gains}
    entries |= {k: list(x) if isinstance(x, tuple) else x for k, x in gains.items()}
    line = ", ".join(
        f"{key} = {tomlkit.item(value).as_string()}" for key, value in entries.items()
    )
    before, after = map(_numbers, (document.before, document.after))
    blocks = [
        Table(CHANGES, [(name, before[name], after[name]) for name in after]),
        Picture("tune.png", drawn_by("tune_figures.gains_figure", tuned)),
        Lines("", [sentence(REQUIRED, document)]),
        Text("Line for the scene's [vehicle]", f"control = {{ {line} }}", "everywhere"),
    ]
    title = f"{sentence(SEARCHED, document)}: {cut_words(tuned)}"

    def change(tables: Any) -> None:
        tables["vehicle"].setdefault("control", {}).update(entries)

    comments = ["gains to the blasts of this scene"]
    files = _written(scene, out, change, comments)
    return Answer(document, _view(title, blocks, notes), files)


SEARCHED = (
    "{vehicle}: gains tuned by gradient over {vehicles} blasts, validated with "
    "{unseen} unseen blasts"
)
REQUIRED = (
    "Required margins: {margin_db:g} dB and {margin_deg:g} degrees, each loop opened "
    "at the rotors. Motor lag {motor_lag_s:g} s, dead time {dead_time_s:.3g} s."
)


def _view(title: str, blocks: Sequence[Block], notes: Sequence[Note]) -> View:
    """Return a view with its problems first, and the other notes last."""
    texts = [f"{capitalised(one)}." for one in sentences_of(notes)]
    is_problem = [note.level == "problem" for note in notes]
    problems = [*compress(texts, is_problem)]
    others = Lines("Warnings", [one for one in texts if one not in problems])
    return View(title, [*blocks, others], problems=problems)


def _written(
    scene: str, out: str | None, change: Any, comments: list[str]
) -> dict[str, str]:
    return {"scene.toml": tuned_scene(scene, out, change, comments)} if out else {}


def parameters_view() -> View:
    """Return every tunable parameter, with unit, default and key in a scene file."""
    rows = [
        (name, row, ", ".join(IDENTIFIED_BY[name])) for name, row in TUNABLES.items()
    ]
    known = {**PARAMETERS, f"{CLOCK.name}.NAME": CLOCK}
    rows += [(name, row, "priors") for name, row in known.items()]
    columns = [
        Column("name", lambda row: row[0]),
        Column("unit", lambda row: row[1].unit),
        Column(
            "default",
            lambda row: (
                "from the record"
                if math.isnan(row[1].default)
                else f"{row[1].default:g}"
            ),
        ),
        Column("identified by", lambda row: row[2]),
        Column("in the scene file", lambda row: _place(row[1].key)),
    ]
    return View("Parameters that can be tuned", [Table(columns, rows)])


ESTIMATES = [
    Column("", lambda row: row[0]),
    Column(
        "value", lambda row: printed_estimate(row[0], row[1].found).value, right=True
    ),
    Column(
        "90 % interval", lambda row: printed_estimate(row[0], row[1].found).interval
    ),
    Column("before", lambda row: printed_number(row[0], row[1].before), right=True),
    Column("", lambda row: row[1].key),
]
CHANGES = [
    Column("", lambda row: row[0]),
    Column("before", lambda row: f"{row[1]:.4g}", right=True),
    Column("after", lambda row: f"{row[2]:.4g}", right=True),
    Column(
        "change",
        lambda row: change_words(*row[1:]) if "[m]" in row[0] else "",
        right=True,
    ),
]


def change_words(before: float, after: float) -> str:
    """Return a relative change in per cent; "" where it is not a number."""
    if not (math.isfinite(before) and math.isfinite(after) and before > 0):
        return ""
    return f"{100 * (after / before - 1):+.1f} %"


def _numbers(tried: TriedGains) -> dict[str, float]:
    """Return gains and their results by printed names."""
    found: dict[str, float] = {}
    for key, value in tried.gains.items():
        if isinstance(value, tuple):
            found[f"{GAINS[key]}, sideways"] = value[0]
            found[f"{GAINS[key]}, upwards"] = value[2]
        else:
            found[GAINS[key]] = value
    peaks = tried.peak_deviation_m
    return found | {
        "gain margin [dB]": tried.gain_margin_db,
        "phase margin [deg]": tried.phase_margin_deg,
        "peak deviation, median [m]": peaks.q50,
        "peak deviation, 90 % [m]": peaks.q90,
        "peak deviation, worst [m]": peaks.worst,
        "path error after, median [m]": tried.error_after_m,
        "fly on [%]": 100 * tried.flies_on_share,
    }


def _facts(answer: TuneAnswer) -> Any:
    """Yield fixed parameters and the fit."""
    fixed = [f"{name} {x:.4g}" for name, x in answer.fixed.items() if x is not None]
    yield "fixed by the scene", ", ".join(fixed)
    left = answer.explained
    if left.error is not None and left.error_allowed is not None:
        unit = "steps of 8 bits" if answer.kind == "frames" else "thresholds"
        limit = f"(good fit: up to {left.error_allowed:.2g})"
        yield "residuals", f"{left.error:.2g} {unit} {limit}"
    worst = min(left.tests.items(), key=lambda one: one[1], default=None)
    p = "" if worst is None else f"; smallest p = {worst[1]:.2g} ({TESTS[worst[0]]})"
    yield "chi2", f"{left.chi2:.6g}, expected {left.dof:,}{p}"


def notes_of(tuned: Tuned) -> list[Note]:
    """Return notes on tuned parameters."""
    found = list(tuned.notes)
    for direction in tuned.null_directions:
        names = list(direction.parameters)
        kind = "not_constrained" if len(names) == 1 else "not_separated"
        found.append(problem(kind, names=names))
    found += [warning("interval_of_prior", name=name) for name in tuned.by_prior]
    for name in tuned.at_bound:
        value = tuned_value(tuned.scene, tuned.problem.evidence.index, name)
        printed = printed_number(name, float(np.asarray(value)))
        found.append(warning("at_bound", name=name, value=printed))
    explained = tuned.explained
    if explained.is_poor:
        poor = [TESTS[name] for name, p in explained.tests.items() if p < POOR]
        # residuals can be too large while every test of their pattern passes
        found.append(problem("poor_residuals", tests=poor or [TESTS["error"]]))
    if not tuned.converged:
        found.append(problem("search_not_converged"))
    return found


def gain_notes(tuned: TunedGains) -> list[Note]:
    """Return notes on tuned gains."""
    before, after, settings = tuned.before, tuned.after, tuned.settings
    margins = (
        (before.gain_margin_db, settings.margin_db, "dB"),
        (before.phase_margin_deg, settings.margin_deg, "degrees"),
    )
    short = [
        f"{margin:.3g} {unit}" for margin, least, unit in margins if margin < least
    ]
    fewer = float(np.mean(before.outcomes.flies_on) - np.mean(after.outcomes.flies_on))
    old, new = (
        np.nanmedian(one.outcomes.metrics.error_after_m) for one in (before, after)
    )
    found = [
        *((True, warning("remark", text=text)) for text in tuned.notes),
        (bool(short), warning("margins_short", margins=short)),
        (fewer > 0, warning("fewer_fly_on", percent=100 * fewer)),
        (tuned.cut(1.0) < 0 < tuned.cut(), warning("largest_peak_grew")),
        (not tuned.cut() > 0, warning("median_peak_not_less")),
        (new > old, warning("slower_recovery")),
        (not tuned.converged, problem("gains_not_converged")),
    ]
    return [note for holds, note in found if holds]


def cut_words(tuned: TunedGains) -> str:
    """Return the change of the median peak deviation, as text."""
    cut = tuned.cut()
    if not np.isfinite(cut):
        return "median peak deviation not comparable"
    return f"median {100 * abs(cut):.0f} % {'less' if cut >= 0 else 'more'}"


def key_words(name: str, sensor: str | None) -> str:
    """Return the key of a parameter in a scene file, as text."""
    key, label = row_named(name).key, name.partition(".")[2]
    if name.startswith(CLOCK_OFFSET):
        key = Key("sensor", "clock_offset_s")
    elif key.table == "sensor":
        label = label or sensor or ""
    return _place(key, label)


def _place(key: Key, label: str = "") -> str:
    is_list = label or key.table == "sensor"
    table = f"[[{key.table}]]" if is_list else f"[{key.table}]"
    of = f" {label!r}" if label else ""
    return f"{table}{of} {key.name}" + ("" if key.index is None else f"[{key.index}]")


def _tried(tried: EvaluatedGains) -> TriedGains:
    each = zip(LOOPS, *(np.asarray(x).tolist() for x in tried.margins), strict=True)
    peaks = known_peaks(tried)
    return filled(
        TriedGains,
        tried,
        gains=keys_of_gains(tried.gains),
        margins={name: LoopMargins(*values) for name, *values in each},
        peak_deviation_m=Peaks(
            *(float(np.quantile(peaks, q)) for q in (0.5, 0.9, 1.0))
        ),
        error_after_m=float(np.nanmedian(tried.outcomes.metrics.error_after_m)),
        flies_on_share=float(np.mean(tried.outcomes.flies_on)),
    )
