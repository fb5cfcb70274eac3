"""How fast: the rate of each subject, by the wall clock and by the processors' time.

    python -m calibration.benchmarks SUBJECT ...

Rates are the best of several runs, compilation apart. A rate of a core-second tells
alike while others use the machine. The subjects:

    benchmarks laws           one law at one range, mass, pressure and sound speed
    benchmarks fit_many       logs of six stations around a charge of unknown mass,
                              place and time, air and ground arrivals by Wu and Hao
    benchmarks picks          pressure records of 4,096 samples
    benchmarks flights        right-hand sides of Crazyflies that hold their place
                              5 m from charges of 0.5 to 2 kg for 2.5 s, float32 and
                              float64, and the gradient
    benchmarks flight_kernel  the same of a million by the kernel of Warp, on a GPU
    benchmarks events         frames to events: pixel-frames, 346 x 260 pixels of 8 bits
    benchmarks views          frames of 640 x 480 pixels with the shipped explosion;
                              on a GPU in batches
    benchmarks world          a second of one world with frames, events, sound, flight
    benchmarks environments   steps of 10 ms of lanes all through their episodes
    benchmarks study          see `calibration.benchmark_study`
"""

import argparse
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple
from unittest import mock

import equinox as eqx
import jax

if __name__ == "__main__" and "device_count" not in os.environ.get("XLA_FLAGS", ""):
    # before the imports below, which begin with JAX's devices
    jax.config.update("jax_num_cpu_devices", os.cpu_count())

import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array

from calibration.cases import BACKGROUND, filmed
from calibration.timing import best_of, machine
from jblast import waves
from jblast.environments import (
    EnvironmentParams,
    EnvironmentState,
    environment_params,
    reset_lanes,
    step_lanes,
)
from jblast.environments.lanes import in_chunks
from jblast.inference import fit_many
from jblast.kept_programs import WIDE
from jblast.report.view import aligned
from jblast.scene import (
    ByCount,
    Camera,
    Charge,
    Instrument,
    Ring,
    Scene,
    Sensor,
    UncertainScene,
    Uniform,
    VehicleSpec,
    WorldSpec,
    freed,
    look_at,
    with_values,
)
from jblast.sensors import planned_layout, recording
from jblast.sensors.camera import Pixel, event_stream, explosion_views, luminance
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.pixel import NoiseModel, noisy_pixel, pixel_events
from jblast.sensors.camera.rendering import light, render, view_of
from jblast.vehicle import (
    PositionHold,
    State,
    blast_load,
    hold_of,
    named,
    named_gains,
    simulate,
    start_of,
    vehicle_of,
)

Law = Callable[..., Array | tuple[Array, ...]]


class Row(NamedTuple):
    """Something to time.

    Attributes:
        label: Its name.
        work: Amount of work of a call.
        call: What is timed, or what returns its seconds by a clock of its own.
        says: What there is to say of the answer of a call.
        repeats: Number of timed calls.
    """

    label: str
    work: float
    call: Callable[[], Any]
    says: Callable[[Any], str] = lambda _: ""
    repeats: int = 5


def on_gpu() -> bool:
    """Return whether there is a GPU."""
    return jax.default_backend() == "gpu"


def both(slant_range, charge_mass, ambient_pressure, sound_speed):
    """Arrival and pressure by Kingery and Bulmash: two evaluations."""
    air = slant_range, charge_mass, ambient_pressure
    return (
        waves.kingery_bulmash_arrival_time(*air, sound_speed),
        waves.kingery_bulmash_pressure(*air),
    )


EVALUATED: dict[str, tuple[Law, int, int]] = {
    "arrival + pressure, Kingery-Bulmash": (both, 4, 2),
    "arrival, shock kinematics": (waves.shock_kinematics_arrival_time, 4, 1),
    "pressure, shock kinematics": (waves.shock_kinematics_pressure, 3, 1),
    "pressure, Kinney-Graham": (waves.kinney_graham_pressure, 3, 1),
    "pressure, Swisdak": (waves.swisdak_pressure, 3, 1),
    "pressure, point source": (waves.point_source_pressure, 3, 1),
}
"""Law, number of its arguments, evaluations it counts as."""


def laws() -> Iterator[Row]:
    """Give laws in both precisions, a part of the points on each device."""
    points = 1 << (26 if on_gpu() else 22)
    for wide in (True, False):
        with jax.enable_x64(wide):
            for name, (law, arguments, count) in EVALUATED.items():
                call = evaluated(law, arguments, points, "f8" if wide else "f4")
                yield Row(
                    f"{'double' if wide else 'single'}, {name}", points * count, call
                )


