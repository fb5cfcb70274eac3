"""How far a long task has come: at which stage of how many, at which row of how many.

What may take long tells where it is, by `stages` or `counted`. Who wants to know
listens (`heard_by`), as the command line does (`cli/progress_line.py`); where nobody
does, nothing is done. A task within a task is a level further down; it is over when the
one above goes on, or when nobody holds what tells of it any more.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, TypeVar

Item = TypeVar("Item")


class Level(NamedTuple):
    """Where one task is.

    Attributes:
        stage: In words: "searching (3 of 5)"; "" where a number tells.
        number: "12 of 40 logs"; "" where nothing is counted.
        through: Share of the task that is done.
        current: Share that is being done, of which a level further down tells more.
    """

    stage: str
    number: str
    through: float
    current: float


class Listener:
    """Who wants to know.

    Attributes:
        levels: Where the task is, and where the tasks within it are.
    """

    def __init__(self):
        self.levels: tuple[Level, ...] = ()

    def tell(self, depth: int, level: Level) -> None:
        """Take in where the task at a depth is; what was below it is over."""
        self.levels = (*self.levels[:depth], level)
        self.heard()

    def over(self, depth: int, last: Level | None) -> None:
        """Take off a task that last told this, unless another stands in its place."""
        if last is not None and self.levels[depth : depth + 1] == (last,):
            self.levels = self.levels[:depth]

    def heard(self) -> None:
        """Do something about news."""

    def words(self) -> str:
        """Return where it is, level by level."""
        return ": ".join(level.stage or level.number for level in self.levels)

    def stages(self) -> tuple[str, ...]:
        """Return the same without counts."""
        return tuple(level.stage for level in self.levels)

    def share(self) -> float:
        """Return how much of the whole is done."""
        share = 0.0
        for level in reversed(self.levels):
            share = level.through + level.current * share
        return share


_LISTENER: ContextVar[Listener | None] = ContextVar("progress", default=None)


@contextmanager
def heard_by(listener: Listener) -> Iterator[None]:
    """Let a listener hear what is told inside."""
    before = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(before)


def stages(shares: Mapping[str, float]) -> Callable[[str], None]:
    """Return what is to be called with the name of each stage as it begins.

    Args:
        shares: About how long each stage takes, in any unit, in order.
    """
    teller = Task()
    names, whole = list(shares), sum(shares.values())

    def begin(name: str) -> None:
        nth = names.index(name)
        through = sum(list(shares.values())[:nth])
        words = f"{name} ({nth + 1} of {len(names)})"
        teller(Level(words, "", through / whole, shares[name] / whole))

    return begin


def counted(total: int, what: str) -> Callable[[float | int], None]:
    """Return what is to be called with how many of so many are through."""
    teller = Task()

    def through(done: float | int) -> None:
        words = f"{done:,.0f} of {total:,.0f} {what}"
        teller(Level("", words, done / total, min(1.0, total - done) / total))

    if total > 0:
        through(0)
    return through


def in_words() -> Callable[[str], None]:
    """Return what is to be called with where a task is in words: nothing is counted."""
    teller = Task()
    return lambda words: teller(Level(words, "", 0.0, 0.0))


def each(items: Collection[Item], what: str) -> Iterator[Item]:
    """Go through items and tell how many are through."""
    through = counted(len(items), what)
    for done, item in enumerate(items):
        through(done)
        yield item


class Task:
    """Tells where a task that begins here is, as long as it is held.

    Whoever works holds it, so an exception ends the task as a return does.
    """

    def __init__(self):
        self._listener, self._last = _LISTENER.get(), None
        self._depth = len(self._listener.levels) if self._listener else 0

    def __call__(self, level: Level) -> None:
        """Tell where it is."""
        if self._listener is not None:
            self._last = level
            self._listener.tell(self._depth, level)

    def __del__(self):
        if self._listener is not None:
            self._listener.over(self._depth, self._last)
