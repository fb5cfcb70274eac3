"""What there is to say of a charge's curve set beside the height at which it bursts."""

import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Charge, Scene
from jblast.waves.propagation.ambient import ambient
from jblast.waves.scaling import sachs_distance_factor


def burst_notes(
    charge: Charge,
    heights: tuple[float, float],
    free: Bool[np.ndarray, " place"],
    what: str,
) -> list[str]:
    """Say by which curves a charge above the ground was taken, and what they miss.

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
        if charge.burst == "free-air" and charge.range_m is None:
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
    _, pressure = ambient(scene.air)
    mass = charge.tnt_mass("peak_overpressure_pa")
    return charge.up / sachs_distance_factor(mass, pressure)
