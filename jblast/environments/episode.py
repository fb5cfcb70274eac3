r"""The draws of an episode of an environment, and the state of a lane in it.

Actions lie within -1 and 1 and are clipped to these bounds. By the mode of command they
mean:

- `rotor_speeds` (4): from the least to the greatest speed of each rotor;
- `thrust_rates` (4): collective thrust $T = m g (1 + a_0)$ and body rates
  $\omega_d = a \omega_{max}$, followed by $M = J k_\omega (\omega_d - \omega) + \omega
  \times J \omega$ with $k_\omega$ of the hold;
- `velocity` (3): $a v_{max}$, east, north, up, followed by the position hold without
  its position;
- `hold` (3): the place to hold moves by $a$ times a reach, about where the task has it:
  an action of zero is the SE(3) hold itself.

Mass, inertia and allocation are the nominal ones, without the episode's draws.

Most steps are outside all blasts, and a bound of the times of a wave is cheaper than
the load. Where the episode starts, a front comes at $t_0$ and its wave lasts $D$. At a
distance $d$ from there it comes at $t_0 - d/c$ at the earliest and at $t_0 + 4.7 d/c$
at the latest (`BlastLoad.quiet_until`), and lasts no longer than the longest wave at
half, once and twice the start's distance from the charge, as long as $d$ is less than
half of that distance. Farther away the blast is taken to act.
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
from jblast.types import as_float_array
from jblast.vehicle import BlastLoad, Controller, Gains, Vehicle, blast_load
from jblast.vehicle.control.allocation import speeds_within
from jblast.vehicle.loads.blast_wave import crossing_time
from jblast.vehicle.quadrotor import required_body
from jblast.vehicle.rollout import INWARD, Flight, FlightState, OneStep, Ticks
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
"""Numbers of an action by the mode's name."""
Action = tuple[Number, ...]
OF_BLASTS, OF_VEHICLE, OF_IMU, OF_TASK, OF_READINGS = range(5)
"""Folded into an episode's key: what each draw is for."""
LATE = 4.7
"""Most that a front comes later for each metre farther off, in units of 1/c."""
LONGER = 1.05
"""Of a wave, for the roundings of its tables."""
NumberOrPrior = Float[Array, ""] | Prior
"""A number that every episode has, or the distribution that each draws its own from."""


class Aim(eqx.Module):
    """Where the vehicle should be in this step.

    Attributes:
        point: Place, velocity and acceleration.
        yaw_rad: Heading.
    """

    point: SetPoint
    yaw_rad: Float[Array, ""]


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


def _number(value: ArrayLike | Prior) -> NumberOrPrior:
    return value if isinstance(value, Prior) else as_float_array(value)


class Randomisation(eqx.Module):
    """Differences between episodes besides the blasts: numbers or priors.

    The hold and the loop of the body's rates use the nominal vehicle.

    Attributes:
        mass_factor: On the vehicle's mass [-].
        inertia_factor: On its inertia [-].
        gain_factor: On all gains of its loops [-].
        wind_east_m_s: Steady wind; it blows on the vehicle and carries the waves.
        wind_north_m_s: Likewise.
        delay_s: From an action to the rotors' command, in whole steps, rounded.
    """

    mass_factor: NumberOrPrior = eqx.field(converter=_number, default=1.0)
    inertia_factor: NumberOrPrior = eqx.field(converter=_number, default=1.0)
    gain_factor: NumberOrPrior = eqx.field(converter=_number, default=1.0)
    wind_east_m_s: NumberOrPrior = eqx.field(converter=_number, default=0.0)
    wind_north_m_s: NumberOrPrior = eqx.field(converter=_number, default=0.0)
    delay_s: NumberOrPrior = eqx.field(converter=_number, default=0.0)


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
        command: What an action means, a name of `COMMANDS`.
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


class Windows(NamedTuple):
    """Of each blast, about the place where an episode starts.

    Attributes:
        came_s: When the front comes there; infinite: never.
        lasts_s: How long its wave may last thereabouts.
        crossing_s: How long the front takes across the vehicle.
        near_m: Up to where that holds.
        slowness_s_m: One over the speed of sound, against any wind there is.
    """

    came_s: Float[Array, "*blast"]
    lasts_s: Float[Array, "*blast"]
    crossing_s: Float[Array, "*blast"]
    near_m: Float[Array, "*blast"]
    slowness_s_m: Float[Array, "*blast"]


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

    now: FlightState
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


