"""Loads on a vehicle other than air and weight: forces, short pulses, and gusts.

A load is a function of time and state. A pulse returns its impulse between two times.
The part within a step is applied as a constant force over that step, so the impulse is
complete at any step, even if the pulse is shorter.

A gust is a uniform wind. At its beginning it has the limit from inside, and it is zero
before. A gust with an infinite beginning never occurs.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.vehicle.dynamics import Wrench
from jblast.vehicle.quadrotor import Vehicle, floats
from jblast.vehicle.state import (
    Number,
    State,
    StateComponents,
    Vector,
    add,
    joined,
    three,
)


@runtime_checkable
class Load(Protocol):
    """A force that varies slowly within a step; jumps at its ends are allowed."""

    def __call__(
        self, time_s: Float[Array, ""], state: State, vehicle: Vehicle
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return force, world [N], and moment about the centre of mass, body [N m]."""
        ...


@runtime_checkable
class Pulse(Protocol):
    """A force that may begin and end within a step.

    It may also have a method `quiet_until(start_s, state, vehicle)` that returns a time
    before which the pulse cannot act on a vehicle with this state at `start_s`, or
    `start_s` itself if it may act immediately. Its impulse is not evaluated before.
    """

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return its impulse on a vehicle between two times.

        Returns:
            Impulse, world [N s], and angular impulse, body [N m s].
        """
        ...


def load_wrench(
    loads: tuple[Load | Pulse, ...],
    time_s: Number,
    state: State,
    vehicle: Vehicle,
    start: Wrench,
) -> Wrench:
    """Sum of `start` and the loads at a time; pulses are skipped."""
    for load in loads:
        if not isinstance(load, Pulse):
            start = _plus(start, load(time_s, state, vehicle), 1.0)
    return start


def pulse_wrench(
    pulses: Sequence[Pulse],
    start_s: Number,
    step_s: Number,
    motion: StateComponents,
    vehicle: Vehicle,
    inactive_until_s: tuple[Number, ...],
    axis: str | None,
) -> tuple[Wrench, tuple[Number, ...]]:
    """Mean force and moment of the pulses over a step, from the state at its beginning.

    Args:
        pulses: The pulses.
        start_s: Beginning of the step.
        step_s: Length of the step.
        motion: State at its beginning.
        vehicle: The vehicle.
        inactive_until_s: Time before which each pulse is zero.
        axis: Name of the `vmap` axis of a chunk of vehicles; None: a single vehicle.

    Returns:
        Force and moment, and the times before which each pulse is zero for all of the
        vehicles.
    """
    zero = (0 * step_s, 0 * step_s, 0 * step_s)
    total: Wrench = (zero, zero)
    end_s, inactive_until = start_s + step_s, []
    for load, until in zip(pulses, inactive_until_s, strict=True):

        def mean(load: Any = load) -> Wrench:
            given = load.impulse(start_s, end_s, joined(motion), vehicle)
            # A constant force over the step gives the whole impulse at any step.
            return _plus((zero, zero), given, 1 / step_s)

        def none() -> Wrench:
            return zero, zero

        def look(load: Any = load, mean: Any = mean) -> tuple[Wrench, Number]:
            until = load.quiet_until(start_s, joined(motion), vehicle)
            # A diverged vehicle must not keep the chunk evaluating its loads. For any
            # other vehicle a NaN is an error of the load, which is then evaluated and
            # makes the flight diverge visibly.
            lost = ~jnp.isfinite(sum(jax.tree.leaves(motion)))
            unknown = jnp.where(lost, jnp.inf, -jnp.inf)
            until = jnp.where(jnp.isnan(until), unknown, until)
            until = jax.lax.stop_gradient(until).astype(start_s.dtype)
            if axis is not None:
                # A condition that differs between vehicles would turn `cond` into a
                # `select`, which evaluates both branches: one time for the chunk.
                until = jax.lax.pmin(until, axis)
            return jax.lax.cond(end_s > until, mean, none), until

        if hasattr(load, "quiet_until"):
            given, until = jax.lax.cond(
                end_s > until, look, lambda until=until: ((zero, zero), until)
            )
        else:
            given = mean()
        total = (add(total[0], given[0]), add(total[1], given[1]))
        inactive_until.append(until)
    return total, tuple(inactive_until)


def _plus(
    total: Wrench,
    given: tuple[Float[Array, "3"], Float[Array, "3"]],
    scale: float | Number,
) -> Wrench:
    """Return the sum of a total and a scaled load, in the precision of the flight."""
    dtype = total[0][0].dtype

    def scaled(vector: Float[Array, "3"]) -> Vector:
        x, y, z = three(vector.astype(dtype))
        return x * scale, y * scale, z * scale

    return add(total[0], scaled(given[0])), add(total[1], scaled(given[1]))


def steady(phase: Float[Array, ""]) -> Float[Array, ""]:
    """Return the shape of a gust that stays."""
    return jnp.ones_like(phase)


def n_wave(phase: Float[Array, ""]) -> Float[Array, ""]:
    """Return the shape that falls linearly to its opposite; its mean is zero."""
    return jnp.where(phase <= 1, 1 - 2 * phase, 0)


def friedlander(phase: Float[Array, ""]) -> Float[Array, ""]:
    """Return the shape of Friedlander's pulse of decay 1, negative phase included."""
    return (1 - phase) * jnp.exp(-phase)


class Gust(eqx.Module):
    """A uniform wind after still air.

    Attributes:
        velocity_m_s: At its beginning: east, north, up [m/s].
        start_s: Time of its beginning [s].
        duration_s: Unit of the phase: duration of an N-wave, or of the positive phase
            of a blast wind [s].
        shape: Function from phase, the time since the beginning over the duration, to
            the share of the velocity: `steady`, `n_wave`, `friedlander`, or another.
    """

    velocity_m_s: Float[Array, "*batch 3"]
    start_s: Float[Array, "*batch"]
    duration_s: Float[Array, "*batch"]
    shape: Callable[[Array], Array] = eqx.field(static=True)

    def __init__(
        self,
        velocity_m_s: ArrayLike | Sequence[float],
        start_s: ArrayLike,
        duration_s: ArrayLike = 1.0,
        shape: Callable[[Array], Array] = steady,
    ):
        """Convert the numbers; a duration may be common to all gusts of a batch."""
        self.velocity_m_s, self.start_s = floats(velocity_m_s), floats(start_s)
        self.duration_s = jnp.broadcast_to(floats(duration_s), self.start_s.shape)
        self.shape = shape

    def __call__(
        self, time_s: Float[Array, ""], position_m: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Velocity of the air [m/s]."""
        begun = time_s >= self.start_s
        # The guard is on the difference: that from an infinite time has no gradient.
        phase = jnp.where(begun, time_s - self.start_s, 0) / self.duration_s
        return self.velocity_m_s * jnp.where(begun, self.shape(phase), 0)
