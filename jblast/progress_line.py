"""Progress of a command or of a function: its stage, and the time left.

Functions of the library with an argument `progress` have the decorator `reported`.
Nothing is printed in the first second. After that a terminal has one line on stderr,
which is overwritten and cleared at the end. A pipe or a file gets a line at each stage,
at intervals that grow with the run. Stdout is not used.
"""

import functools
import io
import sys
import threading
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from typing import Any, ParamSpec, TextIO, TypeVar

from jblast.errors import InputError, shown
from jblast.progress import Listener, heard_by

P = ParamSpec("P")
R = TypeVar("R")
Progress = bool | Callable[[str, float], object]
"""Argument `progress` of a function: True for lines on stderr, or a function that is
called at each report with words and the finished share, 0 to 1."""

# Intervals by judgement of readability, not by measurement.
QUIET_S = 1.0
"""Time without a line [s]: a second's wait needs no explanation."""
REFRESH_S = 0.2
"""Interval of updates on a terminal [s]: slower looks stuck, faster cannot be read."""
REPEAT_S, REPEAT_SHARE = 10.0, 0.2
"""Least interval of lines of one stage in a pipe [s], and as a share of the run so far.

The share keeps a log of a run of any length short: its lines grow with the logarithm of
the duration.
"""
STAGE_S, STAGE_SHARE = 1.0, 0.05
"""The same for the first line of a new stage, which has more to report."""
COMPILATION = {
    "/jax/core/compile/jaxpr_to_mlir_module_duration": True,
    "/jax/core/compile/backend_compile_duration": False,
}
"""Whether a compilation runs after an event of `jax.monitoring`: JAX reports the end of
lowering, which is the start of compilation, and its end."""
_COMPILING: dict[int, bool] = {}
"""Whether each thread compiles, by its identifier."""
WIDTH = 79
"""Characters of the line: a terminal of 80 columns would wrap a longer one."""


class _ClearingStream:
    """A text stream that removes the progress line before it writes."""

    def __init__(self, line: "ProgressLine", stream: TextIO | io.TextIOBase):
        self._line, self._stream = line, stream

    def write(self, text: str) -> int:
        self._line.clear()
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


Stream = TextIO | io.TextIOBase | _ClearingStream


def note_compilation(event: str, duration_secs: float, **kwargs: str | int) -> None:
    """Record that a compilation has begun or ended; a listener of `jax.monitoring`."""
    if event in COMPILATION:
        _COMPILING[threading.get_ident()] = COMPILATION[event]


