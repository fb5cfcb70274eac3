"""How far every method is off its reference: measured here, stored in `data/`.

In scaled terms most laws are curves of Z alone, so one charge of 1 kg in standard air
tells their error for all. What else a method's error depends on (Wu's and Hao's arrival
obeys neither Hopkinson nor Sachs) is a product of powers, whose exponents are measured
beside it. The absorption in the far reference depends on frequency, so on distance,
mass and air: it is measured on a grid of its own.
"""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.fidelity import solver
from jblast.fidelity.reference import (
    END,
    FORD_START,
    KINGERY_BULMASH_END,
    reference_value,
    scaled_distances,
)
from jblast.registry import call, law_for, names_for
from jblast.scene import Air, Scene
from jblast.scene.charge import Burst
from jblast.waves.paths import Path, path_between

PER_OCTAVE = 17
_OCTAVES = np.arange(-164, 79) / PER_OCTAVE
JUST_PAST = 1.0 + 1e-9
NODES = np.sort(
    np.concatenate(
        [
            KINGERY_BULMASH_END * 2.0**_OCTAVES,
            JUST_PAST * np.array([FORD_START, KINGERY_BULMASH_END]),
            [END],
        ]
    )
)
"""Scaled distances where errors are measured, from 0.05 [m/kg^(1/3)]: 4 % apart, and on
both sides of where one reference hands over to another."""

BURSTS: tuple[Burst, ...] = ("surface", "free-air")

STEP = math.log(2.0)
"""In ln of mass and of ambient pressure, to measure exponents."""

NO_POWER = 1e-9

MASSES = 10.0 ** np.arange(-4.0, 6.01)
ALTITUDES = np.arange(0.0, 5001.0, 1000.0)
FAR_NODES = np.exp(np.linspace(math.log(KINGERY_BULMASH_END), math.log(END), 17))
"""The grid of the absorption [kg], [m], [m/kg^(1/3)]."""


def standard_path(
    z: Float[np.ndarray, " place"],
    burst: Burst,
    mass: float = 1.0,
    altitude: float = 0.0,
) -> Path:
    """Return paths to scaled distances from a charge of TNT on the ground.

    Args:
        z: Scaled distances [m/kg^(1/3)].
        burst: Which curve set.
        mass: Of the charge [kg].
        altitude: Above sea level, in the standard atmosphere [m].
    """
    scene = Scene(air=Air(altitude=altitude))
    charge = dataclasses.replace(scene.charge, mass_kg=jnp.asarray(mass), burst=burst)
    nothing = jnp.full(len(z), jnp.nan)
    here = path_between(scene, charge, jnp.zeros((len(z), 3)), nothing, nothing)
    scale = jnp.cbrt(mass * STANDARD_PRESSURE / here.ambient_pressure)
    distance = jnp.asarray(z) * scale
    return dataclasses.replace(here, slant_range=distance, ground_range=distance)


CONTINUATIONS = (
    ("positive_duration_s", "shock_kinematics"),
    ("positive_impulse_pa_s", "shock_kinematics"),
)
"""Laws that are their reference as far as it goes and theory farther on, where another
one was fitted to recordings: for records that need one law at all distances, not for
choosing by measured errors."""


def methods_for(quantity: str) -> tuple[str, ...]:
    """Return the methods to choose from for a quantity: laws, and the solver."""
    laws = tuple(
        name
        for name in names_for(quantity)
        if "time_since_detonation" not in law_for(quantity, name).arguments()
        and (quantity, name) not in CONTINUATIONS
    )
    return laws + ((solver.METHOD,) if quantity in solver.SOLVED else ())


def value_of(quantity: str, method: str, path: Path) -> Float[np.ndarray, " place"]:
    """Return what a method says, also where it does not hold (see `holds`).

    Args:
        quantity: What is asked for.
        method: One of `methods_for`.
        path: To every place; the mass is that of TNT.
    """
    if method == solver.METHOD:
        return _by_solver(quantity, path)
    value = np.asarray(call(law_for(quantity, method).function, path))
    return np.broadcast_to(value, path.slant_range.shape)


def holds(quantity: str, method: str, path: Path) -> Bool[np.ndarray, " place"]:
    """Return where a method holds, by place."""
    if method == solver.METHOD:
        return np.asarray(solver.holds(scaled_distances(path), path.one_burst()))
    valid = np.asarray(call(law_for(quantity, method).valid, path))
    return np.broadcast_to(valid, path.slant_range.shape)


def _by_solver(quantity: str, path: Path) -> Float[np.ndarray, " place"]:
    value = solver.scaled_value(quantity, scaled_distances(path), path.one_burst())
    unit = {
        "air_arrival_s": path.slant_range / path.sound_speed,
        "peak_overpressure_pa": path.ambient_pressure,
        "shock_speed_m_s": path.sound_speed,
    }[quantity]
    return value * np.asarray(unit)


def log_ratio(
    quantity: str, method: str, path: Path, *, lossless: bool = False
) -> Float[np.ndarray, " place"]:
    """Return ln of a method over its reference; NaN where that does not hold."""
    said = value_of(quantity, method, path)
    reference = np.asarray(reference_value(quantity, path, lossless=lossless))
    return np.log(said) - np.log(reference)


def log_ratios(quantity: str, burst: Burst) -> dict[str, Float[np.ndarray, " node"]]:
    """Return ln of every method over its lossless reference, at `NODES`."""
    path = standard_path(NODES, burst)
    return {
        method: log_ratio(quantity, method, path, lossless=True)
        for method in methods_for(quantity)
    }


def exponents(quantity: str, method: str, burst: Burst) -> tuple[float, float]:
    """Return the powers of mass and of ambient pressure in a method's ratio.

    Both at a given Z; zero for a law that obeys Hopkinson and Sachs. The median over
    all nodes: a law may have another exponent where it leaves its range.
    """
    path = standard_path(NODES, burst)
    plain = log_ratio(quantity, method, path, lossless=True)
    factor = math.exp(STEP)
    distance = path.slant_range * factor ** (1.0 / 3.0)
    heavier = dataclasses.replace(
        path,
        slant_range=distance,
        ground_range=distance,
        charge_mass=path.charge_mass * factor,
    )
    distance = path.slant_range / factor ** (1.0 / 3.0)
    denser = dataclasses.replace(
        path,
        slant_range=distance,
        ground_range=distance,
        ambient_pressure=path.ambient_pressure * factor,
    )
    found = []
    for changed in (heavier, denser):
        step = log_ratio(quantity, method, changed, lossless=True) - plain
        known = step[np.isfinite(step)]
        power = float(np.median(known)) / STEP if known.size else 0.0
        found.append(0.0 if abs(power) < NO_POWER else power)
    return found[0], found[1]


def log_losses(burst: Burst) -> Float[np.ndarray, "node mass altitude"]:
    """Return ln of the far reference of pressure over itself without absorption."""
    law = law_for("peak_overpressure_pa", "weak_shock_iso")
    plain = law_for("peak_overpressure_pa", "shock_kinematics")
    grid = np.empty((len(FAR_NODES), len(MASSES), len(ALTITUDES)))
    for j, mass in enumerate(MASSES):
        for k, altitude in enumerate(ALTITUDES):
            path = standard_path(FAR_NODES, burst, float(mass), float(altitude))
            grid[:, j, k] = np.log(
                call(law.function, path) / call(plain.function, path)
            )
    return grid