def evaluated(law: Law, arguments: int, points: int, dtype: str) -> Callable[[], Any]:
    """Return what evaluates a law at points with Z from 0.07 to 40."""
    rng = np.random.default_rng(0)
    mass = np.exp(rng.uniform(math.log(1e-2), math.log(1e6), points))
    z = np.exp(rng.uniform(math.log(0.07), math.log(40.0), points))
    pressure = rng.uniform(7e4, 1.05e5, points)
    distance = z * np.cbrt(mass * 101325.0 / pressure)
    columns = distance, mass, pressure, rng.uniform(320.0, 350.0, points)
    mesh = Mesh(np.array(jax.devices()), ("part",))
    spread = NamedSharding(mesh, PartitionSpec("part"))
    inputs = [jax.device_put(x.astype(dtype), spread) for x in columns[:arguments]]
    compiled = jax.jit(law).lower(*inputs).compile()
    return lambda: compiled(*inputs)


SIGMA, SOUND, ROCK = 1e-4, 340.0, 5660.0
STATIONS_M = (60.0, 140.0, 80.0, 120.0, 70.0, 130.0)
ARRIVALS = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}


def six_stations() -> UncertainScene:
    """Return a scene of six stations around a charge."""
    angle = np.arange(6) * math.pi / 3
    records = tuple((quantity, SIGMA) for quantity in ARRIVALS)
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([r * np.cos(a), r * np.sin(a), 0.0]), records=records)
        for i, (r, a) in enumerate(zip(STATIONS_M, angle, strict=True))
    )
    names = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")
    speeds = {"air_sound_speed_m_s": SOUND, "ground_p_speed_m_s": ROCK}
    scene = with_values(Scene(scatter=False, sensors=sensors), speeds)
    return freed(UncertainScene(scene), list(names))


def fits() -> Iterator[Row]:
    """Give fits of many logs: 5 to 200 kg within 20 m of the middle."""
    with jax.enable_x64(True):
        count = 1 << (23 if on_gpu() else 17)
        scene = six_stations()
        layout, sigma, _ = planned_layout(scene.scene)
        rng = np.random.default_rng(0)
        reach, way = 20 * np.sqrt(rng.random(count)), 2 * math.pi * rng.random(count)
        mass = rng.uniform(math.log(5), math.log(200), count)
        truth = np.stack(
            [mass, reach * np.cos(way), reach * np.sin(way), rng.uniform(-1, 1, count)],
            axis=1,
        )
        place = np.asarray(layout.position)[:, :2]
        apart = np.linalg.norm(truth[:, None, 1:3] - place, axis=-1)
        air = np.array([q == "air_arrival_s" for q in layout.quantity])
        charge = np.exp(truth[:, :1])
        exact = truth[:, 3:] + np.where(
            air,
            waves.wu_hao_air_arrival_time(apart, charge, SOUND),
            waves.wu_hao_ground_arrival_time(apart, charge, ROCK),
        )
        readings = jnp.asarray(exact + SIGMA * rng.standard_normal(exact.shape))

        def fit(starts: Any = None) -> Any:
            given = scene, layout, readings, np.asarray(sigma), ARRIVALS
            return fit_many(*given, noise="gaussian", starts=starts)

        def says(found: Any) -> str:
            best = jnp.fmin(found.cost, fit(jnp.asarray(truth)).cost)
            off = np.asarray(~(found.cost - best <= 1e-6))
            wrong = off & np.asarray(found.converged)
            return f"off the optimum {off.sum():,}, falsely converged {wrong.sum():,}"

        yield Row("fits/s, starts included", count, fit, says)


def picks() -> Iterator[Row]:
    """Give picks of records, on one core; nothing is compiled."""
    from calibration.picks import SAMPLES, drawn, noise_of, signal_of
    from jblast.signals.picks import pick

    rng = np.random.default_rng(21)
    clock = np.arange(SAMPLES, dtype=float)
    samples = [signal_of(one) + noise_of(one, rng) for one in drawn(20, rng)]

    def all_of_them() -> None:
        for one in samples:
            pick(clock, one)

    yield Row("records/s, as they come", len(samples), all_of_them, repeats=3)


SECONDS, HELD_S = 2.5, 4e-3
TARGET = [5.0, 0.0, 2.0]


