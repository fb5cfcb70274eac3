"""What a window shows of a world: a lane a sense, each with its last seconds."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from jblast.report.world.live.rolling import Rolling
from jblast.report.world.page.folder import RunFolder

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
