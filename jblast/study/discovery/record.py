"""A noisy record, smoothed, and its windows: what every equation is looked for in."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import sparse

from jblast.errors import InputError
from jblast.study.discovery.smoothing import Curves, smoothed
from jblast.study.discovery.weak_form import Windows, half_width, windows


class Sides(NamedTuple):
    r"""Both sides of the equations of some states, but for the coefficients.

    Attributes:
        columns: States, smoothed, then inputs, at the places of quadrature.
        left: $-\int \varphi' x$ of the states as they were recorded.
    """

    columns: Float[np.ndarray, "place column"]
    left: Float[np.ndarray, "window state"]


class Record(NamedTuple):
    r"""States over a time, and what they look like without noise.

    Attributes:
        time_s: Of the rows.
        states: At the rows, as recorded.
        inputs: At the rows.
        held: Whether inputs keep their value until the next row.
        windows: Integrals over windows.
        rate: What the terms are multiplied by: dt/ds, where windows lie in another time
            s than t.
        smooth: States at the rows, smoothed.
        sides: Of the equations, of the states as they were recorded.
        noise_sd: Standard deviation of the noise of each state, relative if `relative`.
        relative: Whether noise multiplies.
        sides_of: The sides of other states at these rows, smoothed as much.
    """

    time_s: Float[np.ndarray, " row"]
    states: Float[np.ndarray, "row state"]
    inputs: Float[np.ndarray, "row input"]
    held: bool
    windows: Windows
    rate: Float[np.ndarray, " place"]
    smooth: Float[np.ndarray, "row state"]
    sides: Sides
    noise_sd: Float[np.ndarray, " state"]
    relative: bool
    sides_of: Callable[[Float[np.ndarray, "row state"]], Sides]

    @property
    def noise_in_unit(self) -> Float[np.ndarray, " state"]:
        """Standard deviation of the noise of each state, in its unit, over the rows."""
        if not self.relative:
            return self.noise_sd
        return self.noise_sd * np.sqrt(np.mean(self.smooth**2, axis=0))

    def noise_map(self, state: int) -> sparse.csr_array:
        """Return what takes the noise of a state at the rows to the left side."""
        if not self.relative:
            return self.windows.of_rows
        return sparse.csr_array(
            self.windows.of_rows.multiply(self.smooth[:, state][None, :])
        )

    def with_noise(
        self, states: Float[np.ndarray, "row state"], rng: np.random.Generator
    ) -> Float[np.ndarray, "row state"]:
        """Return states with noise as large as this record's."""
        noise = self.noise_sd * rng.standard_normal(states.shape)
        return states * np.exp(noise) if self.relative else states + noise


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
    curves, noise_sd, again = smoothed(time_s, states)
    cut = windows(time_s, half_width(time_s, curves.value, curves.slope(time_s)))
    between = [input_at(time_s, column, cut.time, held=held) for column in inputs.T]

    def sides(states: Float[np.ndarray, "row state"], curves: Curves) -> Sides:
        at = curves.at(cut.time)
        left = cut.derivative @ at + cut.of_rows @ (states - curves.value)
        return Sides(np.column_stack([at, *between]), left)

    return Record(
        time_s,
        states,
        inputs,
        held,
        cut,
        np.ones(len(cut.time)),
        curves.value,
        sides(states, curves),
        noise_sd,
        False,
        lambda states: sides(states, again(states)),
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
    curves, noise_sd, again = smoothed(log_time, log_radius)
    half = half_width(log_time, curves.value, curves.slope(log_time))
    cut = windows(log_time, half)
    left = cut.derivative @ np.exp(curves.at(cut.time))
    if not np.all(left > 0.0):
        raise InputError(
            "shock radius: expected one that grows with time; smoothed, it shrinks "
            "somewhere: its noise is too large"
        )
    relative = sparse.diags_array(1.0 / left[:, 0])
    cut = cut._replace(
        integral=sparse.csr_array(relative @ cut.integral),
        derivative=sparse.csr_array(relative @ cut.derivative),
        of_rows=sparse.csr_array(relative @ cut.of_rows),
    )

    def sides(log_radius: Float[np.ndarray, "row state"], curves: Curves) -> Sides:
        radius, smooth = np.exp(curves.at(cut.time)), np.exp(curves.value)
        noise = cut.of_rows @ (smooth * (log_radius - curves.value))
        return Sides(radius, cut.derivative @ radius + noise)

    def sides_of(radius: Float[np.ndarray, "row state"]) -> Sides:
        log_radius = np.log(radius)
        return sides(log_radius, again(log_radius))

    return Record(
        time_s,
        radius_m[:, None],
        np.empty((len(time_s), 0)),
        False,
        cut,
        np.exp(cut.time),
        np.exp(curves.value),
        sides(log_radius, curves),
        noise_sd,
        True,
        sides_of,
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
