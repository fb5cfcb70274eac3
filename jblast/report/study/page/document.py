"""A report on a study for a program."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jblast.json_values import plain
from jblast.report.study.page.columns import StudyColumns
from jblast.report.study.page.shares import LaneShares
from jblast.report.study.page.summaries import LaneSummary


@dataclass(frozen=True)
class OutcomeAnswer:
    """What an outcome amounts to.

    Attributes:
        outcome: Its name.
        sensor: Whose it is; null where it is no sensor's.
        axes: Value of each axis in words; empty of all samples.
        units: Of a number; "1" of none.
        kind: "number" or "yes_no".
        found: Of a number `count`, `infinite`, `lost`, `effective_size`, `mean`,
            `standard_error`, `variance`, `sd`, `minimum`, `maximum`, `q05`, `q50`,
            `q95`; of yes or no `count`, `yes`, `lost`, `effective_size`,
            `equivalent_size`, `share`, `standard_error`, `low`, `high` (Wilson, 90 %).
    """

    outcome: str
    sensor: str | None
    axes: Mapping[str, str]
    units: str
    kind: str
    found: Mapping[str, float | int]


@dataclass(frozen=True)
class InputShare:
    """What a number has to do with an outcome's scatter.

    Attributes:
        name: Of the number.
        first: Sobol' index: share of the variance that it explains alone.
        first_interval: 90 % interval of it.
        total: Share of all in which it takes part.
        total_interval: 90 % interval of it.
        elasticity: Per cent of the outcome for one per cent of the number, about the
            middle of the samples.
        differs: Why slope and index tell different things; null where they do not.
    """

    name: str
    first: float
    first_interval: tuple[float, float]
    total: float
    total_interval: tuple[float, float]
    elasticity: float
    differs: str | None


@dataclass(frozen=True)
class SharesAnswer:
    """What an outcome's scatter comes from.

    Attributes:
        outcome: Its name.
        sensor: Whose it is; null where it is no sensor's.
        explained: Share of the variance that the method accounts for.
        method: In words.
        rows: Samples that it was found from.
        numbers: Each number that varies.
    """

    outcome: str
    sensor: str | None
    explained: float
    method: str
    rows: int
    numbers: tuple[InputShare, ...]


@dataclass(frozen=True)
class StudyReportAnswer:
    """A report on a study.

    Attributes:
        samples: In the store.
        complete: Whether it has all.
        seed: Of the study.
        design: How its draws fill what the priors allow.
        study_sha256: Of the study's file.
        scene_sha256: Of the scene's.
        axes: Values of each axis, in words.
        outcomes: Each over all samples.
        cells: Each in each combination of the values of the axes.
        sensitivity: What the scatter of each comes from, where samples tell it.
        notes: What to know.
    """

    samples: int
    complete: bool
    seed: int | None
    design: str | None
    study_sha256: str | None
    scene_sha256: str | None
    axes: Mapping[str, tuple[str, ...]]
    outcomes: tuple[OutcomeAnswer, ...]
    cells: tuple[OutcomeAnswer, ...]
    sensitivity: tuple[SharesAnswer, ...]
    notes: tuple[str, ...]


def study_document(
    columns: StudyColumns,
    overall: list[LaneSummary],
    cells: list[LaneSummary],
    shares: list[LaneShares],
) -> dict[str, Any]:
    """Return the document; what is not known, or infinite, is null."""
    said, names = columns.attributes, [axis.name for axis in columns.axes]

    def word(name: str) -> str | None:
        return None if said.get(name) is None else str(said[name])

    answer = StudyReportAnswer(
        columns.total,
        bool(said.get("complete", False)),
        None if said.get("seed") is None else int(said["seed"]),
        word("design"),
        word("study_sha256"),
        word("scene_sha256"),
        {
            axis.name: tuple(axis.said(n) for n in range(axis.values.size))
            for axis in columns.axes
        },
        tuple(_outcome(one, names) for one in overall),
        tuple(_outcome(one, names) for one in cells),
        tuple(_shares(one) for one in shares),
        tuple(columns.notes),
    )
    return {"schema": 1} | plain(answer)


def _outcome(one: LaneSummary, names: list[str]) -> OutcomeAnswer:
    lane = one.lane
    axes = dict(zip(names, one.cell, strict=True)) if one.cell else {}
    return OutcomeAnswer(
        lane.name, lane.sensor or None, axes, lane.units, lane.kind, one.found
    )


def _shares(one: LaneShares) -> SharesAnswer:
    of = one.indices
    numbers = tuple(
        InputShare(
            name,
            float(of.first[n]),
            (float(of.first_interval[0, n]), float(of.first_interval[1, n])),
            float(of.total[n]),
            (float(of.total_interval[0, n]), float(of.total_interval[1, n])),
            one.elasticity[name],
            one.reasons.get(name),
        )
        for n, name in enumerate(of.names)
    )
    lane = one.lane
    return SharesAnswer(
        lane.name, lane.sensor or None, of.explained, of.method, of.rows, numbers
    )
