"""What a lane shows: what its task has, and an IMU's readings if there is one."""

import jax

from jblast.environments.episode import OF_IMU
from jblast.environments.params import EnvironmentParams
from jblast.environments.state import EnvironmentState
from jblast.environments.tasks.table import TASKS
from jblast.environments.tasks.task import Seen


def observed(params: EnvironmentParams, state: EnvironmentState) -> Seen:
    """Return the numbers that a lane shows.

    With an IMU six numbers follow those of the task: specific force, mean of the last
    step [m/s2], and body rates [rad/s], along the body's axes, with bias and noise.

    Args:
        params: Of the environment.
        state: Of the lane.
    """
    seen = TASKS[params.task].observe(params, state)
    if params.imu is None:
        return seen
    episode, imu, motion = state.episode, params.imu, state.now.motion
    key = jax.random.fold_in(jax.random.fold_in(state.key, state.number), OF_IMU)
    key = jax.random.fold_in(jax.random.fold_in(key, 1), state.steps)
    noise = jax.random.normal(key, (2, 3), params.step_s.dtype)
    forces = [
        force + bias + imu.force_noise_m_s2 * one
        for force, bias, one in zip(
            state.force_m_s2, episode.force_bias_m_s2, noise[0], strict=True
        )
    ]
    rates = [
        rate + bias + imu.rate_noise_rad_s * one
        for rate, bias, one in zip(
            motion.body_rate, episode.rate_bias_rad_s, noise[1], strict=True
        )
    ]
    return (*seen, *forces, *rates)
