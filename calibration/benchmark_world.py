"""How many times real time a whole world goes, and how many worlds at once.

    python -m calibration.benchmarks world > calibration/results/benchmark_world.txt

One scene with every sense, a second of it: 10 kg go off 60 m from a camera of 346 x 260
pixels (100 frames of three colours, the law's fireball, and the events of their
luminance), 30 m from a microphone at 48 kHz and a Hummingbird that holds its place,
steps of 1 ms: by JAX, and by the kernel of Warp, which is the quicker for one vehicle
alone. Frames on one thread, their events on another, the rest on a third. Then 1,000
random worlds of a blast each, 1 s, without pictures: sound, force and path, the vehicle
by steps of 1 ms and of 4 ms; how far apart these paths are stands below.

Single precision. Cold: a process without anything compiled. Warm: the best of several.
The processor's seconds stand beside those of the wall, for others use the machine:
what two cores to oneself would make of them is told as well, as if the parts could be
shared evenly.
"""

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from calibration.timing import machine
from jblast.report.view import aligned
from jblast.scene import (
    Camera,
    Charge,
    Instrument,
    Ring,
    Scene,
    Sensor,
    Uniform,
    VehicleSpec,
    WorldSpec,
    look_at,
)
from jblast.scene.random_blasts import ByCount
from jblast.sensors import recording
from jblast.sensors.camera import Pixel, event_stream
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.image import luminance
from jblast.vehicle import blast_load, hold_of, simulate, start_of, vehicle_of
from jblast.world import blast_sequence, world_key

SECONDS, STEP_S, LONG_STEP_S = 1.0, 1e-3, 4e-3
RATE_HZ, LOW_HZ = 48_000.0, 8_000.0
WORLDS = 1000
PLACE = (0.0, 0.0, 10.0)
SPEC = VehicleSpec("hummingbird", np.array(PLACE), integral=True)
STORED_S = 0.02
"""From one stored place of a path of many to the next [s]."""
MARGIN_S = 0.01
"""Before and after a wave, in which it may still push: a front takes time to cross [s].
"""
"""Where the law of the peak holds, as here, air absorbs nothing besides."""


FRAMES_HZ, REPEATS = 100.0, 15
WARP = "warp:cpu"


class Taken(NamedTuple):
    """Seconds of the wall and of processors, the first time and at best."""

    cold: tuple[float, float]
    warm: tuple[float, float]


def taken(call: Callable[[], Any], repeats: int = REPEATS) -> Taken:
    """Return what a call takes."""

    def once() -> tuple[float, float]:
        wall, cores = time.perf_counter(), time.process_time()
        jax.block_until_ready(call())
        return time.perf_counter() - wall, time.process_time() - cores

    cold = once()
    runs = [once() for _ in range(repeats)]
    return Taken(cold, (min(w for w, _ in runs), min(c for _, c in runs)))


def one_scene() -> tuple[Scene, Camera]:
    """Return the scene, and who looks on."""
    scene = Scene(Charge(10.0, (30.0, 0.0, 0.0), 0.2), vehicle=SPEC)
    place = np.array([-30.0, 0.0, 2.0])
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array([30.0, 0.0, 5.0])),
        focal=np.array([260.0, 260.0]),
        center=np.array([172.5, 129.5]),
        width=346,
        height=260,
    )
    return scene, camera


def parts_of_one() -> dict[str, Callable[[], Any]]:
    """Return what makes each sense of the one scene."""
    scene, camera = one_scene()
    times = np.arange(0.0, SECONDS, 1.0 / FRAMES_HZ)
    vehicle, hold = vehicle_of(SPEC), hold_of(SPEC, integral=True)
    load, start = blast_load(scene), start_of(SPEC)

    @jax.jit
    def sound(charge: Charge) -> Any:
        own = Scene(charge)
        ear = ear_at(jnp.asarray(PLACE), RATE_HZ)
        return recording(own, ear, jax.random.key(0)).samples(SECONDS)

    film = Film(scene, camera, times)

    def frames() -> Any:
        return [block for _, block in film.frames()][-1]

    def pictures() -> Any:
        blocks = ((times[n], luminance(x)) for n, x in ahead(film.frames(), pool))
        found = event_stream(blocks, Pixel(0.2, 0.2), workers=1)
        return [sum(int(e.count) for e in found)]

    def flight(backend: str = "jax") -> Any:
        return simulate(
            vehicle,
            start,
            duration_s=SECONDS,
            step_s=STEP_S,
            control=hold,
            loads=(load,),
            backend=backend,
        ).position_m

    def heard() -> Any:
        return sound(scene.charge)

    pool = ThreadPoolExecutor(3)

    def whole(backend: str) -> Any:
        seen = pool.submit(pictures)
        felt = pool.submit(lambda: (flight(backend), heard()))
        return seen.result(), felt.result()

    return {
        "frames": frames,
        "frames and events": pictures,
        "sound, 48 kHz": heard,
        "path, 1 kHz, JAX": flight,
        "path, 1 kHz, Warp": lambda: flight(WARP),
        "all of it, path by JAX": lambda: whole("jax"),
        "all of it, path by Warp": lambda: whole(WARP),
    }


