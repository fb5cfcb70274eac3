"""A study as one HTML page that needs nothing beside it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from matplotlib.figure import Figure

from jblast.report.figure_files import Picture, picture_of
from jblast.report.pages import page
from jblast.report.study.page.columns import StudyColumns
from jblast.report.study.page.contour_figure import contour_figure
from jblast.report.study.page.curve_figures import (
    convergence_figure,
    exceedance_figure,
    response_figure,
)
from jblast.report.study.page.document import study_document
from jblast.report.study.page.share_figure import share_figure
from jblast.report.study.page.shares import shares_of
from jblast.report.study.page.summaries import cell_summaries, summaries_of
from jblast.report.study.page.tables import (
    Table,
    number_table,
    sensitivity_table,
    share_table,
    text_lines,
)

RESPONSE = (
    "Medians with the band of 90 % of the samples; shares with Wilson's 90 % interval."
)
EXCEEDANCE = "Share of samples above a value, with Wilson's 90 % interval."
EVEN = (
    "Solid: half of the samples. Between the dashed lines the 90 % interval of the "
    "share holds a half. Between the values of the axes shares are interpolated."
)
CONVERGENCE = "Estimates as samples come in, in their order, with 90 % intervals."
SHARES = "Sobol' indices with bootstrapped 90 % intervals."
HOW_SHARES = (
    "Alone: the share of the variance that a number explains by itself; with others: "
    "all in which it takes part. Elasticity: per cent of the outcome for one per cent "
    "of the number, by a plane through the samples nearest to the middle. Axes count "
    "as drawn evenly from their values. What is not explained is noise that no number "
    "makes, or an edge too sharp for polynomials."
)


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    title: str
    tables: list[Table] = field(default_factory=list)
    pictures: list[dict[str, Any]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class StudyReport:
    """A report: what was found, as numbers, figures, a page.

    Attributes:
        columns: The samples.
        name: Of the store.
    """

    columns: StudyColumns
    name: str = ""

    @cached_property
    def overall(self):
        """Each outcome over all samples."""
        return summaries_of(self.columns)

    @cached_property
    def cells(self):
        """Each outcome in each cell of the axes."""
        return cell_summaries(self.columns)

    @cached_property
    def shares(self):
        """What the scatter of the outcomes comes from."""
        return shares_of(self.columns)

    @cached_property
    def pictures(self) -> dict[str, Picture]:
        """The figures that there is something to draw in, by name."""
        drawn: dict[str, Callable[[], Figure | None]] = {
            "response": lambda: response_figure(self.columns),
            "contours": lambda: contour_figure(self.columns),
            "exceedance": lambda: exceedance_figure(self.columns),
            "sensitivity": lambda: share_figure(self.shares),
            "convergence": lambda: convergence_figure(self.columns),
        }
        made = ((name, draw()) for name, draw in drawn.items())
        return {name: picture_of(of) for name, of in made if of is not None}

    def document(self) -> dict[str, Any]:
        """Return it for a program."""
        return study_document(self.columns, self.overall, self.cells, self.shares)

    def text(self) -> str:
        """Return it for a terminal."""
        return "\n".join(text_lines(self.columns, self.overall)) + "\n"

    def page(self, made: list[str] | None = None) -> str:
        """Return the page.

        Args:
            made: What else there is to say of how it came about.
        """
        said = self.columns.attributes
        return page(
            "study/page/template.html",
            title=f"Study {self.name}".strip(),
            subtitle=f"{self.columns.total:,} samples, seed {said.get('seed')}, "
            f"design {said.get('design')}",
            notes=self.columns.notes,
            sections=[one for one in self._sections() if one.tables or one.pictures],
            texts=[
                (name, text)
                for name, text in (
                    ("The study", said.get("study")),
                    ("Its scene", said.get("scene")),
                )
                if text
            ],
            made=[
                f"Study: SHA-256 {said.get('study_sha256')}; scene: SHA-256 "
                f"{said.get('scene_sha256')}",
                f"Run by jblast {said.get('jblast')}.",
                *(made or []),
            ],
        )

    def _sections(self) -> list[Section]:
        names = tuple(axis.name for axis in self.columns.axes)
        return [
            Section(
                "Outcomes, over all samples",
                _some(number_table(self.overall), share_table(self.overall)),
            ),
            Section(
                "Over the axes",
                [],
                self._shown("response", "Outcomes over the first axis.", RESPONSE)
                + self._shown("contours", "Shares over two axes.", EVEN),
            ),
            Section(
                "How often above",
                [],
                self._shown("exceedance", "Exceedance curves.", EXCEEDANCE),
            ),
            Section(
                "What the scatter comes from",
                _some(sensitivity_table(self.shares)),
                self._shown("sensitivity", "Bars of Sobol' indices.", SHARES),
                [HOW_SHARES],
            ),
            Section(
                "Convergence",
                [],
                self._shown("convergence", "Running estimates.", CONVERGENCE),
            ),
            Section(
                "By cell of the axes",
                _some(number_table(self.cells, names), share_table(self.cells, names)),
            ),
        ]

    def _shown(self, name: str, alt: str, caption: str) -> list[dict[str, Any]]:
        picture = self.pictures.get(name)
        if picture is None:
            return []
        return [
            {
                "source": picture.source,
                "alt": alt,
                "caption": caption,
                "width": picture.width,
            }
        ]


def _some(*tables: Table | None) -> list[Table]:
    return [one for one in tables if one is not None]


def study_report(columns: StudyColumns, name: str = "") -> StudyReport:
    """Return the report on a study's samples; its parts are made when asked for."""
    return StudyReport(columns, name)