def asked_for(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> tuple[Four, Vector]:
    """Return rotor speeds to ask for [rad/s], and the hold's integral afterwards.

    Args:
        params: Of the environment.
        state: Of the lane.
        action: Within -1 and 1.
        aim: Where to be.
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
    return four(speeds_within(vehicle, params.inverse, (thrust, *moment)))


def _by_hold(
    params: EnvironmentParams, state: EnvironmentState, action: Action, aim: Aim
) -> tuple[Four, Vector]:
    flown = joined(state.now.motion)

    # number by number: a step of many lanes has no arrays but theirs
    def by_factor(gain: Array) -> Array:
        parts = [part * state.episode.gain_factor for part in jnp.ravel(gain)]
        return jnp.stack(parts).reshape(gain.shape)

    def with_action(start: Vector, scale: Array) -> Array:
        pairs = zip(start, action, strict=True)
        return jnp.stack([begun + scale * part for begun, part in pairs])

    gains = jax.tree.map(by_factor, params.gains)
    own = params.gains
    gains = replace(gains, integral_limit=own.integral_limit, motor_lead=own.motor_lead)
    if params.command == "velocity":
        place = flown.position_m
        velocity = with_action(state.now.motion.velocity, -params.speed_m_s)
        shown = replace(flown, velocity_m_s=velocity)
    else:
        place = with_action(three(aim.point.position_m), params.reach_m)
        shown = as_if_at_rest(params.vehicle, gains, flown, aim.point)
    hold = eqx.tree_at(
        lambda ready: (ready.hold.target_m, ready.hold.yaw_rad, ready.hold.gains),
        params.hold,
        (place, aim.yaw_rad, gains),
    )
    start = jnp.zeros_like(params.step_s)
    speeds, gained = hold(
        start, shown, params.vehicle, jnp.stack(state.now.memory), params.step_s
    )
    return four(speeds), three(gained)


def draw_episode(key: PRNGKeyArray, params: EnvironmentParams) -> Episode:
    """Draw what an episode needs.

    Args:
        key: Of the episode.
        params: With priors, and numbers that stay.
    """
    one = params.randomisation
    keys = iter(jax.random.split(jax.random.fold_in(key, OF_VEHICLE), 6))
    dtype = params.step_s.dtype

    def number(value: NumberOrPrior) -> Float[Array, ""]:
        own = next(keys)
        return (draw(own, value) if isinstance(value, Prior) else value).astype(dtype)

    mass, inertia, gain = map(
        number, (one.mass_factor, one.inertia_factor, one.gain_factor)
    )
    east, north = number(one.wind_east_m_s), number(one.wind_north_m_s)
    late = jnp.round(number(one.delay_s) / params.step_s).astype(jnp.int32)
    occurrence = params.world.occurrence
    assert isinstance(occurrence, ByCount), "environment_params asks for it"
    blasts = blast_sequence(
        jax.random.fold_in(key, OF_BLASTS),
        params.world,
        about(params),
        occurrence.count,
    )
    none = jnp.zeros((), dtype)
    force = rate = (none, none, none)
    if params.imu is not None:
        drawn = jax.random.normal(jax.random.fold_in(key, OF_IMU), (2, 3), dtype)
        force = three(params.imu.force_bias_m_s2 * drawn[0])
        rate = three(params.imu.rate_bias_rad_s * drawn[1])
    return Episode(
        mass_factor=mass,
        inertia_factor=inertia,
        gain_factor=gain,
        wind_m_s=(east, north, none),
        # `most_delay` is rounded in float64: a draw next to the upper bound may round
        # to one step more in float32, for which the queue of actions has no room
        delay_steps=jnp.minimum(late, params.most_delay),
        blasts=jax.tree.map(lambda x: x.astype(dtype), blasts),
        force_bias_m_s2=force,
        rate_bias_rad_s=rate,
    )


def about(params: EnvironmentParams) -> Float[Array, "3"]:
    """Return what the region of the blasts is about, on the ground for a ring."""
    if params.world.about == "world":
        return jnp.zeros_like(params.target_m)
    return params.target_m


def vehicle_in(params: EnvironmentParams, episode: Episode) -> Vehicle:
    """Return the vehicle of an episode."""
    vehicle = params.vehicle
    # number by number: a step of many lanes has no arrays but theirs
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
        params: Of the environment.
        wind: Of the episode.
        blast: Its numbers alone.
    """
    east, north, _ = wind
    charge = Charge(
        blast.mass_kg, three(blast.position_m), blast.time_s, burst="surface"
    )
    air = replace(params.air, wind_east=east, wind_north=north)
    return blast_load(Scene(charge, air=air))


def one_step(params: EnvironmentParams, episode: Episode) -> OneStep:
    """Return the step of a flight of an episode, blasts left out."""
    wind = episode.wind_m_s

    def steady(time_s: Array, position_m: Array) -> Array:
        return jnp.stack(wind)

    flight = Flight(
        vehicle=vehicle_in(params, episode),
        state=None,  # pyright: ignore[reportArgumentType] (not asked for its start)
        commands=None,
        control=None,
        wind=steady,
        loads=(),
        ground_up_m=params.ground_up_m,
    )
    return OneStep(flight, params.step_s, "rk4", control_held=False, axis=None)


def tick_of(params: EnvironmentParams, state: EnvironmentState) -> Ticks:
    """Return the times of a lane's next step, as `timetable` has them."""
    step = params.step_s
    start = state.steps.astype(step.dtype) * step
    inward = jnp.maximum(INWARD * step, 2 * jnp.finfo(step.dtype).eps * (start + step))
    return Ticks(
        stages=jnp.stack([start + inward, start + step / 2, start + step - inward]),
        start=start,
        step=step,
        command=jnp.zeros(3, jnp.int32),
        sample=jnp.asarray(True),
    )


def window_of(load: BlastLoad, params: EnvironmentParams, start: Vector) -> Windows:
    """Return when a blast may push a vehicle that starts at a place.

    Args:
        load: Of the one blast.
        params: Of the environment.
        start: Where the episode starts.
    """
    (blast,) = load.blasts
    place, body = jnp.stack(start), required_body(params.vehicle.body)
    way = place - blast.position_m
    shares = jnp.asarray([0.5, 1.0, 2.0], way.dtype)
    waves = load.wave_of(blast, blast.position_m[None] + shares[:, None] * way[None])
    slowest = jax.tree.map(lambda x: jnp.broadcast_to(x, shares.shape)[-1], waves)
    wind = jnp.sqrt(jnp.sum(jnp.square(load.wind_m_s)))
    sound = jnp.maximum(load.sound_speed_m_s - 2 * wind, 1.0)
    found = Windows(
        load.arrival_time_s(place)[0],
        LONGER * jnp.max(waves.duration_s + waves.suction_s),
        crossing_time(body, slowest),
        jnp.sqrt(jnp.sum(jnp.square(way))) / 2,
        1 / sound,
    )
    return jax.lax.stop_gradient(found)


def may_push(
    windows: Windows, off_m: Number, start_s: Number, end_s: Number
) -> Bool[Array, "*blast"]:
    """Return whether each blast may push a vehicle between two times.

    Args:
        windows: Of its episode.
        off_m: How far it is from where that started.
        start_s: From when.
        end_s: To when.
    """
    off = off_m * windows.slowness_s_m
    first = windows.came_s - windows.crossing_s - off
    last = windows.came_s + windows.crossing_s + LATE * off + windows.lasts_s
    inside = (end_s >= first) & (start_s <= last)
    return inside | ~(off_m < windows.near_m)


def default_world() -> WorldSpec:
    """Return two blasts about the vehicle in each episode."""
    return WorldSpec(
        occurrence=ByCount(2),
        region=Ring(12.0, 40.0),
        about="vehicle",
        mass=Uniform(5.0, 15.0),
        time=Uniform(0.5, 8.0),
    )
