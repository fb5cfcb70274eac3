"""Flights of a scene's vehicles with position controllers through its blasts.

One flight is simulated, or many that are sampled from the scene's priors. A flight
begins at time 0 of the scene's clock, over level ground at height 0, in the scene's
wind. Each vehicle flies once with each controller. If none is named, these are the
SE(3) controller with and without integral action: without it wind leaves a permanent
offset, and the vehicle does not recover. Vehicles with instruments are controlled by an
estimate of their state.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt

from jblast.autopilot.estimator import (
    EstimatedControl,
    Followed,
    Thrown,
    followed,
    thrown,
)
from jblast.autopilot.lockstep import suite_of
from jblast.errors import InputError, argument
from jblast.kept_programs import kept, kept_between_runs
from jblast.progress import Progress, counted, reported
from jblast.scene import (
    Place,
    Scene,
    UncertainScene,
    VehicleSpec,
    draw_scene,
    parameter_named,
    scene_of,
)
from jblast.scene.uncertain import value_of
from jblast.sensors.flight_sensors import Barometer
from jblast.study.flight_results import (
    FlightLoad,
    Flights,
    Flown,
    Options,
    arrival_at,
    encounter_of,
    exposed,
    load_of,
    with_bursts_at_start,
)
from jblast.vehicle import (
    Controller,
    State,
    StepGust,
    Trajectory,
    controller_of,
    flight_metrics,
    hold_of,
    path_error,
    simulate,
    start_of,
    vehicle_of,
)
from jblast.vehicle.quadrotor import in_precision

GROUND_UP_M = 0.0
"""Height of the ground, from which scenes measure heights."""
CHUNK = {"cpu": 2048, "gpu": 16_384}
"""Vehicles with `BATCH_ROWS` rows in memory: on a CPU some 2 GB in float64."""
encounter_along = kept(encounter_of)
_encounter_each = eqx.filter_jit(jax.vmap(encounter_of, (0, None, 0, 0)))
exposed_along = kept(exposed)
_exposed_each = eqx.filter_jit(
    eqx.filter_vmap(exposed, in_axes=(0, 0, None, 0, None, 0))
)
followed_along = kept(followed)
thrown_of = kept(thrown)
AFTER_S = 5.0
"""Default time after the last arrival [s], declared."""
MAX_STEPS = 4_000_000
"""Steps of a flight, by declaration: half an hour at the default step."""
ROWS = 20_000
"""Stored rows of a single flight: 10 s at the default step."""
BATCH_ROWS = 500
"""Stored rows of each flight of a batch, which limit its memory."""
ROW_S = 0.02
"""Longest time between two rows [s]: a peak lasts a tenth of a second or more."""
MAX_VEHICLES = 10_000_000
"""Largest number of vehicles, whose metrics take about a gigabyte."""
BOTH_HOLDS = ("with_integral", "without_integral")
"""Default controllers."""


@kept_between_runs()
@reported("fly")
def fly(
    uncertain: UncertainScene | Scene | str | os.PathLike[str],
    options: Options | None = None,
    *,
    vehicles: int = 1,
    seed: int = 0,
    controllers: Sequence[str] | None = None,
    progress: Progress = False,
) -> Flights:
    """Fly a scene's vehicle through its blasts.

    Args:
        uncertain: Scene, or its file; parameters with a prior are sampled.
        options: Options of the flights; None for the defaults.
        vehicles: Number of sampled scenes.
        seed: Seed of the samples.
        controllers: Names in `vehicle.CONTROLLERS`, or "hold" for the SE(3) controller
            of the scene; None for that with and without integral action, the one of
            the scene first.
        progress: As for `jblast.fit`.

    Returns:
        Flights by controller, with peak deviation, recovery and crash of each vehicle.

    Raises:
        InputError: The scene cannot be flown, a parameter cannot be sampled, or an
            option is invalid.

    Example:
        `flights = jblast.fly("scene.toml", vehicles=100)`
    """
    options = Options() if options is None else options
    uncertain = scene_of(uncertain)
    vehicle = checked_scene(uncertain, vehicles, options.profile is not None)
    scenes = drawn_scenes(uncertain, vehicles, seed)
    notes = ()
    if options.profile is None:
        scenes, notes = with_bursts_at_start(scenes, vehicle)
    seconds = flight_seconds(scenes, vehicle, uncertain.source, options)
    own = None if vehicle.integral is None else BOTH_HOLDS[not vehicle.integral]
    names = named_controllers(controllers, own)
    for name in names:
        controller_of(vehicle, name)  # rejects an unknown name before the work
    flown: dict[str, list[Flown]] = {name: [] for name in names}
    most = CHUNK["cpu" if jax.default_backend() == "cpu" else "gpu"]
    rows = rows_stored(seconds, vehicles, options)
    if rows > BATCH_ROWS:
        most = max(1, most * BATCH_ROWS // rows)
    # equal chunks instead of full ones and a remainder: one size, one program
    chunks = math.ceil(vehicles / most)
    size = math.ceil(vehicles / chunks)
    through = counted(vehicles, "vehicles")
    for n in range(chunks):
        # the last chunk is padded: another size would compile everything again
        lanes = np.minimum(np.arange(n * size, (n + 1) * size), vehicles - 1)
        some = scenes if vehicles == 1 else lanes_of(scenes, lanes)
        carried = {}
        if options.estimator:
            drawn = lanes if vehicles > 1 else lanes[0]
            instruments = instruments_of(uncertain.place, seed, drawn, options.step_s)
            carried = {"instruments": instruments}
        for nth, name in enumerate(names, start=1):
            flown[name].append(
                flown_by(some, vehicle, name, seconds, vehicles, options, **carried)
            )
            here = min(size, vehicles - n * size)
            through(n * size + nth / len(names) * here)
    charges = scenes.charges
    return Flights(
        vehicle=vehicle,
        options=options,
        seconds=seconds,
        count=vehicles,
        drawn=drawn_values(uncertain, scenes),
        blasts=tuple(charge.name for charge in charges),
        places_m=np.stack([np.stack(c.position_m, axis=-1) for c in charges], axis=-2),
        wind_m_s=np.stack([scenes.air.wind_east, scenes.air.wind_north], axis=-1),
        holds={name: joined(parts, vehicles) for name, parts in flown.items()},
        own=own if own in names else None,
        notes=notes,
    )


class Instruments(NamedTuple):
    """Instruments of the state estimator.

    Attributes:
        place: Geographic position of the origin, for the magnetic field; None for PX4's
            default home.
        seeds: Seed of the noise of each vehicle.
    """

    place: Place | None
    seeds: UInt[Array, "*batch"]


def flown_by(
    scenes: Scene,
    spec: VehicleSpec,
    hold: str,
    seconds: float,
    vehicles: int,
    options: Options,
    instruments: Instruments | None = None,
) -> Flown:
    """Return flights of some vehicles with one controller.

    Args:
        scenes: One scene, or several with a leading axis in each array.
        spec: Vehicle section of the scene.
        hold: Name in `vehicle.CONTROLLERS`.
        seconds: Duration of each flight [s].
        vehicles: Number of vehicles in all chunks; a single one keeps its trajectory.
        options: Options of the flights.
        instruments: Instruments of the state estimator; None without one.
    """
    single = vehicles == 1
    control = controller_of(spec, hold)
    start, load = start_of(spec), _load(scenes, options, single)
    flown_control: Any = control
    if options.estimator:
        assert instruments is not None
        flown_control = by_instruments(
            control, scenes, start, load, instruments, 1 / options.step_s
        )
    wind = StepGust(steady_wind(scenes), 0 * scenes.air.wind_east)
    if not single:
        count = scenes.air.wind_east.shape
        start = jax.tree.map(lambda x: jnp.broadcast_to(x, (*count, *x.shape)), start)
    # GPUs and Warp are several times faster in single precision
    if jax.default_backend() != "cpu" or options.backend.startswith("warp"):
        start = in_precision(start, np.dtype("float32"))
    steps = math.ceil(seconds / options.step_s)
    trajectory = simulate(
        vehicle_of(spec),
        start,
        duration_s=seconds,
        step_s=options.step_s,
        control=flown_control,
        wind=wind,
        loads=(load,),
        ground_up_m=GROUND_UP_M,
        # whole steps between rows: their number is at most `rows_stored`
        store_every=math.ceil(steps / rows_stored(seconds, vehicles, options)),
        backend=options.backend,
    )
    # back to the default precision, in which metrics are computed
    trajectory = in_precision(trajectory, jnp.zeros(()).dtype)
    places = trajectory.position_m, trajectory.quaternion
    encounter = (encounter_along if single else _encounter_each)(
        load, trajectory.time_s, *places
    )
    first = encounter.arrival_s.min(axis=-1)
    metrics = flight_metrics(
        trajectory,
        control.target_m,
        first,
        tolerance_m=options.tolerance_m,
        ground_up_m=GROUND_UP_M,
    )
    error = path_error(trajectory, control.target_m)
    # the error of the last row before the blast: the effect of start and wind alone
    times = jnp.broadcast_to(trajectory.time_s, error.shape)
    last = jnp.sum(times < first[..., None], axis=-1, keepdims=True) - 1
    before = jnp.take_along_axis(error, jnp.maximum(last, 0), axis=-1)[..., 0]
    exposure = (exposed_along if single else _exposed_each)(
        unwatched(scenes),
        load,
        vehicle_of(spec),
        encounter,
        trajectory.time_s,
        trajectory.states,
    )
    found = Flown(
        metrics,
        encounter,
        exposure,
        before,
        trajectory.lost,
        trajectory if single else None,
    )
    if flown_control is control:
        return found
    thrown, estimated = thrown_by_blasts(
        flown_control, trajectory, encounter.arrival_s, options.step_s
    )
    return replace(found, thrown=thrown, followed=estimated if single else None)


def _load(scenes: Scene, options: Options, single: bool) -> FlightLoad:
    if single:
        return load_of(scenes, options.profile, options.load)
    each = eqx.filter_vmap(lambda one: load_of(one, options.profile, options.load))
    return each(scenes)


def steady_wind(scenes: Scene) -> Float[Array, "*batch 3"]:
    """Return the velocity of a scene's air: east, north, up [m/s]."""
    air = scenes.air
    return jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east], axis=-1)


