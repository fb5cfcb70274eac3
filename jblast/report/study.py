"""Answers of `jblast study`: a run, its list of outcomes, and a report on a store."""

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

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
from jblast.results import Document, filled
from jblast.study.columns import Lane, StudyColumns, read_columns
from jblast.study.outcome.family import Outcome
from jblast.study.outcome.quantities import LIMITS, limit_of
from jblast.study.outcome.registry import known_outcomes
from jblast.study.runs import StudyRun
from jblast.study.sensitivity import Shares, lane_shares, rest_name
from jblast.study.statistics import Moments, finish_moments, over_cases
from jblast.study.store import Variable

MAX_ROWS = 200
"""Largest number of rows of a table on the page; the JSON has all of them."""
MAX_LINES = 30
"""Largest number of rows on a terminal: with its heading a table fits one screen."""
CAPTIONS = {
    "response": "Medians with the band of 90 % of the samples; shares with Wilson's "
    "90 % interval.",
    "contours": "Solid: half of the samples. Between the dashed lines the 90 % "
    "interval of the share contains a half. Shares are interpolated between the values "
    "of the axes.",
    "exceedance": "Share of samples above a value, with Wilson's 90 % interval.",
    "sensitivity": "Sobol' indices with bootstrapped 90 % intervals, and the share of "
    "the variance that no parameter explains.",
    "convergence": "Estimates against the number of samples, with 90 % intervals.",
}
NAMES = ("study.json", *(f"{name}.png" for name in CAPTIONS))
"""Files of a report, besides the page."""
HOW_SHARES = (
    "First order: share of the variance that a parameter explains alone. Total: share "
    "with its interactions. Elasticity: change of the outcome in per cent for one per "
    "cent of the parameter, by a plane through the samples nearest to the middle. Axes "
    "count as sampled evenly from their values."
)
FOOTER = (
    "SIMULATED, not measured. No clearance, and no safety distance, follows from it."
)


@dataclass(frozen=True)
class OutcomeKnown:
    """Statistics of an outcome over all samples, at one sensor if it has any.

    Attributes:
        outcome: Name of the outcome.
        sensor: Name of the sensor; "" for none.
        units: Unit of mean and sd.
        kind: "number", or "yes_no", whose mean is a share.
        mean: Mean of the successful samples.
        sd: Their standard deviation; null for fewer than two.
        standard_error: Standard error of the mean; null for fewer than two.
        samples: Number of successful samples.
        failed: Number of failed samples.
    """

    outcome: str
    sensor: str
    units: str
    kind: str
    mean: float
    sd: float
    standard_error: float
    samples: int
    failed: int