def starts(count: int, dtype: Any) -> State:
    """Return vehicles that hover within a metre of 5 m from the charge."""
    vehicle, rng = named("crazyflie"), np.random.default_rng(0)
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    near = rng.uniform(-0.5, 0.5, (count, 3)) * (np.arange(count) > 0)[:, None]
    level = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    still = np.zeros((count, 3))
    speeds = np.full((count, 4), speed)
    parts = near + np.array(TARGET), still, level, still, speeds
    return State(*(part.astype(dtype) for part in parts))


def flown(
    count: int, step_s: float, dtype: str = "float32", *, blast: bool = True, **how: Any
) -> Callable[..., Any]:
    """Return what flies vehicles near a charge of their own."""
    mass = np.random.default_rng(1).uniform(0.5, 2.0, count).astype(dtype)
    charges = jax.vmap(lambda m: blast_load(Scene(Charge(mass_kg=m, time_s=0.05))))
    return partial(
        simulate,
        named("crazyflie"),
        starts(count, dtype),
        duration_s=SECONDS,
        step_s=step_s,
        control=PositionHold(TARGET, named_gains("crazyflie", integral=True)),
        control_period_s=HELD_S,
        loads=(charges(jnp.asarray(mass)),) if blast else (),
        store_every=round(SECONDS / step_s),
        **how,
    )


def error(step_s: float, dtype: str = "float32", **how: Any) -> str:
    """Return the largest distance from the same flights in float64 at 0.1 ms."""
    near = flown(100, step_s, dtype, **how)(store_every=round(0.1 / step_s))
    fine = flown(100, 1e-4, "float64")(store_every=1000)
    off = jnp.linalg.norm(near.position_m - fine.position_m, axis=-1)
    return f"{1e3 * float(jnp.max(off)):.3g} mm at {1e3 * step_s:g} ms"


def flights() -> Iterator[Row]:
    """Give flights by JAX."""
    step, count = 5e-4, 2048
    work = 4.0 * round(SECONDS / step) * count
    with jax.enable_x64(True):
        for dtype in ("float32", "float64"):
            fly = flown(count, step, dtype)
            says = partial(lambda d, _: error(step, d), dtype)
            yield Row(f"right-hand sides/s, {dtype}", work, fly, says, 3)

        begin = starts(100, "float64")

        def off(mass: Array, near: Array) -> Array:
            """Return the mean square distance, by the charge and a factor of a gain."""
            gains = named_gains("crazyflie", integral=True)
            own = eqx.tree_at(lambda g: g.position, gains, near * gains.position)
            flight = simulate(
                named("crazyflie"),
                begin,
                duration_s=1.0,
                step_s=1e-3,
                control=PositionHold(TARGET, own),
                loads=(blast_load(Scene(Charge(mass_kg=mass))),),
                store_every=1000,
            )
            away = flight.position_m[:, -1] - jnp.array(TARGET)
            return jnp.mean(jnp.sum(jnp.square(away), axis=-1))

        at = [jnp.asarray(1.0)] * 2
        for name, made in (("one", off), ("its gradient", jax.jacfwd(off, (0, 1)))):
            call = partial(jax.jit(made), *at)
            yield Row(f"100 flights at 1 ms, {name}", 1.0, call, repeats=3)


def flight_kernel() -> Iterator[Row]:
    """Give flights of a million by the kernel of Warp, by its own time."""
    from jblast.vehicle import kernel

    count = 1_000_000
    with jax.enable_x64(True):
        cases: list[tuple[str, float, dict[str, Any]]] = [
            ("float32, with blasts", 4e-3, {}),
            ("float32, with blasts", 1e-3, {}),
            ("float32, no blast", 1e-3, {"blast": False}),
            ("float64, with blasts", 1e-3, {"dtype": "float64"}),
        ]
        for label, step, how in cases:
            fly, run, spent = flown(count, step, backend="warp", **how), kernel.run, []

            def timed(*a: Any, run: Any = run, spent: list = spent, **k: Any) -> None:
                begun = time.perf_counter()
                run(*a, **k)
                spent.append(time.perf_counter() - begun)

            def call(fly: Any = fly, timed: Any = timed) -> Any:
                with mock.patch.object(kernel, "run", timed):
                    return fly()

            def says(_: Any, spent: list = spent, step: float = step) -> str:
                work = 4.0 * round(SECONDS / step) * count
                return f"{work / min(spent[1:]):.3g}/s within the kernel"

            work = 4.0 * round(SECONDS / step) * count
            yield Row(f"{label}, {1e3 * step:g} ms", work, call, says, 3)


