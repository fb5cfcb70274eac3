"""Progress reports of long tasks: current stage, or number of finished items.

A long function reports its progress by `stages`, `counted`, `each` or `in_words`. The
reports go to the `Listener` set by `heard_by`, for example by the command line or by
the argument `progress` of a function (`progress_line.py`); without one they are
discarded. A task within a task is one level deeper. It ends with the next report of its
parent, or when its `Task` object is deleted.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, TypeVar

Item = TypeVar("Item")


class Level(NamedTuple):
    """Progress of one task.

    Attributes:
        stage: Description: "searching (3 of 5)"; "" for a counted task.
        number: "12 of 40 logs"; "" for a task without a count.
        through: Finished share of the task.
        current: Share in progress; a deeper level divides it further.
    """

    stage: str
    number: str
    through: float
    current: float


class Listener:
    """Receiver of progress reports.

    Attributes:
        levels: Progress of the task, followed by that of nested tasks.
    """

    def __init__(self):
        self.levels: tuple[Level, ...] = ()

    def update(self, depth: int, level: Level) -> None:
        """Store the progress of the task at a depth; deeper tasks have ended."""
        self.levels = (*self.levels[:depth], level)
        self.heard()

    def over(self, depth: int, last: Level | None) -> None:
        """Remove a task after its last report, unless another one replaced it."""
        # Compared by value: a later task may already be at this depth.
        if last is not None and self.levels[depth : depth + 1] == (last,):
            self.levels = self.levels[:depth]

    def heard(self) -> None:
        """Handle a new report; subclasses override this."""

    def words(self) -> str:
        """Return the progress in words, level by level."""
        return ": ".join(level.stage or level.number for level in self.levels)

    def stages(self) -> tuple[str, ...]:
        """Return the stages, level by level, without counts."""
        return tuple(level.stage for level in self.levels)

    def share(self) -> float:
        """Return the finished share of the whole task."""
        share = 0.0
        # From the innermost: each level fills the current part of the one above.
        for level in reversed(self.levels):
            share = level.through + level.current * share
        return share


_LISTENER: ContextVar[Listener | None] = ContextVar("progress", default=None)


@contextmanager
def heard_by(listener: Listener) -> Iterator[None]:
    """Send the reports of the enclosed code to a listener."""
    before = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(before)


def stages(shares: Mapping[str, float]) -> Callable[[str], None]:
    """Return a function to call with the name of each stage at its start.

    Args:
        shares: Approximate duration of each stage, in any unit, in order.
    """
    task = Task()
    names, whole = list(shares), sum(shares.values())

    def begin(name: str) -> None:
        nth = names.index(name)
        through = sum(list(shares.values())[:nth])
        words = f"{name} ({nth + 1} of {len(names)})"
        task(Level(words, "", through / whole, shares[name] / whole))

    return begin


def counted(total: int, what: str) -> Callable[[float | int], None]:
    """Return a function to call with the number of finished items."""
    task = Task()

    def through(done: float | int) -> None:
        words = f"{done:,.0f} of {total:,.0f} {what}"
        # The item in progress has one part of the total, except after the last.
        task(Level("", words, done / total, min(1.0, total - done) / total))

    if total > 0:
        through(0)
    return through


def in_words() -> Callable[[str], None]:
    """Return a function to call with the state of a task in words, without a count."""
    task = Task()
    return lambda words: task(Level(words, "", 0.0, 0.0))


def each(items: Collection[Item], what: str) -> Iterator[Item]:
    """Iterate over items and report the number of finished ones."""
    through = counted(len(items), what)
    for done, item in enumerate(items):
        through(done)
        yield item


class Task:
    """Reports of a task, from the construction of this object to its deletion.

    The working function has the only reference, so the task ends with it, also by an
    exception.
    """

    def __init__(self):
        self._listener, self._last = _LISTENER.get(), None
        # The depth at construction: tasks started later are nested in this one.
        self._depth = len(self._listener.levels) if self._listener else 0

    def __call__(self, level: Level) -> None:
        """Report the progress of the task."""
        if self._listener is not None:
            self._last = level
            self._listener.update(self._depth, level)

    def __del__(self):
        if self._listener is not None:
            self._listener.over(self._depth, self._last)
