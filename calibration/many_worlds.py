"""A thousand random worlds of a blast each: sound, force and path, without pictures.

Part of `calibration.benchmark_world`, which says what is measured.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import (
    Charge,
    Instrument,
    Ring,
    Scene,
    Sensor,
    Uniform,
    VehicleSpec,
    WorldSpec,
)
from jblast.scene.random_blasts import ByCount
from jblast.sensors import microphone
from jblast.vehicle import Each, blast_load, hold_of, simulate, start_of, vehicle_of
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
PATHS = microphone.WavePaths(absorption=False)
"""Where the law of the peak holds, as here, air absorbs nothing besides."""


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
            return microphone.record(scene, ear, SECONDS, key, wave_paths=PATHS)

        record = jax.jit(jax.vmap(one))
        return lambda: record(scenes, keys)

    def flights(step_s: float) -> Any:
        flown = simulate(
            vehicle,
            starts,
            duration_s=SECONDS,
            step_s=step_s,
            control=hold,
            loads=(Each(jax.vmap(blast_load)(scenes)),),
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
        waves = [load.wave_of(blast, jnp.asarray(PLACE)) for blast in load.waves]
        return jnp.stack([wave.duration_s + wave.suction_s for wave in waves]).max()

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
    """Return a microphone."""
    return Sensor("ear", place, "microphone", instrument=Instrument(rate=rate_hz))


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
