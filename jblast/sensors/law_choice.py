"""The law of each quantity of a log if none is specified.

One law is used for each quantity: `fidelity.choose_for` over the positions of its rows,
within a third of their smallest sigma. It is chosen before a search, and again at its
result, and is constant during a search, so that it has derivatives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Float

from jblast.errors import nearest, require
from jblast.fidelity import TakenLaw, choose_for, tolerance_of
from jblast.fidelity.choose import by_curves, jitted_conditions
from jblast.registry import is_law, names_for
from jblast.scene import Scene
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to
from jblast.waves.height_of_burst import burst_notes, scaled_height


def resolve_laws(
    scene: Scene, layout: Layout, sigma: Float[np.ndarray, " row"] | None = None
) -> dict[str, TakenLaw]:
    """Return the law of every quantity: the scene's, else chosen.

    Args:
        scene: Charges, air, ground and sensors.
        layout: Rows of a log.
        sigma: Sigma of each row; seconds for times, else relative; NaN if unknown. None
            selects the best law.

    Raises:
        InputError: The scene names a law that does not predict a quantity, or a
            quantity has no law yet.
    """
    chosen = dict(scene.law)
    for quantity, name in chosen.items():
        known = names_for(quantity)
        require(
            name == "auto" or is_law(quantity, name),
            f"[law] {quantity}",
            f"auto or one of {', '.join(known) or '(none yet)'}",
            f"{name!r}{nearest(name, known)}",
        )
    # an explicit law is never replaced
    left = [q for q in layout.quantities() if chosen.get(q, "auto") == "auto"]
    automatic = choose_laws(scene, layout, left, sigma)
    return {
        quantity: automatic.get(quantity, TakenLaw(chosen.get(quantity, "")))
        for quantity in layout.quantities()
    }


def choose_laws(
    scene: Scene,
    layout: Layout,
    quantities: Sequence[str],
    sigma: Float[np.ndarray, " row"] | None = None,
) -> dict[str, TakenLaw]:
    """Return the automatic law of some quantities of a layout.

    Raises:
        InputError: A quantity has no law yet.
    """
    for quantity in quantities:
        require(names_for(quantity), quantity, "a quantity that a law predicts")
    stated = np.full(len(layout.quantity), np.nan) if sigma is None else np.array(sigma)
    charges = scene.charges if quantities else ()
    paths = [jax.tree.map(np.asarray, path_to(scene, layout, one)) for one in charges]
    found = {}
    for quantity in quantities:
        conditions, shares = [], []
        for shot, (charge, path) in enumerate(zip(charges, paths, strict=True)):
            rows, _ = layout.rows(quantity, shot)
            if not rows.size:
                continue
            here = jax.tree.map(lambda x, r=rows: x[r] if x.ndim else x, path)
            here = replace(here, charge_mass=charge.tnt_mass(quantity))
            for one in by_curves([here]):
                each = jax.tree.map(np.asarray, jitted_conditions(quantity, one))
                conditions.append(each)
                shares.append(tolerance_of(stated[rows], quantity, [each]))
        # the strictest stated tolerance of any row; without one the best law wins
        tolerance = min((share for share in shares if share > 0.0), default=0.0)
        choice = choose_for(quantity, conditions, tolerance)
        found[quantity] = TakenLaw(choice.method, choice)
    return found


def law_names(laws: Mapping[str, TakenLaw]) -> dict[str, str]:
    """Return only the names of laws."""
    return {quantity: law.name for quantity, law in laws.items()}


def height_notes(scene: Scene, layout: Layout, shot: int) -> list[str]:
    """Return a note on the curves of a charge off the ground, if one is due.

    Args:
        scene: Charges, air, ground and sensors.
        layout: The rows.
        shot: Index of the charge.
    """
    charge = scene.charges[shot]
    path = path_to(scene, layout, replace(charge, burst=None))
    weight = np.broadcast_to(path.free_air, len(layout.shot))
    here = weight[np.array(layout.shot) == shot]
    height = float(scaled_height(scene, charge))
    return burst_notes(charge, (height, height), here, "reading")
