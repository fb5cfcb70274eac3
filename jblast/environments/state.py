"""The state of one lane: a vehicle, what its episode drew, and how far it is."""

from typing import NamedTuple

from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, PyTree

from jblast.environments.windows import Windows
from jblast.vehicle.dynamics.components import Number, Vector
from jblast.vehicle.rollout.step import Now
from jblast.world import Blasts


class Episode(NamedTuple):
    """What an episode drew; it stays to its end.

    Attributes:
        mass_factor: On the vehicle's mass.
        inertia_factor: On its inertia.
        gain_factor: On the gains of its loops.
        wind_m_s: East, north, up.
        delay_steps: From an action to its command.
        blasts: That may go off.
        force_bias_m_s2: Of the accelerometer; zero without one.
        rate_bias_rad_s: Of the gyroscope.
    """

    mass_factor: Number
    inertia_factor: Number
    gain_factor: Number
    wind_m_s: Vector
    delay_steps: Int[Array, ""]
    blasts: Blasts
    force_bias_m_s2: Vector
    rate_bias_rad_s: Vector


class EnvironmentState(NamedTuple):
    """A lane between two steps. Numbers stand alone: batches are one array each.

    Attributes:
        now: Vehicle, command, integral of the hold and pulse, as in a flight
            (`vehicle/rollout`).
        steps: Taken in this episode.
        queue: Actions that are still to take effect, the newest first.
        episode: What it drew.
        windows: When its blasts may push the vehicle.
        start_m: Where it started.
        task: Memory of the task.
        force_m_s2: Specific force of the last step, body axes.
        farthest_m: Greatest distance from where the vehicle should have been.
        ended: Whether the next step begins another episode.
        key: Of the lane; each episode folds its number into it.
        number: Of the episode, from 0.
    """

    now: Now
    steps: Int[Array, ""]
    queue: tuple[tuple[Float[Array, ""], ...], ...]
    episode: Episode
    windows: Windows
    start_m: Vector
    task: PyTree[Array]
    force_m_s2: Vector
    farthest_m: Float[Array, ""]
    ended: Bool[Array, ""]
    key: PRNGKeyArray
    number: Int[Array, ""]
