"""What one blast gives a vehicle over time, in the state that its front finds it in.

Force and moment are means over each step, from the impulses of `vehicle.blast_load`.
While the pulse passes the vehicle is taken to stay in the state it was met in: where,
how fast, how it is turned. So the profile is open-loop; who flies by the load itself
(`world.remote.blast_load`) has what the vehicle gains meanwhile, too.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.vehicle import BlastLoad, State, Vehicle, rotor_speeds
from jblast.vehicle.loads.blast.passage import Blast, crossing_time
from jblast.world.server.entity import Motion
from jblast.world.server.payload import ForceProfile

STEPS_HZ = 2000.0
"""Steps a second: those of a flight where nothing is said."""
MOST_STEPS = 2**14
"""Eight seconds: longer than any blast wave here."""


def state_met(vehicle: Vehicle, motion: Motion) -> State:
    """Return a vehicle's state as it moves, its rotors carrying its weight."""
    zero = jnp.zeros(())
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return State(
        position_m=jnp.asarray(motion.position_m),
        velocity_m_s=jnp.asarray(motion.velocity_m_s),
        quaternion=jnp.asarray(motion.quaternion),
        body_rate_rad_s=jnp.asarray(motion.body_rate_rad_s),
        rotor_speed_rad_s=rotor_speeds(vehicle, (weight, zero, zero, zero)),
    )


def force_profile(load: BlastLoad, vehicle: Vehicle, state: State) -> ForceProfile:
    """Return what a blast gives a vehicle.

    Args:
        load: Of one blast, which happens.
        vehicle: The vehicle.
        state: As the front comes.
    """
    begins, ends = (float(x) for x in _passing(load, vehicle, state))
    first = math.floor(begins * STEPS_HZ)
    last = math.ceil(ends * STEPS_HZ) + 1
    steps = min(last - first, MOST_STEPS)
    size = max(2 ** math.ceil(math.log2(steps)), 256)
    edges = np.arange(first, first + size + 1) / STEPS_HZ
    force, moment = (
        np.asarray(x)[:steps] for x in _means(load, vehicle, state, jnp.asarray(edges))
    )
    return ForceProfile(first, STEPS_HZ, force.copy(), moment.copy())


@kept
def _passing(
    load: BlastLoad, vehicle: Vehicle, state: State
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return when a blast begins to push, and when it has, by way of the ground too."""
    assert vehicle.body is not None, "models have one"
    body = vehicle.body

    def times(blast: Blast) -> tuple[Float[Array, ""], Float[Array, ""]]:
        wave, never = load.wave_of(blast, state.position_m), blast.never
        at_once = jnp.zeros_like(blast.time_s)
        came = load.front_time_s(blast, state.position_m, at_once)
        crossing = crossing_time(body, wave)
        over = came + crossing + 1.05 * (wave.duration_s + wave.suction_s)
        begins = jnp.where(never, jnp.inf, came - crossing)
        return begins, jnp.where(never, -jnp.inf, over)

    begins, ends = (jnp.stack(x) for x in zip(*map(times, load.waves), strict=True))
    return jnp.min(begins), jnp.max(ends)


@kept
def _means(
    load: BlastLoad, vehicle: Vehicle, state: State, edges: Float[Array, " edge"]
) -> tuple[Float[Array, "step 3"], Float[Array, "step 3"]]:
    """Return mean force and moment over each step, the state held where it is met."""

    def mean(
        start: Float[Array, ""], end: Float[Array, ""]
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        push, turn = load.impulse(start, end, state, vehicle)
        return push / (end - start), turn / (end - start)

    return jax.vmap(mean)(edges[:-1], edges[1:])
