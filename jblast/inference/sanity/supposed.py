"""Which blast the rows of a shot are held against: the scene's, or one found from them.

A scene says where and when, or leaves it open. Without a scene a fit takes the origin
and time 0; rows that agree better on another place or time are held against that.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from jblast.inference.sanity.consensus import Agreement, anywhere, at_place
from jblast.inference.sanity.readings import Readings
from jblast.inference.sanity.scaled_laws import ScaledLaws
from jblast.observations.check import Doubt
from jblast.parameters import CHARGE_POSITION
from jblast.scene import Charge, UncertainScene
from jblast.scene.uncertain import NO_SCENE


@dataclass(frozen=True)
class Supposed:
    """What the rows of a shot are held against.

    Attributes:
        readings: The rows, with the range that the scene has of the charge.
        found: What the blast explains; None where nothing could be told.
        distance: From the charge of each [m]; NaN where its place was not said.
        origin: Time of the shot on the common clock [s]; None where it was not said.
        said: What the blast explains that a fit would suppose; None where the scene
            leaves its place open.
        said_origin: Time of that one on the common clock [s].
        doubt: That it is another blast than a fit would suppose.
    """

    readings: Readings
    found: Agreement | None
    distance: Float[np.ndarray, " n"]
    origin: float | None
    said: Agreement | None = None
    said_origin: float | None = None
    doubt: Doubt | None = None


def supposed_blast(
    readings: Readings,
    laws: ScaledLaws,
    charge: Charge,
    uncertain: UncertainScene,
    label: str,
) -> Supposed:
    """Return what the rows of a shot are held against.

    Args:
        readings: The rows.
        laws: Of a kilogram.
        charge: Of the scene.
        uncertain: The scene.
        label: What the names of the charge's numbers end in.
    """
    free = set(uncertain.beliefs)
    origin = None if "origin_time_s" + label in free else float(charge.time_s)
    place = np.array([float(x) for x in charge.position_m])
    if charge.range_m is not None:
        ranges = np.full(len(readings.row), float(charge.range_m))
        ranged = "charge_range_m" + label not in free
        readings = readings.but(slant_range=ranges if ranged else np.nan * ranges)
        place = None if not ranged else place
    elif free & {name + label for name in CHARGE_POSITION}:
        place = None
    if not np.isnan(readings.slant_range).any():
        place = np.zeros(3)  # of no account
    if place is None:
        found = _anywhere(readings, laws, charge)
        nowhere = np.where(np.isnan(readings.slant_range), np.nan, readings.slant_range)
        return Supposed(readings, found, nowhere, origin)
    found = at_place(readings, laws, place, origin)
    distance = readings.distances(place[None])[0]
    said = Supposed(readings, found, distance, origin, found, origin)
    if uncertain.source != NO_SCENE or found.all_agree():
        return said
    return _another(said, laws, charge, place)


def _another(
    said: Supposed, laws: ScaledLaws, charge: Charge, place: Float[np.ndarray, "3"]
) -> Supposed:
    """Return the blast that most rows agree on where none was said to be."""
    readings, found = said.readings, said.found
    first = int(readings.row[0])
    later = at_place(readings, laws, place, None)
    elsewhere = _anywhere(readings, laws, charge)
    best = said
    if found is None or _better(later, found):
        doubt = Doubt("not_at_time_0", (first,))
        best = replace(said, found=later, origin=None, doubt=doubt)
    if elsewhere is not None and (best.found is None or _better(elsewhere, best.found)):
        east, north, _ = elsewhere.place.tolist()
        doubt = Doubt("not_at_the_origin", (first,), {"east_m": east, "north_m": north})
        far = np.where(np.isnan(readings.slant_range), np.nan, said.distance)
        best = replace(said, found=elsewhere, distance=far, origin=None, doubt=doubt)
    return best


def _better(one: Agreement, other: Agreement) -> bool:
    """Return whether one agreement says more with less."""
    if not one.is_believable():
        return False
    if one.price() == other.price():
        return one.holds() and not other.holds()
    return one.price() < other.price()


def _anywhere(readings: Readings, laws: ScaledLaws, charge: Charge) -> Agreement | None:
    """Look for the charge, if there are places to look from."""
    placed = ~np.isnan(readings.position).any(axis=1)
    places = {tuple(at) for at in readings.position[placed].tolist()}
    untold = np.isnan(readings.slant_range)
    flash = np.array([quantity == "flash_time_s" for quantity in readings.quantity])
    if len(places) < 3 or not (placed & untold)[~flash].all():
        return None
    return anywhere(readings, laws, float(charge.position_m[2]))
