"""What an environment is made of: all that lanes share, and what each draws."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.missions import Guidance
from jblast.scene import Air, ByCount, Ring, Uniform, WorldSpec
from jblast.scene.priors import Prior
from jblast.types import as_float_array
from jblast.vehicle import Controller, Gains, Vehicle

Number = Float[Array, ""] | Prior
"""A number that every episode has, or the distribution that each draws its own from."""


def _number(value: ArrayLike | Prior) -> Number:
    return value if isinstance(value, Prior) else as_float_array(value)


class Randomisation(eqx.Module):
    """What differs from episode to episode beside the blasts: numbers or priors.

    The hold and the loop of the body's rates know the vehicle without it.

    Attributes:
        mass_factor: On the vehicle's mass [-].
        inertia_factor: On its inertia [-].
        gain_factor: On all gains of its loops [-].
        wind_east_m_s: Steady wind; it blows on the vehicle and carries the waves.
        wind_north_m_s: Likewise.
        delay_s: From an action to the rotors' command, in whole steps, rounded.
    """

    mass_factor: Number = eqx.field(converter=_number, default=1.0)
    inertia_factor: Number = eqx.field(converter=_number, default=1.0)
    gain_factor: Number = eqx.field(converter=_number, default=1.0)
    wind_east_m_s: Number = eqx.field(converter=_number, default=0.0)
    wind_north_m_s: Number = eqx.field(converter=_number, default=0.0)
    delay_s: Number = eqx.field(converter=_number, default=0.0)


class Imu(eqx.Module):
    """Errors of accelerometer and gyroscope; all declared, as of a cheap MEMS part.

    Attributes:
        force_noise_m_s2: Standard deviation of each reading.
        rate_noise_rad_s: Likewise.
        force_bias_m_s2: Standard deviation of a bias that lasts an episode.
        rate_bias_rad_s: Likewise.
    """

    force_noise_m_s2: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=0.1
    )
    rate_noise_rad_s: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=0.01
    )
    force_bias_m_s2: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.1)
    rate_bias_rad_s: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=0.005
    )


def default_world() -> WorldSpec:
    """Return two blasts about the vehicle in each episode."""
    return WorldSpec(
        occurrence=ByCount(2),
        region=Ring(12.0, 40.0),
        about="vehicle",
        mass=Uniform(5.0, 15.0),
        time=Uniform(0.5, 8.0),
    )


class EnvironmentParams(eqx.Module):
    """All that lanes of an environment share; `environment_params` makes one.

    Attributes:
        vehicle: What flies.
        hold: The position hold, ready for that vehicle.
        inverse: Of the vehicle's allocation.
        world: What the blasts of an episode are drawn by: a number of them that is
            known beforehand.
        air: What their waves go through.
        randomisation: What else episodes draw.
        guidance: Of the mission; None where there is none.
        imu: Errors of the IMU; None where it is not observed.
        target_m: Where a vehicle hovers.
        spread_m: How far off it an episode may start, along each axis.
        far_m: How far off an episode ends.
        rate_rad_s: Most that a command or an aim asks for of body rates.
        speed_m_s: Most that a command asks for of velocity.
        reach_m: Farthest that a command moves the place to hold.
        ground_up_m: Height of the ground.
        step_s: Of environment and integrator.
        episode_steps: Most steps of an episode.
        task: Its name.
        command: What an action means, a name of `commands.COMMANDS`.
        most_delay: Steps that an action may be late.
    """

    vehicle: Vehicle
    hold: Controller
    inverse: Float[Array, "4 4"]
    world: WorldSpec
    air: Air
    randomisation: Randomisation
    guidance: Guidance | None
    imu: Imu | None
    target_m: Float[Array, "3"] = eqx.field(converter=as_float_array)
    spread_m: Float[Array, ""] = eqx.field(converter=as_float_array)
    far_m: Float[Array, ""] = eqx.field(converter=as_float_array)
    rate_rad_s: Float[Array, ""] = eqx.field(converter=as_float_array)
    speed_m_s: Float[Array, ""] = eqx.field(converter=as_float_array)
    reach_m: Float[Array, ""] = eqx.field(converter=as_float_array)
    ground_up_m: Float[Array, ""] = eqx.field(converter=as_float_array)
    step_s: Float[Array, ""] = eqx.field(converter=as_float_array)
    episode_steps: Int[Array, ""] = eqx.field(
        converter=lambda x: jnp.asarray(x, jnp.int32)
    )
    task: str = eqx.field(static=True)
    command: str = eqx.field(static=True)
    most_delay: int = eqx.field(static=True, default=0)

    @property
    def gains(self) -> Gains:
        """Of the hold."""
        return self.hold.hold.gains  # pyright: ignore[reportAttributeAccessIssue] (that of a ready hold)
