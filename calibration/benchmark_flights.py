"""Right-hand sides a second of flights, at a step whose error stays below 1 mm.

    python -m calibration.benchmarks flights > calibration/results/benchmark_flights.txt
    python -m calibration.benchmarks flight_kernel
        > calibration/results/benchmark_flight_kernel.txt

Crazyflies near a charge of 1 kg, 2.5 s each; their hold is asked every 4 ms. The error
is that of one of them, 5 m from the charge and held there through its blast, in
float64: the largest distance over the flight from the same flight at 0.1 ms. The rates
are those of batches, the start of the program's compilation not counted, by the wall
clock, the best of a few; all devices of JAX take part. A step of RK4 takes four
right-hand sides.

The gradient: of the mean square distance from the target after 1 s, by the charge and
two gains, forwards (`jax.jacfwd`), against the flight itself.

Kernel: crazyflies at rest 4 to 6.5 m from a charge of their own, 0.5 to 2 kg of TNT on
the ground, each holding its place with integral action for 2.5 s, asked every 4 ms, the
ground below. The error is of a thousand of them, the largest distance over the flight
(rows every 20 ms) from the same kernel in float64 at steps of 0.1 ms.
"""

import os
import time
from collections.abc import Callable
from typing import Any
from unittest import mock

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from calibration.timing import best_of
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Gust,
    PositionHold,
    State,
    Trajectory,
    blast_load,
    friedlander,
    named,
    named_gains,
    simulate,
)

SECONDS, FINE_S = 2.5, 1e-4
HELD_S = 4e-3
STEPS_S = (4e-3, 2e-3, 1e-3, 5e-4)
"""Errors are those of all, rates those of the last."""
ROW_S = 0.1
"""Between rows of which the error is the largest: a whole number of every step."""
VEHICLES = 2048
REPEATS = 3
TARGET = [5.0, 0.0, 2.0]
GRADIENTS = ((1, 5e-3), (100, 1e-3))
"""Vehicles, and the step."""

Number = Float[Array, ""]


COUNT, CHECKED, ROWS_S = 1_000_000, 1000, 0.02
CASES = (
    ("float32, with blasts", {"step_s": 4e-3}),
    ("float32, with blasts", {"step_s": 2e-3}),
    ("float32, with blasts", {"step_s": 1e-3}),
    ("float32, with blasts", {"step_s": 5e-4}),
    ("  of vehicles of their own", {"step_s": 1e-3, "own": True}),
    ("float32, no blast", {"step_s": 1e-3, "blasts": False}),
    ("float64, with blasts", {"step_s": 1e-3, "dtype": "float64"}),
    ("JAX, float32, with blasts", {"step_s": 1e-3, "backend": "jax"}),
)


def starts(count: int, dtype: Any) -> State:
    """Return vehicles that hover within a metre of 5 m from the charge."""
    vehicle, rng = named("crazyflie"), np.random.default_rng(0)
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    near = rng.uniform(-0.5, 0.5, (count, 3)) * (np.arange(count) > 0)[:, None]
    level = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    still = np.zeros((count, 3))
    parts = (
        near + np.array([5.0, 0.0, 2.0]),
        still,
        level,
        still,
        np.full((count, 4), speed),
    )
    return State(*(part.astype(dtype) for part in parts))


def models() -> dict[str, dict[str, Any]]:
    """Return what acts on the vehicles, by name."""
    hold = PositionHold(TARGET, named_gains("crazyflie", integral=True))
    return {
        "plain": {},
        "hold, gust": {
            "control": hold,
            "control_period_s": HELD_S,
            "wind": Gust([30.0, 0.0, 0.0], 0.01, 0.02, friedlander),
        },
        "hold, blast": {
            "control": hold,
            "control_period_s": HELD_S,
            "loads": (blast_load(Scene(Charge(mass_kg=1.0))),),
        },
    }


