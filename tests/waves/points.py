"""All laws with points to evaluate them at, in NumPy and in JAX."""

from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves  # noqa: F401  registers the laws
from jblast.constants import STANDARD_PRESSURE, TNT_SPECIFIC_ENERGY
from jblast.registry import LAWS, Law
from jblast.waves.laws.kinney_graham import EVERYWHERE, FIRST_ARRIVAL
from jblast.waves.laws.negative_phase_rigby import DURATION, IMPULSE, PRESSURE
from jblast.waves.laws.negative_phase_ufc import FIRST, LAST
from jblast.waves.laws.point_source import ENDS, LENGTH, SPAN
from jblast.waves.laws.sadovsky import RANGE
from jblast.waves.laws.sedov_taylor import EARLIEST_TIME
from jblast.waves.laws.shock_kinematics import END_OF_TABLE, JOIN
from jblast.waves.tables import BLEND_WIDTH, data_rows

WORDS = {"burst": ("surface", "free-air"), "ground_path": ("head", "thesis")}
"""Arguments that are words, and their values; a law has at most one."""


def word_of(law: Law) -> str:
    return next((name for name in WORDS if name in law.arguments()), "")


OF_WAVES = {
    key
    for key, law in LAWS.items()
    if law.function.__module__.startswith("jblast.waves")
}
"""Laws of this package: not those of vehicles, and of the thesis."""
every_law = pytest.mark.parametrize(
    ("law", "word"),
    [
        pytest.param(law, word, id=f"{law.quantity}-{law.name}-{word or 'any'}")
        for law in LAWS.values()
        if (law.quantity, law.name) in OF_WAVES
        for word in WORDS.get(word_of(law), ("",))
    ],
)


def points(z: np.ndarray, mass: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Return numbers of a path at scaled distances and masses; the rest is drawn."""
    rng = np.random.default_rng(seed)

    def draw(low: float, high: float) -> np.ndarray:
        return rng.uniform(low, high, z.shape)

    pressure, density = draw(5e4, 1.05e5), draw(0.7, 1.3)
    distance = z * (mass / (pressure / STANDARD_PRESSURE)) ** (1 / 3)
    # the time at which a strong shock (alpha = 1) is there
    time = np.sqrt(density * distance**5 / (TNT_SPECIFIC_ENERGY * mass))
    return {
        "slant_range": distance,
        "ground_range": distance,
        "charge_mass": mass,
        "height_of_burst": draw(-0.3, 2.0) * mass ** (1 / 3),
        "ambient_pressure": pressure,
        "sound_speed": draw(300.0, 360.0),
        "air_density": density,
        "p_speed": draw(2e3, 6e3),
        "sedov_gamma": draw(1.15, 1.65),
        "time_since_detonation": time,
        "sensor_height": draw(0.1, 5.0),
        "temperature": draw(255.0, 320.0),
        "relative_humidity": draw(0.05, 0.95),
        "toward_east": draw(0.1, 1.0) * distance,
        "toward_north": draw(0.1, 1.0) * distance,
        "toward_up": draw(0.1, 1.0) * distance,
        "fireball_growth": draw(3e-4, 3e-3) * mass ** (1 / 3),
        "camera_focal": draw(1e2, 1e4),
    }


def grid(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Return Z from 0.01 to 1e5 with masses from 0.1 g to 1 Mt, evenly in ln."""
    rng = np.random.default_rng(seed + 1)
    z = np.geomspace(0.01, 1e5, count)
    return points(z, rng.permutation(np.geomspace(1e-4, 1e9, count)), seed)


JOINS = sorted(
    {
        float(row[end])
        for table in ("kingery_bulmash", "swisdak_1994")
        for row in data_rows(table)
        for end in ("z_min", "z_max")
    }
    | {
        first
        for printed in (PRESSURE, IMPULSE, DURATION)
        for segments in printed.values()
        for first, _ in segments
    }
    | {LENGTH * end for end in ENDS}
    | {JOIN, END_OF_TABLE * np.sqrt(1 + BLEND_WIDTH), FIRST, LAST, *RANGE}
    | {FIRST_ARRIVAL, 0.5, 300.0, *SPAN, *EVERYWHERE}
)
"""Scaled distances where a curve has a segment or an end, or where its curvature
jumps."""


@cache
def sweep() -> dict[str, np.ndarray]:
    """Return the grid, its corners and both sides of the joins of all curves."""
    corners = points(np.repeat([0.01, 1e5], 2), np.tile([1e-4, 1e9], 2))
    beside = np.array([1 - 1e-9, 1.0, 1 + 1e-9])
    sides = np.outer(JOINS, beside).ravel()
    at_joins = points(sides, np.full(sides.size, 3.0), seed=2)
    times = np.resize(EARLIEST_TIME * np.cbrt(3.0) * beside, sides.size)
    at_joins["time_since_detonation"] = times
    parts = grid(400), corners, at_joins
    return {name: np.concatenate([p[name] for p in parts]) for name in corners}


def numbers(law: Law) -> list[str]:
    """Return the names of a law's arguments that are numbers."""
    return [name for name in law.arguments() if name not in WORDS]


def evaluated(law: Law, word: str, values: dict[str, Any]) -> Any:
    """Return a law at values: of NumPy, or of JAX."""
    chosen = {name: values[name] for name in numbers(law)}
    return law.function(**chosen, **({word_of(law): word} if word else {}))


def shifted(values: dict, steps: dict, exp=jnp.exp) -> dict:
    """Move each number by a step in its ln; heights by a step in W^(1/3) metres."""
    moved = {name: values[name] * exp(step) for name, step in steps.items()}
    if "height_of_burst" in steps:
        unit = values["charge_mass"] ** (1 / 3)
        moved["height_of_burst"] = (
            values["height_of_burst"] + steps["height_of_burst"] * unit
        )
    return {**values, **moved}


@cache
def compiled(law: Law, word: str, curved: bool = False):
    """Return the program of ln y and its slopes; or of their change along all."""

    def log_value(steps, values):
        return jnp.log(evaluated(law, word, shifted(values, steps)))

    def value_and_slopes(values):
        nothing = dict.fromkeys(numbers(law), 0.0)
        return jax.value_and_grad(log_value)(nothing, values)

    def curvatures(values):
        nothing = dict.fromkeys(numbers(law), 0.0)
        along_all = dict.fromkeys(numbers(law), 1.0)
        slopes = jax.grad(log_value)
        return jax.jvp(lambda x: slopes(x, values), (nothing,), (along_all,))[1]

    return jax.jit(jax.vmap(curvatures if curved else value_and_slopes))