def unwatched(scenes: Scene) -> Scene:
    """Return scenes without observers and names, so that one program serves all."""
    first, *others = (replace(charge, name="") for charge in scenes.charges)
    # part of the structure of a scene: each one would compile its own program
    removed: dict[str, Any] = {"sensors": (), "camera": None, "clocks": ()}
    removed |= {"vehicle": None, "ambient": None, "law": ()}
    return replace(scenes, charges=(first, *others), **removed)


def lanes_of(scenes: Scene, lanes: Int[np.ndarray, " lane"]) -> Scene:
    """Return some of a batch of scenes."""
    return jax.tree.map(lambda x: x[lanes], scenes)


def joined(parts: list[Flown], vehicles: int) -> Flown:
    """Return the flights of all chunks, without the padding of the last.

    Args:
        parts: Flights of each chunk.
        vehicles: Number of vehicles.
    """
    if vehicles == 1:
        return parts[0]

    def whole(*chunks: Array) -> Array:
        return jnp.concatenate(chunks)[:vehicles]

    return Flown(
        jax.tree.map(whole, *(part.metrics for part in parts)),
        jax.tree.map(whole, *(part.encounter for part in parts)),
        jax.tree.map(whole, *(part.exposure for part in parts)),
        whole(*(part.error_at_blast_m for part in parts)),
        whole(*(part.lost for part in parts)),
        None,
        jax.tree.map(whole, *(part.thrown for part in parts)),
    )


