"""Clocks of a log and of its scene.

All clocks are set by a common one: that of the rows without a clock where others name
theirs, otherwise the first of the log. A log is refused if a clock has two settings or
none, if its clock times are fewer than its unknown offsets and origin times, and if
floating-point numbers near its clock times are further apart than their sigma (128 s
for seconds since 1970 in single precision).
"""

from collections.abc import Collection
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from jblast.errors import InputError, nearest, shown
from jblast.observations.table import Observations
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import CLOCK_TIMES
from jblast.scene import Free, Scene, UncertainScene


def check_clocks(
    observations: Observations, scene: Scene, beliefs: Collection[str]
) -> None:
    """Refuse clocks that are not in the log, and an offset of the common one.

    The first clock of the log is the common one, by which all others are set; or that
    of the rows whose column `clock` is empty, where others name theirs.

    Args:
        observations: The log.
        scene: The scene.
        beliefs: Names of its parameters that are not fixed.

    Raises:
        InputError: There is a clock that the log does not have, or the common clock has
            an offset.
    """
    source = observations.source or "observations"
    known = list(dict.fromkeys(observations.clocks()))
    for clock in scene.clocks:
        if clock.name not in known:
            raise InputError(
                f"{CLOCK_OFFSET}.{clock.name}: {source} has no such clock"
                f"{nearest(clock.name, known)}; expected one of {', '.join(known)}"
            )
    named = list(dict.fromkeys(filter(None, observations.clock)))
    others = clocks_apart(observations)
    # with a common clock all named clocks may have offsets
    if named != others and f"{CLOCK_OFFSET}.{named[0]}" in beliefs:
        raise InputError(
            f"{CLOCK_OFFSET}.{named[0]}: {shown(named[0])} is the first clock of "
            f"{source}, by which the others are set; expected "
            + (" or ".join(f"{CLOCK_OFFSET}.{name}" for name in others) or "no clock")
        )


def has_common_clock(observations: Observations) -> bool:
    """Return True if some clock times are on the common clock, others on named ones."""
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    named = np.array([bool(clock) for clock in observations.clock])
    return bool(named.any() and (timed & ~named).any())


def clocks_apart(observations: Observations) -> list[str]:
    """Return the clocks named in a log, except the one by which others are set."""
    named = list(dict.fromkeys(filter(None, observations.clock)))
    return named if has_common_clock(observations) else named[1:]


def untied_flashes(
    observations: Observations, known: Collection[str]
) -> Bool[np.ndarray, " row"]:
    """Return True for rows of flashes on clocks without a relation to the others.

    Such a clock is named in the column `clock`, has flashes only, and its offset is
    neither given nor fitted. The first clock is related to others whose offsets are
    given or fitted. If no other clock has other readings, all rows are False.

    Args:
        observations: The log.
        known: Clocks whose offset is given or fitted.
    """
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    flash = np.isin(observations.quantity, "flash_time_s")
    clocks = np.array(observations.clocks(), object)
    named = np.array([bool(clock) for clock in observations.clock])
    tied = set(clocks[timed & ~flash]) | set(clocks[timed & ~named]) | set(known)
    if set(observations.clock) & set(known) and not has_common_clock(observations):
        tied.add(next((clock for clock in observations.clock if clock), ""))
    untied = flash & ~np.isin(clocks, list(tied))
    return untied if (timed & ~untied).any() else np.zeros(len(observations), bool)


def refuse_unsolvable_clocks(
    observations: Observations, uncertain: UncertainScene
) -> None:
    """Refuse unknown clocks that the clock times of a log cannot determine.

    Each clock time determines one offset or origin time at most. Where there are no
    more times than these, the times do not constrain the position; the other readings
    must then determine all other unknowns.

    Raises:
        InputError: There are fewer times than unknown offsets and origin times, or as
            many, and fewer other readings than other unknowns. The message names the
            unknowns and possible remedies.
    """
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    read = set(np.array(observations.clocks(), object)[timed])
    # a prior constrains an offset, so only free ones count
    free = [name for name, of in uncertain.beliefs.items() if isinstance(of, Free)]
    # an offset of a clock without readings changes nothing
    offsets = [n for n in free if n in {f"{CLOCK_OFFSET}.{clock}" for clock in read}]
    origins = [n for n in free if n.partition(".")[0] == "origin_time_s"]
    clocks, times = len(offsets) + len(origins), int(timed.sum())
    others = len(free) - clocks
    too_few = times == clocks and len(observations) - times < others
    if not offsets or not (times < clocks or too_few):
        return
    left = f" and {others} other unknowns" if too_few else ""
    raise InputError(
        f"{observations.source or 'observations'}: {times} clock times and "
        f"{len(observations) - times} other readings cannot determine {clocks} unknown "
        f"clocks ({', '.join([*offsets, *origins])}){left}; expected recorders on a "
        "common clock (one name in the column clock), a flash_time_s beside the "
        "arrival on each clock, or known offsets ([[clock]] offset_s in the scene)"
    )


def refuse_unresolved(
    observations: Observations, dtype: type[np.floating[Any]] | None = None
) -> None:
    """Raise an error for clock times that are too coarse in the computation's numbers.

    A time since 1970 in single precision has steps of 128 s, and a fit would converge
    to a wrong result. Neighbouring numbers may be one sigma apart, a rounding error of
    0.3 sigma.

    Args:
        observations: The log.
        dtype: Type of the computation; JAX's default.

    Raises:
        InputError: There is a row with such a time; the message names the first.
    """
    dtype = dtype or jnp.zeros(()).dtype.type
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    value = np.where(timed, observations.value, 0.0)
    # distance to the next representable number at each value
    spacing = np.spacing(np.abs(value).astype(dtype)).astype(float)
    # false for NaN: without a sigma there is nothing to compare
    coarse = timed & (spacing > observations.sigma)
    for row in np.flatnonzero(coarse).tolist():
        raise observations.fault(
            row,
            f"{observations.quantity[row]} = {value[row]:.10g} s with a sigma of "
            f"{observations.sigma[row]:g} s: in {np.dtype(dtype).name} such times are "
            f"{spacing[row]:.3g} s apart; expected times counted from near the shot, "
            "or float64 (jax_enable_x64)",
        )
