"""Many times over: what methods cost, how far they are off, where they break.

A study draws a scene again and again and asks of each sample what became of it: `run`
makes a data set of `read_study`'s study, `outcomes` is one sample as a pure function.
What is behind a name is imported when it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jblast.study.file.read import read_study as read_study
    from jblast.study.file.study import Axis as Axis, Study as Study
    from jblast.study.sampling.pure import draw as draw, outcomes as outcomes
    from jblast.study.sampling.run import run as run, run_into as run_into

HOMES = {
    "Axis": "jblast.study.file.study",
    "Study": "jblast.study.file.study",
    "draw": "jblast.study.sampling.pure",
    "outcomes": "jblast.study.sampling.pure",
    "read_study": "jblast.study.file.read",
    "run": "jblast.study.sampling.run",
    "run_into": "jblast.study.sampling.run",
}

__all__ = ["Axis", "Study", "draw", "outcomes", "read_study", "run", "run_into"]


def __getattr__(name: str) -> Any:
    """Import a name when it is first asked for."""
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Name also what is not imported yet."""
    return sorted({*globals(), *__all__})
