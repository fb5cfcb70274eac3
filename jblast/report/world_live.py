"""A world shown while it runs.

All records are computed before the window opens; it plays them at the pace of the
world's clock, or faster by a factor.
"""

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from jblast.errors import InputError
from jblast.report.figure_style import BLUE, INK, MUTED, quiet, titled
from jblast.report.world_page import RunFolder
from jblast.sensors.samples import Ring

PAUSE_S = 0.03
"""Least time between two drawings [s]: about the frame rate of a video."""
PAGES = {"webagg", "nbagg"}
"""Backends of matplotlib that serve a page: their `show` does not return while it is
open."""
WINDOW_S = 5.0
"""Length of the time axis [s]: a vehicle recovers within it."""
COLUMN_S = 0.005
"""Time in one drawn column, of its least and largest value [s]: 1,000 columns are about
one a pixel."""
CAPACITY = round(WINDOW_S / COLUMN_S)
"""Number of columns that a lane stores."""
MAX_SAMPLED = 4
"""Largest number of sampling sensors that are drawn: more make plots too low."""
EVENT_BIN_S = 0.02
"""Width of a bin of the event rate [s]."""
Columns = tuple[
    Float[np.ndarray, " column"],
    Float[np.ndarray, " column"],
    Float[np.ndarray, " column"],
]
"""Time, least and largest value."""


class LiveFigure:
    """A figure of the last seconds, drawn again at each instant.

    Attributes:
        figure: The figure.
        lanes: Lanes, one a sense.
    """

    def __init__(self, run: RunFolder, figure: Figure):
        """Create the plots.

        Args:
            run: The world.
            figure: An empty figure.
        """
        self.run, self.figure = run, figure
        self.lanes = lanes_of(run)
        self._last: Path | None = None
        rows = max(len(self.lanes), 1)
        parts = figure.subfigures(1, 2, squeeze=False, width_ratios=(2.2, 1.0))[0]
        plots = parts[0].subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
        self._plots = list(plots)
        for axes, lane in zip(plots, self.lanes, strict=False):
            quiet(axes)
            titled(axes, lane.title)
            axes.set_ylabel(lane.unit)
            axes.set_ylim(*lane.limits)
            for blast in run.document["blasts"]:
                axes.axvline(blast["time_s"], color=INK, linewidth=0.9, linestyle="--")
        plots[-1].set_xlabel("time [s] on the common clock; dashed: a blast")
        self._areas = [axes.fill_between([], []) for axes in plots]
        caption, picture = parts[1].subplots(2, 1)
        for axes in (caption, picture):
            axes.set_axis_off()
        self._text = caption.text(0.0, 1.0, "", va="top", color=INK, fontsize=11)
        self._picture = picture

    def show(self, now: float) -> None:
        """Draw the world at a time of its clock [s], not before the last call's."""
        lines = announced(self.run, now) or ["no further events"]
        self._text.set_text("\n".join([f"{now:.2f} s", "", *lines]))
        for number, (axes, lane) in enumerate(
            zip(self._plots, self.lanes, strict=False)
        ):
            lane.advance(now)
            self._areas[number].remove()
            self._areas[number] = axes.fill_between(
                *lane.kept.shown(), color=BLUE, linewidth=0.8
            )
        end = max(now, WINDOW_S)
        self._plots[-1].set_xlim(end - WINDOW_S, end)
        self._show_frame(now)

    def _show_frame(self, now: float) -> None:
        """Draw the latest frame."""
        times = np.array([time for time, _ in self.run.frames])
        number = int(np.searchsorted(times, now, side="right")) - 1
        if number < 0 or self.run.frames[number][1] == self._last:
            return
        from matplotlib.image import imread

        exposed, self._last = self.run.frames[number]
        self._picture.clear()
        self._picture.set_axis_off()
        self._picture.imshow(imread(self._last), cmap="gray")
        self._picture.set_title(f"{exposed:.3f} s", fontsize=9, color=MUTED)


def check_display() -> None:
    """Check that a window can be opened.

    Raises:
        InputError: There is no display, or MPLBACKEND is a backend without windows.
    """
    import matplotlib.pyplot as plt
    from matplotlib.backends.registry import BackendFilter, backend_registry

    backend = plt.get_backend().lower()
    windows = backend_registry.list_builtin(BackendFilter.INTERACTIVE)
    if backend not in {name.lower() for name in windows} - PAGES:
        raise InputError(
            "--live: expected a display to open a window on (DISPLAY, and Python's "
            f"tkinter or Qt), got matplotlib's {backend!r}; `jblast report RUN` writes "
            "a page instead"
        )


