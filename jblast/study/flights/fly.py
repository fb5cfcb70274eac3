"""Position hold through a scene's blasts: one flight, or many drawn from its priors.

The flight begins at 0 on the scene's clock, over level ground at height 0, in the
scene's wind. Each vehicle flies once with each controller; where none is named, with
the SE(3) hold with and without integral action: without it a wind leaves an offset for
ever, and no recovery.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.kept_programs import kept
from jblast.progress import counted
from jblast.scene import Scene, UncertainScene, VehicleSpec
from jblast.study.flights.bursts import with_bursts_at_start
from jblast.study.flights.controllers import BOTH_HOLDS, named_controllers
from jblast.study.flights.draws import checked_scene, drawn_scenes, drawn_values
from jblast.study.flights.duration import BATCH_ROWS, flight_seconds, rows_stored
from jblast.study.flights.encounter import FlightLoad, encounter_of, load_of
from jblast.study.flights.exposure import exposed
from jblast.study.flights.instruments import (
    Instruments,
    by_instruments,
    instruments_of,
    thrown_by_blasts,
)
from jblast.study.flights.lanes import joined, lanes_of
from jblast.study.flights.records import Flights, Flown, Options
from jblast.vehicle import (
    Each,
    StepGust,
    controller_of,
    flight_metrics,
    path_error,
    simulate,
    start_of,
    vehicle_of,
)
from jblast.vehicle.quadrotor import in_precision

GROUND_UP_M = 0.0
CHUNK = {"cpu": 2048, "gpu": 16_384}
"""Vehicles of `BATCH_ROWS` in memory at once: on a CPU some 2 GB, in float64."""


def fly(
    uncertain: UncertainScene,
    options: Options | None = None,
    *,
    vehicles: int = 1,
    seed: int = 0,
    controllers: Sequence[str] | None = None,
) -> Flights:
    """Fly a scene's vehicle through its blasts.

    Args:
        uncertain: The scene; what has a prior is drawn from it.
        options: How to fly; None: the defaults.
        vehicles: How many scenes are drawn.
        seed: Of the draws.
        controllers: Names of `vehicle.CONTROLLERS`, or "hold" for the SE(3) hold as the
            scene has it; None: that with integral action and without, the scene's own
            first.

    Returns:
        The flights by controller: how far each vehicle was thrown, when it had
        recovered, which crashed.

    Raises:
        InputError: The scene cannot be flown, a number cannot be drawn, or an option
            cannot be used.

    Example:
        `flights = jblast.fly(jblast.read_scene("scene.toml"), vehicles=100)`
    """
    options = Options() if options is None else options
    vehicle = checked_scene(uncertain, vehicles, options.profile is not None)
    scenes = drawn_scenes(uncertain, vehicles, seed)
    notes = ()
    if options.profile is None:
        scenes, notes = with_bursts_at_start(scenes, vehicle)
    seconds = flight_seconds(scenes, vehicle, uncertain.source, options)
    own = None if vehicle.integral is None else BOTH_HOLDS[not vehicle.integral]
    names = named_controllers(controllers, own)
    for name in names:
        controller_of(vehicle, name)  # or a name that is none ends it at once
    flown: dict[str, list[Flown]] = {name: [] for name in names}
    most = CHUNK["cpu" if jax.default_backend() == "cpu" else "gpu"]
    rows = rows_stored(seconds, vehicles, options)
    if rows > BATCH_ROWS:
        most = max(1, most * BATCH_ROWS // rows)
    chunks = math.ceil(vehicles / most)
    size = math.ceil(vehicles / chunks)
    through = counted(vehicles, "vehicles")
    for n in range(chunks):
        # the last chunk is filled up: another size would compile everything anew
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


def flown_by(
    scenes: Scene,
    spec: VehicleSpec,
    hold: str,
    seconds: float,
    vehicles: int,
    options: Options,
    instruments: Instruments | None = None,
) -> Flown:
    """Fly some vehicles with one controller.

    Args:
        scenes: One, or several with a leading axis in every array.
        spec: The vehicle.
        hold: A name of `vehicle.CONTROLLERS`.
        seconds: How long each flight is.
        vehicles: How many are flown in all: of one alone every row is kept.
        options: How to fly.
        instruments: Of the vehicles, where they fly by what these say.
    """
    single = vehicles == 1
    control = controller_of(spec, hold)
    start, load = start_of(spec), _load(scenes, options, single)
    flier: Any = control
    if options.estimator:
        assert instruments is not None
        flier = by_instruments(
            control, scenes, start, load, instruments, 1 / options.step_s
        )
    wind = StepGust(steady_wind(scenes), 0 * scenes.air.wind_east)
    if not single:
        count = scenes.air.wind_east.shape
        start = jax.tree.map(lambda x: jnp.broadcast_to(x, (*count, *x.shape)), start)
    if jax.default_backend() != "cpu" or options.backend.startswith("warp"):
        start = in_precision(start, np.dtype("float32"))
    steps = math.ceil(seconds / options.step_s)
    trajectory = simulate(
        vehicle_of(spec),
        start,
        duration_s=seconds,
        step_s=options.step_s,
        integrator=options.integrator,
        control=flier if single or flier is control else Each(flier),
        wind=wind if single else Each(wind),
        loads=(load if single else Each(load),),
        ground_up_m=GROUND_UP_M,
        store_every=math.ceil(steps / rows_stored(seconds, vehicles, options)),
        backend=options.backend,
    )
    trajectory = in_precision(trajectory, jnp.zeros(()).dtype)
    places = trajectory.position_m, trajectory.quaternion
    encounter = (_encounter if single else _encounter_each)(
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
    times = jnp.broadcast_to(trajectory.time_s, error.shape)
    last = jnp.sum(times < first[..., None], axis=-1, keepdims=True) - 1
    before = jnp.take_along_axis(error, jnp.maximum(last, 0), axis=-1)[..., 0]
    exposure = (_exposed if single else _exposed_each)(
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
    if flier is control:
        return found
    thrown, estimated = thrown_by_blasts(
        flier, trajectory, encounter.arrival_s, options.step_s
    )
    return replace(found, thrown=thrown, followed=estimated if single else None)


_encounter = kept(encounter_of)
_encounter_each = eqx.filter_jit(jax.vmap(encounter_of, (0, None, 0, 0)))
_exposed = kept(exposed)
_exposed_each = eqx.filter_jit(
    eqx.filter_vmap(exposed, in_axes=(0, 0, None, 0, None, 0))
)


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
    """Leave out who looks on: one program whoever it is and what charges are called."""
    first, *others = (replace(charge, name="") for charge in scenes.charges)
    nobody: dict[str, Any] = {"sensors": (), "camera": None, "clocks": ()}
    nobody |= {"vehicle": None, "ambient": None, "law": ()}
    return replace(scenes, charge=first, others=tuple(others), **nobody)
