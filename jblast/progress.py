"""Progress of long tasks: their stage or number of finished items, and the time left.

A long function reports its progress by `stages`, `counted`, `each` or `in_words`. The
reports go to the `Listener` set by `heard_by`, for example by the command line or by
the argument `progress` of a function with the decorator `reported`. Without a listener
they are discarded. A task within a task is one level deeper. It ends with the next
report of its parent, or when its `Task` object is deleted.

`ProgressLine` prints on stderr. A terminal has one line, which is overwritten; whoever
writes to the terminal calls `clear` first. A pipe or a file gets lines at intervals
that grow with the run.
"""

import functools
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from typing import Any, NamedTuple, ParamSpec, TextIO, TypeVar

from jblast.errors import InputError, shown

P = ParamSpec("P")
R = TypeVar("R")
Item = TypeVar("Item")
Report = Callable[[str, float], object]
"""A function of the progress in words and the finished share, 0 to 1."""
Progress = bool | Report
"""Argument `progress` of a function: True for lines on stderr, or a function that is
called at each report."""

# Intervals by judgement of readability, not by measurement.
QUIET_S = 3.0
"""Time without a line [s]: the start of JAX takes two, and needs no explanation."""
REFRESH_S = 0.2
"""Interval of updates on a terminal [s]: slower looks stuck, faster cannot be read."""
REPEAT_S, REPEAT_SHARE = 10.0, 0.2
"""Least interval of lines in a pipe [s], also before the first, and as a share of the
run so far.

The share keeps a log of a run of any length short: its lines grow with the logarithm of
the duration.
"""
WIDTH = 79
"""Characters of the line: a terminal of 80 columns would wrap a longer one."""


class Level(NamedTuple):
    """Progress of one task.

    Attributes:
        words: "searching (3 of 5)", "12 of 40 logs".
        through: Finished share of the task.
        current: Share in progress; a deeper level divides it further.
    """

    words: str
    through: float
    current: float


class Listener:
    """Receiver of progress reports, which calls a function with each.

    Attributes:
        levels: Progress of the task, followed by that of nested tasks.
    """

    def __init__(self, report: Report = lambda words, share: None):
        self.levels: tuple[Level, ...] = ()
        self._report = report

    def update(self, depth: int, level: Level) -> None:
        """Store the progress of the task at a depth; deeper tasks have ended."""
        self.levels = (*self.levels[:depth], level)
        self._report(self.words(), self.share())

    def over(self, depth: int, last: Level | None) -> None:
        """Remove a task after its last report, unless another one replaced it."""
        # Compared by value: a later task may already be at this depth.
        if last is not None and self.levels[depth : depth + 1] == (last,):
            self.levels = self.levels[:depth]

    def words(self) -> str:
        """Return the progress in words, level by level."""
        return ": ".join(level.words for level in self.levels)

    def share(self) -> float:
        """Return the finished share of the whole task."""
        share = 0.0
        # From the innermost: each level fills the current part of the one above.
        for level in reversed(self.levels):
            share = level.through + level.current * share
        return share

    def clear(self) -> None:
        """Remove a printed line before other output."""


_LISTENER: ContextVar[Listener | None] = ContextVar("progress", default=None)


@contextmanager
def heard_by(listener: Listener) -> Iterator[None]:
    """Send the reports of the enclosed code to a listener."""
    before = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(before)


def clear() -> None:
    """Remove the progress line from a terminal, before other output."""
    if listener := _LISTENER.get():
        listener.clear()


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
        task(Level(words, through / whole, shares[name] / whole))

    return begin


def counted(total: int, what: str) -> Callable[[float | int], None]:
    """Return a function to call with the number of finished items."""
    task = Task()

    def through(done: float | int) -> None:
        words = f"{done:,.0f} of {total:,.0f} {what}"
        # The item in progress has one part of the total, except after the last.
        task(Level(words, done / total, min(1.0, total - done) / total))

    if total > 0:
        through(0)
    return through


