"""Flights of a scene's vehicles through its blasts, hovering or on a mission.

One flight is simulated, or many that are sampled from the scene's priors. A flight
begins at time 0 of the scene's clock, over level ground at height 0, in the scene's
wind. A hovering vehicle flies once with each controller. If none is named, these are
the SE(3) controller with and without integral action: without it wind leaves a
permanent offset, and the vehicle does not recover. A mission has its own controller,
which follows the set points of its guidance. Vehicles with instruments are controlled
by an estimate of their state.

Without a given duration the flight of a mission ends when the vehicle is disarmed. Its
length is bounded beforehand by the undisturbed legs plus a recovery time for each
blast; if that is too short, the mission is flown again with twice the length.
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt

from jblast.autopilot.estimator import (
    EstimatedControl,
    Thrown,
    followed,
    thrown,
)
from jblast.autopilot.lockstep import suite_of
from jblast.errors import argument, require
from jblast.kept_programs import kept, kept_between_runs
from jblast.missions import MissionControl, mission_of, read_plan, replay
from jblast.progress import Progress, counted, reported
from jblast.scene import (
    Place,
    Scene,
    UncertainScene,
    VehicleSpec,
    draw_scene,
    parameter_named,
    read_scene_or_world,
    scene_of,
)
from jblast.scene.uncertain import value_of
from jblast.sensors.flight_sensors import Barometer
from jblast.study.flight_results import (
    GROUND_UP_M,
    ROWS,
    FlightLoad,
    Flights,
    Flown,
    Options,
    arrival_at,
    burst_remarks,
    effects,
    load_of,
    mapped,
    options_of,
)
from jblast.study.missions import (
    crash_of,
    ended,
    kept_rows,
    longest_seconds,
    outcome_of,
)
from jblast.vehicle import (
    Gust,
    Trajectory,
    Vehicle,
    controller_of,
    hold_of,
    simulate,
    start_of,
    vehicle_of,
)
from jblast.vehicle.from_scene import wind_of
from jblast.vehicle.quadrotor import in_precision
from jblast.vehicle.state import LENGTHS
from jblast.world import draw_world, with_nevers

T = TypeVar("T")
CPU_ROWS, ROW_BYTES = 2048 * 500, 2048
"""Rows of a chunk of vehicles on a CPU, and bytes of a row on a device with a memory of
its own: 23 numbers in the precision of the flight and in float64, some times over."""
AFTER_S = 5.0
"""Default time after the last arrival [s], declared."""
MAX_STEPS = 4_000_000
"""Steps of a flight, by declaration: half an hour at the default step."""
BATCH_ROWS = 500
"""Stored rows of each flight of a batch, which limit its memory."""
ROW_S = 0.02
"""Longest time between two rows [s]: a peak lasts a tenth of a second or more."""
MAX_VEHICLES = 10_000_000
"""Largest number of vehicles, whose metrics take about a gigabyte."""
BOTH_HOLDS = ("with_integral", "without_integral")
"""Default controllers."""
MISSION = "mission"
"""Name of the controller of a mission."""
followed_along, thrown_of = kept(followed), kept(thrown)


@kept_between_runs()
@reported("fly")
def fly(
    scene: UncertainScene | Scene | str | os.PathLike[str],
    *,
    vehicles: int = 1,
    controllers: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress = False,
    **options: Any,
) -> Flights:
    """Fly a scene's vehicle through its blasts, on its mission if it has one.

    Args:
        scene: Scene, or its file; parameters with a prior are sampled.
        vehicles: Number of sampled scenes.
        controllers: Names in `vehicle.CONTROLLERS`, or "hold" for the SE(3) controller
            of the scene; None for that with and without integral action, the one of
            the scene first.
        seed: Seed of the samples.
        progress: As for `jblast.fit`.
        options: Attributes of `study.flight_results.Options`, for example `seconds`,
            `step_s`, `estimator` or `profile`.

    Returns:
        Flights by controller, with peak deviation, recovery and crash of each vehicle,
        and the outcome of a mission.

    Raises:
        InputError: The scene or its plan cannot be flown, a parameter cannot be
            sampled, or an option is invalid.

    Example:
        `jblast.fly("scene.toml", vehicles=100, controllers=["cascade"])`
    """
    if isinstance(scene, str | os.PathLike):
        scene = scene_to_run(scene, seconds=options.get("seconds"), seed=seed)
    uncertain = scene_of(scene)
    on_mission = has_mission(uncertain)
    if on_mission:
        _check_alone(vehicles, controllers)
    chosen = options_of(on_mission=on_mission, **options)
    spec = checked_scene(uncertain, vehicles, chosen.profile is not None)
    single, mission, own = vehicles == 1, None, None
    if spec.mission is not None:
        mission = mission_of(
            read_plan(spec.mission),
            place=uncertain.place,
            position_m=np.asarray(spec.position, float) if spec.placed else None,
            yaw_rad=float(spec.yaw),
            may_hover_on=chosen.seconds is not None,
        )
        # the plan may place a vehicle that the scene does not place
        spec = replace(spec, position=jnp.asarray(mission.home_m))
        uncertain = replace(uncertain, scene=replace(uncertain.scene, vehicle=spec))
        # the position controller of a hovering vehicle follows the set points here
        hold = hold_of(replace(spec, mission=None), integral=spec.integral is not False)
        controls = {MISSION: MissionControl(mission.guidance, hold)}
    else:
        own = None if spec.integral is None else BOTH_HOLDS[not spec.integral]
        names = named_controllers(controllers, own)
        controls = {name: controller_of(spec, name) for name in names}
        own = own if own in names else None
    scenes = drawn_scenes(uncertain, vehicles, seed)
    charges = scenes.charges
    notes = () if chosen.profile is not None else burst_remarks(scenes, spec)
    if single and chosen.profile is None:
        # one program for several numbers of blasts
        scenes = with_nevers(scenes)
    load = load_of(scenes, chosen)
    if mission is None:
        source = uncertain.source or "scene"
        seconds = flight_seconds(scenes, load, spec, source, chosen)
    else:
        seconds = chosen.seconds or longest_seconds(mission, len(charges))
    flown: dict[str, list[Flown]] = {name: [] for name in controls}
    place = uncertain.place or (None if mission is None else mission.plan.home)
    through = counted(vehicles, "vehicles")
    for lanes in _chunks(vehicles, rows_stored(seconds, chosen, single=single)):
        some, part = scenes, load
        if not single:
            some, part = jax.tree.map(itemgetter(lanes), (scenes, load))
        seeds = None
        if chosen.estimator:
            seeds = seeds_of(seed, lanes[0] if single else lanes, chosen.step_s)
        for nth, (name, control) in enumerate(controls.items(), start=1):
            one = flown_by(some, part, spec, control, seconds, chosen, place, seeds)
            flown[name].append(one)
            first, last = lanes[0], min(lanes[0] + lanes.size, vehicles)
            through(first + nth / len(controls) * (last - first))
    # A charge that never detonates, as in a scene without [charge], is not reported by
    # a mission, and those of the padding by no flight.
    shown = [n for n, c in enumerate(charges) if mission is None or not c.never]
    holds = {
        name: _of_blasts(joined(parts, vehicles), shown)
        for name, parts in flown.items()
    }
    charges, outcome = [charges[n] for n in shown], None
    names = tuple(charge.name for charge in charges)
    places = [np.stack(charge.position_m, axis=-1) for charge in charges]
    if mission is not None:
        (one,) = holds.values()
        assert one.trajectory is not None
        seconds = float(one.trajectory.time_s[-1])
        arrival_s, tolerance_m = one.encounter.arrival_s, chosen.tolerance_m
        outcome = outcome_of(mission, one.trajectory, names, arrival_s, tolerance_m)
    return Flights(
        vehicle=spec,
        mission=mission,
        options=chosen,
        seconds=seconds,
        count=vehicles,
        drawn=drawn_values(uncertain, scenes),
        blasts=names,
        places_m=np.stack(places, axis=-2) if places else np.zeros((0, 3)),
        wind_m_s=np.asarray(wind_of(scenes))[..., :2],
        holds=holds,
        own=own,
        outcome=outcome,
        notes=notes,
    )


def scene_to_run(
    path: str | os.PathLike[str], *, seconds: float | None = None, seed: int = 0
) -> UncertainScene:
    """Read a scene for a simulation; random blasts are sampled as by `jblast world`.

    Args:
        path: Scene file; without [charge] its blast never detonates.
        seconds: End of the world [s].
        seed: Seed of random blasts.

    Returns:
        The scene; with random blasts all of its priors are sampled too.

    Raises:
        InputError: As in `read_scene` and `draw_world`.
    """
    uncertain, world = read_scene_or_world(path, needs_charge=False)
    if world is None:
        return uncertain
    until = math.inf if seconds is None else seconds
    drawn = draw_world(uncertain, world, seed, until_s=until)
    return replace(uncertain, scene=drawn.scene, beliefs={})


def has_mission(uncertain: UncertainScene) -> bool:
    """Return whether the scene's vehicle has a mission."""
    vehicle = uncertain.scene.vehicle
    return vehicle is not None and vehicle.mission is not None