class ProgressLine(Listener):
    """A listener that prints the progress of a command."""

    def __init__(
        self, verb: str, file: Stream, clock: Callable[[], float] = time.monotonic
    ):
        super().__init__()
        self._verb, self._file, self._clock = verb, file, clock
        self._terminal = file.isatty()
        self._begun = self._last = clock()
        self._last_stages: tuple[str, ...] = ()
        self._width, self._reported = 0, False
        self._times, self._shares = [0.0], [0.0]
        # Kind of the counted units in progress, and the index of its first share.
        self._kind: tuple[str, ...] = ()
        self._first_of_kind = 0
        # The line is shown by the working thread, by that of the clock, and by output
        # to the terminal; `clear` is called within `show`, hence reentrant.
        self._lock = threading.RLock()

    def heard(self) -> None:
        """Record the time of a new share of the work, and show the line."""
        with self._lock:
            share, self._reported = self.share(), True
            kind = self._units()
            if share > self._shares[-1] or kind != self._kind:
                self._times.append(self._clock() - self._begun)
                self._shares.append(max(share, self._shares[-1]))
            if kind != self._kind:
                self._kind, self._first_of_kind = kind, len(self._shares) - 1
            self.show()

    def show(self) -> None:
        """Write a line if the interval since the last one is over."""
        with self._lock:
            now, words, stages = self._clock(), self.words(), self.stages()
            gone, since = now - self._begun, now - self._last
            if gone < QUIET_S:
                return
            if self._reported and not self.levels:  # a window is open, or a server runs
                self.clear()
                return
            if self._terminal:
                if since >= REFRESH_S:
                    self._write_over(self._line(words, gone))
                    self._last = now
                return
            least = (REPEAT_S, REPEAT_SHARE)
            if stages != self._last_stages:
                least = (STAGE_S, STAGE_SHARE)
            first = self._last == self._begun
            if first or since >= max(least[0], least[1] * gone):
                self._write(self._line(words, gone) + "\n")
                self._last, self._last_stages = now, stages

    def clear(self) -> None:
        """Remove the line from a terminal, before other output."""
        with self._lock:
            if self._width:
                self._write_over("")

    def seconds_left(self) -> float | None:
        """Return the estimated time left [s], at the pace of the last units.

        These are the second half of the completed units of the present kind. None if
        there is no estimate: nothing is counted, no unit of the present kind is
        complete, or the present one takes longer than the pace predicts.
        """
        share, gone = self._shares[-1], self._clock() - self._begun
        first = self._shares[self._first_of_kind]
        # A stage of another kind has another pace, and loading or compiling has none.
        if not self._kind or share <= first:
            return None
        # the first half includes compilation, which does not recur
        half = bisect_right(self._shares, (first + share) / 2.0) - 1
        pace = (self._times[-1] - self._times[half]) / (share - self._shares[half])
        left = pace * (1.0 - share) - (gone - self._times[-1])
        return left if left > 0.0 else None

    def _units(self) -> tuple[str, ...]:
        """Return the stages of the outermost counted task; empty if none counts."""
        for depth, level in enumerate(self.levels):
            if level.number:
                return (*(above.stage for above in self.levels[:depth]), "counted")
        return ()

    def _line(self, words: str, gone: float) -> str:
        left = self.seconds_left()
        left_words = f", about {_time(left)} left" if left is not None else ""
        first, last = f"jblast {self._verb}: ", f", {_time(gone)} so far{left_words}"
        if any(_COMPILING.values()):
            words = f"{words}: compiling" if words else "compiling"
        words, room = words or "working", WIDTH - len(first) - len(last)
        if self._terminal and len(words) > room:  # its end is the most specific
            words = "..." + words[3 - room :]
        return first + words + last

    def _write_over(self, line: str) -> None:
        self._write("\r" + line.ljust(self._width) + ("" if line else "\r"))
        self._width = len(line)

    def _write(self, text: str) -> None:
        # a closed pipe or a full disk must not end the computation
        with suppress(OSError, ValueError):
            self._file.write(text)
            self._file.flush()


@contextmanager
def printed_progress(verb: str) -> Iterator[None]:
    """Print the progress of a command on stderr within the context.

    Other output to a terminal replaces the line.
    """
    if sys.stderr is None:  # closed by the shell: `2>&-`
        yield
        return
    line, over = ProgressLine(verb, sys.stderr), threading.Event()

    def tick() -> None:
        # In a thread, because a compilation makes no reports while it runs.
        while not over.wait(REFRESH_S):
            line.show()

    streams = sys.stdout, sys.stderr
    # A daemon does not keep the process alive after an error.
    ticking = threading.Thread(target=tick, daemon=True)
    ticking.start()
    # Replaced once only: calls in two threads may end in any order, and the second
    # would restore the replacements of the first.
    replaced = sys.stderr.isatty() and not isinstance(sys.stderr, _ClearingStream)
    if replaced:
        sys.stdout, sys.stderr = (_ClearingStream(line, stream) for stream in streams)
    try:
        with heard_by(line):
            yield
    finally:
        over.set()
        ticking.join()
        if replaced:
            sys.stdout, sys.stderr = streams
        line.clear()


class _Calls(Listener):
    """A listener that calls a function with each report."""

    def __init__(self, function: Callable[[str, float], object]):
        super().__init__()
        self._function = function

    def heard(self) -> None:
        self._function(self.words(), self.share())


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
    return heard_by(_Calls(progress))


def reported(name: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator of functions with a keyword argument `progress`.

    Args:
        name: Name of the function in the lines.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def reporting(*args: P.args, **kwargs: P.kwargs) -> R:
            progress: Any = kwargs.get("progress", False)
            with shown_by(progress, name):
                return function(*args, **kwargs)

        return reporting

    return decorated


def serve_line(line: str) -> None:
    """Write a line of `jblast serve` on stderr."""
    sys.stderr.write(f"jblast serve: {line}\n")
    sys.stderr.flush()


def _time(seconds: float) -> str:
    # two significant digits: seconds below 90 s, minutes below 90 min, then hours
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