def in_words() -> Callable[[str], None]:
    """Return a function to call with the state of a task in words, without a count."""
    task = Task()
    return lambda words: task(Level(words, 0.0, 0.0))


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
        self._listener = _LISTENER.get()
        self._last: Level | None = None
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


class ProgressLine(Listener):
    """A listener that prints the progress of a command or function."""

    def __init__(
        self, verb: str, file: TextIO, clock: Callable[[], float] = time.monotonic
    ):
        super().__init__(lambda words, share: self.show())
        self._verb, self._file, self._clock = verb, file, clock
        self._terminal = file.isatty()
        self._begun = self._last = clock()
        self._width = 0
        # The line is shown by the working thread and by that of the clock; `clear` is
        # called within `show`, hence reentrant.
        self._lock = threading.RLock()

    def show(self) -> None:
        """Write a line if the interval since the last one is over."""
        with self._lock:
            now, words = self._clock(), self.words()
            gone = now - self._begun
            interval = max(REPEAT_S, REPEAT_SHARE * gone)
            if self._terminal:
                interval = REFRESH_S
            if not words:  # a window is open, or a server runs
                self.clear()
            elif gone >= QUIET_S and now - self._last >= interval:
                line, self._last = self._line(words, gone), now
                self._write(
                    f"\r{line:{self._width}}" if self._terminal else f"{line}\n"
                )
                self._width = len(line)

    def clear(self) -> None:
        """Remove the line from a terminal."""
        with self._lock:
            if self._terminal and self._width:
                self._write(f"\r{'':{self._width}}\r")
                self._width = 0

    def seconds_left(self) -> float | None:
        """Return the estimated time left [s] at the mean pace; None before any."""
        share, gone = self.share(), self._clock() - self._begun
        return gone * (1.0 - share) / share if share > 0.0 else None

    def _line(self, words: str, gone: float) -> str:
        left = self.seconds_left()
        left_words = f", about {_time(left)} left" if left is not None else ""
        first, last = f"jblast {self._verb}: ", f", {_time(gone)} so far{left_words}"
        room = WIDTH - len(first) - len(last)
        if self._terminal and len(words) > room:  # its end is the most specific
            words = "..." + words[3 - room :]
        return first + words + last

    def _write(self, text: str) -> None:
        # a closed pipe or a full disk must not end the computation
        with suppress(OSError, ValueError):
            self._file.write(text)
            self._file.flush()


@contextmanager
def printed_progress(verb: str) -> Iterator[None]:
    """Print the progress of a command on stderr within the context."""
    if sys.stderr is None:  # closed by the shell: `2>&-`
        yield
        return
    line, over = ProgressLine(verb, sys.stderr), threading.Event()

    def tick() -> None:
        # In a thread, because a compilation makes no reports while it runs.
        while not over.wait(REFRESH_S):
            line.show()

    # A daemon does not keep the process alive after an error.
    ticking = threading.Thread(target=tick, daemon=True)
    ticking.start()
    try:
        with heard_by(line):
            yield
    finally:
        over.set()
        ticking.join()
        line.clear()


def shown_by(progress: Any, name: str) -> AbstractContextManager[None]:
    """Return a context whose progress is shown as the argument `progress` states.

    Raises:
        InputError: It is neither True, False nor a function.
    """
    if progress is False:  # reports go to the listener around the call, if any
        return nullcontext()
    if progress is True:
        return printed_progress(name)
    if not callable(progress):
        raise InputError(
            "progress: expected True, False, or a function of the words and the "
            f"finished share, got {shown(progress)}"
        )
    return heard_by(Listener(progress))


def reported(name: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator of functions with a keyword argument `progress`.

    Args:
        name: Name of the function in the lines.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def reporting(*args: P.args, **kwargs: P.kwargs) -> R:
            with shown_by(kwargs.get("progress", False), name):
                return function(*args, **kwargs)

        return reporting

    return decorated


def serve_line(line: str) -> None:
    """Write a line of `jblast serve` on stderr."""
    clear()
    sys.stderr.write(f"jblast serve: {line}\n")
    sys.stderr.flush()


def _time(seconds: float) -> str:
    # two significant digits: seconds below 90 s, minutes below 90 min, then hours
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