def events() -> Iterator[Row]:
    """Give ways from frames to events: a bright disc that grows, as a fireball does."""
    count, height, width = 512, 260, 346
    times = np.arange(count) / 1000.0
    y, x = np.mgrid[:height, :width]
    away = np.hypot(x - width / 2, y - height / 2)
    edges = 3.0 + 104.0 * (1.0 - np.exp(-times / 0.4))
    opacity = np.stack([1.0 / (1.0 + np.exp(away - edge)) for edge in edges])
    bright = (0.16 + opacity * (200 / 255 - 0.16)).astype(np.float32)
    grey, both = np.round(255 * bright).astype(np.uint8), (0.2, 0.2)
    colour = np.repeat(grey[..., None], 4, axis=-1)
    copy = np.empty_like(colour)

    def streamed(frames: np.ndarray, pixel: Any) -> int:
        blocks = ((times[a : a + 32], frames[a : a + 32]) for a in range(0, count, 32))
        return sum(int(part.count) for part in event_stream(blocks, pixel))

    compiled = jax.jit(
        lambda logs, clock: pixel_events(logs, clock, Pixel(*both), capacity=1 << 17)[0]
    )
    few = jnp.log(bright[:64]), jnp.asarray(times[:64], jnp.float32)
    flawed = noisy_pixel(jax.random.key(0), both, NoiseModel(), (height, width))
    work, said = float(grey.size), "{:,} events".format
    yield Row("copied, RGBA of 8 bits", work, lambda: np.copyto(copy, colour))
    for label, frames, pixel in (
        ("converted, grey of 8 bits", grey, Pixel(*both)),
        ("converted, float32", bright, Pixel(*both)),
        ("grey of 8 bits, all imperfections", grey, flawed),
    ):
        yield Row(label, work, partial(streamed, frames, pixel), said, 3)
    yield Row("by JAX, whole frames", few[0].size, lambda: compiled(*few))


def views() -> Iterator[Row]:
    """Give frames of 15 kg from 40 m away, from the burst until the fire is out."""
    if not on_gpu():
        for label, wide, ball in (
            ("nearest view, double", True, False),
            ("nearest view, single", False, False),
            ("smooth ball, single", False, True),
        ):
            with jax.enable_x64(wide):
                film = filmed(64)
                call = partial(
                    render,
                    film.scene,
                    film.camera,
                    film.times,
                    views=None if ball else explosion_views(),
                    appearance=film.appearance,
                )
                yield Row(label, len(film.times), call, repeats=3)
        return
    film, batch = filmed(2048, flash=False), 256
    shipped = explosion_views(towards=np.asarray(film.camera.position))
    view = view_of(
        film.scene,
        film.camera,
        BACKGROUND,
        views=shipped,
        appearance=film.appearance,
        dtype=jnp.float32,
        reverse=False,
    )

    @eqx.filter_jit
    def frames(view: Any, moments: Array, grey: bool) -> Array:
        seen = jnp.moveaxis(jax.vmap(lambda at: light(view, at))(moments), 1, -1)
        return luminance(seen) if grey else seen

    moments = jnp.asarray(film.times, jnp.float32).reshape(-1, batch)
    for label, grey in (("nearest view, RGB", False), ("nearest view, grey", True)):
        call = partial(lambda g: [frames(view, m, g) for m in moments][-1], grey)
        yield Row(label, len(film.times), call, repeats=3)


def world() -> Iterator[Row]:
    """Give parts of a world of 10 kg, and all of them beside each other.

    They go off 60 m from a camera of 346 x 260 pixels at 100 frames/s, 30 m from a
    microphone at 48 kHz and a Hummingbird that holds its place, steps of 1 ms.
    """
    place, eye = (0.0, 0.0, 10.0), np.array([-30.0, 0.0, 2.0])
    spec = VehicleSpec("hummingbird", np.array(place), integral=True)
    scene = Scene(Charge(10.0, (30.0, 0.0, 0.0), 0.2), vehicle=spec)
    camera = Camera(
        position=eye,
        quaternion=look_at(eye, np.array([30.0, 0.0, 5.0])),
        focal=np.array([260.0, 260.0]),
        center=np.array([172.5, 129.5]),
        width=346,
        height=260,
    )
    times = np.arange(100) / 100.0
    film = Film(scene, camera, times)
    ear = Sensor("ear", jnp.array(place), "pressure", instrument=Instrument(rate=48e3))

    def pictures() -> int:
        blocks = ((times[n], luminance(x)) for n, x in film.frames())
        found = event_stream(blocks, Pixel(0.2, 0.2), workers=1)
        return sum(int(e.count) for e in found)

    @jax.jit
    def sound(charge: Charge) -> Any:
        return recording(Scene(charge), ear, jax.random.key(0)).samples(1.0)

    fly = partial(
        simulate,
        vehicle_of(spec),
        start_of(spec),
        duration_s=1.0,
        step_s=1e-3,
        control=hold_of(spec, integral=True),
        loads=(blast_load(scene),),
    )
    by_warp = partial(fly, backend="warp:cpu")
    pool = ThreadPoolExecutor(2)

    def whole(fly: Callable[[], Any]) -> Any:
        seen = pool.submit(pictures)
        felt = pool.submit(lambda: (fly(), sound(scene.charge)))
        return seen.result(), felt.result()[0].position_m

    for label, call in (
        ("frames and events", pictures),
        ("sound, 48 kHz", lambda: sound(scene.charge)),
        ("path, 1 kHz, JAX", fly),
        ("path, 1 kHz, Warp", by_warp),
        ("all of it, path by JAX", partial(whole, fly)),
        ("all of it, path by Warp", partial(whole, by_warp)),
    ):
        yield Row(label, 1.0, call, repeats=7)