def instruments_of(
    place: Place | None,
    seed: int,
    lanes: Int[np.ndarray, "*batch"] | np.integer,
    step_s: float,
) -> Instruments:
    """Return the instruments of vehicles.

    Args:
        place: Geographic position of the origin, if the scene has one.
        seed: Seed of all samples.
        lanes: Numbers of the vehicles.
        step_s: Sampling interval of the inertial unit [s].

    Raises:
        InputError: The interval is longer than that of the barometer.
    """
    # a slower inertial unit would skip readings of the barometer
    longest = 1 / Barometer().rate
    if step_s > longest * (1 + 1e-9):
        raise InputError(
            f"step: expected at most {longest:g} s with an estimator, the sampling "
            f"interval of its barometer, got {step_s:g} s"
        )
    # a prime above the size of usual batches: seeds of two runs do not coincide
    seeds = (seed * 1_000_003 + np.asarray(lanes, np.int64)) % 2**32
    return Instruments(place, jnp.asarray(seeds, jnp.uint32))


def by_instruments(
    control: Controller,
    scenes: Scene,
    start: State,
    load: FlightLoad,
    instruments: Instruments,
    rate: float,
) -> EstimatedControl:
    """Return a controller that uses the estimated state, for one vehicle or a batch.

    Args:
        control: Controller.
        scenes: One scene, or several with a leading axis in each array.
        start: Initial state of each vehicle.
        load: Loads of the blasts, with the axis of the scenes.
        instruments: Instruments of the vehicles.
        rate: Rate of the controller [Hz].
    """

    def one(scene: Scene, load: FlightLoad, seed: Array) -> EstimatedControl:
        suite = suite_of(scene, instruments.place, load, rate)
        return EstimatedControl(control, suite, start, seed)

    seeds = instruments.seeds
    if not seeds.ndim:
        return one(scenes, load, seeds)
    return eqx.filter_vmap(one)(scenes, load, seeds)


