"""Groups of quantities: clock times, directions, what errs in its own unit."""

from jblast.quantity import CLOCK_KINDS, TIME_KINDS
from jblast.quantity_table import QUANTITIES

_ROWS = tuple(QUANTITIES.values())

CLOCK_TIMES = tuple(q.name for q in _ROWS if q.kind in CLOCK_KINDS)
"""Quantities that are readings of a clock."""

ARRIVALS = tuple(q.name for q in _ROWS if q.kind == "arrival")
"""Clock times at which a wave comes."""

TIMES = tuple(q.name for q in _ROWS if q.kind in TIME_KINDS)
"""Quantities in seconds whose laws' scatter is a share of the travel time."""

FIREBALL_RADII = tuple(q.name for q in _ROWS if q.kind == "fireball radius")

TIMED = (*(q.name for q in _ROWS if q.kind == "shock radius"), *FIREBALL_RADII)
"""Quantities taken at a time: their rows have a `time_s`."""

PLACELESS = tuple(q.name for q in _ROWS if q.placeless)
"""Quantities that are the same wherever their sensor stands."""

BY_CAMERA = tuple(q.name for q in _ROWS if q.by_camera)
"""Quantities read off images of the scene's camera."""

BY_VEHICLE = tuple(q.name for q in _ROWS if q.by_vehicle)
"""What happens to the scene's vehicle: which it is, and its place, decide."""

DIRECTIONS = {q.name: q.largest for q in _ROWS if q.kind == "direction"}
"""Angles seen from a sensor's position, and the largest value either way [rad]."""

CIRCULAR = tuple(q.name for q in _ROWS if q.circular)
"""Quantities that are the same after a full circle."""

ADDITIVE = (*TIMES, *DIRECTIONS)
"""Quantities that err in their own unit; all others err in ln, so are positive."""

FEEL_WIND = tuple(q.name for q in _ROWS if q.feels_wind)
"""Quantities that change with the wind."""

ADDABLE = {q.name: q.default_sigma for q in _ROWS if q.default_sigma is not None}
"""Quantities that one more datum may be of, and its error: seconds, or relative."""


def components(quantity: str) -> tuple[tuple[str, float], ...]:
    """Return the quantities with a law, and their signs, that make up a quantity."""
    known = QUANTITIES.get(quantity)
    return (known.parts if known else ()) or ((quantity, 1.0),)


def made_with(part: str) -> tuple[str, ...]:
    """Return the quantities that a quantity with a law makes up, itself among them."""
    return tuple(name for name in QUANTITIES if part in dict(components(name)))
