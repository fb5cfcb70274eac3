"""Where flights by a kernel of Warp would break: derivatives, sums in float32."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError
from jblast.vehicle import named, simulate
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.flights.hold_limits import hovering
from jblast.verification.stability.flights.overwriting_loop import (
    slope_by_tape,
    slope_of_steps,
)

LOOPS = (1, 2, 3, 5, 10, 20, 40)
WRONG = 1e-3
"""Share by which a derivative may be off."""
STEPS = np.array([1e-2, 2e-3, 5e-4, 1e-4, 2e-5])
FALL_S, ALLOWED_M = 2.5, 1e-3


def adjoint_errors() -> Float[np.ndarray, " loop"]:
    """Return by what share the tape's derivative is off, by steps of the loop."""
    return np.array(
        [abs(slope_by_tape(1.0, n) / slope_of_steps(1.0, n) - 1) for n in LOOPS]
    )


def adjoint_failure() -> FailureMode:
    """Measure when an adjoint of a loop in registers is wrong."""
    errors = adjoint_errors()
    first = int(np.argmax(errors > WRONG))
    said = _refusal()
    return FailureMode(
        area="flights",
        method="Warp, adjoint of a loop that overwrites its state",
        failure=f"the derivative is off by more than {WRONG:.1%}, and nothing says so",
        boundary=float(LOOPS[first]),
        unit="steps",
        beyond=f"{LOOPS[-1]} steps: off by {errors[-1]:.0%}",
        response=verified("refuses", "no derivatives" in said, "gradient by Warp"),
        message=f"{said}; those of JAX keep or repeat every state",
    )


def _refusal() -> str:
    """Return what is said of a derivative through the kernel."""
    vehicle = named("crazyflie")
    level = hovering(vehicle)

    def end(speed):
        start = dataclasses.replace(level, velocity_m_s=speed * jnp.ones(3))
        return simulate(
            vehicle, start, duration_s=1e-3, backend="warp:cpu"
        ).position_m.sum()

    try:
        jax.grad(end)(1.0)
    except InputError as error:
        return str(error)
    return ""


def falls() -> tuple[Float[np.ndarray, " step"], Float[np.ndarray, " step"]]:
    """Return how far a fall of 2.5 s in float32 ends off, by step [m].

    First by plain sums of semi-implicit Euler's exact gain in place, then by the
    kernel, rotors at rest and no drag.
    """
    vehicle = eqx.tree_at(
        lambda v: (v.frame_drag, v.translational_lift),
        named("hummingbird"),
        (jnp.zeros(3), jnp.zeros(())),
    )
    level = hovering(vehicle)
    start = dataclasses.replace(
        level,
        position_m=level.position_m.astype(jnp.float32),
        velocity_m_s=level.velocity_m_s.astype(jnp.float32),
        quaternion=level.quaternion.astype(jnp.float32),
        body_rate_rad_s=level.body_rate_rad_s.astype(jnp.float32),
        rotor_speed_rad_s=jnp.zeros(4, jnp.float32),
    )
    up = float(start.position_m[2])
    exact = up - FLIGHT_GRAVITY * FALL_S**2 / 2
    plain, ours = [], []
    for step in STEPS:
        plain.append(abs(_plain_fall(up, float(step)) - exact))
        flown = simulate(
            vehicle,
            start,
            duration_s=FALL_S,
            step_s=float(step),
            store_every=10**6,
            backend="warp:cpu",
        )
        ours.append(abs(float(flown.position_m[-1, 2]) - exact))
    return np.array(plain), np.array(ours)


def _plain_fall(up: float, step: float) -> float:
    """Return the height after a fall, each step's exact gain summed in float32 [m]."""
    x, v = np.float32(up), np.float32(0.0)
    h, g = np.float32(step), np.float32(FLIGHT_GRAVITY)
    for _ in range(round(FALL_S / step)):
        x = x + h * (v - g * h / np.float32(2))
        v = v - g * h
    return float(x)


def sum_failure() -> FailureMode:
    """Measure at which step float32 rounds a flight away."""
    plain, ours = falls()
    first = int(np.argmax(plain > ALLOWED_M))
    kept = bool((ours < ALLOWED_M).all())
    return FailureMode(
        area="flights",
        method="flight in float32, plain sums",
        failure=f"a fall of {FALL_S:g} s ends more than 1 mm off",
        boundary=1e3 * float(STEPS[first]),
        unit="ms and shorter steps",
        beyond=f"{1e6 * STEPS[-1]:g} us: {1e3 * plain[-1]:.2g} mm",
        response=verified("holds", kept, "sums in float32"),
        message="what a sum rounds away is added to the next: "
        f"{1e3 * ours.max():.1g} mm at most, steps of 20 us to 10 ms",
    )
