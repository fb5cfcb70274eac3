"""Answers in words, their figures, and one page with all of it."""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.report.calc import Calc as Calc
    from jblast.report.choice import (
        law_reason as law_reason,
        reason_for as reason_for,
    )
    from jblast.report.design import bound_view as bound_view
    from jblast.report.discovery import (
        discovery_figure as discovery_figure,
        equation_text as equation_text,
    )
    from jblast.report.fit_figures import (
        corner_figure as corner_figure,
        recordings_figure as recordings_figure,
    )
    from jblast.report.fit_map import map_of_fit as map_of_fit
    from jblast.report.fit_report import (
        fit_document as fit_document,
        summary as summary,
        write_report as write_report,
    )
    from jblast.report.flight_figures import (
        distribution_figure as distribution_figure,
        time_figure as time_figure,
    )
    from jblast.report.flights import (
        fly_answer as fly_answer,
        mission_map as mission_map,
    )
    from jblast.report.map_figures import map_figure as map_figure
    from jblast.report.messages import (
        sentence_of as sentence_of,
        sentences_of as sentences_of,
    )
    from jblast.report.study import report_answer as report_answer
    from jblast.report.view import terminal as terminal
    from jblast.report.world import run_world as run_world

# a calculation needs nothing of a fit
__getattr__, __dir__ = lazy_face(__name__)