def places(step_s: float, options: dict[str, Any]) -> Float[Array, "time 3"]:
    """Return the rows of one flight in float64."""
    one = jax.tree.map(lambda x: x[0], starts(1, np.float64))
    return simulate(
        named("crazyflie"),
        one,
        duration_s=SECONDS,
        step_s=step_s,
        store_every=round(ROW_S / step_s),
        **options,
    ).position_m


def errors(options: dict[str, Any]) -> dict[float, float]:
    """Return the error of each step [m]."""
    exact, found = places(FINE_S, options), {}
    for step in STEPS_S:
        apart = jnp.linalg.norm(places(step, options) - exact, axis=-1)
        found[step] = float(jnp.max(apart))
    return found


def rate(step_s: float, dtype: Any, options: dict[str, Any]) -> float:
    """Return right-hand sides a second."""
    state = starts(VEHICLES, dtype)
    steps = round(SECONDS / step_s)

    def fly() -> Any:
        return simulate(
            named("crazyflie"),
            state,
            duration_s=SECONDS,
            step_s=step_s,
            store_every=steps,
            **options,
        )

    return 4 * steps * VEHICLES / best_of(fly, REPEATS)[0]


def gradient_cost(vehicles: int, step_s: float) -> float:
    """Return how many flights in float64 the gradient takes, of one vehicle or many."""
    state = starts(vehicles, np.float64)
    if vehicles == 1:
        state = jax.tree.map(lambda x: x[0], state)
    gains = named_gains("crazyflie", integral=True)

    def off(mass: Number, near: Number, fast: Number) -> Number:
        """Return the mean square distance: of the charge, and of factors of gains."""
        scaled = (near * gains.position, fast * gains.velocity)
        own = eqx.tree_at(lambda g: (g.position, g.velocity), gains, scaled)
        flight = simulate(
            named("crazyflie"),
            state,
            duration_s=1.0,
            step_s=step_s,
            control=PositionHold(TARGET, own),
            loads=(blast_load(Scene(Charge(mass_kg=mass))),),
            store_every=round(1.0 / step_s),
        )
        away = flight.position_m[..., -1, :] - jnp.array(TARGET)
        return jnp.mean(jnp.sum(jnp.square(away), axis=-1))

    at = [jnp.asarray(1.0)] * 3
    run, slopes = jax.jit(off), jax.jit(jax.jacfwd(off, (0, 1, 2)))
    forward, flight = (best_of(lambda f=f: f(*at), REPEATS)[0] for f in (slopes, run))
    return forward / flight


def row(name: str, step_s: float, error_m: float, per_second: float) -> str:
    """Return a line of the table; the rate is that of right-hand sides of RK4."""
    seconds = per_second / 4 * step_s
    return f"{name:34s}{1e3 * step_s:9.3g}{1e3 * error_m:12.3g}" + (
        f"{per_second:14.3g}{seconds:16.3g}"
    )


def flights_text() -> str:
    """Measure and return the table."""
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    try:
        found = errors(models()["hold, blast"])
        step, error = STEPS_S[-1], found[STEPS_S[-1]]
        lines = [
            f"Flights: RK4, {VEHICLES:,} Crazyflies, {jax.default_backend()}, "
            f"{os.cpu_count()} cores, {len(jax.devices())} devices of JAX "
            f"{jax.__version__}, load average {os.getloadavg()[0]:.1f}",
            "  errors of hold and blast at "
            + ", ".join(f"{1e3 * h:g} ms: {1e3 * e:.2g} mm" for h, e in found.items()),
            f"{'':34s}step [ms]  error [mm]         rhs/s     vehicle-s/s",
        ]
        for dtype in (np.float32, np.float64):
            for name, options in models().items():
                # all at one step: the error is that of hold and blast
                full = f"JAX {np.dtype(dtype).name}, {name}"
                lines.append(row(full, step, error, rate(step, dtype, options)))
        lines += [
            f"gradient by charge and two gains, {count} for 1 s at {1e3 * step:g} ms: "
            f"{gradient_cost(count, step):.1f} flights"
            for count, step in GRADIENTS
        ]
        return "\n".join(lines)
    finally:
        jax.config.update("jax_enable_x64", before)


