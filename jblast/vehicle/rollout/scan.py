"""The flight of one vehicle: a scan over steps, its state stored now and then."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.dynamics.components import Number, StateComponents
from jblast.vehicle.dynamics.equations import Wrench, net_wrench
from jblast.vehicle.rollout.flight import Flight, StoredRows
from jblast.vehicle.rollout.step import Now, OneStep
from jblast.vehicle.rollout.timetable import Ticks

BLOCK = 16
"""Most steps that are taken at once: their times are small arrays (`batching.py`), and
where no pulse comes in all of them nothing looks for one."""

Step = Callable[[Now, Ticks], Now]


def fly(
    flight: Flight,
    ticks: Ticks,
    period_s: Float[Array, ""],
    *,
    integrator: str,
    store_every: int,
    control_held: bool,
    axis: str | None = None,
) -> StoredRows:
    """Return the stored rows of one vehicle's flight: the start, and so on to the end.

    Args:
        flight: The vehicle, its start and what acts on it.
        ticks: The steps.
        period_s: Time between two turns of the controller [s].
        integrator: "rk4" or "euler".
        store_every: Steps between rows.
        control_held: Whether there are steps at which the controller is not asked.
        axis: Of the vehicles that fly in one chunk, as `vmap` names it; None: one flies
            alone.
    """
    if hasattr(flight.control, "ready"):
        flight = flight._replace(control=flight.control.ready(flight.vehicle))
    one = OneStep(flight, period_s, integrator, control_held, axis)
    now = one.start()
    first = (now.motion, now.impulse_wrench)

    def stretch(now: Now, part: Ticks) -> tuple[Now, tuple[StateComponents, Wrench]]:
        size = part.step.size
        block = max(n for n in range(1, BLOCK + 1) if size % n == 0)
        blocks = jax.tree.map(lambda x: x.reshape(-1, block, *x.shape[1:]), part)
        now, _ = jax.lax.scan(
            lambda now, part: (_few(one, now, part), None), now, blocks
        )
        return now, (now.motion, now.impulse_wrench)

    def wrench(row: tuple[StateComponents, Wrench], time: Number) -> Wrench:
        motion, impulse_wrench = row
        rate = one.rates(impulse_wrench, time, motion.rotor_speed, motion)
        return net_wrench(flight.vehicle, motion, rate)

    count = ticks.step.size // store_every
    even = count * store_every
    whole = jax.tree.map(
        lambda x: x[:even].reshape(count, store_every, *x.shape[1:]), ticks
    )
    now, between = jax.lax.scan(stretch, now, whole)
    parts = [jax.tree.map(lambda x: x[None], first), between]
    times = [ticks.stages[:1, 0], whole.stages[:, -1, 2]]
    if even < ticks.step.size:
        _, end = stretch(now, jax.tree.map(lambda x: x[even:], ticks))
        parts.append(jax.tree.map(lambda x: x[None], end))
        times.append(ticks.stages[-1:, 2])
    rows = jax.tree.map(lambda *x: jnp.concatenate(x), *parts)
    forces = jax.vmap(wrench)(rows, jnp.concatenate(times))
    # what has once diverged stays lost, wherever its numbers go
    lost = ~jnp.isfinite(sum(jax.tree.leaves((rows, forces))))
    alive = jnp.cumsum(lost) == 0
    ended = jax.tree.map(lambda x: jnp.where(alive, x, jnp.nan), (rows[0], forces))
    return StoredRows(ended[0], ended[1], alive)


def _few(one: OneStep, now: Now, part: Ticks) -> Now:
    """Take a block of steps."""
    if not now.inactive_until_s:
        return _steps(one.advance, now, part)
    end_s = part.start[-1] + part.step[-1]
    active = end_s > functools.reduce(jnp.minimum, now.inactive_until_s)
    none = jax.tree.map(jnp.zeros_like, now.impulse_wrench)
    return jax.lax.cond(
        active,
        lambda now: _steps(one.advance_pushed, now, part),
        lambda now: _steps(one.advance, now._replace(impulse_wrench=none), part),
        now,
    )


def _steps(step: Step, now: Now, part: Ticks) -> Now:
    # Backwards, a step is calculated again instead of being kept whole.
    again = jax.checkpoint(lambda now, tick: (step(now, tick), None), prevent_cse=False)
    return jax.lax.scan(again, now, part)[0]
