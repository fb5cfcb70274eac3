"""To the end, however many steps it takes: one compiled stretch after another."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.waves.euler.gas import Gas
from jblast.waves.euler.gauges import cell_centres
from jblast.waves.euler.run import COURANT, History, run
from jblast.waves.euler.state import Flow, FlowState, is_positive, primitives
from jblast.waves.euler.step import step

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

    state: FlowState
    history: History
    lost: str


def march(
    state: FlowState,
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
        courant: Fraction of the largest stable step, as in `run`.
        gauges: Radii at which pressure and velocity are recorded [m].

    Raises:
        InputError: The fraction of the largest stable step is above 1.
    """
    parts = []
    while True:
        begun = state
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
    history = jax.tree.map(lambda values: values[moved & whole.alive], whole)
    if state.alive:
        return March(state, history, "")
    before, after = _last_step(begun, flow, end, courant)
    return March(before, history, _where_lost(before, after, flow.gas))


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


@eqx.filter_jit
def _last_step(state, flow, end, courant) -> tuple[FlowState, FlowState]:
    """Return the last state that is positive, and the first that is not."""

    def onward(pair):
        return pair[1], step(pair[1], flow, courant, jnp.asarray(end))[0]

    return jax.lax.while_loop(
        lambda pair: is_positive(pair[1], flow.gas), onward, (state, state)
    )


def _where_lost(before: FlowState, after: FlowState, gas: Gas) -> str:
    """Return the message; of several cells it names the innermost."""
    was, is_now = primitives(before, gas), primitives(after, gas)
    good = (np.asarray(is_now.density) > 0.0) & (np.asarray(is_now.pressure) > 0.0)
    at = int(np.argmin(good))
    place = float(cell_centres(before.radius, "planar")[at])
    return (
        f"positivity lost at r = {place:.6g} m, t = {float(before.time):.6g} s, in "
        f"cell {at}: a step takes its density from {float(was.density[at]):.3g} to "
        f"{float(is_now.density[at]):.3g} kg/m3, its pressure from "
        f"{float(was.pressure[at]):.3g} to {float(is_now.pressure[at]):.3g} Pa"
    )
