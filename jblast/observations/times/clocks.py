"""The clocks of a log: which there are, which may be left open, how fine they are."""

from collections.abc import Collection
from typing import Any

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError, nearest, shown
from jblast.observations.table import Observations
from jblast.parameter_table import CLOCK_OFFSET
from jblast.quantities import CLOCK_TIMES
from jblast.scene import Scene


def check_clocks(
    observations: Observations, scene: Scene, beliefs: Collection[str]
) -> None:
    """Refuse clocks that the log does not have, that nothing sets, or set twice.

    The first clock of the log is the common one, by which all others are set; or that
    of the rows whose column `clock` is empty, where others name theirs.

    Raises:
        InputError: As said; the message names the clock.
    """
    source = observations.source or "observations"
    named = list(dict.fromkeys(clock for clock in observations.clock if clock))
    sensors = {sensor.name: sensor for sensor in scene.sensors}
    for clock in scene.clocks:
        known = list(dict.fromkeys(observations.clocks()))
        if clock.name not in known:
            raise InputError(
                f"{CLOCK_OFFSET}.{clock.name}: {source} has no such clock"
                f"{nearest(clock.name, known)}; expected one of {', '.join(known)}"
            )
    if (
        named
        and f"{CLOCK_OFFSET}.{named[0]}" in beliefs
        and not has_common_clock(observations)
    ):
        others = " or ".join(f"{CLOCK_OFFSET}.{other}" for other in named[1:])
        raise InputError(
            f"{CLOCK_OFFSET}.{named[0]}: {shown(named[0])} is the first clock of "
            f"{source}, by which the others are set; expected {others or 'no clock'}"
        )
    for row, (clock, sensor) in enumerate(
        zip(observations.clock, observations.sensor, strict=True)
    ):
        own = sensors.get(sensor)
        if not clock or clock == sensor or own is None:
            continue
        if float(own.clock_offset_s) != 0 or f"{CLOCK_OFFSET}.{sensor}" in beliefs:
            raise InputError(
                f"{observations.where(row)}, column clock: got {shown(clock)}, but the "
                f"scene gives sensor {shown(sensor)} a clock_offset_s of its own; "
                "expected one of the two"
            )


def has_common_clock(observations: Observations) -> bool:
    """Return whether some clock times are on the common clock, others on named ones."""
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    named = np.array([bool(clock) for clock in observations.clock])
    return bool(named.any() and (timed & ~named).any())


def clocks_apart(observations: Observations) -> list[str]:
    """Return the clocks that a log names, but for the one by which others are set."""
    named = list(dict.fromkeys(clock for clock in observations.clock if clock))
    return named if has_common_clock(observations) else named[1:]


def refuse_unresolved(
    observations: Observations, dtype: type[np.floating[Any]] | None = None
) -> None:
    """Refuse a clock time that the computation's numbers are too coarse for.

    A time since 1970 in single precision has steps of 128 s: a fit would converge on
    nonsense. Neighbouring numbers may be one sigma apart, which is a rounding error of
    0.3 sigma.

    Args:
        observations: The log.
        dtype: Of the computation; JAX's default.

    Raises:
        InputError: As said; the message names the first such row.
    """
    if dtype is None:
        dtype = jnp.zeros(()).dtype.type
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    value = np.where(timed, observations.value, 0.0)
    spacing = np.spacing(np.abs(value).astype(dtype)).astype(float)
    coarse = timed & (spacing > observations.sigma)  # no sigma, NaN: not compared
    for row in np.flatnonzero(coarse):
        raise InputError(
            f"{observations.where(int(row))}: {observations.quantity[row]} = "
            f"{value[row]:.10g} s with a sigma of {observations.sigma[row]:g} s: in "
            f"{np.dtype(dtype).name} such times are {spacing[row]:.3g} s apart; "
            "expected times counted from near the shot, or float64 (jax_enable_x64)"
        )