@dataclass(frozen=True)
class StudyAnswer(Document):
    """The answer of `jblast study`: a complete or partial study.

    Attributes:
        store: Folder of the store.
        complete: Whether all samples are stored.
        reached: Whether it ended at the requested standard errors.
        samples: Number of stored samples.
        calculated: Number of samples computed in this run.
        seconds: Time of this run.
        outcomes: Statistics of each outcome, over all cells of the axes together.
        notes: Notes on the computation.
    """

    store: str
    complete: bool
    reached: bool
    samples: int
    calculated: int
    seconds: float
    outcomes: tuple[OutcomeKnown, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class OutcomesAnswer(Document):
    """The answer of `jblast study --list`.

    Attributes:
        outcomes: The available outcomes.
    """

    outcomes: tuple[Outcome, ...]


@dataclass(frozen=True)
class OutcomeAnswer:
    """Statistics of an outcome.

    Attributes:
        outcome: Name of the outcome.
        sensor: Name of the sensor; null for none.
        axes: Value of each axis, as text; empty for all samples.
        units: Unit of a number; "1" for none.
        kind: "number" or "yes_no".
        found: For a number `count`, `infinite`, `lost`, `mean`, `standard_error`,
            `variance`, `sd`, `minimum`, `maximum`, `q05`, `q50`, `q95`; for yes or no
            `count`, `yes`, `lost`, `share`, `standard_error`, `low`, `high` (Wilson, 90
            %).
    """

    outcome: str
    sensor: str | None
    axes: Mapping[str, str]
    units: str
    kind: str
    found: Mapping[str, float | int]


@dataclass(frozen=True)
class StudyReportAnswer(Document):
    """A report on a study.

    Attributes:
        samples: Number of samples in the store.
        complete: Whether the study is complete.
        seed: Seed of the study.
        design: Design of the sampling.
        study_sha256: SHA-256 of the study's file.
        scene_sha256: SHA-256 of the scene's file.
        axes: Values of each axis, as text.
        outcomes: Statistics of each outcome over all samples.
        cells: Statistics of each outcome in each combination of the axes' values.
        sensitivity: Sources of the scatter of each outcome, if samples identify them.
        notes: Notes, as sentences.
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
    sensitivity: tuple[Shares, ...]
    notes: tuple[str, ...]


RUN = [
    Column("outcome", lambda one: f"{one.outcome}{unit_of(one.units)}"),
    Column("sensor", lambda one: one.sensor),
    Column("mean", lambda one: f"{one.mean:.6g}", right=True),
    Column("error", lambda one: f"{one.standard_error:.2g}", right=True),
    Column("sd", lambda one: f"{one.sd:.4g}", right=True),
    Column("samples", lambda one: f"{one.samples:,}", right=True),
    Column("failed", lambda one: f"{one.failed:,}", right=True),
]
LISTED = [
    Column("outcome", lambda one: one.name),
    Column("unit", lambda one: "yes or no" if one.kind == "yes_no" else one.units),
    Column("description", lambda one: one.long_name),
    Column("needs", lambda one: one.needs),
]


def unit_of(units: str) -> str:
    """Return a unit in brackets; "" for none."""
    return "" if units in ("", "1") else f" [{units}]"


def run_answer(ran: StudyRun) -> Answer:
    """Return the answer of a run: number of samples and mean of each outcome."""
    known = tuple(
        one for v in ran.slabs.outcomes for one in _known(v, ran.moments[v.name])
    )
    found = filled(
        StudyAnswer, ran, store=str(ran.store.path), calculated=ran.new, outcomes=known
    )
    added = ""
    if found.calculated:
        rate = found.calculated / found.seconds if found.seconds > 0 else math.inf
        added = f", {found.calculated:,} of them new, in {found.seconds:.3g} s "
        added += f"({rate:.3g} a second)"
    state = "complete" if found.complete else "not complete: --resume continues it"
    if found.reached:
        state = "complete: the requested standard errors are reached"
    title = f"{found.store}: {found.samples:,} samples{added}; {state}"
    blocks = [Table(RUN, known, most=MAX_LINES), Lines("", found.notes)]
    return Answer(found, View(title, blocks))


def _known(variable: Variable, moments: Moments) -> Iterable[OutcomeKnown]:
    whole = finish_moments(over_cases(moments, slice(None)))
    for n, sensor in enumerate(variable.sensors or ("",)):
        found = {name: np.ravel(value)[n].item() for name, value in whole.items()}
        yield filled(
            OutcomeKnown,
            variable,
            outcome=variable.name,
            sensor=sensor,
            mean=found["mean"],
            sd=found["sd"],
            standard_error=found["standard_error"],
            samples=found["count"],
            failed=found["lost"] + found["infinite"],
        )


def list_answer() -> Answer:
    """Return the available outcomes with units and requirements."""
    found = OutcomesAnswer(tuple(known_outcomes().values()))
    return Answer(found, View("Available outcomes", [Table(LISTED, found.outcomes)]))


def store_answer(path: str) -> Answer:
    """Return the report on the store at a path.

    Raises:
        InputError: There is no store, it has another format, or no samples.
    """
    return report_answer(read_columns(path), Path(path).name)


def printed(value: float, digits: int = 4) -> str:
    """Return a number as text, a dash for NaN."""
    return "-" if math.isnan(value) else f"{value:.{digits}g}"


def printed_share(share: float, digits: int = 3) -> str:
    """Return a share as text; near one with two digits of its difference from one."""
    # 0.99987 and 0.9991 differ by a factor of seven in what a reader looks for
    difference = 1.0 - float(share)
    if 0.0 < difference < 0.01:
        digits = max(digits, 2 + math.ceil(-math.log10(difference)))
    return printed(share, digits)


def _found(name: str, head: str, digits: int = 4) -> Column:
    """Return the column of a statistic; a whole number is a count."""

    def cell(one: OutcomeAnswer) -> str:
        value = one.found[name]
        if isinstance(value, int):
            return f"{value:,}" if value or name in ("count", "yes") else ""
        shown = printed_share if name == "share" else printed
        return shown(value, digits)

    return Column(head, cell, right=True)


def _tables(found: Sequence[OutcomeAnswer], title: str, **shown: Any) -> list[Block]:
    """Return the tables of numbers and of shares."""
    axes = list(found[0].axes) if found else []
    start = [
        Column("outcome", lambda one: one.outcome),
        Column("sensor", lambda one: one.sensor or ""),
        *(Column(name, lambda one, name=name: one.axes[name]) for name in axes),
    ]
    end = [_found("count", "samples"), _found("lost", "failed")]
    numbers = [
        Column("unit", lambda one: one.units if one.units != "1" else ""),
        _found("mean", "mean"),
        _found("standard_error", "± s.e.", 2),
        *(_found("q05", "5 %"), _found("q50", "median"), _found("q95", "95 %")),
        _found("infinite", "infinite"),
    ]
    interval = Column(
        "90 % interval",
        lambda one: (
            f"{printed_share(one.found['low'])} to {printed_share(one.found['high'])}"
        ),
    )
    shares = [
        *(_found("share", "share"), _found("standard_error", "± s.e.", 2), interval),
        _found("yes", "yes"),
    ]
    parts = {
        kind: [one for one in found if one.kind == kind]
        for kind in ("number", "yes_no")
    }
    return [
        Table([*start, *numbers, *end], parts["number"], f"{title}: numbers", **shown),
        Table([*start, *shares, *end], parts["yes_no"], f"{title}: shares", **shown),
    ]


SHARES = [
    Column("outcome", lambda row: row[0].outcome),
    Column("sensor", lambda row: row[0].sensor or ""),
    Column("parameter", lambda row: row[1].name),
    Column("first order", lambda row: _index(row[1].first, row[1].first_interval)),
    Column("total", lambda row: _index(row[1].total, row[1].total_interval)),
    Column("elasticity", lambda row: printed(row[1].elasticity, 3), right=True),
    Column("remark: the parameter", lambda row: row[1].differs or ""),
]


def _index(value: float, interval: tuple[float, float]) -> str:
    return f"{value:.2f} ({interval[0]:.2f} to {interval[1]:.2f})"


def report_answer(columns: StudyColumns, name: str = "") -> Answer:
    """Return the report on a store: tables, figures and sensitivities."""
    lanes, shares = columns.lanes, lane_shares(columns)
    attributes = columns.attributes
    found = filled(
        StudyReportAnswer,
        {"seed": None, "design": None, "study_sha256": None, "scene_sha256": None}
        | dict(attributes),
        samples=columns.samples,
        complete=bool(attributes.get("complete", False)),
        axes={
            axis.name: tuple(axis.shown(n) for n in range(axis.values.size))
            for axis in columns.axes
        },
        outcomes=tuple(_outcome(lane) for lane in lanes),
        cells=tuple(
            _outcome(lane, *cell) for lane in lanes for cell in columns.cells()
        ),
        sensitivity=shares,
        notes=tuple(columns.notes),
    )
    rows = [(one, number) for one in found.sensitivity for number in one.numbers]
    how = HOW_SHARES if rows else ""
    rest = [
        f"{one.title}: {100 * one.rest:.0f} % of the variance "
        f"({rest_name(columns, one)})"
        for one in shares
    ]
    blocks = [
        Lines("", found.notes),
        *_tables(found.outcomes, "All samples"),
        *_pictures(columns, shares),
        Table(SHARES, rows, "Sources of scatter", "page", MAX_ROWS, caption=how),
        Lines("Scatter without a parameter", rest, "page"),
        Lines("Inputs without effect", [*map(_without_effect, shares)], "page"),
        *_tables(found.cells, "Cells of the axes", where="page", most=MAX_ROWS),
        Text("The study", str(attributes.get("study", ""))),
        Text("Its scene", str(attributes.get("scene", ""))),
        Facts(
            [
                ("Study", f"SHA-256 {found.study_sha256}"),
                ("Scene", f"SHA-256 {found.scene_sha256}"),
                ("Run by", f"jblast {attributes.get('jblast')}"),
            ],
            "Provenance",
            "page",
        ),
    ]
    conditions = f"{found.samples:,} samples, seed {found.seed}, design {found.design}"
    title = f"Study {name}".strip()
    return Answer(found, View(title, blocks, conditions, footer=FOOTER))


def _outcome(
    lane: Lane, axes: Mapping[str, str] | None = None, which: Any = slice(None)
) -> OutcomeAnswer:
    return filled(
        OutcomeAnswer,
        lane,
        outcome=lane.name,
        sensor=lane.sensor or None,
        axes=axes or {},
        found=lane.statistics(which),
    )


def _without_effect(one: Shares) -> str:
    names = ", ".join(one.without_effect)
    return f"{one.title} does not depend on {names}" if names else ""


def _pictures(columns: StudyColumns, shares: Sequence[Shares]) -> list[Picture]:
    """Return the figures that have content."""
    known = [one for one in columns.lanes if one.statistics()["count"] > 1]
    columns = replace(columns, lanes=tuple(known))
    kinds, grid = {one.kind for one in known}, len(columns.numeric_axes) > 1
    limits = thresholds(columns.attributes)
    drawn: list[tuple[bool, str, tuple[Any, ...]]] = [
        (bool(columns.numeric_axes and known), "response", (columns, limits)),
        (grid and "yes_no" in kinds, "contours", (columns,)),
        ("number" in kinds, "exceedance", (columns, limits)),
        (bool(shares), "sensitivity", (columns, shares)),
        (bool(known), "convergence", (columns,)),
    ]
    return [
        Picture(
            f"{name}.png",
            drawn_by(f"study_figures.{name}_figure", *arguments),
            name.capitalize(),
            CAPTIONS[name],
            CAPTIONS[name],
        )
        for there, name, arguments in drawn
        if there
    ]


def thresholds(attributes: Mapping[str, Any]) -> list[tuple[str, float, str]]:
    """Return quantity, value and name of the thresholds that a study compares with."""
    study = tomllib.loads(str(attributes.get("study", "")))
    options = study.get("options", {})
    return [
        (
            LIMITS[n].quantity,
            limit_of(n, options),
            n.removeprefix("above_").replace("_", " "),
        )
        for n in study.get("outcomes", ())
        if n in LIMITS
    ]
