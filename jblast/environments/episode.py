r"""Random parameters of an episode, and the state of a lane.

Actions lie within -1 and 1 and are clipped to these bounds. Their meaning by mode of
command:

- `rotor_speeds` (4): from the minimum to the maximum speed of each rotor;
- `thrust_rates` (4): collective thrust $T = m g (1 + a_0)$ and body rates
  $\omega_d = a \omega_{max}$, followed by $M = J k_\omega (\omega_d - \omega) + \omega
  \times J \omega$ with the controller's $k_\omega$;
- `velocity` (3): $a v_{max}$, east, north, up, followed by the position controller
  without its position term;
- `hold` (3): the controller's target is displaced by $a$ times `reach_m` from that of
  the task; an action of zero is the SE(3) controller itself.

Mass, inertia and allocation of controllers are the nominal ones, without the episode's
random factors.

Most steps are outside all blasts, and a bound on the times of a wave is cheaper than
the load. At the start of the episode a front arrives at $t_0$ and its wave lasts $D$.
At a distance $d$ from there it arrives between $t_0 - d/c$ and $t_0 + 4.7 d/c$
(`BlastLoad.quiet_until`). If $d$ is less than half of the start's distance from the
charge, the wave lasts no longer than the longest one at 0.5, 1 and 2 times that
distance. Farther away the load is always evaluated.
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
from jblast.scene import Air, Charge, Ring, Scene, Uniform, WorldSpec
from jblast.scene.random_blasts import ByCount
from jblast.scene.uncertain import Prior, draw
from jblast.types import as_numbers
from jblast.vehicle import BlastLoad, Controller, Gains, Vehicle, blast_load
from jblast.vehicle.control.allocation import speeds_within
from jblast.vehicle.loads.blast_wave import crossing_time
from jblast.vehicle.quadrotor import required_body
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
from jblast.world import Blasts, blast_sequence

COMMANDS = {"rotor_speeds": 4, "thrust_rates": 4, "velocity": 3, "hold": 3}
"""Length of an action by the name of its mode."""
Action = tuple[Number, ...]
BLASTS_KEY, VEHICLE_KEY = range(2)
"""Folded into an episode's key, one number per use."""
MAX_DELAY_PER_METRE = 4.7
"""Maximum increase of the end of a wave per metre, in units of 1/c; see
`BlastLoad.quiet_until`."""
DURATION_MARGIN = 1.05
"""Factor on a wave's duration: 5 % for the error of its table between the three
distances."""
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
        hold: Position controller.
        world: Distribution of an episode's blasts, with a fixed number.
        air: Ambient air.
        randomisation: Other random parameters of episodes.
        guidance: Guidance of the mission; None without one.
        target_m: Hover target.
        spread_m: Maximum initial distance from the target along each axis.
        far_m: Distance from the target at which an episode ends.
        rate_rad_s: Maximum commanded body rate.
        speed_m_s: Maximum commanded velocity.
        reach_m: Maximum displacement of the target by a command.
        ground_up_m: Height of the ground.
        step_s: Step of environment and integrator.
        episode_steps: Maximum number of steps of an episode.
        task: Name of the task.
        command: Meaning of an action, a name of `COMMANDS`.
        most_delay: Maximum delay of an action in steps.
    """

    vehicle: Vehicle
    hold: Controller
    world: WorldSpec
    air: Air
    randomisation: Randomisation
    guidance: Guidance | None
    target_m: Float[Array, "3"] = eqx.field(converter=as_numbers)
    spread_m: Float[Array, ""] = eqx.field(converter=as_numbers)
    far_m: Float[Array, ""] = eqx.field(converter=as_numbers)
    rate_rad_s: Float[Array, ""] = eqx.field(converter=as_numbers)
    speed_m_s: Float[Array, ""] = eqx.field(converter=as_numbers)
    reach_m: Float[Array, ""] = eqx.field(converter=as_numbers)
    ground_up_m: Float[Array, ""] = eqx.field(converter=as_numbers)
    step_s: Float[Array, ""] = eqx.field(converter=as_numbers)
    episode_steps: Int[Array, ""] = eqx.field(
        converter=lambda x: jnp.asarray(x, jnp.int32)
    )
    task: str = eqx.field(static=True)
    command: str = eqx.field(static=True)
    most_delay: int = eqx.field(static=True, default=0)

    @property
    def gains(self) -> Gains:
        """Gains of the position controller."""
        return self.hold.gains  # pyright: ignore[reportAttributeAccessIssue] (of `with_gains`)


class Episode(NamedTuple):
    """Sampled parameters of an episode.

    Attributes:
        mass_factor: Factor on the vehicle's mass.
        inertia_factor: Factor on its inertia.
        gain_factor: Factor on its controller gains.
        wind_m_s: East, north, up.
        delay_steps: Delay from action to command.
        blasts: Blasts of the episode.
    """

    mass_factor: Number
    inertia_factor: Number
    gain_factor: Number
    wind_m_s: Vector
    delay_steps: Int[Array, ""]
    blasts: Blasts


class Windows(NamedTuple):
    """Bounds on the times of each blast near the start of an episode.

    Attributes:
        came_s: Arrival of the front at the start; infinite: never.
        lasts_s: Bound on the duration of the wave.
        crossing_s: Crossing time of the front over the vehicle.
        near_m: Distance from the start up to which the bounds are valid.
        slowness_s_m: Inverse of the minimum speed of sound, against the wind.
    """

    came_s: Float[Array, "*blast"]
    lasts_s: Float[Array, "*blast"]
    crossing_s: Float[Array, "*blast"]
    near_m: Float[Array, "*blast"]
    slowness_s_m: Float[Array, "*blast"]


class EnvironmentState(NamedTuple):
    """State of a lane between two steps, as scalars: one array each in a batch.

    Attributes:
        now: Vehicle, command, controller integral and pulse, as in a flight
            (`vehicle/rollout`).
        steps: Number of steps in this episode.
        queue: Pending actions, the newest first.
        episode: Sampled parameters of the episode.
        windows: Bounds on the times of its blasts.
        start_m: Initial position.
        task: State of the task.
        farthest_m: Maximum distance from the target so far.
        ended: True if the next step begins another episode.
        key: Key of the lane; each episode folds its number into it.
        number: Number of the episode, from 0.
    """

    now: FlightState
    steps: Int[Array, ""]
    queue: tuple[tuple[Float[Array, ""], ...], ...]
    episode: Episode
    windows: Windows
    start_m: Vector
    task: PyTree[Array]
    farthest_m: Float[Array, ""]
    ended: Bool[Array, ""]
    key: PRNGKeyArray
    number: Int[Array, ""]


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
    hold = eqx.tree_at(
        lambda hold: (hold.target_m, hold.yaw_rad, hold.gains),
        params.hold,
        (place, aim.yaw_rad, gains),
    )
    start = jnp.zeros_like(params.step_s)
    speeds, gained = hold(
        start, shown, params.vehicle, jnp.stack(state.now.memory), params.step_s
    )
    return four(speeds), three(gained)


def draw_episode(key: PRNGKeyArray, params: EnvironmentParams) -> Episode:
    """Sample the parameters of an episode.

    Args:
        key: Key of the episode.
        params: Parameters of the environment, with priors.
    """
    one = params.randomisation
    # All six are split at once, fixed numbers included: a new prior leaves the draws of
    # the others unchanged.
    keys = iter(jax.random.split(jax.random.fold_in(key, VEHICLE_KEY), 6))
    dtype = params.step_s.dtype

    def number(value: NumberOrPrior) -> Float[Array, ""]:
        own = next(keys)
        return (draw(own, value) if isinstance(value, Prior) else value).astype(dtype)

    mass, inertia, gain = map(
        number, (one.mass_factor, one.inertia_factor, one.gain_factor)
    )
    east, north = number(one.wind_east_m_s), number(one.wind_north_m_s)
    # A delay acts in whole steps, as the queue of actions does.
    late = jnp.round(number(one.delay_s) / params.step_s).astype(jnp.int32)
    occurrence = params.world.occurrence
    assert isinstance(occurrence, ByCount), "checked by environment_params"
    blasts = blast_sequence(
        jax.random.fold_in(key, BLASTS_KEY),
        params.world,
        about(params),
        occurrence.count,
    )
    none = jnp.zeros((), dtype)
    return Episode(
        mass_factor=mass,
        inertia_factor=inertia,
        gain_factor=gain,
        wind_m_s=(east, north, none),
        # `most_delay` is rounded in float64: in float32 a sample next to the upper
        # bound may round to one more step, for which the queue has no room.
        delay_steps=jnp.minimum(late, params.most_delay),
        blasts=jax.tree.map(lambda x: x.astype(dtype), blasts),
    )


def about(params: EnvironmentParams) -> Float[Array, "3"]:
    """Return the centre of the blasts' region."""
    if params.world.about == "world":
        return jnp.zeros_like(params.target_m)
    return params.target_m


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


