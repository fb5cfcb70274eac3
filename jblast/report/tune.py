"""The answer of `jblast tune`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from jblast.inference.tuning.result import (
    POOR,
    Explained,
    Note,
    Tuned,
    TunedNumber,
)
from jblast.inference.tuning.unknowns import TUNABLES, names_known, tuned_value
from jblast.parameters import CLOCK, CLOCK_OFFSET, PARAMETERS, Key
from jblast.report.words import aligned, hanging, joined, parameter_words, rounded
from jblast.results import AMONG, Document, among
from jblast.scene import parameter_named

NOT_TOLD = "not told"
TESTS = {
    "spectrum": "the noise in bands of frequency",
    "whiteness": "likeness of neighbours in what is left",
    "blast": "what is left while the blast goes by",
    "error": "size of what is left",
}
"""What was looked at, in words."""


@dataclass(frozen=True)
class NotTold:
    """A change of several numbers that leaves the record as it is.

    Attributes:
        parameters: By name, how much each takes part in it, in large changes of each.
    """

    parameters: Mapping[str, float]


@dataclass(frozen=True)
class TunedEstimate:
    """A number that was looked for.

    Attributes:
        found: Its value with an interval, and its values before the search and in the
            tuned scene.
        unit: Of all its numbers.
        key: Where it stands in a scene file.
    """

    found: TunedNumber = field(
        metadata=among("value", "sd", "q05", "q95", "before", "fitted")
    )
    unit: str
    key: str


@dataclass(frozen=True)
class TuneAnswer(Document):
    """An answer of jblast tune.

    Attributes:
        scene: The scene's file.
        recorded: What was recorded: the file or the folder.
        kind: What it holds.
        sensor: Name of who recorded; null of the camera.
        estimates: What was looked for, by name.
        free: Their names.
        fixed: Numbers that such a record could tell and that were taken as the scene
            has them, by name; null where it has none.
        identifiable: Whether the record identifies all searched parameters.
        null_directions: Combinations that it does not constrain.
        explained: How well the record is explained; poorly if one of `tests` is below
            0.001.
        converged: Whether the search ended of itself.
        warnings: Warnings, a sentence each.
        files: What was written.
    """

    scene: str
    recorded: str
    kind: Literal["sound", "frames", "events"]
    sensor: str | None
    estimates: Mapping[str, TunedEstimate]
    free: tuple[str, ...]
    fixed: Mapping[str, float | None]
    identifiable: bool
    null_directions: tuple[NotTold, ...]
    explained: Explained = field(metadata=AMONG)
    converged: bool
    warnings: tuple[str, ...]
    files: tuple[str, ...]


def tune_text(answer: TuneAnswer) -> str:
    """Return numbers with intervals, how well the record is explained, and doubts."""
    rows = [["", "value", "90 % interval", "unit", "before", ""]]
    for name, one in answer.estimates.items():
        value, interval, found = NOT_TOLD, "", one.found
        if found.value is not None and found.sd is not None:
            sd = max(found.sd, 1e-12 * abs(found.value))
            value = rounded(found.value, sd)
            ends = [rounded(x, sd) for x in (found.q05, found.q95) if x is not None]
            interval = " to ".join(ends)
        unit = "" if one.unit == "1" else one.unit
        rows.append([name, value, interval, unit, f"{found.before:.4g}", one.key])
    lines = [f"{answer.recorded}: {_who(answer)}", *aligned(rows, right=(1, 4))]
    if decibels := _decibels(answer):
        lines.append(decibels)
    lines.append(_fixed(answer))
    left = answer.explained
    worst = min(left.tests.items(), key=lambda item: item[1], default=None)
    if left.error is not None and left.error_allowed is not None:
        what = "steps of 8 bits" if answer.kind == "frames" else "thresholds"
        lines.append(
            f"what is left: {left.error:.2g} {what}; up to "
            f"{left.error_allowed:.2g} it is well explained"
        )
    explained = f"chi2 {left.chi2:.6g} of {left.dof:,} expected"
    if worst is not None:
        explained += f"; least likely: {TESTS[worst[0]]}, p = {worst[1]:.2g}"
    lines.append(explained)
    for warning in answer.warnings:
        lines += hanging(f"Note: {warning}")
    return "\n".join(line for line in lines if line) + "\n"


def list_text() -> str:
    """Return every name that can be tuned, with unit, default, and where it stands."""
    rows = [["name", "unit", "default", "told by", "in the scene file"]]
    for name, row in TUNABLES.items():
        default = "by the record" if math.isnan(row.start) else f"{row.start:g}"
        records = ", ".join(row.identified_by)
        rows.append([name, row.unit, default, records, _place(row.key)])
    for name, one in {**PARAMETERS, f"{CLOCK.name}.NAME": CLOCK}.items():
        rows.append([name, one.unit, f"{one.default:g}", "beside", _place(one.key)])
    return "\n".join(aligned(rows)) + "\n"


def _place(key) -> str:
    table = f"[[{key.table}]]" if key.table == "sensor" else f"[{key.table}]"
    return f"{table} {key.name}" + ("" if key.index is None else f"[{key.index}]")


def _who(answer: TuneAnswer) -> str:
    if answer.sensor is None:
        return f"{answer.kind} of the camera of {answer.scene}"
    return f"{answer.kind} of sensor {answer.sensor!r} of {answer.scene}"


def _decibels(answer: TuneAnswer) -> str:
    """Return levels of sound as they are mostly told."""
    levels = []
    for name in ("ambient_level_pa", "noise_pa"):
        one = answer.estimates.get(name)
        value = None if one is None else one.found.value
        if value is not None and value > 0:
            level = 20.0 * math.log10(value / 20e-6)
            levels.append(f"{words_of(name)} {level:.1f} dB")
    return f"{', '.join(levels)} re 20 µPa" if levels else ""


def _fixed(answer: TuneAnswer) -> str:
    said = [
        f"{name} {value:.4g}"
        for name, value in answer.fixed.items()
        if value is not None
    ]
    return f"taken as the scene has it: {', '.join(said)}" if said else ""


def tune_answer(
    tuned: Tuned, scene: str, recorded: str, files: tuple[str, ...] = ()
) -> TuneAnswer:
    """Return an answer as it is printed.

    Args:
        tuned: What was found.
        scene: The scene's file.
        recorded: The record.
        files: What was written.
    """
    index = tuned.problem.evidence.index
    sensor = tuned.scene.sensors[index].name if index >= 0 else None
    estimates = {
        name: TunedEstimate(one, unit_of(name), key_words(name, sensor))
        for name, one in tuned.numbers.items()
    }
    fixed = {}
    for name in names_known(tuned.scene, tuned.kind):
        if name in TUNABLES and name not in tuned.numbers:
            held = tuned_value(tuned.before, index, name)
            fixed[name] = None if held is None else float(held)
    return TuneAnswer(
        scene=scene,
        recorded=Path(recorded).name,
        kind=tuned.kind,
        sensor=sensor,
        estimates=estimates,
        free=tuple(tuned.numbers),
        fixed=fixed,
        identifiable=tuned.is_identifiable,
        null_directions=tuple(NotTold(one.parameters) for one in tuned.null_directions),
        explained=tuned.explained,
        converged=tuned.converged,
        warnings=tuple(warnings_of(tuned)),
        files=files,
    )


def words_of(name: str) -> str:
    """Return what a sentence calls a number."""
    return TUNABLES[name].words if name in TUNABLES else parameter_words(name)


def unit_of(name: str) -> str:
    """Return the unit of a number; "1" if it has none."""
    return TUNABLES[name].unit if name in TUNABLES else parameter_named(name).unit


def key_of(name: str) -> Key:
    """Return where a number stands in a scene file."""
    return TUNABLES[name].key if name in TUNABLES else parameter_named(name).key


def key_words(name: str, sensor: str | None) -> str:
    """Return where a number stands in a scene file, as a sentence has it."""
    key, label = key_of(name), name.partition(".")[2]
    index = "" if key.index is None else f"[{key.index}]"
    if key.table == "sensor" and not label:
        label = sensor or ""
    table = f"[[{key.table}]]" if label or key.table == "sensor" else f"[{key.table}]"
    of = f" {label!r}" if label else ""
    if name.startswith(CLOCK_OFFSET):
        return f"[[sensor]]{of} clock_offset_s"
    return f"{table}{of} {key.name}{index}"


def warnings_of(tuned: Tuned) -> list[str]:
    """Return warnings on the use of the numbers."""
    found = [_note(note) for note in tuned.notes]
    for direction in tuned.null_directions:
        names = list(direction.parameters)
        if len(names) == 1:
            found.append(f"the record says nothing about {names[0]}")
            continue
        found.append(
            f"the record does not tell {joined(names)} apart: together they change "
            "and leave it as it is; give one of them a value"
        )
    for name, one in tuned.numbers.items():
        if one.prior_decides:
            found.append(f"{name}: the record adds next to nothing to its prior")
        if one.at_bound:
            found.append(
                f"{name} ended at its bound, {one.fitted:.4g} {unit_of(name)}: the "
                "record asks for more than it may be"
            )
    poor = [TESTS[name] for name, p in tuned.explained.tests.items() if p < POOR]
    if tuned.explained.is_poor and not poor:
        poor = [TESTS["error"]]
    if poor:
        found.append(
            f"the record is poorly explained ({'; '.join(poor)}): the intervals count "
            "noise, not what the model lacks, and are too narrow"
        )
    if not tuned.converged:
        found.append("the search did not settle")
    return found


def _note(note: Note) -> str:
    about = note.about
    match note.kind:
        case "reading":
            return str(about["text"])
        case "noise_added":
            return (
                "the scene has no noise: noise_pa is looked for beside what was named"
            )
        case "blast_outside":
            return (
                f"no blast is in the record of {about['seconds']:g} s: it tells of "
                "noise alone"
            )
        case "law_invalid":
            return (
                f"{joined(about['quantities'])} come from laws that were not made for "
                "where the sensor stands"
            )
        case "thinned":
            return (
                f"{about['used']:,} of {about['count']:,} {about['what']} were looked "
                "at, evenly chosen"
            )
