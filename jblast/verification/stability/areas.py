"""The areas of the map, and which module measures each: imported when it is asked."""

import importlib

from jblast.errors import InputError, nearest, shown
from jblast.verification.stability.failure import FAILURE_MODES, FailureMode

AREAS: dict[str, str] = {
    "laws": "laws.laws",
    "wave forms": "laws.waveforms",
    "gradients": "laws.gradients",
    "clocks": "laws.clocks",
    "solver": "laws.shock_solver",
    "fits": "inference.fits",
    "walks": "inference.samplers",
    "events": "camera.events",
    "flights": "flights.flights",
}
"""By the name of an area, the module below this folder that measures it."""


def area_named(word: str) -> str:
    """Return an area by its name, hyphens and underscores read as spaces.

    Raises:
        InputError: There is no such area; the message lists all.
    """
    name = word.strip().lower().replace("-", " ").replace("_", " ")
    if name not in AREAS:
        known = [area.replace(" ", "-") for area in AREAS]
        raise InputError(
            f"area {shown(word)}: expected one of {', '.join(known)}"
            f"{nearest(word, known)}"
        )
    return name


def failure_modes_of(area: str) -> list[FailureMode]:
    """Measure the failure modes of one area, here and now.

    Args:
        area: A name of `AREAS`.
    """
    importlib.import_module(f"jblast.verification.stability.{AREAS[area]}")
    return FAILURE_MODES[area]()
