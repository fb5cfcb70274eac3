"""Loads on a vehicle other than air and weight: forces, short pulses, and gusts.

A load is a function of time and state. A pulse returns its impulse between two times.
The part within a step is applied as a constant force over that step, so the impulse is
complete at any step, even if the pulse is shorter.

Gusts are uniform winds: a step, an N-wave, a Friedlander pulse. At its beginning a gust
has the limit from inside, and it is zero before. A gust with an infinite beginning
never occurs.
"""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

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
from jblast.waves.pulse import friedlander_pressure


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


class StepGust(eqx.Module):
    """Still air, then a steady wind.

    Attributes:
        velocity_m_s: East, north, up [m/s].
        start_s: When it sets in [s].
    """

    velocity_m_s: Float[Array, "3"] = eqx.field(converter=floats)
    start_s: Float[Array, ""] = eqx.field(converter=floats)

    def __call__(
        self, time_s: Float[Array, ""], position_m: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Velocity of the air [m/s]."""
        return jnp.where(time_s >= self.start_s, self.velocity_m_s, 0)


class NWaveGust(eqx.Module):
    """A wind that falls linearly from a peak to its opposite, with zero mean.

    Attributes:
        velocity_m_s: At the peak: east, north, up [m/s].
        start_s: When it sets in [s].
        duration_s: How long it lasts [s].
    """

    velocity_m_s: Float[Array, "3"] = eqx.field(converter=floats)
    start_s: Float[Array, ""] = eqx.field(converter=floats)
    duration_s: Float[Array, ""] = eqx.field(converter=floats)

    def __call__(
        self, time_s: Float[Array, ""], position_m: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Velocity of the air [m/s]."""
        begun = time_s >= self.start_s
        phase = jnp.where(begun, time_s - self.start_s, 0) / self.duration_s
        return self.velocity_m_s * jnp.where(begun & (phase <= 1), 1 - 2 * phase, 0)


class FriedlanderGust(eqx.Module):
    """A blast wind with the shape of Friedlander's pulse, negative phase included.

    Attributes:
        velocity_m_s: At the peak: east, north, up [m/s].
        start_s: When it sets in [s].
        duration_s: Of its positive phase [s].
        decay: $b$ [-], positive.
    """

    velocity_m_s: Float[Array, "3"] = eqx.field(converter=floats)
    start_s: Float[Array, ""] = eqx.field(converter=floats)
    duration_s: Float[Array, ""] = eqx.field(converter=floats)
    decay: Float[Array, ""] = eqx.field(converter=floats, default=1.0)

    def __call__(
        self, time_s: Float[Array, ""], position_m: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Velocity of the air [m/s]."""
        # Any negative time is before the arrival, where the pulse is zero.
        since = jnp.where(time_s >= self.start_s, time_s - self.start_s, -1)
        one = jnp.ones_like(since)
        shape = friedlander_pressure(since, one, self.duration_s, self.decay)
        return self.velocity_m_s * shape
