"""Answers in words, their figures, and one page with all of it."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jblast.report.choice import (
        law_reason as law_reason,
        reason_for as reason_for,
    )
    from jblast.report.fit.files import (
        check_directory as check_directory,
        write_report as write_report,
    )
    from jblast.report.fit.terminal import summary as summary
    from jblast.report.world_files import run_world as run_world

HOMES = {
    "law_reason": "choice",
    "reason_for": "choice",
    "summary": "fit.terminal",
    "check_directory": "fit.files",
    "write_report": "fit.files",
    "run_world": "world_files",
}


def __getattr__(name: str) -> Any:
    """Import a name when it is asked for: a calculation needs nothing of a fit."""
    if name in HOMES:
        return getattr(import_module(f"{__name__}.{HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
