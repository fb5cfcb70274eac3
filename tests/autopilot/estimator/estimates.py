"""An estimate in flight, and flights that were not simulated, for the filter."""

import jax
import jax.numpy as jnp
import numpy as np

from jblast.autopilot.estimator import Estimate, aligned, alignment
from jblast.sensors.flight_sensors import Magnetometer, Suite
from jblast.vehicle import State, Trajectory
from tests.vehicle.flights import by_hand

FIELD = jnp.array([0.01, 0.2, -0.43])
SUITE = Suite(Magnetometer(FIELD))
PERIOD = jnp.asarray(0.004)
FORCE, RATE = jnp.array([1.5, -2.0, 9.0]), jnp.array([0.8, -0.5, 1.2])


def in_flight() -> Estimate:
    """An estimate that is turned, moves, and knows of biases."""
    quaternion = jnp.array([0.1, -0.2, 0.5, 0.8])
    state = State(
        jnp.array([3.0, -4.0, 12.0]),
        jnp.array([2.0, 1.0, -0.5]),
        quaternion / jnp.linalg.norm(quaternion),
        jnp.zeros(3),
        jnp.zeros(4),
    )
    deviations = alignment(jnp.asarray(0.002), jnp.asarray(0.02))
    estimate = aligned(jax.random.key(0), state, deviations)
    return estimate._replace(
        rate_bias=jnp.array([0.01, -0.02, 0.015]),
        force_bias=jnp.array([0.05, 0.02, -0.1]),
    )


def swinging(key: int, seconds: float) -> Trajectory:
    """A flight along random slow waves, tilting and turning."""
    rng = np.random.default_rng(key)
    time = np.arange(round(seconds / 0.004) + 1) * 0.004

    def waves(size: float) -> tuple[np.ndarray, np.ndarray]:
        pulses, phases = rng.uniform(0.5, 2.5, 3), rng.uniform(0, 6, 3)
        angle = time[:, None] * pulses + phases
        sizes = size * rng.uniform(0.3, 1.0, 3)
        return sizes * np.sin(angle), sizes * pulses * np.cos(angle)

    place, moves = waves(2.0)
    turn, _ = waves(0.4)
    turn[:, 2] += 0.3 * time
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    axis = turn / np.maximum(angle, 1e-12)
    quaternion = np.concatenate([np.sin(angle / 2) * axis, np.cos(angle / 2)], axis=1)
    above = place + np.array([0, 0, 20.0])
    return by_hand(time, above, velocity_m_s=moves, quaternion=quaternion)
