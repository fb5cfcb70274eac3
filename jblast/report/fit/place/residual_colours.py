"""What colour a residual has on a map: blue below the law, red above, white on it."""

import math

EDGES = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
"""Between colours [sd]."""
COLOURS = (
    *("#2166ac", "#67a9cf", "#d1e5f0"),
    "#f7f7f7",
    *("#fddbc7", "#ef8a62", "#b2182b"),
)
"""Brewer's RdBu of seven, told apart by colour-blind readers."""
NONE = "#b0b0b0"
"""Of a sensor without a residual."""


def residual_colour(residual_sd: float) -> str:
    """Return the colour of a residual [sd] as #rrggbb."""
    if math.isnan(residual_sd):
        return NONE
    steps = sum(abs(residual_sd) > edge for edge in EDGES if edge > 0.0)
    return COLOURS[len(COLOURS) // 2 + (steps if residual_sd > 0.0 else -steps)]
