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
"""Between two drawings, at least: a screen is as fast."""
PAGES = {"webagg", "nbagg"}
"""Backends of matplotlib that serve a page: who shows one waits until it is ended."""
WINDOW_S = 5.0
"""How much of the past is shown."""
COLUMN_S = 0.005
"""What is drawn as one column: its least and its greatest value."""
CAPACITY = round(WINDOW_S / COLUMN_S)
"""Columns that a lane keeps."""
MOST_SAMPLED = 4
EVENT_BIN_S = 0.02
Columns = tuple[
    Float[np.ndarray, " column"],
    Float[np.ndarray, " column"],
    Float[np.ndarray, " column"],
]
"""Time, least and greatest."""


class LiveFigure:
    """A figure of the last seconds, drawn again at each instant.

    Attributes:
        figure: What is drawn on.
        lanes: A sense each.
    """

    def __init__(self, run: RunFolder, figure: Figure):
        """Lay the plots out.

        Args:
            run: The world.
            figure: An empty one.
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
        """Draw the world at an instant of its clock [s]; time does not run back."""
        lines = announced(self.run, now) or ["nothing more to come"]
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
        """Draw the last frame that was taken."""
        times = np.array([taken for taken, _ in self.run.frames])
        number = int(np.searchsorted(times, now, side="right")) - 1
        if number < 0 or self.run.frames[number][1] == self._last:
            return
        from matplotlib.image import imread

        taken, self._last = self.run.frames[number]
        self._picture.clear()
        self._picture.set_axis_off()
        self._picture.imshow(imread(self._last), cmap="gray")
        self._picture.set_title(f"{taken:.3f} s", fontsize=9, color=MUTED)


def check_display() -> None:
    """Refuse to go on where no window can be opened.

    Raises:
        InputError: There is no display, or MPLBACKEND names what draws into files.
    """
    import matplotlib.pyplot as plt
    from matplotlib.backends.registry import BackendFilter, backend_registry

    backend = plt.get_backend().lower()
    windows = backend_registry.list_builtin(BackendFilter.INTERACTIVE)
    if backend not in {name.lower() for name in windows} - PAGES:
        raise InputError(
            "--live: expected a display to open a window on (DISPLAY, and Python's "
            f"tkinter or Qt), got matplotlib's {backend!r}; `jblast report RUN` shows "
            "the same on a page"
        )


def play(run: RunFolder, speed: float = 1.0) -> None:
    """Show a run in a window until its end; it stays until it is closed.

    Args:
        run: The world.
        speed: Seconds of the world a second.

    Raises:
        InputError: As in `check_display`.
    """
    check_display()
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(13.0, 8.0), layout="constrained")
    live = LiveFigure(run, figure)
    live.show(0.0)
    figure.canvas.draw()
    figure.set_layout_engine("none")  # places stay as they are
    began, now, seconds = time.monotonic(), 0.0, run.document["seconds"]
    while now < seconds and plt.fignum_exists(figure.number):
        now = min(speed * (time.monotonic() - began), seconds)
        live.show(now)
        plt.pause(PAUSE_S)
    if plt.fignum_exists(figure.number):
        plt.show()


class Rolling:
    """Columns of a plot that moves on: when a new one does not fit, the oldest goes.

    Attributes:
        capacity: How many columns are kept.
    """

    def __init__(self, capacity: int):
        """Make an empty one.

        Raises:
            ValueError: It would keep nothing.
        """
        self._rows = tuple(Ring(capacity) for _ in range(3))
        self.capacity = capacity

    def write(
        self,
        time_s: Float[np.ndarray, " column"],
        least: Float[np.ndarray, " column"],
        greatest: Float[np.ndarray, " column"],
    ) -> None:
        """Append columns: when, the smallest value of each and the largest."""
        count = min(time_s.size, self.capacity)
        for ring, values in zip(self._rows, (time_s, least, greatest), strict=True):
            ring.read(max(ring.waiting + count - self.capacity, 0))
            ring.write(values[values.size - count :])

    def shown(self) -> tuple[Float[np.ndarray, " column"], ...]:
        """Return time, least and greatest of the columns that are kept."""
        return tuple(ring.peek(ring.waiting) for ring in self._rows)


@dataclass
class Lane:
    """One sense: all that came of it, and what of that has come in by now.

    Attributes:
        title: Whose it is, and what.
        unit: In brackets.
        time_s: Of all columns, increasing.
        least: Smallest value of each.
        greatest: Largest value of each.
        kept: The last of those that came in.
        limits: Of the axis, over the whole run.
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
        """Range of the axis: of the whole run, so that it stands still."""
        if not self.least.size:
            return 0.0, 1.0
        low, high = float(self.least.min()), float(self.greatest.max())
        room = 0.05 * (high - low) or 1.0
        return low - room, high + room

    def advance(self, now: float) -> None:
        """Let in what came up to now [s]; time does not run backwards."""
        end = max(int(np.searchsorted(self.time_s, now, side="right")), self._next)
        new = slice(self._next, end)
        self.kept.write(self.time_s[new], self.least[new], self.greatest[new])
        self._next = end


def lanes_of(run: RunFolder) -> list[Lane]:
    """Return the lanes of a run: flight, what sensors sampled, events."""
    lanes = []
    if run.flight is not None:
        time = run.flight["time_s"].to_numpy(float)
        error = run.flight["path_error_m"].to_numpy(float)
        force = run.flight[[f"force_{a}_n" for a in ("east", "north", "up")]]
        force = np.linalg.norm(force.to_numpy(float), axis=1)
        lanes.append(Lane("path error", "[m]", *_columns(time, error, error)))
        lanes.append(Lane("force", "[N]", *_columns(time, force, force)))
    for wave in run.waveforms[:MOST_SAMPLED]:
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
    """Return the last instant of each column, and its least and greatest value."""
    first = np.flatnonzero(np.diff(np.floor(time_s / COLUMN_S), prepend=-np.inf))
    if not first.size:
        return time_s, least, greatest
    return (
        time_s[np.append(first[1:], time_s.size) - 1],
        np.minimum.reduceat(least, first),
        np.maximum.reduceat(greatest, first),
    )


def announced(run: RunFolder, now: float, most: int = 3) -> list[str]:
    """Return what comes next, as it was announced: a line each, soonest first."""
    blasts = [
        (blast["time_s"], f"blast {blast['shot']}") for blast in run.document["blasts"]
    ]
    senses = [
        (one["time_s"], f"blast {one['shot']} at {one['entity']}: {one['sense']}")
        for one in run.document["perceived"]
    ]
    coming = sorted(one for one in blasts + senses if one[0] > now)
    return [f"{words} in {time - now:.2f} s" for time, words in coming[:most]]
