"""Flights: cost of each integrator and step, against the greatest position error.

The vehicles are independent Crazyflies in two cases. In the first they start with
random velocities and body rates in an oscillating wind, at constant rotor speeds. In
the second a controller holds the position through the blast of 1 kg of TNT; its period
is 10 ms whatever the step. The reference is RK4 in float64 with a step of 0.05 ms.
"""

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.fidelity.timing import best_of
from jblast.progress import in_words
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    PositionHold,
    State,
    Trajectory,
    blast_load,
    named,
    named_gains,
    simulate,
)
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)

VEHICLES = 64
"""Few enough that one core takes them at once."""
DURATION = 2.5
PERIOD = 10e-3
"""Of the controller, and between the rows that are compared [s]."""
FINEST = 5e-5
STEPS = (1e-4, 5e-4, 2e-3, 5e-3, 1e-2)
FEWER = (5e-4, 2e-3, 1e-2)
"""Of the blast: each step is a program of its own, which takes 10 s to compile."""
INTEGRATORS = {"RK4": "rk4", "Euler": "euler"}
DTYPES = ("float64", "float32")
HOME = (0.0, 0.0, 5.0)


class Case(NamedTuple):
    """Flights that every way is to repeat: their starts and what acts on them.

    Attributes:
        name: In words.
        state: Where each begins.
        steps: Of the integrators, from small to large [s].
        options: Of `simulate`.
    """

    name: str
    state: State
    steps: tuple[float, ...]
    options: dict


def swinging_wind(
    time_s: Float[Array, ""], position_m: Float[Array, "3"]
) -> Float[Array, "3"]:
    """Air that swings at 1 and 0.6 Hz, and slower where it is higher [m/s]."""
    fast = jnp.sin(2 * jnp.pi * time_s + 0.1 * position_m[2])
    slow = jnp.cos(1.2 * jnp.pi * time_s)
    return jnp.stack([5 * fast, 4 * slow, fast * slow])


def cases(count: int = VEHICLES) -> list[Case]:
    """Return the two cases, drawn from a seed.

    Args:
        count: How many vehicles.
    """
    rng = np.random.default_rng(0)
    home, still = np.tile(HOME, (count, 1)), np.zeros((count, 3))
    level, hover = np.tile([0.0, 0, 0, 1], (count, 1)), np.full((count, 4), 1788.5)
    turning = rng.uniform(-2.0, 2.0, (count, 3))
    thrown = State(home, rng.uniform(-2.0, 2.0, (count, 3)), level, turning, hover)
    away = rng.uniform([-2.0, -2.0, -1.0], [2.0, 2.0, 1.0], (count, 3))
    held = State(home + away, still, level, still, hover)
    hold = PositionHold(HOME, named_gains("crazyflie"))
    blast = blast_load(
        Scene(
            charge=Charge(
                mass_kg=1.0, position_m=(8.0, 0.0, 1.0), time_s=0.1, burst="surface"
            )
        )
    )
    return [
        Case("swinging wind", thrown, STEPS, {"wind": swinging_wind}),
        Case(
            "blast, held in place",
            held,
            FEWER,
            {"control": hold, "loads": (blast,), "command_step_s": PERIOD},
        ),
    ]


def fly(case: Case, integrator: str, step: float, dtype: str) -> Trajectory:
    """Fly a case; a row is stored every `PERIOD`.

    Args:
        case: Which.
        integrator: "rk4" or "euler".
        step: Its step [s].
        dtype: Precision of the flight.
    """
    return simulate(
        named("crazyflie"),
        jax.tree.map(lambda x: x.astype(dtype), case.state),
        duration_s=DURATION,
        step_s=step,
        integrator=integrator,
        store_every=round(PERIOD / step),
        **case.options,
    )


def farthest(found: Trajectory, truth: Trajectory) -> float:
    """Return the greatest distance between two flights of a batch [m]."""
    off = np.asarray(found.position_m, float) - np.asarray(truth.position_m)
    return float(np.linalg.norm(off, axis=-1).max())


def order(errors: Sequence[float], steps: Sequence[float]) -> float:
    """Return the order of an integrator: the steepest slope between two steps.

    Rounding flattens it at the smallest steps, the limit of stability at the largest.

    Args:
        errors: Of each step.
        steps: The steps, from small to large.
    """
    return float(np.max(np.diff(np.log(errors)) / np.diff(np.log(steps))))


def flight_points(
    count: int = VEHICLES,
    repeats: int = 1,
) -> list[BenchmarkPoint]:
    """Return what a second of flight costs at each step, and the largest error.

    Args:
        count: Vehicles in each case.
        repeats: How often each is timed.
    """
    tell = in_words()
    return [
        point for case in cases(count) for point in _points(case, tell, count, repeats)
    ]


def _points(
    case: Case, tell: Callable[[str], None], count: int, repeats: int
) -> Iterator[BenchmarkPoint]:
    tell(f"{case.name}, the truth")
    truth = fly(case, "rk4", FINEST, "float64")
    for dtype in DTYPES:
        for words, integrator in INTEGRATORS.items():
            measured = []
            for step in case.steps:
                tell(f"{case.name}, {words} {1e3 * step:g} ms, {dtype}")
                way = functools.partial(fly, case, integrator, step, dtype)
                took, found = best_of(way, repeats)
                measured.append((took / (count * DURATION), farthest(found, truth)))
            slope = order([error for _, error in measured], case.steps)
            for step, (cost, error) in zip(case.steps, measured, strict=True):
                yield BenchmarkPoint(
                    f"{words} {1e3 * step:g} ms",
                    cost,
                    1e3 * error,
                    f"{dtype}, {case.name}; measured order {slope:.1f}",
                    f"{case.name}, {dtype}",
                )


register_benchmark(
    Benchmark(
        name="vehicle",
        title="Flights: cost against error",
        cost=f"time of a second of flight, one of {VEHICLES} Crazyflies at once",
        error=f"largest distance from the truth over {DURATION:g} s [mm]",
        measure=flight_points,
        relative=False,
        orders={"RK4": 4, "Euler": 1},
    )
)
