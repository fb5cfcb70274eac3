"""What an engineer asks: every quantity at a range, or the range of a quantity."""

import dataclasses
import math
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.constants import TNT_DENSITY
from jblast.kept_programs import kept
from jblast.scene import Scene
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to
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
    """

    scene: Scene
    slant_range: tuple[float, ...] = ()
    charge_mass: tuple[float, ...] = ()
    quantity: str = ""
    target: float = math.nan
    defaults: frozenset[str] = frozenset()

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


def tnt_factor_in(scene: Scene, quantity: str) -> Float[Array, ""]:
    """Return the TNT mass of a scene's charge over its mass, for a quantity [-]."""
    return scene.charge.tnt_mass(quantity) / scene.charge.mass


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

    Args:
        path: From `scene_path`.
        slant_range: Distances [m].
        charge_mass: TNT-equivalent masses [kg].
    """
    return dataclasses.replace(
        path, slant_range=slant_range, ground_range=slant_range, charge_mass=charge_mass
    )
