"""How many times real time a whole world goes, and how many worlds at once.

    python -m calibration.benchmarks world > calibration/results/benchmark_world.txt

One scene with every sense, a second of it: 10 kg go off 60 m from a camera of 346 x 260
pixels (100 frames of three colours, the law's fireball, and the events of their
luminance), 30 m from a microphone at 48 kHz and a Hummingbird that holds its place,
steps of 1 ms. Pictures on one thread, the rest on another. Then 1,000 random worlds of
a blast each, 1 s, without pictures: sound, force and path.

Single precision. Cold: a process without anything compiled. Warm: the best of several.
The processor's seconds stand beside those of the wall, for others use the machine:
what two cores to oneself would make of them is told as well, as if the parts could be
shared evenly.
"""

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jblast.fidelity.timing import machine
from jblast.report.tables import aligned
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
from jblast.scene.random.spec import ByCount
from jblast.sensors import microphone
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.image.grey_composite import luminance
from jblast.vehicle import (
    Each,
    blast_load,
    hold_of,
    simulate,
    start_of,
    vehicle_of,
)
from jblast.world import blast_sequence, world_key

SECONDS, FRAMES_HZ, STEP_S = 1.0, 100.0, 1e-3
RATE_HZ, LOW_HZ = 48_000.0, 8_000.0
WORLDS, REPEATS = 1000, 5
PLACE = (0.0, 0.0, 10.0)
SPEC = VehicleSpec("hummingbird", np.array(PLACE), integral=True)
WAVE_S = (0.01, 0.2)
"""Before and after an arrival, of the time in which a wave may push [s]."""
PATHS = microphone.WavePaths(absorption=False)
"""Where the law of the peak holds, as here, air absorbs nothing besides."""


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
        ear = _ear(jnp.asarray(PLACE), RATE_HZ)
        return microphone.record(own, ear, SECONDS, jax.random.key(0), wave_paths=PATHS)

    film = Film(scene, camera, times)

    def frames() -> Any:
        return [block for _, block in film.frames()][-1]

    def pictures() -> Any:
        blocks = ((times[n], luminance(x)) for n, x in film.frames())
        return [sum(int(e.count) for e in stream_events(blocks, (0.2, 0.2)))]

    def flight() -> Any:
        return simulate(
            vehicle,
            start,
            duration_s=SECONDS,
            step_s=STEP_S,
            control=hold,
            loads=(load,),
        ).position_m

    def heard() -> Any:
        return sound(scene.charge)

    pool = ThreadPoolExecutor(2)

    def whole() -> Any:
        seen = pool.submit(pictures)
        felt = pool.submit(lambda: (flight(), heard()))
        return seen.result(), felt.result()

    return {
        "frames": frames,
        "frames and events": pictures,
        "sound, 48 kHz": heard,
        "path, 1 kHz": flight,
        "all of it, on two threads": whole,
    }


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
    starts = jax.tree.map(lambda x: jnp.broadcast_to(x, (*many, *x.shape)), start)

    def recorder(rate_hz: float) -> Callable[[], Any]:
        def one(scene: Scene, key: Any) -> Any:
            ear = _ear(place, rate_hz)
            return microphone.record(scene, ear, SECONDS, key, wave_paths=PATHS)

        record = jax.jit(jax.vmap(one))
        return lambda: record(scenes, keys)

    def flights() -> Any:
        flown = simulate(
            vehicle,
            starts,
            duration_s=SECONDS,
            step_s=STEP_S,
            control=hold,
            loads=(Each(jax.vmap(blast_load)(scenes)),),
            store_every=10,
        )
        return flown.position_m

    load = jax.jit(jax.vmap(lambda scene, state: _pushed(scene, state, vehicle)))

    def force() -> Any:
        return load(scenes, starts)

    found: dict[str, Callable[[], Any]] = {"path": flights, "force": force}
    for rate, name in ((RATE_HZ, "48 kHz"), (LOW_HZ, "8 kHz")):
        sound = recorder(rate)
        found[f"sound, {name}"] = sound

        def whole(sound: Callable[[], Any] = sound) -> Any:
            return jax.block_until_ready((flights(), force(), sound()))

        found[f"all of it, {name}"] = whole
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


def _pushed(scene: Scene, state: Any, vehicle: Any) -> Any:
    """Return force and moment of a held vehicle, means over the steps of a flight.

    Before its wave, and 0.2 s after it began, there is none.
    """
    load = blast_load(scene)
    steps = round(SECONDS / STEP_S)
    arrival = load.arrival_time_s(state.position_m)[0]
    first = jnp.floor((arrival - WAVE_S[0]) / STEP_S)
    few = round(sum(WAVE_S) / STEP_S)
    first = jnp.clip(first, 0, steps - few).astype(int)
    edges = (first + jnp.arange(few + 1)) * STEP_S

    def step(start: Any, end: Any) -> Any:
        push, turn = load.impulse(start, end, state, vehicle)
        return jnp.concatenate([push, turn]) / STEP_S

    some = jax.vmap(step)(edges[:-1], edges[1:])
    return jax.lax.dynamic_update_slice(jnp.zeros((steps, 6)), some, (first, 0))


def _ear(place: Any, rate_hz: float) -> Sensor:
    return Sensor("ear", place, "microphone", instrument=Instrument(rate=rate_hz))


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
    for name, call in parts_of_many().items():
        rows.append(_row(name, taken(call, 3), WORLDS))
    lines += aligned(rows, right=range(1, 7))
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
