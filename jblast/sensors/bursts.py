"""Which curve set holds for each row, where the height of the charge decides.

Laws are chosen, and curve sets with them, at settled numbers: before a search, and once
more at its answer. Within a search they stay, so that it has derivatives.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Charge, Scene
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to
from jblast.waves.atmosphere import standard_atmosphere
from jblast.waves.scaling import sachs_distance_factor


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


def burst_notes(
    charge: Charge,
    heights: tuple[float, float],
    free: Bool[np.ndarray, " place"],
    what: str,
) -> list[str]:
    """Say likewise for any places.

    Args:
        charge: With its curve set, None where that differs from place to place.
        heights: The least and the largest height of burst [m/kg^(1/3)].
        free: Where the reflection comes after the positive phase.
        what: What the places are called.
    """
    low, high = heights
    height = f"{low:.2g}" if low == high else f"{low:.2g} to {high:.2g}"
    which = f"the charge {charge.name}" if charge.name else "the charge"
    at = f"at {free.sum()} of {free.size} {what}s"
    at = f"at every {what}" if free.all() else at
    late = "the reflection from the ground comes after the positive phase"
    stood = f"{which} stood {height} m/kg^(1/3) above the ground"
    against = f'burst = "{charge.burst}" contradicts the height: '
    asked = "as asked for"
    if charge.by_height:  # settled elsewhere, and not as the height here would have it
        against, asked = "", "chosen before the height was known"
    if not free.size:
        return []
    if high <= 0.0:
        if charge.burst == "free-air" and charge.range is None:
            return [
                f"{against}{which} stood on the ground or in it; the free-air curves "
                f"were used, {asked}"
            ]
        return []
    if charge.burst == "surface" and (free.all() if charge.by_height else free.any()):
        return [
            f"{against}{stood}, and {at} {late}; the surface curves, of up to twice "
            f"the impulse, were used, {asked}"
        ]
    if charge.burst == "free-air" and not free.all():
        early = f"at {(~free).sum()} of {free.size} {what}s"
        return [
            f"{against}{stood}, and {early} the reflection from the ground comes "
            "within the positive phase, of which the free-air curves know nothing; "
            f"they were used, {asked}"
        ]
    if free.all():
        return [f"{stood}; {at} {late}: the free-air curves were used"]
    between = (
        f"{stood}, neither on it nor so high that {late}: between the limits of the "
        "curves"
    )
    if free.any() and charge.burst is not None:
        return [f"{between}; {at} it does; the {charge.burst} curves were used for all"]
    if free.any():
        return [
            f"{between}; {at} it does, and the free-air curves were used, at the "
            "others neither set holds, and the surface curves were"
        ]
    return [f"{between}, of which the surface ones were used"]


def scaled_height(scene: Scene, charge: Charge) -> Float[Array, ""]:
    """Return the height of burst [m/kg^(1/3)]."""
    air = scene.air
    pressure = (
        air.pressure if air.altitude is None else standard_atmosphere(air.altitude)[1]
    )
    mass = charge.tnt_mass("peak_overpressure_pa")
    return charge.up / sachs_distance_factor(mass, pressure)
