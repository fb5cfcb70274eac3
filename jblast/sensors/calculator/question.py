"""What an engineer asks: every quantity at a range, or the range of a quantity."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Bool, Float

from jblast.constants import TNT_DENSITY
from jblast.kept_programs import kept
from jblast.scene import Scene
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to
from jblast.types import as_float_array
from jblast.waves.height_of_burst import bursts_in_free_air
from jblast.waves.paths import Path


@dataclass(frozen=True)
class Question:
    """One question to the laws.

    Attributes:
        scene: Charge, air and ground; the mass of its charge is not used.
        slant_range: Distances from the charge [m]; none where they are asked for.
        charge_mass: Masses of the explosive [kg]; none where they are asked for.
        quantity: What was measured instead of the one that is asked for; "" if none.
        target: Its value, in its unit.
        defaults: What was not said, by field: "air", "burst", "explosive", "ground".
        units: What the answer is printed in: "si", or "us": feet, pounds, psi.
    """

    scene: Scene
    slant_range: tuple[float, ...] = ()
    charge_mass: tuple[float, ...] = ()
    quantity: str = ""
    target: float = math.nan
    defaults: frozenset[str] = frozenset()
    units: Literal["si", "us"] = "si"

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ranges and masses of all combinations, the ranges running faster."""
        masses, ranges = np.meshgrid(self.charge_mass, self.slant_range, indexing="ij")
        return ranges.ravel(), masses.ravel()


def charge_radius(charge_mass: Float[ArrayLike, "..."]) -> Float[np.ndarray, "..."]:
    r"""Return the radius of a sphere of TNT [m]: $(3 W / (4 \pi \rho))^{1/3}$.

    Args:
        charge_mass: $W$ [kg].
    """
    volume = np.asarray(charge_mass) / TNT_DENSITY
    return np.asarray(np.cbrt(3.0 * volume / (4.0 * math.pi)))


@kept
def scene_path(scene: Scene) -> Path:
    """Return what lies between the charge of a scene and a sensor 1 m away.

    Its ambient air is that of every other sensor.
    """
    layout = Layout(
        quantity=("air_arrival_s",),
        position=jnp.zeros((1, 3)),
        slant_range=jnp.ones(1),
        time=jnp.full(1, jnp.nan),
        group=(0,),
        shot=(0,),
        clock=("",),
    )
    return path_to(scene, layout)


def with_rows(
    path: Path,
    slant_range: Float[ArrayLike, " row"],
    charge_mass: Float[ArrayLike, " row"],
) -> Path:
    """Return a path with ranges and TNT masses put in; both ranges are the slant one.

    Where the height leaves the curve set, sensors stand as low as their ranges allow.

    Args:
        path: From `scene_path`.
        slant_range: Distances [m].
        charge_mass: TNT-equivalent masses [kg].
    """
    free_air = path.free_air
    if free_air is not None:
        ranges = jnp.asarray(slant_range)
        free_air = bursts_in_free_air(
            ranges,
            charge_mass,
            path.height_of_burst,
            jnp.maximum(path.height_of_burst - ranges, 0.0),
            path.ambient_pressure,
            path.sound_speed,
        )
    return dataclasses.replace(
        path,
        slant_range=slant_range,
        ground_range=slant_range,
        charge_mass=charge_mass,
        free_air=free_air,
    )


def path_of_rows(question: Question, quantity: str = "peak_overpressure_pa") -> Path:
    """Return the path of each row, its masses those of TNT for a quantity."""
    ranges, masses = question.rows()
    factor = float(question.scene.charge.tnt_factor_for(quantity))
    path = scene_path(question.scene)
    return with_rows(path, as_float_array(ranges), as_float_array(factor * masses))


def free_air_rows(question: Question) -> Bool[np.ndarray, " row"]:
    """Return at which rows the reflection comes after the positive phase.

    A sensor stands as low as its range allows: on the ground, unless the charge is
    higher than the range is long.
    """
    ranges, _ = question.rows()
    charge = question.scene.charge
    if question.quantity or not float(charge.up) > 0.0:
        return np.zeros(ranges.shape, bool)
    unsaid = dataclasses.replace(charge, burst=None)
    scene = dataclasses.replace(question.scene, charge=unsaid)
    rows = path_of_rows(dataclasses.replace(question, scene=scene))
    return np.asarray(rows.free_air)


def with_burst(question: Question) -> Question:
    """Return a question with the curve set that the height leaves, if none is said.

    One set for all rows, or, where the height leaves both, each row its own. Where a
    range or a mass is asked for it is the surface curves.
    """
    charge = question.scene.charge
    if charge.burst is not None:
        return question
    free = free_air_rows(question)
    burst = (
        "free-air" if free.size and free.all() else None if free.any() else "surface"
    )
    charge = dataclasses.replace(charge, burst=burst, by_height=True)
    scene = dataclasses.replace(question.scene, charge=charge)
    return dataclasses.replace(question, scene=scene)
