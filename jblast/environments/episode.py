r"""Random parameters of an episode, and the state of a lane.

Actions lie within -1 and 1 and are clipped to these bounds. Their meaning by mode of
command:

- `rotor_speeds` (4): from the minimum to the maximum speed of each rotor;
- `thrust_rates` (4): collective thrust $T = m g (1 + a_0)$ and rates about the body
  axes ahead, left, up $\omega_d = a \omega_{max}$, followed by $M = J k_\omega
  (\omega_d - \omega) + \omega \times J \omega$ with the controller's $k_\omega$;
- `velocity` (3): $a v_{max}$, east, north, up, followed by the position controller
  without its position term;
- `hold` (3): the controller's target is displaced by $a$ times `reach_m` from that of
  the task; an action of zero is the SE(3) controller itself.

Mass, inertia and allocation of controllers are the nominal ones, without the episode's
random factors.
"""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float, Int, PRNGKeyArray, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.missions import Guidance
from jblast.missions.guidance import SetPoint, as_if_at_rest
from jblast.scene import Air, Charge, Ring, Scene, Uniform, VehicleSpec, WorldSpec
from jblast.scene.random_blasts import ByCount
from jblast.scene.uncertain import Prior, draw
from jblast.types import as_numbers
from jblast.vehicle import BlastLoad, Gains, Vehicle, blast_load
from jblast.vehicle.control.allocation import speeds_within
from jblast.vehicle.controllers import gains_controller
from jblast.vehicle.quadrotor import in_precision
from jblast.vehicle.rollout import FlightState, Simulator
from jblast.vehicle.state import (
    Four,
    Number,
    Vector,
    add,
    cross,
    four,
    joined,
    rows,
    three,
    times,
)
from jblast.world import blast_sequence

COMMANDS = {"rotor_speeds": 4, "thrust_rates": 4, "velocity": 3, "hold": 3}
"""Length of an action by the name of its mode."""
Action = tuple[Number, ...]
BLASTS_KEY, VEHICLE_KEY = range(2)
"""Folded into an episode's key, one number per use."""
GROUND_UP_M = 0.0
"""Height of the ground."""
NumberOrPrior = Float[Array, ""] | Prior
"""A number for all episodes, or the prior of each episode's number."""


class Aim(eqx.Module):
    """Target of the vehicle in a step.

    Attributes:
        point: Set point of position, velocity and acceleration.
        yaw_rad: Heading.
    """

    point: SetPoint
    yaw_rad: Float[Array, ""]


def _number(value: ArrayLike | Prior) -> NumberOrPrior:
    return value if isinstance(value, Prior) else as_numbers(value)


class Randomisation(eqx.Module):
    """Random parameters of episodes other than blasts: numbers or priors.

    Controllers use the nominal vehicle.

    Attributes:
        mass_factor: Factor on the vehicle's mass [-].
        inertia_factor: Factor on its inertia [-].
        gain_factor: Factor on all controller gains [-].
        wind_east_m_s: Steady wind towards east, on the vehicle and the waves.
        wind_north_m_s: Steady wind towards north.
        delay_s: Delay from action to rotor command, rounded to whole steps.
    """

    mass_factor: NumberOrPrior = eqx.field(converter=_number, default=1.0)
    inertia_factor: NumberOrPrior = eqx.field(converter=_number, default=1.0)
    gain_factor: NumberOrPrior = eqx.field(converter=_number, default=1.0)
    wind_east_m_s: NumberOrPrior = eqx.field(converter=_number, default=0.0)
    wind_north_m_s: NumberOrPrior = eqx.field(converter=_number, default=0.0)
    delay_s: NumberOrPrior = eqx.field(converter=_number, default=0.0)


class EnvironmentParams(eqx.Module):
    """Common parameters of an environment's lanes, as by `environment_params`.

    Attributes:
        vehicle: Nominal vehicle.
        gains: Gains of the position controller.
        world: Distribution of an episode's blasts, with a fixed number.
        air: Ambient air.
        randomisation: Other random parameters of episodes.
        guidance: Guidance of the mission; None without one.
        target_m: Hover target.
        scale: Error at which the reward of a step is 1/e, in the task's unit.
        spread_m: Maximum initial distance from the target along each axis.
        far_m: Distance from the target at which an episode ends.
        rate_rad_s: Maximum commanded body rate.
        speed_m_s: Maximum commanded velocity.
        reach_m: Maximum displacement of the target by a command.
        step_s: Step of environment and integrator.
        episode_steps: Maximum number of steps of an episode.
        task: Name of the task.
        command: Meaning of an action, a name of `COMMANDS`.
        controller: Name of the position controller.
        most_delay: Maximum delay of an action in steps.
    """

    vehicle: Vehicle
    gains: Gains
    world: WorldSpec
    air: Air
    randomisation: Randomisation
    guidance: Guidance | None
    target_m: Float[Array, "3"] = eqx.field(converter=as_numbers)
    scale: Float[Array, ""] = eqx.field(converter=as_numbers)
    spread_m: Float[Array, ""] = eqx.field(converter=as_numbers)
    far_m: Float[Array, ""] = eqx.field(converter=as_numbers)
    rate_rad_s: Float[Array, ""] = eqx.field(converter=as_numbers)
    speed_m_s: Float[Array, ""] = eqx.field(converter=as_numbers)
    reach_m: Float[Array, ""] = eqx.field(converter=as_numbers)
    step_s: Float[Array, ""] = eqx.field(converter=as_numbers)
    episode_steps: Int[Array, ""] = eqx.field(
        converter=lambda x: jnp.asarray(x, jnp.int32)
    )
    task: str = eqx.field(static=True)
    command: str = eqx.field(static=True)
    controller: str = eqx.field(static=True)
    most_delay: int = eqx.field(static=True)