def play(run: RunFolder, speed: float = 1.0) -> None:
    """Show a run in a window, which stays open after its end.

    Args:
        run: The world.
        speed: Speed relative to real time.

    Raises:
        InputError: As in `check_display`.
    """
    check_display()
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(13.0, 8.0), layout="constrained")
    live = LiveFigure(run, figure)
    live.show(0.0)
    figure.canvas.draw()
    # the layout is computed once: later it would take longer than a frame, and jump
    figure.set_layout_engine("none")
    began, now, seconds = time.monotonic(), 0.0, run.document["seconds"]
    while now < seconds and plt.fignum_exists(figure.number):
        now = min(speed * (time.monotonic() - began), seconds)
        live.show(now)
        plt.pause(PAUSE_S)
    if plt.fignum_exists(figure.number):
        plt.show()


class Rolling:
    """Buffer of the latest columns of a plot; the oldest ones are overwritten.

    Attributes:
        capacity: Number of columns.
    """

    def __init__(self, capacity: int):
        """Create an empty buffer.

        Raises:
            ValueError: The capacity is not positive.
        """
        self._rows = tuple(Ring(capacity) for _ in range(3))
        self.capacity = capacity

    def write(
        self,
        time_s: Float[np.ndarray, " column"],
        least: Float[np.ndarray, " column"],
        greatest: Float[np.ndarray, " column"],
    ) -> None:
        """Append columns: time, least and largest value of each."""
        count = min(time_s.size, self.capacity)
        for ring, values in zip(self._rows, (time_s, least, greatest), strict=True):
            ring.read(max(ring.waiting + count - self.capacity, 0))
            ring.write(values[values.size - count :])

    def shown(self) -> tuple[Float[np.ndarray, " column"], ...]:
        """Return time, least and largest value of the stored columns."""
        return tuple(ring.peek(ring.waiting) for ring in self._rows)


@dataclass
class Lane:
    """One sense: all of its columns, and those up to the current time.

    Attributes:
        title: Sensor and quantity.
        unit: Unit in brackets.
        time_s: Times of all columns, increasing.
        least: Smallest value of each column.
        greatest: Largest value of each column.
        kept: The latest columns up to the current time.
        limits: Limits of the axis, over the whole run.
    """

    title: str
    unit: str
    time_s: Float[np.ndarray, " column"]
    least: Float[np.ndarray, " column"]
    greatest: Float[np.ndarray, " column"]
    kept: Rolling = field(default_factory=lambda: Rolling(CAPACITY), init=False)
    _next: int = field(default=0, init=False)

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of the axis over the whole run, so that it does not move."""
        if not self.least.size:
            return 0.0, 1.0
        low, high = float(self.least.min()), float(self.greatest.max())
        room = 0.05 * (high - low) or 1.0
        return low - room, high + room

    def advance(self, now: float) -> None:
        """Add the columns up to a time [s], not before the last call's."""
        end = max(int(np.searchsorted(self.time_s, now, side="right")), self._next)
        new = slice(self._next, end)
        self.kept.write(self.time_s[new], self.least[new], self.greatest[new])
        self._next = end


def lanes_of(run: RunFolder) -> list[Lane]:
    """Return the lanes of a run: flight, sampling sensors, camera events."""
    lanes = []
    if run.flight is not None:
        time = run.flight["time_s"].to_numpy(float)
        error = run.flight["path_error_m"].to_numpy(float)
        force = run.flight[[f"force_{a}_n" for a in ("east", "north", "up")]]
        force = np.linalg.norm(force.to_numpy(float), axis=1)
        lanes.append(Lane("path error", "[m]", *_columns(time, error, error)))
        lanes.append(Lane("force", "[N]", *_columns(time, force, force)))
    for wave in run.waveforms[:MAX_SAMPLED]:
        columns = _columns(wave.time_s, wave.least, wave.greatest)
        lanes.append(Lane(wave.title, wave.unit, *columns))
    if run.events_s.size:
        edges = np.arange(0.0, run.document["seconds"] + EVENT_BIN_S, EVENT_BIN_S)
        rate = np.histogram(run.events_s, edges)[0] / EVENT_BIN_S
        lanes.append(Lane("events", "[1/s]", edges[1:], np.zeros(rate.size), rate))
    return lanes


def _columns(
    time_s: Float[np.ndarray, " row"],
    least: Float[np.ndarray, " row"],
    greatest: Float[np.ndarray, " row"],
) -> Columns:
    """Return the last time of each column, and its least and largest value."""
    first = np.flatnonzero(np.diff(np.floor(time_s / COLUMN_S), prepend=-np.inf))
    if not first.size:
        return time_s, least, greatest
    return (
        time_s[np.append(first[1:], time_s.size) - 1],
        np.minimum.reduceat(least, first),
        np.maximum.reduceat(greatest, first),
    )


def announced(run: RunFolder, now: float, most: int = 3) -> list[str]:
    """Return the next blasts and perceptions, one a line, the soonest first."""
    blasts = [
        (blast["time_s"], f"blast {blast['shot']}") for blast in run.document["blasts"]
    ]
    senses = [
        (one["time_s"], f"blast {one['shot']} at {one['entity']}: {one['sense']}")
        for one in run.document["perceived"]
    ]
    coming = sorted(one for one in blasts + senses if one[0] > now)
    return [f"{words} in {time - now:.2f} s" for time, words in coming[:most]]