def flight_kernel_text(count: int = COUNT) -> str:
    """Measure and return the table."""
    with jax.enable_x64(True):
        rows = [_row(label, count, **case) for label, case in CASES]
    head = (
        f"Flights: {jax.devices()[0].device_kind}, jax {jax.__version__}, {count} "
        f"vehicles, {SECONDS:g} s\n"
        f"{'':28}{'step':>8}{'error':>10}{'right-hand':>12}{'vehicle-':>12}"
        f"{'the same, whole':>18}\n"
        f"{'':28}{'ms':>8}{'mm':>10}{'sides/s':>12}{'seconds/s':>12}{'call':>18}"
    )
    return "\n".join([head, *rows])


def _row(label: str, count: int, **case: Any) -> str:
    """Measure one way of flying."""
    step = case["step_s"]
    few, every = min(CHECKED, count), round(ROWS_S / step)
    fine = flights(
        few,
        step_s=FINE_S,
        dtype="float64",
        own=case.get("own", False),
        blasts=case.get("blasts", True),
    )
    near = flights(few, **case)(store_every=max(1, every))
    true = fine(store_every=round(max(ROWS_S, step) / FINE_S))
    error = float(jnp.max(jnp.linalg.norm(near.position_m - true.position_m, axis=-1)))
    kernel, whole = _seconds(flights(count, **case))
    rate = count * round(SECONDS / step) * 4 / kernel
    return (
        f"{label:28}{1e3 * step:8.3g}{1e3 * error:10.3g}{rate:12.3g}"
        f"{count * SECONDS / kernel:12.3g}{count * SECONDS / whole:18.3g}"
    )


def flights(
    count: int,
    *,
    step_s: float,
    dtype: str = "float32",
    backend: str = "warp",
    blasts: bool = True,
    own: bool = False,
) -> Callable[..., Trajectory]:
    """Return what flies a batch."""
    random = np.random.default_rng(0)
    vehicle = named("crazyflie")
    hover = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    place = random.uniform([4.0, -1.0, 1.0], [6.0, 1.0, 3.0], (count, 3))
    mass = jnp.asarray(random.uniform(0.5, 2.0, count), dtype)

    def all_alike(tree: Any) -> Any:
        return jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), tree)

    still = jnp.zeros((count, 3), dtype)
    level = jnp.tile(jnp.array([0.0, 0.0, 0.0, 1.0], dtype), (count, 1))
    speeds = jnp.full((count, 4), hover, dtype)
    state = State(jnp.asarray(place, dtype), still, level, still, speeds)
    gains = all_alike(named_gains("crazyflie", integral=True))
    hold = PositionHold(state.position_m, gains, jnp.zeros(count))

    def load(mass):
        return blast_load(Scene(Charge(mass_kg=mass, time_s=0.05)))

    loads = (jax.vmap(load)(mass),) if blasts else ()

    def fly(store_every: int = 10**9) -> Trajectory:
        return simulate(
            all_alike(vehicle) if own else vehicle,
            state,
            duration_s=SECONDS,
            step_s=step_s,
            control=hold,
            control_period_s=HELD_S,
            loads=loads,
            ground_up_m=0.0,
            store_every=store_every,
            backend=backend,
        )

    return fly


def _seconds(fly: Callable[[], Trajectory]) -> tuple[float, float]:
    """Return how long the kernel takes, and the whole call: the best of several."""
    from jblast.vehicle import kernel

    spent: list[float] = []
    run = kernel.run

    def timed(*arguments: Any, **options: Any) -> None:
        start = time.perf_counter()
        run(*arguments, **options)
        spent.append(time.perf_counter() - start)

    with mock.patch.object(kernel, "run", timed):
        whole, _ = best_of(fly, REPEATS)
    return min(spent[1:] or [whole]), whole  # the first call compiles
