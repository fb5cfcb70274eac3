"""The answer of `jblast tune`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from jblast.inference.posterior.parameters import Estimate
from jblast.inference.tuning.result import (
    POOR,
    Explained,
    Note,
    NotIdentified,
    Tuned,
)
from jblast.inference.tuning.unknowns import (
    IDENTIFIED_BY,
    TUNABLES,
    row_named,
    tuned_value,
)
from jblast.parameters import CLOCK, CLOCK_OFFSET, PARAMETERS
from jblast.report.words import aligned, hanging, joined, rounded
from jblast.results import AMONG, Document, among

NOT_IDENTIFIED = "not identified"
TESTS = {
    "spectrum": "noise in frequency bands",
    "whiteness": "serial correlation of the residuals",
    "blast": "residuals during the blast",
    "error": "size of the residuals",
}
"""Names of the tests of the residuals."""
LEVELS = {
    "ambient_level_pa": "level of the ambient sound on the ground",
    "noise_pa": "noise of the sensor",
}
"""Levels that are also printed in decibels."""


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


def tune_text(answer: TuneAnswer) -> str:
    """Return parameters with intervals, tests of the residuals and warnings."""
    rows = [["", "value", "90 % interval", "unit", "before", ""]]
    for name, one in answer.estimates.items():
        value, interval, found = NOT_IDENTIFIED, "", one.found
        if found.identified:
            # digits past the twelfth are rounding errors of the search
            sd = max(found.sd, 1e-12 * abs(found.value))
            value = rounded(found.value, sd)
            interval = f"{rounded(found.q05, sd)} to {rounded(found.q95, sd)}"
        unit = "" if one.unit == "1" else one.unit
        rows.append([name, value, interval, unit, f"{one.before:.4g}", one.key])
    by = "the camera" if answer.sensor is None else f"sensor {answer.sensor!r}"
    title = f"{answer.recorded}: {answer.kind} of {by} of {answer.scene}"
    lines = [title, *aligned(rows, right=(1, 4))]
    if decibels := _decibels(answer):
        lines.append(decibels)
    fixed = [f"{n} {x:.4g}" for n, x in answer.fixed.items() if x is not None]
    lines += [f"fixed by the scene: {', '.join(fixed)}"] if fixed else []
    left = answer.explained
    worst = min(left.tests.items(), key=lambda item: item[1], default=None)
    if left.error is not None and left.error_allowed is not None:
        unit = "steps of 8 bits" if answer.kind == "frames" else "thresholds"
        lines.append(
            f"residuals: {left.error:.2g} {unit} (good fit: up to "
            f"{left.error_allowed:.2g})"
        )
    explained = f"chi2 {left.chi2:.6g}, expected {left.dof:,}"
    if worst is not None:
        explained += f"; smallest p = {worst[1]:.2g} ({TESTS[worst[0]]})"
    lines.append(explained)
    for warning in answer.warnings:
        lines += hanging(f"Warning: {warning}")
    return "\n".join(line for line in lines if line) + "\n"


def list_text() -> str:
    """Return every tunable parameter, with unit, default and key in a scene file."""
    rows = [["name", "unit", "default", "identified by", "in the scene file"]]
    for name, row in TUNABLES.items():
        default = "from the record" if math.isnan(row.default) else f"{row.default:g}"
        kinds = ", ".join(IDENTIFIED_BY[name])
        rows.append([name, row.unit, default, kinds, _place(row.key)])
    for name, one in {**PARAMETERS, f"{CLOCK.name}.NAME": CLOCK}.items():
        rows.append([name, one.unit, f"{one.default:g}", "priors", _place(one.key)])
    return "\n".join(aligned(rows)) + "\n"


def _place(key) -> str:
    table = f"[[{key.table}]]" if key.table == "sensor" else f"[{key.table}]"
    return f"{table} {key.name}" + ("" if key.index is None else f"[{key.index}]")


def _decibels(answer: TuneAnswer) -> str:
    """Return sound levels in decibels, as they are usually given."""
    levels = []
    for name, words in LEVELS.items():
        one = answer.estimates.get(name)
        # silence has no decibels
        if one is not None and one.found.value > 0:
            # 20 uPa is the reference pressure of sound levels in air (ISO 1683)
            level = 20.0 * math.log10(one.found.value / 20e-6)
            levels.append(f"{words} {level:.1f} dB")
    return f"{', '.join(levels)} re 20 µPa" if levels else ""


def tune_answer(
    tuned: Tuned, scene: str, recorded: str, files: tuple[str, ...] = ()
) -> TuneAnswer:
    """Return the answer on tuned parameters.

    Args:
        tuned: The tuned parameters.
        scene: The scene's file.
        recorded: The record.
        files: Files that were written.
    """
    index = tuned.problem.evidence.index
    sensor = tuned.scene.sensors[index].name if index >= 0 else None
    estimates = {
        name: TunedEstimate(
            found=one,
            before=float(np.asarray(tuned_value(tuned.before, index, name))),
            fitted=float(np.asarray(tuned_value(tuned.scene, index, name))),
            unit=row_named(name).unit,
            key=key_words(name, sensor),
        )
        for name, one in tuned.numbers.items()
    }
    fixed = {}
    for name, kinds in IDENTIFIED_BY.items():
        if tuned.kind in kinds and name not in tuned.numbers:
            value = tuned_value(tuned.before, index, name)
            fixed[name] = None if value is None else float(value)
    return TuneAnswer(
        scene=scene,
        recorded=Path(recorded).name,
        kind=tuned.kind,
        sensor=sensor,
        estimates=estimates,
        free=tuple(tuned.numbers),
        fixed=fixed,
        identifiable=tuned.is_identifiable,
        null_directions=tuned.null_directions,
        explained=tuned.explained,
        converged=tuned.converged,
        warnings=tuple(warnings_of(tuned)),
        files=files,
    )


def key_words(name: str, sensor: str | None) -> str:
    """Return the key of a parameter in a scene file, as text."""
    key, label = row_named(name).key, name.partition(".")[2]
    index = "" if key.index is None else f"[{key.index}]"
    if key.table == "sensor" and not label:
        label = sensor or ""
    table = f"[[{key.table}]]" if label or key.table == "sensor" else f"[{key.table}]"
    of = f" {label!r}" if label else ""
    if name.startswith(CLOCK_OFFSET):
        return f"[[sensor]]{of} clock_offset_s"
    return f"{table}{of} {key.name}{index}"


def warnings_of(tuned: Tuned) -> list[str]:
    """Return warnings on tuned parameters, as sentences."""
    found = [_note(note) for note in tuned.notes]
    for direction in tuned.null_directions:
        names = list(direction.parameters)
        if len(names) == 1:
            found.append(f"the record does not constrain {names[0]}")
            continue
        found.append(
            f"the record does not separate {joined(names)}: a joint change leaves it "
            "unchanged; fix one of them"
        )
    for name in tuned.by_prior:
        found.append(f"{name}: its interval is nearly that of the prior")
    for name in tuned.at_bound:
        value = tuned_value(tuned.scene, tuned.problem.evidence.index, name)
        found.append(
            f"{name} is at its bound, {float(np.asarray(value)):.4g} "
            f"{row_named(name).unit}: the best value lies outside the permitted range"
        )
    poor = [TESTS[name] for name, p in tuned.explained.tests.items() if p < POOR]
    if tuned.explained.is_poor and not poor:
        # residuals can be too large while every test of their pattern passes
        poor = [TESTS["error"]]
    if poor:
        found.append(
            f"poor fit ({'; '.join(poor)}): the intervals include noise, but no model "
            "error, and are too narrow"
        )
    if not tuned.converged:
        found.append("the search did not converge")
    return found


def _note(note: Note) -> str:
    about = note.about
    match note.kind:
        case "reading":
            return str(about["text"])
        case "noise_added":
            return "the scene has no noise: noise_pa is tuned as well"
        case "blast_outside":
            return (
                f"the record of {about['seconds']:g} s contains no blast: it "
                "constrains the noise only"
            )
        case "law_invalid":
            return (
                f"{joined(about['quantities'])} are extrapolated: the sensor lies "
                "outside the range of their laws"
            )
        case "thinned":
            return (
                f"{about['used']:,} of {about['count']:,} {about['what']} were used, "
                "evenly spaced"
            )
