"""What an accelerometer reads beyond what a vehicle's own air gives it."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.scene import quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.sensors.imu.motion import Felt, rotation_quaternion
from jblast.vehicle import State, Vehicle
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.state import components


@kept
def beyond(
    samples: Felt,
    step_s: Float[Array, ""] | float,
    base: int,
    vehicle: Vehicle,
    start: State,
    rotor_speed: Float[Array, "sample 4"],
    offset_m: Float[Array, "3"],
    quaternion: Float[Array, "4"],
    wind: Float[Array, "3"],
) -> tuple[Float[Array, "sample 3"], Float[Array, "sample 3"]]:
    """Return what the accelerometer reads beyond the vehicle's own air [m/s2].

    Args:
        samples: The stretch.
        step_s: Time of a sample.
        base: Of how many samples the mean is nothing: their bias is taken off.
        vehicle: What it is on.
        start: Its motion where the stretch begins.
        rotor_speed: In the middle of each sample [rad/s].
        offset_m: Of the instrument, body axes.
        quaternion: Instrument to body.
        wind: Of the air [m/s].

    Returns:
        Along body axes, and along the world's.
    """
    to_body = quaternion_matrix(quaternion)
    force, rate = samples.force @ to_body.T, samples.rate @ to_body.T
    turns = jax.vmap(rotation_quaternion)(rate * step_s)
    halves = jax.vmap(rotation_quaternion)(rate * step_s / 2)

    def turn(attitude, both):
        whole, half = both
        return quaternion_product(attitude, whole), quaternion_product(attitude, half)

    _, attitude = jax.lax.scan(turn, start.quaternion, (turns, halves))
    # the instrument's place is thrown as the vehicle turns, and it is not
    edges = jnp.concatenate([rate[:1], (rate[1:] + rate[:-1]) / 2, rate[-1:]])
    thrown = jnp.diff(_cross(edges, offset_m), axis=0) / step_s
    thrown = thrown + jnp.cross(rate, _cross(rate, offset_m))
    centre = force - thrown
    to_world = jax.vmap(quaternion_matrix)(attitude)
    gravity = jnp.array([[0.0, 0.0, FLIGHT_GRAVITY]])

    def left(bias):
        gained = jnp.einsum("nij,nj->ni", to_world, centre - bias[None]) - gravity
        after = start.velocity_m_s[None] + jnp.cumsum(gained, axis=0) * step_s
        velocity = after - gained * step_s / 2

        def of(velocity, attitude, rate, speeds):
            state = State(jnp.zeros(3), velocity, attitude, rate, speeds)
            return jnp.stack(air_wrench(vehicle, components(state), tuple(wind))[0])

        own = jax.vmap(of)(velocity, attitude, rate, rotor_speed) / vehicle.mass_kg
        return centre - own - bias[None]

    bias = jnp.zeros(3)
    for _ in range(2):  # by the first an own velocity that drifts with the bias
        bias = bias + left(bias)[:base].mean(axis=0)
    found = left(bias)
    return found, jnp.einsum("nij,nj->ni", to_world, found)


def _cross(
    rates: Float[Array, "row 3"], arm: Float[Array, "3"]
) -> Float[Array, "row 3"]:
    return jnp.cross(rates, jnp.broadcast_to(arm, rates.shape))
