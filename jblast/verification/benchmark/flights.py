"""Flights: cost of each step, against the greatest position error.

The vehicles are independent Crazyflies in two cases. In the first they start with
random velocities and body rates in an oscillating wind, at constant rotor speeds. In
the second a controller holds the position through the blast of 1 kg of TNT; its period
is 10 ms whatever the step. The reference is RK4 in float64 with a step of 0.05 ms.
"""

from collections.abc import Sequence
from functools import partial
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
"""Vehicles in a batch, few enough that one core integrates them together."""
# Two periods of the slowest wind, 0.6 Hz, and the return of a vehicle after the blast.
DURATION = 2.5
"""Duration of a flight [s]."""
PERIOD = 10e-3
"""Period of the controller and of the compared rows [s]."""
# Half the smallest compared step: with RK4 its error is 16 times smaller.
REFERENCE_STEP = 5e-5
"""Step of the reference flights [s]."""
STEPS = (1e-4, 5e-4, 2e-3, 5e-3, 1e-2)
"""Steps of the flights in the wind [s]; each divides `PERIOD`."""
BLAST_STEPS = (5e-4, 2e-3, 1e-2)
"""Steps of the flights in the blast [s]; each needs 10 s of compilation."""
DTYPES = ("float64", "float32")
HOME = (0.0, 0.0, 5.0)
"""Target position [m]."""
HOVER_SPEED = 1788.5
"""Rotor speed of a hovering Crazyflie [rad/s]."""


class Case(NamedTuple):
    """Flights that every method repeats.

    Attributes:
        name: Name for the chart.
        state: Initial states.
        steps: Steps of the integrators, in rising order [s].
        options: Options of `simulate`.
    """

    name: str
    state: State
    steps: tuple[float, ...]
    options: dict


def swinging_wind(
    time_s: Float[Array, ""], position_m: Float[Array, "3"]
) -> Float[Array, "3"]:
    """Return a wind that oscillates at 1 and 0.6 Hz, with a phase by height [m/s]."""
    fast = jnp.sin(2 * jnp.pi * time_s + 0.1 * position_m[2])
    slow = jnp.cos(1.2 * jnp.pi * time_s)
    return jnp.stack([5 * fast, 4 * slow, fast * slow])


def cases(count: int = VEHICLES) -> list[Case]:
    """Return the two cases, drawn from a seed.

    Args:
        count: Number of vehicles.
    """
    rng = np.random.default_rng(0)
    home, still = np.tile(HOME, (count, 1)), np.zeros((count, 3))
    level = np.tile([0.0, 0, 0, 1], (count, 1))
    hover = np.full((count, 4), HOVER_SPEED)
    body_rate = rng.uniform(-2.0, 2.0, (count, 3))
    moving = State(home, rng.uniform(-2.0, 2.0, (count, 3)), level, body_rate, hover)
    offset = rng.uniform([-2.0, -2.0, -1.0], [2.0, 2.0, 1.0], (count, 3))
    controlled = State(home + offset, still, level, still, hover)
    hold = PositionHold(HOME, named_gains("crazyflie"))
    blast = blast_load(
        Scene(
            charge=Charge(
                mass_kg=1.0, position_m=(8.0, 0.0, 1.0), time_s=0.1, burst="surface"
            )
        )
    )
    return [
        Case("swinging wind", moving, STEPS, {"wind": swinging_wind}),
        Case(
            "blast, held in place",
            controlled,
            BLAST_STEPS,
            {"control": hold, "loads": (blast,), "command_step_s": PERIOD},
        ),
    ]


def fly(case: Case, step: float, dtype: str) -> Trajectory:
    """Fly a case; a row is stored every `PERIOD`.

    Args:
        case: Initial states and options.
        step: Step of the integrator [s].
        dtype: Precision of the flight.
    """
    return simulate(
        named("crazyflie"),
        jax.tree.map(lambda x: x.astype(dtype), case.state),
        duration_s=DURATION,
        step_s=step,
        store_every=round(PERIOD / step),
        **case.options,
    )


def farthest(found: Trajectory, truth: Trajectory) -> float:
    """Return the largest distance between two flights of a batch [m]."""
    error = np.asarray(found.position_m, float) - np.asarray(truth.position_m)
    return float(np.linalg.norm(error, axis=-1).max())


def order(errors: Sequence[float], steps: Sequence[float]) -> float:
    """Return the order of an integrator: the steepest slope between two steps.

    Rounding flattens it at the smallest steps, the limit of stability at the largest.

    Args:
        errors: Error at each step.
        steps: Steps in rising order [s].
    """
    return float(np.max(np.diff(np.log(errors)) / np.diff(np.log(steps))))


def flight_points(
    count: int = VEHICLES,
    repeats: int = 1,
) -> list[BenchmarkPoint]:
    """Return the cost of a second of flight at each step, and the largest error.

    Args:
        count: Vehicles in each case.
        repeats: Number of timed repetitions.
    """
    progress, points = in_words(), []
    for case in cases(count):
        progress(f"{case.name}, the reference")
        truth = fly(case, REFERENCE_STEP, "float64")
        for dtype in DTYPES:
            measured = []
            for step in case.steps:
                progress(f"{case.name}, RK4 {1e3 * step:g} ms, {dtype}")
                flight = partial(fly, case, step, dtype)
                took, found = best_of(flight, repeats)
                measured.append((took / (count * DURATION), farthest(found, truth)))
            slope = order([error for _, error in measured], case.steps)
            points += [
                BenchmarkPoint(
                    f"RK4 {1e3 * step:g} ms",
                    cost,
                    1e3 * error,
                    f"{dtype}, {case.name}; measured order {slope:.1f}",
                    f"{case.name}, {dtype}",
                )
                for step, (cost, error) in zip(case.steps, measured, strict=True)
            ]
    return points


register_benchmark(
    Benchmark(
        name="vehicle",
        title="Flights: cost against error",
        cost=f"time of a second of flight, one of {VEHICLES} Crazyflies at once",
        error=f"largest distance from the reference over {DURATION:g} s [mm]",
        measure=flight_points,
        relative=False,
        orders={"RK4": 4},
    )
)
