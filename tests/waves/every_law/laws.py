"""Every law that importing jblast.waves registers, and points to try it at."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves  # noqa: F401 - registers them
from jblast.constants import STANDARD_PRESSURE, TNT_SPECIFIC_ENERGY
from jblast.registry import LAWS, Law

CHOICES = {"burst": ("surface", "free-air"), "ground_path": ("head", "thesis")}
"""Arguments that are words, and what they may say; a law has at most one."""


def words_of(law: Law) -> str | None:
    return next((name for name in CHOICES if name in law.arguments()), None)


CASES = [
    pytest.param(law, word, id=f"{law.quantity}-{law.name}-{word or 'any'}")
    for law in LAWS.values()
    if "jolt" not in law.arguments()  # those of a vehicle, sensors/jolt.py
    for word in CHOICES.get(words_of(law) or "", (None,))
]
every_law = pytest.mark.parametrize(("law", "word"), CASES)
STEP = 1e-5
SWEPT = 444
"""Points of `sweep`."""


def points(z: np.ndarray, mass: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Everything a path holds, at scaled distances and masses; the rest is drawn."""
    rng = np.random.default_rng(seed)

    def draw(lo: float, hi: float) -> np.ndarray:
        return rng.uniform(lo, hi, z.shape)

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
        "sensor_height": draw(0.0, 5.0),
        "temperature": draw(255.0, 320.0),
        "relative_humidity": draw(0.05, 0.95),
        "toward_east": draw(0.1, 1.0) * distance,
        "toward_north": draw(0.1, 1.0) * distance,
        "toward_up": draw(0.1, 1.0) * distance,
        "fireball_growth": draw(3e-4, 3e-3) * mass ** (1 / 3),
        "camera_focal": draw(1e2, 1e4),
    }


def arguments(law: Law) -> list[str]:
    return [name for name in law.arguments() if name not in CHOICES]


def evaluate(law: Law, word: str | None, values: dict):
    """Call a law by name, as `sensors.record` does by position."""
    chosen = {name: values[name] for name in arguments(law)}
    return law.function(**chosen, **{key: word for key in [words_of(law)] if key})


def shifted(values: dict, steps: dict, exp=jnp.exp) -> dict:
    """Move each number by a step in its ln; heights by a step in W^(1/3) metres."""
    moved = {name: values[name] * exp(step) for name, step in steps.items()}
    if "height_of_burst" in steps:
        unit = values["charge_mass"] ** (1 / 3)
        moved["height_of_burst"] = (
            values["height_of_burst"] + steps["height_of_burst"] * unit
        )
    return {**values, **moved}


def in_blocks(law: Law, word: str | None, values: dict) -> np.ndarray:
    """Evaluate a law at so many points as the sweep has at once: by one program."""
    count = values["charge_mass"].size
    blocks = [
        evaluate(
            law,
            word,
            {n: np.resize(v[at : at + SWEPT], SWEPT) for n, v in values.items()},
        )
        for at in range(0, count, SWEPT)
    ]
    return np.concatenate([np.asarray(block) for block in blocks])[:count]


@cache
def compiled(law: Law, word: str | None):
    """ln of a law over a batch of points; its slopes by reverse mode, and how these
    change where all arguments grow, forward over reverse: one program for all."""

    def log_value(steps, values):
        return jnp.log(evaluate(law, word, shifted(values, steps)))

    def value_slopes_and_curvatures(values):
        nothing = dict.fromkeys(arguments(law), 0.0)
        along_all = dict.fromkeys(arguments(law), 1.0)

        def at(steps):
            return jax.value_and_grad(log_value)(steps, values)

        (value, slopes), (_, curvatures) = jax.jvp(at, (nothing,), (along_all,))
        return value, slopes, curvatures

    return jax.jit(jax.vmap(value_slopes_and_curvatures))


def quotients(law, word, values, above: float, below: float) -> dict[str, np.ndarray]:
    """Difference quotients of ln y between two shifts of each argument in turn."""

    def end(name: str, shift: float) -> np.ndarray:
        moved = shifted(values, {name: np.float64(shift)}, exp=np.exp)
        return np.asarray(compiled(law, word)(moved)[0])

    return {
        name: (end(name, above) - end(name, below)) / (above - below)
        for name in arguments(law)
    }


def away_from_joins(law: Law, values: dict) -> np.ndarray:
    """True where no listed join is within a hundred steps."""
    distance = values["slant_range"] * np.cbrt(
        values["ambient_pressure"] / STANDARD_PRESSURE / values["charge_mass"]
    )
    time = values["time_since_detonation"] / np.cbrt(values["charge_mass"])
    scaled = time if "time_since_detonation" in law.arguments() else distance
    gaps = [abs(np.log(scaled / join)) for join in law.joins]
    return np.min([np.full(scaled.shape, np.inf), *gaps], axis=0) > 100 * STEP


def grid(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Z from 0.01 to 1e5 and masses from 0.1 g to 1 Mt, evenly in ln, paired."""
    rng = np.random.default_rng(seed + 1)
    z = np.geomspace(0.01, 1e5, count)
    return points(z, rng.permutation(np.geomspace(1e-4, 1e9, count)), seed)


def sweep(law: Law) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The grid, its corners and every join of a law; and which of these are joins.

    One batch for every law, so each compiles once: a law with few joins repeats them.
    """
    values = grid(400)
    corners = points(np.repeat([0.01, 1e5], 2), np.tile([1e-4, 1e9], 2))
    joins = np.resize(law.joins or (1.0,), 40)
    at_joins = points(joins, np.full(joins.shape, 3.0), seed=2)
    at_joins["time_since_detonation"] = joins * np.cbrt(3.0)
    parts = values, corners, at_joins
    together = {name: np.concatenate([p[name] for p in parts]) for name in values}
    return together, np.arange(SWEPT) >= SWEPT - 40