def ahead(items: Iterator[Any], pool: ThreadPoolExecutor) -> Iterator[Any]:
    """Return the same items, each made while the one before it is used."""
    none = object()
    coming = pool.submit(next, items, none)
    while (item := coming.result()) is not none:
        coming = pool.submit(next, items, none)
        yield item


def world_text() -> str:
    """Measure, and return both tables."""
    load = os.getloadavg()[0]
    lines = [f"Worlds: {machine()}, float32, load average {load:.1f}", ""]
    heads = ["cold wall s", "cores s", "warm wall s", "cores s", "times real time"]
    heads += ["on two cores"]
    rows = [["one scene, 1 s", *heads]]
    for name, call in parts_of_one().items():
        rows.append(_row(name, taken(call), 1))
    lines += [*aligned(rows, right=range(1, 7)), ""]
    rows = [[f"{WORLDS:,} worlds, 1 s", *heads]]
    many = parts_of_many()
    for name, call in many.items():
        rows.append(_row(name, taken(call, 5), WORLDS))
    lines += aligned(rows, right=range(1, 7))
    lines += [
        "",
        *apart(*(np.asarray(many[f"path, {s}"]()) for s in ("1 ms", "4 ms"))),
    ]
    lines += ["", f"load average at the end {os.getloadavg()[0]:.1f}"]
    return "\n".join(lines)


def _row(name: str, took: Taken, worlds: int) -> list[str]:
    """Return a row; rates are of the wall, and of half of the processors' time."""
    seconds = worlds * SECONDS
    (cold, cold_cores), (warm, warm_cores) = took
    return [
        name,
        f"{cold:.2f}",
        f"{cold_cores:.2f}",
        f"{warm:.3g}",
        f"{warm_cores:.3g}",
        f"{seconds / warm:.3g}",
        f"{2.0 * seconds / warm_cores:.3g}",
    ]


def parts_of_many() -> dict[str, Callable[[], Any]]:
    """Return what makes sound, force and path of random worlds."""
    spec = WorldSpec(
        occurrence=ByCount(1),
        region=Ring(15.0, 60.0),
        mass=Uniform(5.0, 15.0),
        time=Uniform(0.0, 0.5),
    )
    origin = jnp.zeros(3)

    def scene_of(key: Any) -> Scene:
        blasts = blast_sequence(key, spec, origin, 1)
        east, north, up = blasts.position_m[0]
        charge = Charge(
            blasts.mass_kg[0], (east, north, up), blasts.time_s[0], burst="surface"
        )
        return Scene(charge)

    keys = jax.random.split(world_key(0), WORLDS)
    scenes = _by_arrival(jax.jit(jax.vmap(scene_of))(keys))
    vehicle, hold, start = (
        vehicle_of(SPEC),
        hold_of(SPEC, integral=True),
        start_of(SPEC),
    )
    place, many = jnp.asarray(PLACE), (WORLDS,)
    longest_s = _longest_wave_s(scenes)
    starts = jax.tree.map(lambda x: jnp.broadcast_to(x, (*many, *x.shape)), start)

    def recorder(rate_hz: float) -> Callable[[], Any]:
        def one(scene: Scene, key: Any) -> Any:
            ear = ear_at(place, rate_hz)
            return recording(scene, ear, key).samples(SECONDS)

        record = jax.jit(jax.vmap(one))
        return lambda: record(scenes, keys)

    def flights(step_s: float) -> Any:
        flown = simulate(
            vehicle,
            starts,
            duration_s=SECONDS,
            step_s=step_s,
            control=hold,
            loads=(jax.vmap(blast_load)(scenes),),
            store_every=round(STORED_S / step_s),
        )
        return flown.position_m

    @partial(jax.jit, static_argnames="step_s")
    def pushed(step_s: float) -> Any:
        def one(scene: Scene, state: Any) -> Any:
            return _pushed(scene, state, vehicle, step_s, longest_s)

        return jax.vmap(one)(scenes, starts)

    pool = ThreadPoolExecutor(3)
    found: dict[str, Callable[[], Any]] = {}
    recorders = {"48 kHz": recorder(RATE_HZ), "8 kHz": recorder(LOW_HZ)}
    found |= {f"sound, {name}": sound for name, sound in recorders.items()}
    for step_s in (STEP_S, LONG_STEP_S):
        steps = f"{1e3 * step_s:g} ms"
        found[f"path, {steps}"] = partial(flights, step_s)
        found[f"force, {steps}"] = partial(pushed, step_s)
        for name, sound in recorders.items():

            def whole(sound: Any = sound, step_s: float = step_s) -> Any:
                parts = partial(flights, step_s), partial(pushed, step_s), sound
                jobs = [pool.submit(part) for part in parts]
                return [job.result() for job in jobs]

            found[f"all of it, {steps}, {name}"] = whole
    return found


