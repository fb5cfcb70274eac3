"""To the end, however many steps it takes: one compiled stretch after another."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np

from jblast.waves.euler.gas import Gas
from jblast.waves.euler.gauges import cell_centres
from jblast.waves.euler.run import COURANT, History, run
from jblast.waves.euler.state import Flow, State, primitives

RECORDS = 500
"""Records of one compiled call."""


@dataclass(frozen=True)
class March:
    """How far a run came.

    Attributes:
        state: Where it ended: at the end, or the last state with positive densities and
            pressures.
        history: What was recorded until then, as NumPy arrays.
        lost: Where and when positivity was lost, in words; empty if it was not.
    """

    state: State
    history: History
    lost: str


def march(
    state: State,
    flow: Flow,
    end: float,
    *,
    stride: int = 10,
    courant: float = COURANT,
    gauges: Sequence[float] = (),
) -> March:
    """Run one flow until its clock is at the end. It cannot be differentiated.

    Args:
        state: Where the flow is.
        flow: What does not change.
        end: Radius of the shock [m], or time [s] where none is fitted.
        stride: Steps from one record to the next.
        courant: Fraction of the largest stable step.
        gauges: Radii at which pressure and velocity are recorded [m].

    Raises:
        InputError: The fraction of the largest stable step is above 1.
    """
    parts = []
    while True:
        state, history = _stretch(state, flow, end, stride, courant, gauges)
        parts.append(jax.tree.map(np.asarray, history))
        if not state.alive or parts[-1].clock[-1] >= end:
            break
        if not parts[-1].clock[-1] > parts[-1].clock[0]:
            raise RuntimeError(
                f"steps have shrunk to nothing at clock {float(state.clock):g}, before "
                f"the end at {end:g}"
            )
    whole: History = jax.tree.map(lambda *part: np.concatenate(part), *parts)
    moved = np.concatenate([[True], np.diff(whole.clock) > 0.0])
    kept = moved & np.isfinite(whole.front_pressure)
    history = jax.tree.map(lambda values: values[kept], whole)
    return March(state, history, "" if state.alive else _where_lost(state, flow.gas))


@functools.partial(eqx.filter_jit, donate="none")
def _stretch(state, flow, end, stride, courant, gauges):
    return run(
        state,
        flow,
        end,
        records=RECORDS,
        stride=stride,
        courant=courant,
        gauges=gauges,
    )


def _where_lost(state: State, gas: Gas) -> str:
    """Return the message: the cell of least pressure is where it happened."""
    cells = primitives(state, gas)
    at = int(np.argmin(np.asarray(cells.pressure)))
    place = float(cell_centres(state.radius, "planar")[at])
    return (
        f"positivity lost at r = {place:.6g} m, t = {float(state.time):.6g} s, in cell "
        f"{at}: the last density there was {float(cells.density[at]):.3g} kg/m3, the "
        f"pressure {float(cells.pressure[at]):.3g} Pa"
    )
