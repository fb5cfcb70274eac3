"""A million vehicles at once: the kernel of Warp, beside JAX on the same machine.

Crazyflies at rest 4 to 6.5 m from a charge of their own, 0.5 to 2 kg of TNT on the
ground, each holding its place with integral action for 2.5 s, asked every 4 ms, the
ground below. The error is of a thousand of them, the largest distance over the flight
(rows every 20 ms) from the same kernel in float64 at steps of 0.1 ms.
"""

import time
from collections.abc import Callable
from typing import Any
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np

from jblast.fidelity.timing import best_of
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Each,
    PositionHold,
    State,
    Trajectory,
    blast_load,
    named,
    named_gains,
    simulate,
)

COUNT, CHECKED, SECONDS = 1_000_000, 1000, 2.5
HELD_S, ROWS_S, FINE_S = 4e-3, 0.02, 1e-4
REPEATS = 3
CASES = (
    ("float32, with blasts", {"step_s": 4e-3}),
    ("float32, with blasts", {"step_s": 2e-3}),
    ("float32, with blasts", {"step_s": 1e-3}),
    ("float32, with blasts", {"step_s": 5e-4}),
    ("  of vehicles of their own", {"step_s": 1e-3, "own": True}),
    ("  by Euler", {"step_s": 1e-3, "integrator": "euler"}),
    ("float32, no blast", {"step_s": 1e-3, "blasts": False}),
    ("float64, with blasts", {"step_s": 1e-3, "dtype": "float64"}),
    ("JAX, float32, with blasts", {"step_s": 1e-3, "backend": "jax"}),
)


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
    step, integrator = case["step_s"], case.get("integrator", "rk4")
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
    stages = 4 if integrator == "rk4" else 1
    rate = count * round(SECONDS / step) * stages / kernel
    return (
        f"{label:28}{1e3 * step:8.3g}{1e3 * error:10.3g}{rate:12.3g}"
        f"{count * SECONDS / kernel:12.3g}{count * SECONDS / whole:18.3g}"
    )


def flights(
    count: int,
    *,
    step_s: float,
    dtype: str = "float32",
    integrator: str = "rk4",
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
    hold = Each(PositionHold(state.position_m, gains, jnp.zeros(count)))

    def load(mass):
        return blast_load(Scene(charge=Charge(mass_kg=mass, time_s=0.05)))

    loads = (Each(jax.vmap(load)(mass)),) if blasts else ()

    def fly(store_every: int = 10**9) -> Trajectory:
        return simulate(
            all_alike(vehicle) if own else vehicle,
            state,
            duration_s=SECONDS,
            step_s=step_s,
            integrator=integrator,
            control=hold,
            command_step_s=HELD_S,
            loads=loads,
            ground_up_m=0.0,
            store_every=store_every,
            backend=backend,
        )

    return fly


def _seconds(fly: Callable[[], Trajectory]) -> tuple[float, float]:
    """Return how long the kernel takes, and the whole call: the best of several."""
    from jblast.vehicle.warp.flight import KernelFlight

    spent: list[float] = []
    launch = KernelFlight.fly

    def timed(self: KernelFlight) -> None:
        start = time.perf_counter()
        launch(self)
        spent.append(time.perf_counter() - start)

    with mock.patch.object(KernelFlight, "fly", timed):
        whole, _ = best_of(fly, REPEATS)
    return min(spent[1:] or [whole]), whole  # the first call compiles