def thrown_by_blasts(
    control: EstimatedControl, trajectory: Trajectory, arrival_s: Array, step_s: float
) -> tuple[Thrown, Followed | None]:
    """Return the effect of blasts on the estimates, and the estimate of one flight.

    Args:
        control: Controller of the flights.
        trajectory: All rows of the flights.
        arrival_s: Arrival of the blasts at each vehicle.
        step_s: Time between two rows.
    """
    period = jnp.asarray(step_s, float)
    if arrival_s.ndim == 1:
        estimate = followed_along(control, trajectory, period)
        return thrown_of(estimate, trajectory.time_s, arrival_s), estimate
    # the times of the rows are common to all flights: no axis
    rows = eqx.tree_at(
        lambda flight: flight.time_s, jax.tree.map(lambda x: 0, trajectory), None
    )

    def one(
        control: EstimatedControl, flight: Trajectory, came_s: Array, period_s: Array
    ) -> Thrown:
        return thrown(followed(control, flight, period_s), flight.time_s, came_s)

    several = eqx.filter_jit(
        eqx.filter_vmap(one, in_axes=(eqx.if_array(0), rows, 0, None))
    )
    return several(control, trajectory, arrival_s, period), None


def flight_seconds(
    scenes: Scene, vehicle: VehicleSpec, source: str, options: Options
) -> float:
    """Return the duration of each flight: 5 s beyond the last blast, in tenths.

    Args:
        scenes: One scene, or a batch.
        vehicle: Vehicle section, whose start and target the blasts reach.
        source: Name of the scene file, for messages.
        options: Options of the flights.

    Raises:
        InputError: A time is invalid, a blast arrives before the flight, or no blast
            arrives in it.
    """
    for name, value in (
        ("seconds", options.seconds),
        ("step", options.step_s),
        ("tolerance", options.tolerance_m),
    ):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a positive number, got {value:g}")
    turned = start_of(vehicle).quaternion
    target = hold_of(vehicle, integral=False).target_m
    places = jnp.stack([vehicle.position, target])

    def arrivals(scene: Scene):
        load = load_of(scene, options.profile)
        return _arrivals(load, places, turned)

    batch = scenes.air.wind_east.ndim > 0
    came = np.asarray((eqx.filter_vmap(arrivals) if batch else arrivals)(scenes))
    source = source or "scene"
    if np.isposinf(came).all(axis=-1).any() and options.seconds is None:
        raise InputError(
            f"{source}: [charge] time_s: expected a charge with a finite time, or "
            f"{argument('seconds')} for a flight without a blast, got inf for all "
            "charges"
        )
    if not came.min() >= 0:
        raise InputError(
            f"{source}: [charge] time_s: expected arrivals at the vehicle after 0 s, "
            f"when the flight begins, got one at {came.min():.4g} s"
        )
    seconds = options.seconds
    if seconds is None:
        # a charge that never explodes does not extend the flight
        last = came.max(where=came < np.inf, initial=0.0)
        seconds = math.ceil(10 * (last + AFTER_S)) / 10
    first = came.min(axis=-1).max()
    if seconds <= first < np.inf:
        raise InputError(
            f"seconds: expected more than {first:.4g} s, the"
            f"{' latest' if batch else ''} arrival of a first blast, "
            f"got {seconds:g} s"
        )
    if seconds / options.step_s > MAX_STEPS:
        raise InputError(
            f"seconds: expected at most {MAX_STEPS * options.step_s:g} s in steps of "
            f"{options.step_s:g} s, got {seconds:g} s"
        )
    return seconds