def _check_alone(vehicles: int, controllers: Sequence[str] | None) -> None:
    """Check that a mission is flown by one vehicle with its own controller.

    Raises:
        InputError: Controllers or several vehicles are requested.
    """
    words = "none on a mission, which has its own controller"
    got = ",".join(controllers or ())
    require(controllers is None, argument("controllers"), words, got)
    words, got = (
        "1 on a mission",
        f"{vehicles}; for several use MissionControl, in Python",
    )
    require(vehicles == 1, argument("vehicles"), words, got)


def _chunks(vehicles: int, rows: int) -> list[Int[np.ndarray, " lane"]]:
    """Return the numbers of the vehicles that are flown together.

    The chunks have one size, because another one would compile another program: the
    last repeats the last vehicle.

    Args:
        vehicles: Number of vehicles.
        rows: Stored rows of each.
    """
    memory = (jax.local_devices()[0].memory_stats() or {}).get("bytes_limit")
    fit = CPU_ROWS if memory is None else memory // ROW_BYTES
    count = math.ceil(vehicles / max(1, fit // rows))
    size = math.ceil(vehicles / count)
    lanes = np.minimum(np.arange(count * size), vehicles - 1)
    return np.split(lanes, count)


def flown_by(
    scenes: Scene,
    load: FlightLoad,
    spec: VehicleSpec,
    control: Any,
    seconds: float,
    options: Options,
    place: Place | None = None,
    seeds: UInt[Array, "*batch"] | None = None,
) -> Flown:
    """Return flights with one controller.

    Args:
        scenes: One scene, whose flight keeps its trajectory, or several with a leading
            axis in each array.
        load: Loads of the blasts, with the axis of the scenes.
        spec: Vehicle section of the scene.
        control: Controller.
        seconds: Duration of each flight [s].
        options: Options of the flights.
        place: Geographic position of the origin, for the magnetic field; None for PX4's
            default home.
        seeds: Seeds of the instruments of each vehicle; None without an estimator.
    """
    start, controller, count = start_of(spec), control, scenes.air.wind_east.shape
    single, on_mission = not count, isinstance(control, MissionControl)
    if on_mission:
        # a mission begins on the ground with its rotors at rest
        start = replace(start, rotor_speed_rad_s=0 * start.rotor_speed_rad_s)
    if seeds is not None:
        rate = 1 / options.step_s

        def by_instruments(
            scene: Scene, load: FlightLoad, seed: Array
        ) -> EstimatedControl:
            suite = suite_of(scene, place, load, rate)
            return EstimatedControl(control, suite, start, seed)

        controller = mapped(by_instruments, scenes, load, seeds)
    wind = Gust(wind_of(scenes), 0 * scenes.air.wind_east)
    begin = jax.tree.map(lambda x: jnp.broadcast_to(x, (*count, *x.shape)), start)
    # GPUs and Warp are several times faster in single precision
    if jax.default_backend() != "cpu" or options.backend.startswith("warp"):
        begin = in_precision(begin, np.dtype("float32"))
    period = jnp.asarray(options.step_s, float)

    def flight_of(seconds: float) -> tuple[Trajectory, Any]:
        steps = math.ceil(seconds / options.step_s)
        longest = f"{MAX_STEPS * options.step_s:g} s in steps of {options.step_s:g} s"
        few = steps <= MAX_STEPS
        require(few, argument("seconds"), f"at most {longest}", f"{seconds:g} s")
        rows = steps if on_mission else rows_stored(seconds, options, single=single)
        flight = simulate(
            vehicle_of(spec),
            begin,
            duration_s=seconds,
            step_s=options.step_s,
            control=controller,
            wind=wind,
            loads=(load,),
            ground_up_m=GROUND_UP_M,
            # whole steps between rows: their number is at most `rows_stored`
            store_every=math.ceil(steps / rows),
            backend=options.backend,
        )
        # back to the default precision, in which metrics are computed
        flight = in_precision(flight, jnp.zeros(()).dtype)
        return _described(flight, controller, period) if single else (flight, None)

    flight, estimate = flight_of(seconds)
    if on_mission and options.seconds is None:
        if not ended(flight).any() and not crash_of(flight)[0]:
            # not disarmed in time: flown again from the start, for twice as long
            flight, estimate = flight_of(2 * seconds)
        until = slice(kept_rows(flight))
        flight, estimate = flight.at(until), jax.tree.map(lambda x: x[until], estimate)
    target: Any = flight.set_point_m if single else control.target_m
    shared = vehicle_of(spec), target, options.tolerance_m
    found = effects_along(flight, load, unwatched(scenes), *shared)
    came_s, one = found.encounter.arrival_s, None
    if estimate is not None:
        one = thrown_of(estimate, flight.time_s, came_s)
    elif seeds is not None:
        one = _thrown_along(flight, controller, came_s, period)
    kept_flight = lasting(flight, options.least_s) if single else None
    return found._replace(trajectory=kept_flight, thrown=one)


def _described(
    flight: Trajectory, control: Any, period: Float[Array, ""]
) -> tuple[Trajectory, Any]:
    """Return a flight with set point, estimate, item and arming, and its estimate."""
    shown, estimate = flight, None
    if isinstance(control, EstimatedControl):
        estimate, control = followed_along(control, flight, period), control.control
        states = {name: getattr(estimate.shown, name) for name in LENGTHS}
        shown = replace(flight, **states)
    item, armed = None, None
    if isinstance(control, MissionControl):
        aim, item, armed = replay(control.guidance, shown, period)
        # for landing a set point is below the ground
        aim = aim.at[:, 2].max(GROUND_UP_M)
    else:
        aim = jnp.broadcast_to(control.target_m, flight.position_m.shape)
    columns = {"set_point_m": aim, "estimate_m": shown.position_m}
    return replace(flight, **columns, item=item, armed=armed), estimate


def lasting(flight: Trajectory, seconds: float) -> Trajectory:
    """Return a flight that lasts for some time: the vehicle stays where it is."""
    if not float(flight.time_s[-1]) < seconds:
        return flight
    flight = flight.at(np.append(np.arange(flight.time_s.size), -1))
    return replace(flight, time_s=flight.time_s.at[-1].set(seconds))


def unwatched(scenes: Scene) -> Scene:
    """Return scenes without observers and names, so that one program serves all."""
    first, *others = (replace(charge, name="") for charge in scenes.charges)
    # part of the structure of a scene: each one would compile its own program
    removed: dict[str, Any] = {"sensors": (), "camera": None, "clocks": ()}
    removed |= {"vehicle": None, "ambient": None, "law": ()}
    return replace(scenes, charges=(first, *others), **removed)


def joined(parts: list[Flown], vehicles: int) -> Flown:
    """Return the flights of all chunks, without the padding of the last.

    Args:
        parts: Flights of each chunk.
        vehicles: Number of vehicles.
    """
    if vehicles == 1:
        return parts[0]
    return jax.tree.map(lambda *x: jnp.concatenate(x)[:vehicles], *parts)


def _of_blasts(flown: Flown, blasts: list[int]) -> Flown:
    """Return flights with some of their blasts."""
    parts, some = (flown.encounter, flown.thrown), np.array(blasts, int)
    encounter, thrown = jax.tree.map(lambda x: x[..., some], parts)
    return flown._replace(encounter=encounter, thrown=thrown)


def seeds_of(
    seed: int, lanes: Int[np.ndarray, "*batch"] | np.integer, step_s: float
) -> UInt[Array, "*batch"]:
    """Return the seeds of the instruments of vehicles.

    Args:
        seed: Seed of all samples.
        lanes: Numbers of the vehicles.
        step_s: Sampling interval of the inertial unit [s].

    Raises:
        InputError: The interval is longer than that of the barometer.
    """
    # a slower inertial unit would skip readings of the barometer
    longest = 1 / Barometer().rate
    words = f"at most {longest:g} s with an estimator, the sampling interval of its "
    slow = step_s > longest * (1 + 1e-9)
    require(not slow, argument("step"), words + "barometer", f"{step_s:g} s")
    # a prime above the size of usual batches: seeds of two runs do not coincide
    seeds = (seed * 1_000_003 + np.asarray(lanes, np.int64)) % 2**32
    return jnp.asarray(seeds, jnp.uint32)


def flight_seconds(
    scenes: Scene, load: FlightLoad, vehicle: VehicleSpec, source: str, options: Options
) -> float:
    """Return the duration of each flight: 5 s beyond the last blast, in tenths.

    Args:
        scenes: One scene, or several with a leading axis in each array.
        load: Loads of the blasts, with the axis of the scenes.
        vehicle: Vehicle section, whose start and target the blasts reach.
        source: Name of the scene file, for messages.
        options: Options of the flights.

    Raises:
        InputError: A blast arrives before the flight, or no blast arrives in it.
    """
    turned, target = start_of(vehicle).quaternion, hold_of(vehicle, integral=False)
    places = jnp.stack([vehicle.position, target.target_m])
    each = mapped(lambda _, load: _arrivals(load, places, turned), scenes, load)
    came, seconds = np.asarray(each), options.seconds
    at = f"{source}: [charge] time_s"
    words = (
        f"a charge with a finite time, or {argument('seconds')} for a flight without a "
        "blast"
    )
    never = np.isposinf(came).all(axis=-1).any()
    require(seconds is not None or not never, at, words, "inf for all charges")
    words = "arrivals at the vehicle after 0 s, when the flight begins"
    require(came.min() >= 0, at, words, f"one at {came.min():.4g} s")
    if seconds is None:
        # a charge that never explodes does not extend the flight
        last = came.max(where=came < np.inf, initial=0.0)
        seconds = math.ceil(10 * max(last + AFTER_S, options.least_s)) / 10
    first = came.min(axis=-1).max()
    words = f"more than {first:.4g} s, the latest arrival of a first blast"
    require(not seconds <= first < np.inf, "seconds", words, f"{seconds:g} s")
    return seconds


@kept
def _arrivals(
    load: FlightLoad, places: Float[Array, "place 3"], turned: Float[Array, "4"]
) -> Float[Array, "place blast"]:
    return jax.vmap(lambda place: arrival_at(load, place, turned))(places)


def rows_stored(seconds: float, options: Options, *, single: bool) -> int:
    """Return the largest number of stored rows of a flight; all with an estimator."""
    if options.estimator:
        return math.ceil(seconds / options.step_s)
    return max(ROWS if single else BATCH_ROWS, math.ceil(seconds / ROW_S))


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
    spec = scene.vehicle
    words = "a vehicle with its model and position_m"
    require(spec is not None, f"{source}: [vehicle]", words, "none")
    assert spec is not None
    words = f"a whole number from 1 to {MAX_VEHICLES:,}"
    require(1 <= vehicles <= MAX_VEHICLES, "vehicles", words, vehicles)
    placed = all(charge.range_m is None for charge in scene.charges)
    words = "position_m, from which the vehicle's own distance follows"
    require(placed, f"{source}: [charge] range_m", words, "a range")
    one, words = len(scene.charges) == 1, "one charge for a custom profile"
    got = len(scene.charges)
    require(one or not by_profile, f"{source}: [[charge]]", words, got)
    places = {"position_m": spec.position, "control target_m": spec.target}
    for key, place in places.items():
        up = 0.0 if place is None else float(place[2])
        words, got = "a height of 0 m (the ground) or more", f"{up:g} m"
        require(up >= 0, f"{source}: [vehicle] {key}", words, got)
    words = f"a prior to sample {vehicles} scenes from"
    got = "none: all flights would be equal"
    require(vehicles == 1 or uncertain.beliefs, source, words, got)
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
        refused = values[~bounds.allows(values)]
        words = f"a prior of {name} with samples that are {bounds.words()}"
        got = f"{refused[0]:g}, one of {refused.size} of" if refused.size else ""
        got = f"{got} {values.size} samples (seed {seed})"
        require(not refused.size, uncertain.source or "scene", words, got)
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
    require(controllers, "controllers", "one or more", "none")
    hold = BOTH_HOLDS[0] if own is None else own
    return tuple(dict.fromkeys(hold if x == "hold" else x for x in controllers))


def _along(function: Callable[..., T], flight: Trajectory, *own: Any) -> T:
    """Return the value of a function of a flight, or of each of a batch.

    Args:
        function: Function of a flight and `own`.
        flight: The flights; the times of their rows are common to all.
        own: Values of each flight.
    """
    if flight.position_m.ndim == 2:
        return function(flight, *own)
    axes = jax.tree.map(lambda x: 0, flight)
    axes = eqx.tree_at(lambda flight: flight.time_s, axes, None)
    in_axes = (axes, *(eqx.if_array(0) for _ in own))
    return eqx.filter_vmap(function, in_axes=in_axes)(flight, *own)


@kept
def effects_along(
    flight: Trajectory,
    load: FlightLoad,
    scenes: Scene,
    vehicle: Vehicle,
    target_m: Float[Array, "..."],
    tolerance_m: float,
) -> Flown:
    """Return the effects of the blasts on flights; arguments as of `effects`."""

    def one(flight: Trajectory, load: FlightLoad, scene: Scene) -> Flown:
        return effects(load, scene, vehicle, flight, target_m, tolerance_m)

    return _along(one, flight, load, scenes)


@eqx.filter_jit
def _thrown_along(
    flight: Trajectory, control: EstimatedControl, came_s: Array, period_s: Array
) -> Thrown:
    def one(flight: Trajectory, control: EstimatedControl, came_s: Array) -> Thrown:
        return thrown(followed(control, flight, period_s), flight.time_s, came_s)

    return _along(one, flight, control, came_s)
