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
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from calibration.many_worlds import (
    PATHS,
    PLACE,
    RATE_HZ,
    SECONDS,
    SPEC,
    STEP_S,
    WORLDS,
    apart,
    ear_at,
    parts_of_many,
)
from jblast.fidelity.timing import machine
from jblast.report.words import aligned
from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors import microphone
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.image import luminance
from jblast.vehicle import blast_load, hold_of, simulate, start_of, vehicle_of

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
        return microphone.record(own, ear, SECONDS, jax.random.key(0), wave_paths=PATHS)

    film = Film(scene, camera, times)

    def frames() -> Any:
        return [block for _, block in film.frames()][-1]

    def pictures() -> Any:
        blocks = ((times[n], luminance(x)) for n, x in ahead(film.frames(), pool))
        found = stream_events(blocks, (0.2, 0.2), workers=1)
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