def _by_arrival(scenes: Scene) -> Scene:
    """Return scenes in order of arrival: vehicles of a chunk wait for a blast together.

    Until the first of its waves comes, and past its last, none of a chunk is asked for
    its load.
    """
    arrival = jax.jit(
        jax.vmap(lambda scene: blast_load(scene).arrival_time_s(jnp.asarray(PLACE))[0])
    )(scenes)
    order = jnp.argsort(arrival)
    return jax.tree.map(lambda x: x[order], scenes)


def _longest_wave_s(scenes: Scene) -> float:
    """Return how long the longest wave takes to pass the vehicle's place [s]."""

    def one(scene: Scene) -> Any:
        load = blast_load(scene)
        place = jnp.asarray(PLACE)
        waves = jax.vmap(lambda blast: blast.wave(load.air, place))(load.waves)
        return jnp.max(waves.duration_s + waves.suction_s)

    return float(jax.jit(jax.vmap(one))(scenes).max())


def _pushed(
    scene: Scene, state: Any, vehicle: Any, step_s: float, longest_s: float
) -> Any:
    """Return force and moment of a held vehicle, means over the steps of a flight.

    Before its wave, and past it, there is none.
    """
    load = blast_load(scene)
    steps = round(SECONDS / step_s)
    arrival = load.arrival_time_s(state.position_m)[0]
    first = jnp.floor((arrival - MARGIN_S) / step_s)
    few = int(np.ceil((longest_s + 2.0 * MARGIN_S) / step_s))
    first = jnp.clip(first, 0, steps - few).astype(int)
    edges = (first + jnp.arange(few + 1)) * step_s

    def step(start: Any, end: Any) -> Any:
        push, turn = load.impulse(start, end, state, vehicle)
        return jnp.concatenate([push, turn]) / step_s

    some = jax.vmap(step)(edges[:-1], edges[1:])
    return jax.lax.dynamic_update_slice(jnp.zeros((steps, 6)), some, (first, 0))


def ear_at(place: Any, rate_hz: float) -> Sensor:
    """Return an ear that hears the wave in the air, which nothing absorbs at 30 m."""
    return Sensor("ear", place, "pressure", instrument=Instrument(rate=rate_hz))


def apart(fine: np.ndarray, coarse: np.ndarray) -> list[str]:
    """Return lines that say how far the paths by longer steps are off the others."""
    off = 1e3 * np.linalg.norm(coarse - fine, axis=-1).max(axis=1)
    thrown = 1e3 * np.linalg.norm(fine - fine[:, :1], axis=-1).max(axis=1)
    return [
        "between paths by 4 ms and by 1 ms, the most in each world: median "
        f"{np.median(off):.3f} mm, 95 % below {np.quantile(off, 0.95):.3f} mm, all "
        f"below {off.max():.3f} mm",
        f"thrown by: median {np.median(thrown):.3f} mm, at most {thrown.max():.3f} mm",
    ]
