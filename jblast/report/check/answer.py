"""The answer of a check: what was understood, what a fit refuses, what is odd."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jblast.errors import InputError
from jblast.observations import Observations
from jblast.observations.check.doubt import Doubt
from jblast.report.check.words import sentence

REFUSED = 2
"""Exit code where a fit would refuse the log."""


@dataclass(frozen=True)
class Warned:
    """Something odd that stops no fit.

    Attributes:
        kind: What is odd, in one word for programs.
        lines: Lines of the file, the one to look at first; rows from 1 where the log is
            no text.
        sensors: Whose rows these are.
        message: The same in a sentence.
    """

    kind: str
    lines: tuple[int, ...]
    sensors: tuple[str, ...]
    message: str


@dataclass(frozen=True)
class CheckAnswer:
    """All that can be said of a log before it is fitted.

    Attributes:
        source: The file.
        rows: Rows that could be read.
        sensors: How many sensors they are of.
        quantities: How many rows each quantity has.
        shots: Names of the shots; none where the log has one alone.
        clocks: Names of the clocks; none where all rows are by the common one.
        places: How many sensors have a position, how many a range, how many neither.
        lower_bounds: Rows that are lower bounds.
        understood: What was converted, skipped or supplied, a sentence each.
        faults: Why a fit would refuse the log, a message each, all of them.
        warnings: What is odd and stops no fit.
    """

    source: str
    rows: int
    sensors: int
    quantities: Mapping[str, int]
    shots: tuple[str, ...]
    clocks: tuple[str, ...]
    places: Mapping[str, int]
    lower_bounds: int
    understood: tuple[str, ...]
    faults: tuple[str, ...]
    warnings: tuple[Warned, ...]

    @property
    def exit_code(self) -> int:
        """0, or 2 where a fit would refuse the log."""
        return REFUSED if self.faults else 0


def check_answer(
    observations: Observations,
    faults: Sequence[InputError],
    doubts: Sequence[Doubt],
    understood: Sequence[str] = (),
    readings: Observations | None = None,
) -> CheckAnswer:
    """Put together what was found.

    Args:
        observations: The rows that could be read.
        faults: Why a fit would refuse the log.
        doubts: From `inference.sanity.doubts`.
        understood: What the reader made of the file, a sentence each.
        readings: The rows that doubts are of, where records of samples were picked.
    """
    log = observations
    doubted = log if readings is None else readings
    return CheckAnswer(
        source=log.source,
        rows=len(log),
        sensors=len(set(log.sensor)),
        quantities=dict(Counter(log.quantity)),
        shots=tuple(dict.fromkeys(shot for shot in log.shot if shot)),
        clocks=tuple(dict.fromkeys(clock for clock in log.clock if clock)),
        places=_places(log),
        lower_bounds=int(log.bounds().sum()),
        understood=tuple(understood),
        faults=tuple(sorted(map(str, faults), key=_line)),
        warnings=tuple(_warned(doubt, doubted) for doubt in doubts),
    )


def _line(fault: str) -> int:
    """Return the line that a message names; 0, before all, where it names none."""
    numbered = re.search(r": line (\d+)[:,]", fault)
    return int(numbered.group(1)) if numbered else 0


def _warned(doubt: Doubt, log: Observations) -> Warned:
    return Warned(
        kind=doubt.kind,
        lines=tuple(log.line[row] if log.line else row + 1 for row in doubt.rows),
        sensors=tuple(dict.fromkeys(log.sensor[row] for row in doubt.rows)),
        message=sentence(doubt, log),
    )


def _places(log: Observations) -> dict[str, int]:
    """Count sensors by how the log says where they stand."""
    known: dict[str, str] = {}
    positioned = np.asarray(~np.isnan(log.position).any(axis=1))
    ranged = ~np.isnan(log.slant_range)
    for row, sensor in enumerate(log.sensor):
        kind = "position" if positioned[row] else "range" if ranged[row] else ""
        known[sensor] = known.get(sensor, "") or kind
    counts = Counter(known.values())
    return {kind or "neither": counts[kind] for kind in ("position", "range", "")}
