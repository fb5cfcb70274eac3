"""Answers in words, their figures, and one page with all of it."""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.report.choice import (
        law_reason as law_reason,
        reason_for as reason_for,
    )
    from jblast.report.fit_report import (
        summary as summary,
        write_report as write_report,
    )
    from jblast.report.world import run_world as run_world

# a calculation needs nothing of a fit
__getattr__, __dir__ = lazy_face(__name__)
