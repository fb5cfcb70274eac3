"""Which law answers for which quantity, where the user leaves it to us.

Until the choice is measured it is the rule of the contract: one law a quantity a log.
"""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.errors import InputError, nearest
from jblast.registry import names_for
from jblast.scene import Scene
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to
from jblast.waves.scaling import scaled_distance

ONLY = {
    "flash_time_s": "light",
    "ground_arrival_s": "wu_hao",
    "reflected_pressure_pa": "kingery_bulmash",
    "reflected_impulse_pa_s": "kingery_bulmash",
    "shock_radius_m": "sedov_taylor",
}
KINGERY_BULMASH_END = 40.0
FORD_2021_START = 20.0


def resolve_laws(scene: Scene, layout: Layout) -> dict[str, tuple[str, str]]:
    """Return law and reason for every quantity: as the scene says, else chosen.

    Raises:
        InputError: The scene names a law that does not give a quantity, or no law gives
            a quantity yet.
    """
    chosen = dict(scene.law)
    for quantity, name in chosen.items():
        if name != "auto" and name not in names_for(quantity):
            raise InputError(
                f"[law] {quantity} = {name!r}: expected auto or one of "
                f"{', '.join(names_for(quantity)) or '(none yet)'}"
                f"{nearest(name, names_for(quantity))}"
            )
    automatic = choose_laws(scene, layout)
    answer = {}
    for quantity in layout.quantities():
        name = chosen.get(quantity, "auto")
        if name == "auto":
            answer[quantity] = automatic[quantity]
        else:
            answer[quantity] = (name, "as asked for")
    return answer


def choose_laws(scene: Scene, layout: Layout) -> dict[str, tuple[str, str]]:
    """Return the automatic law and the reason for every quantity of a layout.

    Raises:
        InputError: No law gives a quantity yet.
    """
    z = {name: np.asarray(each) for name, each in _distances(scene, layout).items()}
    return {quantity: _choose(quantity, z[quantity]) for quantity in z}


@eqx.filter_jit
def _distances(scene: Scene, layout: Layout) -> dict[str, Float[Array, " n"]]:
    """Return the scaled distances of the rows that each quantity takes part in."""
    answer: dict[str, list[Array]] = {name: [] for name in layout.quantities()}
    for shot, charge in enumerate(scene.charges):
        path = path_to(scene, layout, charge)
        for quantity, found in answer.items():
            rows, _ = layout.rows(quantity, shot)
            mass = charge.tnt_mass(quantity)
            z = scaled_distance(path.slant_range, mass, path.ambient_pressure)
            found.append(z[rows])
    return {name: jnp.concatenate(found) for name, found in answer.items()}


def _choose(quantity: str, z: np.ndarray) -> tuple[str, str]:
    if not names_for(quantity):
        raise InputError(f"no law gives {quantity}: not supported yet")
    if quantity in ONLY:
        return ONLY[quantity], "the law taken unless told otherwise"
    span = f"Z = {z.min():.3g} to {z.max():.3g} m/kg^(1/3)"
    if quantity in ("air_arrival_s", "peak_overpressure_pa"):
        if z.max() <= KINGERY_BULMASH_END:
            return "kingery_bulmash", f"{span}, all within 40"
        return "shock_kinematics", f"{span}, beyond 40 where Kingery-Bulmash ends"
    if z.min() >= FORD_2021_START:
        return "ford_2021", f"{span}, all beyond 20"
    return "kingery_bulmash", f"{span}, not all beyond 20"


def law_names(laws: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """Return the names alone."""
    return {quantity: name for quantity, (name, _) in laws.items()}