class Episode(NamedTuple):
    """Sampled parameters of an episode.

    Attributes:
        key: Key of the lane; each episode folds its number into it.
        number: Number of the episode, from 0.
        mass_factor: Factor on the vehicle's mass.
        inertia_factor: Factor on its inertia.
        gain_factor: Factor on its controller gains.
        wind_m_s: East, north, up.
        delay_steps: Delay from action to command.
        load: Load of the episode's blasts.
    """

    key: PRNGKeyArray
    number: Int[Array, ""]
    mass_factor: Number
    inertia_factor: Number
    gain_factor: Number
    wind_m_s: Vector
    delay_steps: Int[Array, ""]
    load: BlastLoad


class EnvironmentState(NamedTuple):
    """State of a lane between two steps, as scalars: one array each in a batch.

    Attributes:
        episode: Sampled parameters, constant until the next episode.
        now: Vehicle, command, controller integral and blasts, as in a flight
            (`vehicle/rollout`).
        steps: Number of steps in this episode.
        queue: Pending actions, the newest first.
        task: State of the task.
        farthest_m: Maximum distance from the target so far.
        ended: True if the next step begins another episode.
    """

    episode: Episode
    now: FlightState
    steps: Int[Array, ""]
    queue: tuple[tuple[Float[Array, ""], ...], ...]
    task: PyTree[Array]
    farthest_m: Float[Array, ""]
    ended: Bool[Array, ""]