def load_of(params: EnvironmentParams, wind: Vector, blast: Blasts) -> BlastLoad:
    """Return the load of one blast of an episode.

    Args:
        params: Parameters of the environment.
        wind: Wind of the episode.
        blast: A single blast.
    """
    east, north, _ = wind
    charge = Charge(
        blast.mass_kg, three(blast.position_m), blast.time_s, burst="surface"
    )
    # The waves travel in the same wind in which the vehicle flies.
    air = replace(params.air, wind_east=east, wind_north=north)
    return blast_load(Scene(charge, air=air))


def simulator_of(params: EnvironmentParams, episode: Episode) -> Simulator:
    """Return the steps of an episode's vehicle, without blasts."""

    def steady(time_s: Array, position_m: Array) -> Array:
        return jnp.stack(episode.wind_m_s)

    return Simulator(
        vehicle_in(params, episode),
        params.step_s,
        wind=steady,
        ground_up_m=params.ground_up_m,
    )


def window_of(load: BlastLoad, params: EnvironmentParams, start: Vector) -> Windows:
    """Return the bounds on the times of a blast near a position.

    Args:
        load: Load of the single blast.
        params: Parameters of the environment.
        start: Initial position of the episode.
    """
    blast = jax.tree.map(lambda x: x[0], load.blasts)
    place, body = jnp.stack(start), required_body(params.vehicle.body)
    way = place - blast.position_m
    # The duration is not monotonic in distance near the charge, so three distances are
    # compared.
    shares = jnp.asarray([0.5, 1.0, 2.0], way.dtype)
    waves = blast.wave(load.air, blast.position_m[None] + shares[:, None] * way[None])
    slowest = jax.tree.map(lambda x: jnp.broadcast_to(x, shares.shape)[-1], waves)
    wind = jnp.sqrt(jnp.sum(jnp.square(load.wind_m_s)))
    # Twice the wind as in `quiet_until`; 1 m/s avoids a division by zero.
    sound = jnp.maximum(load.sound_speed_m_s - 2 * wind, 1.0)
    found = Windows(
        load.arrival_time_s(place)[0],
        DURATION_MARGIN * jnp.max(waves.duration_s + waves.suction_s),
        crossing_time(body, slowest),
        jnp.sqrt(jnp.sum(jnp.square(way))) / 2,
        1 / sound,
    )
    # The bounds only select which loads to evaluate; their gradient is no part of the
    # physics.
    return jax.lax.stop_gradient(found)


def may_push(
    windows: Windows, off_m: Number, start_s: Number, end_s: Number
) -> Bool[Array, "*blast"]:
    """Return whether each blast may act on a vehicle between two times.

    Args:
        windows: Bounds of the episode's blasts.
        off_m: Distance of the vehicle from the start.
        start_s: Beginning of the interval.
        end_s: End of the interval.
    """
    off = off_m * windows.slowness_s_m
    first = windows.came_s - windows.crossing_s - off
    last = (
        windows.came_s
        + windows.crossing_s
        + MAX_DELAY_PER_METRE * off
        + windows.lasts_s
    )
    inside = (end_s >= first) & (start_s <= last)
    # The negation also holds for a NaN distance.
    return inside | ~(off_m < windows.near_m)


def default_world() -> WorldSpec:
    """Return the default distribution: two blasts around the vehicle."""
    return WorldSpec(
        occurrence=ByCount(2),
        region=Ring(12.0, 40.0),
        about="vehicle",
        mass=Uniform(5.0, 15.0),
        time=Uniform(0.5, 8.0),
    )
