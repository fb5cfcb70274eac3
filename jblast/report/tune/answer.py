"""What was tuned as `jblast tune --json` prints it, key by key."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from jblast.inference.tuning.result import Tuned
from jblast.inference.tuning.tunables import TUNABLES
from jblast.inference.tuning.unknowns import names_known, tuned_value
from jblast.json_values import plain
from jblast.report.tune.words import key_words, unit_of, warnings_of


@dataclass(frozen=True)
class TunedEstimate:
    """A number that was looked for.

    Attributes:
        value: The most probable one; null where the record does not tell it.
        sd: Its standard deviation, in its unit; likewise.
        q05: It is less with 5 %; likewise.
        q95: It is less with 95 %; likewise.
        unit: Of all of these.
        before: What the scene said, or where the search began.
        fitted: What the tuned scene holds: the value, or where the search left what
            the record does not tell.
        key: Where it stands in a scene file.
    """

    value: float | None
    sd: float | None
    q05: float | None
    q95: float | None
    unit: str
    before: float
    fitted: float
    key: str


@dataclass(frozen=True)
class NotTold:
    """A change of several numbers that leaves the record as it is.

    Attributes:
        parameters: By name, how much each takes part in it, in large changes of each.
    """

    parameters: Mapping[str, float]


@dataclass(frozen=True)
class TuneAnswer:
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
        identifiable: Whether the record tells all that was looked for.
        null_directions: What it does not tell.
        chi2: Sum of squares of what is left, each over its variance.
        dof: What is expected of it.
        tests: Probability of what is left, by what was looked at; below 0.001 the
            record is poorly explained.
        error: Of pictures, rms of what is left in steps of 8 bits; of events, the
            typical one in thresholds; null of sound.
        error_allowed: More counts as poorly explained.
        converged: Whether the search ended of itself.
        warnings: What to know.
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
    chi2: float
    dof: int
    tests: Mapping[str, float]
    error: float | None
    error_allowed: float | None
    converged: bool
    warnings: tuple[str, ...]
    files: tuple[str, ...]


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
        name: TunedEstimate(
            one.value,
            one.sd,
            one.q05,
            one.q95,
            unit_of(name),
            one.before,
            one.fitted,
            key_words(name, sensor),
        )
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
        chi2=tuned.explained.chi2,
        dof=tuned.explained.dof,
        tests=tuned.explained.tests,
        error=tuned.explained.error,
        error_allowed=tuned.explained.error_allowed,
        converged=tuned.converged,
        warnings=tuple(warnings_of(tuned)),
        files=files,
    )


def as_json(answer: TuneAnswer) -> str:
    """Return what `--json` prints, and tune.json holds."""
    document = {"schema": 1} | plain(answer)
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
