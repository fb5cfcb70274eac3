"""Which curve set holds for each row, where the height of the charge decides.

Laws are chosen, and curve sets with them, at settled numbers: before a search, and once
more at its answer. Within a search they stay, so that it has derivatives.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from jblast.scene import Charge, Scene
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to
from jblast.waves.height_of_burst import burst_notes, scaled_height


def settled(scene: Scene, layout: Layout) -> tuple[Scene, Layout]:
    """Return scene and layout with the curve sets that the heights leave.

    A charge of which all rows have one set is given that; else the layout says it row
    by row. What was settled before is decided anew.
    """
    charges, free = [], np.zeros(len(layout.quantity), bool)
    for shot, charge in enumerate(scene.charges):
        if charge.burst is None or charge.by_height:
            here = np.array(layout.shot) == shot
            free |= here & free_rows(scene, layout, charge)
            kinds = set(free[here].tolist()) or {False}
            burst = (
                None if len(kinds) == 2 else "free-air" if True in kinds else "surface"
            )
            charge = replace(charge, burst=burst, by_height=True)
        charges.append(charge)
    mixed = any(charge.burst is None for charge in charges)
    scene = replace(scene, charge=charges[0], others=tuple(charges[1:]))
    return scene, replace(layout, free_air=tuple(free.tolist()) if mixed else ())


def with_bursts(scene: Scene, other: Scene) -> Scene:
    """Return a scene with the curve sets of another."""
    charges = [
        replace(charge, burst=like.burst, by_height=like.by_height)
        for charge, like in zip(scene.charges, other.charges, strict=True)
    ]
    return replace(scene, charge=charges[0], others=tuple(charges[1:]))


def free_rows(scene: Scene, layout: Layout, charge: Charge) -> Bool[np.ndarray, " row"]:
    """Return at which rows the reflection comes after the positive phase."""
    if not float(charge.up) > 0.0:
        return np.zeros(len(layout.quantity), bool)
    unsaid = replace(charge, burst=None, by_height=False)
    path = path_to(scene, replace(layout, free_air=()), unsaid)
    return np.asarray(path.free_air)


def height_notes(scene: Scene, layout: Layout, shot: int) -> list[str]:
    """Say by which curves a charge above the ground was taken, and what they miss.

    Args:
        scene: Its numbers settled; a burst that was not said is marked `by_height`.
        layout: The rows.
        shot: Which charge.
    """
    charge = scene.charges[shot]
    here = np.array(layout.shot) == shot
    free = free_rows(scene, layout, charge)[here]
    height = float(scaled_height(scene, charge))
    return burst_notes(charge, (height, height), free, "reading")
