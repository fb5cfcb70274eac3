"""Evaluations of the laws a second, and what a loop in plain Python makes of them.

One evaluation is one law at one range, mass, pressure and sound speed. Each law is
compiled once over an array; on a CPU one part of it runs on each core. The plain loop
is Swisdak's arrival and pressure, point by point with `math.log` and `math.exp`: what
the public packages of these fits do.
"""

import math
import os
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec
from jaxtyping import Array

from calibration.timing import best_of
from jblast import waves
from jblast.waves.tables import data_rows

POINTS = 1 << 22
REPEATS = 7
LOOPED = 20_000

Law = Callable[..., Array | tuple[Array, ...]]


def both(slant_range, charge_mass, ambient_pressure, sound_speed):
    """Arrival and pressure by Kingery and Bulmash: two evaluations."""
    air = slant_range, charge_mass, ambient_pressure
    return (
        waves.kingery_bulmash_arrival_time(*air, sound_speed),
        waves.kingery_bulmash_pressure(*air),
    )


LAWS: dict[str, tuple[Law, int, int]] = {
    "arrival + pressure, Kingery-Bulmash": (both, 4, 2),
    "arrival, Kingery-Bulmash": (waves.kingery_bulmash_arrival_time, 4, 1),
    "pressure, Kingery-Bulmash": (waves.kingery_bulmash_pressure, 3, 1),
    "arrival, shock kinematics": (waves.shock_kinematics_arrival_time, 4, 1),
    "pressure, shock kinematics": (waves.shock_kinematics_pressure, 3, 1),
    "pressure, Kinney-Graham": (waves.kinney_graham_pressure, 3, 1),
    "pressure, Swisdak": (waves.swisdak_pressure, 3, 1),
    "pressure, DNA 1 kt": (waves.dna_1kt_pressure, 3, 1),
    "pressure, point source": (waves.point_source_pressure, 3, 1),
    "arrival, Wu-Hao": (
        lambda r, w, _, c: waves.wu_hao_air_arrival_time(r, w, c),
        4,
        1,
    ),
}
"""Law, number of its arguments, evaluations it counts as."""


def laws_text() -> str:
    """Measure and return the table."""
    device = jax.devices()[0]
    points = POINTS if device.platform == "cpu" else 16 * POINTS
    name = device.device_kind if device.platform == "gpu" else f"{os.cpu_count()} cores"
    columns = {"float64": jnp.float64, "float32": jnp.float32}
    rates = {
        law: [count * rate(f, n, points, dtype) for dtype in columns.values()]
        for law, (f, n, count) in LAWS.items()
    }
    loop = looped_rate()
    lines = [
        f"Evaluations a second: {device.platform}, {name}, jax {jax.__version__}, "
        f"{points:,} points a call",
        "",
        f"{'':36}" + "".join(f"{c:>10}" for c in columns) + f"{'over loop':>12}",
    ]
    for law, values in rates.items():
        row = "".join(f"{value:10.2g}" for value in values)
        lines.append(f"{law:36}{row}{values[0] / loop:12,.0f}")
    lines.append(f"{'arrival + pressure, Swisdak, a loop':36}{loop:10.2g}")
    if device.platform != "cpu":
        lines += ["", f"Largest difference to this machine's CPU: {apart(device):.1e}"]
    return "\n".join(lines)


def apart(device: Any) -> float:
    """Return the largest relative difference of any law between a device and a CPU."""
    worst = 0.0
    with jax.enable_x64(True):
        for law, n, _ in LAWS.values():
            there, here = (
                np.asarray(jax.jit(law)(*jax.device_put(draws(4096)[:n], where)))
                for where in (device, jax.devices("cpu")[0])
            )
            worst = max(worst, float(np.max(np.abs(there / here - 1.0))))
    return worst


def rate(law: Law, arguments: int, points: int, dtype) -> float:
    """Return calls of a law a second, over all points; the best of several."""
    with jax.enable_x64(dtype == jnp.float64):
        inputs = [jnp.asarray(x, dtype) for x in draws(points)[:arguments]]
        if len(jax.devices()) > 1:
            mesh = jax.make_mesh((len(jax.devices()),), ("part",))
            spread = NamedSharding(mesh, PartitionSpec("part"))
            inputs = [jax.device_put(x, spread) for x in inputs]
        compiled = jax.jit(law).lower(*inputs).compile()
        return points / best_of(lambda: compiled(*inputs), REPEATS)[0]


def draws(points: int) -> tuple[np.ndarray, ...]:
    """Ranges, masses, pressures and sound speeds with Z from 0.07 to 40."""
    rng = np.random.default_rng(0)
    mass = np.exp(rng.uniform(math.log(1e-2), math.log(1e6), points))
    z = np.exp(rng.uniform(math.log(0.07), math.log(40.0), points))
    pressure = rng.uniform(7e4, 1.05e5, points)
    distance = z * np.cbrt(mass * 101325.0 / pressure)
    return distance, mass, pressure, rng.uniform(320.0, 350.0, points)


def looped_rate() -> float:
    """Evaluations a second of a loop in plain Python."""
    ranges, masses, *_ = (x.tolist() for x in draws(LOOPED))
    curves = [
        [
            (math.log(float(row["z_max"])), [float(row[c]) for c in "GFEDCBA"])
            for row in data_rows("swisdak_1994")
            if row["quantity"] == quantity
        ]
        for quantity in ("arrival_time", "incident_pressure")
    ]
    start = time.perf_counter()
    for slant_range, mass in zip(ranges, masses, strict=True):
        log_z = math.log(slant_range / mass ** (1 / 3))
        for curve in curves:
            ends, value = (end for end, _ in curve), 0.0
            segment = sum(log_z > end for end in ends) % len(curve)
            for coefficient in curve[segment][1]:
                value = value * log_z + coefficient
            math.exp(value)
    return 2 * LOOPED / (time.perf_counter() - start)
