"""A noisy record, smoothed, and its windows: what every equation is looked for in."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import sparse

from jblast.errors import InputError
from jblast.study.discovery_smooth import smoothed
from jblast.study.discovery_weak import Windows, half_width, windows


class Record(NamedTuple):
    r"""States over a time, and what they look like without noise.

    Attributes:
        windows: Integrals over windows.
        columns: States, smoothed, then inputs, at the places of quadrature.
        rate: What the terms are multiplied by: dt/ds, where windows lie in another time
            s than t.
        smooth: States at the rows, smoothed.
        left: $-\int \varphi' x$ of the states as they were recorded.
        smooth_left: The same of the smoothed states.
        noise_sd: Standard deviation of the noise of each state, relative if `scale` is
            not 1.
        scale: What noise is multiplied by, at the rows.
    """

    windows: Windows
    columns: Float[np.ndarray, "place column"]
    rate: Float[np.ndarray, " place"]
    smooth: Float[np.ndarray, "row state"]
    left: Float[np.ndarray, "window state"]
    smooth_left: Float[np.ndarray, "window state"]
    noise_sd: Float[np.ndarray, " state"]
    scale: Float[np.ndarray, "row state"]

    def noise_map(self, state: int) -> sparse.csr_array:
        """Return what takes the noise of a state at the rows to the left side."""
        scale = self.scale[:, state]
        return sparse.csr_array(self.windows.of_rows.multiply(scale[None, :]))

    def noisy_lefts(
        self, state: int, members: int, rng: np.random.Generator
    ) -> Float[np.ndarray, "member window"]:
        """Return left sides of the smoothed state with new noise."""
        noise = self.noise_sd[state] * rng.standard_normal((len(self.scale), members))
        return self.smooth_left[:, state] + (self.noise_map(state) @ noise).T


def trajectory_record(
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"],
    *,
    held: bool = False,
) -> Record:
    """Smooth the states and lay windows over them.

    Args:
        time_s: Of the rows, rising [s].
        states: In any units.
        inputs: Taken as exact.
        held: Inputs keep their value until the next row, as commands do; else they are
            linear between rows.
    """
    smooth, slope, at, noise_sd = smoothed(time_s, states)
    cut = windows(time_s, half_width(time_s, smooth, slope))
    curves = at(cut.time)
    between = [input_at(time_s, column, cut.time, held=held) for column in inputs.T]
    return Record(
        cut,
        np.column_stack([curves, *between]),
        np.ones(len(cut.time)),
        smooth,
        cut.derivative @ curves + cut.of_rows @ (states - smooth),
        cut.derivative @ curves,
        noise_sd,
        np.ones(states.shape),
    )


def shock_record(
    time_s: Float[np.ndarray, " row"], radius_m: Float[np.ndarray, " row"]
) -> Record:
    """Smooth the radius of a shock and lay windows over it, both in ln of the time.

    A shock slows down as a power of time: in ln it is nearly straight, and few rows
    tell it, however unevenly they lie. What is looked for is dR/dt still; its noise is
    relative, so each window is divided by its own left side.

    Args:
        time_s: Since the detonation, positive, rising [s].
        radius_m: Positive [m].

    Raises:
        InputError: The smoothed radius does not grow all the time.
    """
    log_time = np.log(time_s)
    log_radius = np.log(radius_m)[:, None]
    smooth, slope, at, noise_sd = smoothed(log_time, log_radius)
    cut = windows(log_time, half_width(log_time, smooth, slope))
    radius = np.exp(at(cut.time))
    left = cut.derivative @ radius
    if not np.all(left > 0.0):
        raise InputError(
            "shock radius: expected one that grows with time; smoothed, it shrinks "
            "somewhere: its noise is too large"
        )
    relative = sparse.diags_array(1.0 / left[:, 0])
    cut = Windows(cut.time, *(sparse.csr_array(relative @ part) for part in cut[1:]))
    return Record(
        cut,
        radius,
        np.exp(cut.time),
        np.exp(smooth),
        np.ones(left.shape) + cut.of_rows @ (np.exp(smooth) * (log_radius - smooth)),
        np.ones(left.shape),
        noise_sd,
        np.exp(smooth),
    )


def input_at(
    time: Float[np.ndarray, " row"],
    value: Float[np.ndarray, " row"],
    places: Float[np.ndarray, "..."],
    *,
    held: bool,
) -> Float[np.ndarray, "..."]:
    """Return an input between its rows, held from each to the next or linear."""
    if not held:
        return np.asarray(np.interp(places, time, value))
    row = np.searchsorted(time, places, side="right") - 1
    return np.asarray(value[np.clip(row, 0, len(time) - 1)])