@kept
def _arrivals(
    load: FlightLoad, places: Float[Array, "place 3"], turned: Float[Array, "4"]
) -> Float[Array, "place blast"]:
    return jax.vmap(lambda place: arrival_at(load, place, turned))(places)


def rows_stored(seconds: float, vehicles: int, options: Options | None = None) -> int:
    """Return the largest number of stored rows of a flight; all with an estimator."""
    if options is not None and options.estimator:
        return math.ceil(seconds / options.step_s)
    return max(ROWS if vehicles == 1 else BATCH_ROWS, math.ceil(seconds / ROW_S))


def checked_scene(
    uncertain: UncertainScene, vehicles: int, by_profile: bool
) -> VehicleSpec:
    """Return the vehicle section of a scene after a check that it can be flown.

    Args:
        uncertain: Scene.
        vehicles: Number of vehicles.
        by_profile: Whether a custom profile replaces the laws.

    Raises:
        InputError: The scene has no vehicle, a charge without a position, a position
            below ground, several charges with one profile, or no prior for several
            vehicles.
    """
    scene, source = uncertain.scene, uncertain.source or "scene"
    if scene.vehicle is None:
        raise InputError(
            f"{source}: [vehicle]: expected a vehicle with its model and position_m, "
            "got none"
        )
    if not 1 <= vehicles <= MAX_VEHICLES:
        raise InputError(
            f"vehicles: expected a whole number from 1 to {MAX_VEHICLES:,}, "
            f"got {vehicles}"
        )
    if any(charge.range_m is not None for charge in scene.charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, from which the "
            "vehicle's own distance follows, got a range"
        )
    if by_profile and len(scene.charges) > 1:
        raise InputError(
            f"{source}: [[charge]]: expected one charge for a custom profile, got "
            f"{len(scene.charges)}"
        )
    spec = scene.vehicle
    for key, place in (
        ("position_m", spec.position),
        ("control target_m", spec.target),
    ):
        if place is not None and float(place[2]) < 0:
            raise InputError(
                f"{source}: [vehicle] {key}: expected a height of 0 m (the ground) or "
                f"more, got {float(place[2]):g} m"
            )
    if vehicles > 1 and not uncertain.beliefs:
        raise InputError(
            f"{source}: expected a prior to sample {vehicles} scenes from, got none: "
            "all flights would be equal"
        )
    return spec


def drawn_scenes(uncertain: UncertainScene, vehicles: int, seed: int) -> Scene:
    """Return sampled scenes; several have a leading axis in each array.

    Raises:
        InputError: A parameter is free, or a sample violates its bounds.
    """
    key = jax.random.key(seed)
    if vehicles == 1:
        scenes = draw_scene(key, uncertain)
    else:
        keys = jax.random.split(key, vehicles)
        scenes = eqx.filter_vmap(lambda key: draw_scene(key, uncertain))(keys)
    # a normal prior of a positive parameter may give negative samples
    for name, values in drawn_values(uncertain, scenes).items():
        bounds = parameter_named(name).bounds
        refused = [v for v in values.ravel() if not bounds.allows(float(v))]
        if refused:
            raise InputError(
                f"{uncertain.source or 'scene'}: expected a prior of {name} with "
                f"samples that are {bounds.words()}, got {refused[0]:g}, one of "
                f"{len(refused)} of {values.size} samples (seed {seed})"
            )
    return scenes


def drawn_values(
    uncertain: UncertainScene, scenes: Scene
) -> dict[str, Float[np.ndarray, "..."]]:
    """Return the sampled parameters, by name."""
    return {name: np.asarray(value_of(scenes, name)) for name in uncertain.beliefs}


def named_controllers(
    controllers: Sequence[str] | None, own: str | None
) -> tuple[str, ...]:
    """Return the controllers to fly, each once.

    Args:
        controllers: Requested names; None for `BOTH_HOLDS`.
        own: Controller that the scene specifies; None without one.

    Raises:
        InputError: The list is empty.
    """
    if controllers is None:
        # the controller of the scene comes first
        return BOTH_HOLDS[::-1] if own == BOTH_HOLDS[1] else BOTH_HOLDS
    if not controllers:
        raise InputError("controllers: expected one or more, got none")
    hold = BOTH_HOLDS[0] if own is None else own
    return tuple(dict.fromkeys(hold if x == "hold" else x for x in controllers))
