"""A controller that flies by what its vehicle's instruments say, not by the truth.

At each turn the instruments are sampled, the estimate is carried on and corrected, and
who flies is shown the estimate in place of the state. Its rotors' speeds it is not
shown otherwise; that it stands on the ground a switch tells.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Integer, PRNGKeyArray, PyTree

from jblast.autopilot.estimator.correct import corrected, fix_taken, numbers_read
from jblast.autopilot.estimator.estimate import (
    Alignment,
    Estimate,
    aligned,
)
from jblast.autopilot.estimator.predict import predicted
from jblast.sensors.carried.suite import CALIBRATED, Held, Sample, Suite
from jblast.types import as_float_array
from jblast.vehicle import State, Vehicle

_ALIGNMENT = 2**32 - 1
"""Folded into the key of the first error: past the numbers of the instruments."""


class Known(NamedTuple):
    """What is known at a turn.

    Attributes:
        estimate: Of the state.
        held: What the instruments keep.
        before: The true state at the turn before, which they feel from.
        rate_rad_s: About the body's axes, as it was read and corrected.
    """

    estimate: Estimate
    held: Held
    before: State
    rate_rad_s: Float[Array, "3"]


class EstimatedControl(eqx.Module):
    """Flies by an error-state Kalman filter of a vehicle's instruments.

    Attributes:
        control: Who flies by it.
        suite: The instruments; a turn of the control is a sample of them.
        initial: The state of the start.
        seed: Of all draws of the instruments, and of the first error.
        alignment: How sure it is of its state at the start.
        ground_m: Height of the ground.

    Example:
        `simulate(vehicle, start, control=EstimatedControl(hold, suite, start, seed))`
    """

    control: Any
    suite: Suite
    initial: State
    seed: Integer[Array, "*batch"]
    alignment: Alignment = eqx.field(default_factory=Alignment)
    ground_m: Float[Array, "*batch"] = eqx.field(converter=as_float_array, default=0.0)

    @property
    def gains(self) -> Any:
        """Of who flies: by them the step is checked."""
        return self.control.gains

    def start(self) -> tuple[PyTree[Array], Known]:
        """Return the memory of who flies, and what is known."""
        return self.control.start(), self.known()

    def known(self) -> Known:
        """Return what is known before the first turn."""
        key, imu = self._key(), self.suite.imu
        deviations = self.alignment.deviations(
            CALIBRATED * imu.gyroscope_bias, CALIBRATED * imu.accelerometer_bias
        )
        estimate = aligned(
            jax.random.fold_in(key, _ALIGNMENT), self.initial, deviations
        )
        held = self.suite.start(key, self.initial)
        return Known(estimate, held, self.initial, jnp.zeros(3))

    def ready(self, vehicle: Vehicle) -> "EstimatedControl":
        """Return the same with whatever does not change in flight calculated."""
        control = self.control
        if hasattr(control, "ready"):
            control = control.ready(vehicle)
        return eqx.tree_at(lambda own: own.control, self, control)

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: tuple[PyTree[Array], Known],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], tuple[PyTree[Array], Known]]:
        """Return rotor speeds to ask for [rad/s], and the memory afterwards."""
        inner, known = memory
        known = self.sensed(time_s, state, known, period_s)
        shown = self.shown(known, state)
        speeds, inner = self.control(time_s, shown, vehicle, inner, period_s)
        return speeds, (inner, known)

    def shown(self, known: Known, state: State) -> State:
        """Return what who flies takes for the state.

        Args:
            known: At this turn.
            state: The vehicle, in truth: of it come the rotors, and the switch.
        """
        estimate = known.estimate
        stands = state.position_m[2] <= self.ground_m
        up = jnp.where(stands, self.ground_m, estimate.position_m[2])
        return State(
            estimate.position_m.at[2].set(up),
            estimate.velocity_m_s,
            estimate.quaternion,
            known.rate_rad_s,
            state.rotor_speed_rad_s,
        )

    def sensed(
        self,
        time_s: Float[Array, ""],
        state: State,
        known: Known,
        period_s: Float[Array, ""],
    ) -> Known:
        """Return what is known once the instruments have been read.

        Args:
            time_s: Of the turn.
            state: The vehicle, in truth.
            known: At the turn before.
            period_s: Since then.
        """
        turn = jnp.round(time_s / period_s).astype(jnp.int32)
        sample, held = self.suite(
            self._key(), turn, known.held, known.before, state, time_s, period_s
        )
        estimate = estimated(self.suite, known.estimate, sample, turn > 0, period_s)
        rate = sample.rate_rad_s - estimate.rate_bias
        return Known(estimate, held, state, rate)

    def _key(self) -> PRNGKeyArray:
        return jax.random.key(self.seed)


def estimated(
    suite: Suite,
    estimate: Estimate,
    sample: Sample,
    moves: Array,
    period_s: Float[Array, ""],
) -> Estimate:
    """Return the estimate after a sample.

    Args:
        suite: The instruments.
        estimate: Before.
        sample: What they say.
        moves: Whether time has gone on since the last: at the first turn it has not.
        period_s: Of the sample.
    """
    later = predicted(
        estimate, sample.force_m_s2, sample.rate_rad_s, suite.imu, period_s
    )
    estimate = jax.tree.map(lambda a, b: jnp.where(moves, a, b), later, estimate)
    # at four turns of five nothing comes but the inertial unit's
    comes = sample.has_fix | sample.has_field | sample.has_pressure
    estimate = jax.lax.cond(
        comes,
        lambda own: corrected(own, numbers_read(own, suite, sample)),
        lambda own: own,
        estimate,
    )
    return fix_taken(estimate, sample.takes_fix)