def commanded(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> tuple[Four, Vector]:
    """Return rotor speed commands [rad/s] and the updated controller integral.

    Args:
        params: Parameters of the environment.
        state: State of the lane.
        action: Numbers within -1 and 1.
        aim: Target of the vehicle.
    """
    if params.command == "rotor_speeds":
        low = params.vehicle.rotor_speed_min_rad_s
        half = (params.vehicle.rotor_speed_max_rad_s - low) / 2
        a, b, c, d = (low + half * (1 + part) for part in action)
        return (a, b, c, d), state.now.memory
    if params.command == "thrust_rates":
        return _by_rates(params, state, action), state.now.memory
    return _by_hold(params, state, action, aim)


def _by_rates(
    params: EnvironmentParams, state: EnvironmentState, action: Action
) -> Four:
    vehicle, motion = params.vehicle, state.now.motion
    k_w = params.gains.body_rate * state.episode.gain_factor
    w, inertia = motion.body_rate, rows(vehicle.inertia_kg_m2)
    x, y, z = (
        k_w * (params.rate_rad_s * part - rate)
        for part, rate in zip(action[1:], w, strict=True)
    )
    moment = add(times(inertia, (x, y, z)), cross(w, times(inertia, w)))
    thrust = vehicle.mass_kg * FLIGHT_GRAVITY * (1 + action[0])
    return four(speeds_within(vehicle, (thrust, *moment)))


def _by_hold(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> tuple[Four, Vector]:
    flown = joined(state.now.motion)

    # Scalar by scalar: in a batch every component is one array over the lanes.
    def by_factor(gain: Array) -> Array:
        parts = [part * state.episode.gain_factor for part in jnp.ravel(gain)]
        return jnp.stack(parts).reshape(gain.shape)

    def with_action(start: Vector, scale: Array) -> Array:
        pairs = zip(start, action, strict=True)
        return jnp.stack([begun + scale * part for begun, part in pairs])

    gains = jax.tree.map(by_factor, params.gains)
    own = params.gains
    # Limits and lead are not gains of a loop, so the random factor does not apply.
    gains = replace(gains, integral_limit=own.integral_limit, motor_lead=own.motor_lead)
    if params.command == "velocity":
        # The target is the present position, so that the position term is zero.
        place = flown.position_m
        # The controller damps its velocity: the desired velocity is subtracted from it.
        velocity = with_action(state.now.motion.velocity, -params.speed_m_s)
        shown = replace(flown, velocity_m_s=velocity)
    else:
        place = with_action(three(aim.point.position_m), params.reach_m)
        shown = as_if_at_rest(params.vehicle, gains, flown, aim.point)
    hold = gains_controller(params.controller)(place, gains, aim.yaw_rad)
    start = jnp.zeros_like(params.step_s)
    speeds, gained = hold(
        start, shown, params.vehicle, jnp.stack(state.now.memory), params.step_s
    )
    return four(speeds), three(gained)


def draw_episode(
    lane: PRNGKeyArray,
    number: Array,
    start_m: Float[Array, "3"],
    params: EnvironmentParams,
) -> Episode:
    """Sample the parameters of an episode.

    Args:
        lane: Key of the lane.
        number: Number of the episode.
        start_m: Initial position of the vehicle.
        params: Parameters of the environment, with priors.
    """
    key = episode_key(lane, number)
    one = params.randomisation
    # All six are split at once, fixed numbers included: a new prior leaves the draws of
    # the others unchanged.
    keys = iter(jax.random.split(jax.random.fold_in(key, VEHICLE_KEY), 6))
    dtype = params.step_s.dtype

    def drawn(value: NumberOrPrior) -> Float[Array, ""]:
        own = next(keys)
        return (draw(own, value) if isinstance(value, Prior) else value).astype(dtype)

    mass, inertia, gain = map(
        drawn, (one.mass_factor, one.inertia_factor, one.gain_factor)
    )
    east, north = drawn(one.wind_east_m_s), drawn(one.wind_north_m_s)
    # A delay acts in whole steps, as the queue of actions does.
    late = jnp.round(drawn(one.delay_s) / params.step_s).astype(jnp.int32)
    occurrence = params.world.occurrence
    assert isinstance(occurrence, ByCount), "checked by environment_params"
    centre = params.target_m if params.world.about == "vehicle" else jnp.zeros(3, dtype)
    blasts = blast_sequence(
        jax.random.fold_in(key, BLASTS_KEY), params.world, centre, occurrence.count
    )
    # A ring is on the ground, where no wave is reflected: half of the waves.
    burst = "surface" if isinstance(params.world.region, Ring) else None
    charges = tuple(
        Charge(charge_kg, tuple(place), time, burst=burst)
        for time, place, charge_kg in zip(*blasts, strict=True)
    )
    # The waves travel in the same wind in which the vehicle flies.
    air = replace(params.air, wind_east=east, wind_north=north)
    vehicle = VehicleSpec(params.vehicle.name, start_m)
    load = blast_load(Scene(charges, air=air, vehicle=vehicle))
    return Episode(
        key=lane,
        number=number,
        mass_factor=mass,
        inertia_factor=inertia,
        gain_factor=gain,
        wind_m_s=(east, north, jnp.zeros((), dtype)),
        # `most_delay` is rounded in float64: in float32 a sample next to the upper
        # bound may round to one more step, for which the queue has no room.
        delay_steps=jnp.minimum(late, params.most_delay),
        load=in_precision(load, dtype),
    )


def episode_key(lane: PRNGKeyArray, number: Array) -> PRNGKeyArray:
    """Return the key of an episode.

    It depends on lane and number only, not on the number of lanes nor on the length of
    earlier episodes.
    """
    return jax.random.fold_in(lane, number)


def one_wave(load: BlastLoad, number: int | Array) -> BlastLoad:
    """Return the load of one of the waves, a pulse of its own."""
    wave = jax.tree.map(lambda x: x[number][None], load.waves)
    return replace(load, waves=wave, charges=1)


def vehicle_in(params: EnvironmentParams, episode: Episode) -> Vehicle:
    """Return the vehicle of an episode."""
    vehicle = params.vehicle
    # Scalar by scalar, as in `_by_hold`.
    inertia = [
        [(part * episode.inertia_factor)[None, None] for part in row]
        for row in rows(vehicle.inertia_kg_m2)
    ]
    return replace(
        vehicle,
        mass_kg=vehicle.mass_kg * episode.mass_factor,
        inertia_kg_m2=jnp.block(inertia),
    )


def simulator_of(params: EnvironmentParams, episode: Episode) -> Simulator:
    """Return the steps of an episode's vehicle; each wave is a pulse of its own."""

    def steady(time_s: Array, position_m: Array) -> Array:
        return jnp.stack(episode.wind_m_s)

    waves = episode.load.waves.time_s.shape[-1]
    return Simulator(
        vehicle_in(params, episode),
        params.step_s,
        wind=steady,
        loads=tuple(one_wave(episode.load, number) for number in range(waves)),
        ground_up_m=jnp.full_like(params.step_s, GROUND_UP_M),
    )


def default_world() -> WorldSpec:
    """Return the default distribution: three blasts around the vehicle.

    They change the velocity of a vehicle at a height of 10 m by 0.1 to 2.5 m/s.
    """
    return WorldSpec(
        occurrence=ByCount(3),
        region=Ring(5.0, 15.0),
        about="vehicle",
        mass=Uniform(10.0, 40.0),
        time=Uniform(0.5, 8.0),
    )