EPISODES = WorldSpec(
    occurrence=ByCount(2),
    region=Ring(12.0, 40.0),
    about="vehicle",
    mass=Uniform(5.0, 15.0),
    time=Uniform(0.5, 8.0),
)


def environments(steps: int = 200) -> Iterator[Row]:
    """Give Hover with two blasts in each episode of 10 s, hold asked every step."""
    params = environment_params("Hover", command="hold", world=EPISODES)
    devices = len(jax.devices())
    for lanes, chunk in [(2**20, 2**20)] if on_gpu() else [(4096, 512), (4096, 2048)]:

        def of_chunk(
            params: EnvironmentParams, states: EnvironmentState, chunk: int = chunk
        ) -> Any:
            def one(carried: tuple, _: None) -> tuple[tuple, None]:
                states, seen, earned = carried
                found = step_lanes(states, 0.1 * seen[:, :3], params)
                return (found.state, found.observation, earned + found.reward), None

            none = jnp.zeros(chunk, params.step_s.dtype)
            first = states, jnp.zeros((chunk, 18), params.step_s.dtype), none
            (states, _, earned), _ = jax.lax.scan(one, first, None, length=steps)
            return states, earned

        # of states and params: known to XLA they undo the branches of a step
        def run(states: EnvironmentState, params: EnvironmentParams) -> Any:
            of = partial(of_chunk, params)
            return in_chunks(of, states, chunk, devices)  # noqa: B023

        states, _ = jax.jit(reset_lanes)(jax.random.key(0), jnp.arange(lanes), params)
        through = jnp.arange(lanes) * int(params.episode_steps) // lanes
        states = states._replace(steps=through.astype(jnp.int32))
        compiled: Any = eqx.filter_jit(run, **WIDE)
        program = compiled.lower(states, params).compile()
        call = partial(program, states, params)
        yield Row(
            f"steps/s, {lanes:,} lanes in chunks of {chunk:,}", lanes * steps, call
        )


SUBJECTS: dict[str, Callable[[], Iterator[Row]]] = {
    "laws": laws,
    "fit_many": fits,
    "picks": picks,
    "flights": flights,
    "flight_kernel": flight_kernel,
    "events": events,
    "views": views,
    "world": world,
    "environments": environments,
}


def table(rows: Iterator[Row]) -> list[str]:
    """Measure, and return rates by the wall and by the processors' time."""
    lines = [["", "of a second", "of a core-second", ""]]
    for row in rows:
        spent: list[float] = []

        def call(row: Row = row, spent: list[float] = spent) -> Any:
            begun = time.process_time()
            answer = jax.block_until_ready(row.call())
            spent.append(time.process_time() - begun)
            return answer

        wall, answer = best_of(call, row.repeats)
        cores = row.work / max(min(spent[1:]), 1e-9)
        rates = f"{row.work / wall:.3g}", f"{cores:.3g}"
        lines.append([row.label, *rates, row.says(answer)])
    return aligned(lines, right={1, 2})


def main() -> None:
    """Run the subjects named, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("subject", nargs="*", choices=[*SUBJECTS, "study", []])
    asked = parser.parse_args().subject or [*SUBJECTS, "study"]
    for name in asked:
        if name == "study":
            words = [sys.executable, "-m", "calibration.benchmark_study"]
            subprocess.run(words, check=True)
            continue
        print(f"{name}: {machine()}, load average {os.getloadavg()[0]:.1f}\n")
        print(*table(SUBJECTS[name]()), "", sep="\n", flush=True)


if __name__ == "__main__":
    main()
