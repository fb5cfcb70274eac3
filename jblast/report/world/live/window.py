"""A window that shows a world while its clock runs.

The senses were computed ahead, as everything is that was announced; the window plays
them at the world's own pace, or so many times as fast.
"""

import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from jblast.errors import InputError
from jblast.report.figure_style import BLUE, INK, MUTED, quiet, titled
from jblast.report.world.live.lanes import WINDOW_S, announced, lanes_of
from jblast.report.world.page.folder import RunFolder

PAUSE_S = 0.03
"""Between two drawings, at least: a screen is as fast."""

PAGES = {"webagg", "nbagg"}
"""Backends of matplotlib that serve a page: who shows one waits until it is ended."""


class LiveFigure:
    """A figure of the last seconds, drawn anew at each instant.

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
