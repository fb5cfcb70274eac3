"""Every number of random blasts that may have a prior, described once: pure data."""

from jblast.bounds import POSITIVE, Bounds
from jblast.parameter import Key, Parameter, Spread

WORLD_NUMBERS: dict[str, Parameter] = {
    row.key.name: row
    for row in (
        Parameter(
            name="world_mass_kg",
            unit="kg",
            words="mass of a random charge",
            attribute="mass",
            key=Key("world", "mass_kg"),
            spread=Spread(2.0, "factor"),
            default=10.0,
            bounds=POSITIVE,
        ),
        Parameter(
            name="world_time_s",
            unit="s",
            words="time of a random blast",
            attribute="time",
            key=Key("world", "time_s"),
            spread=Spread(10.0, "unit"),
            default=10.0,
            bounds=Bounds(at_least=0.0),
        ),
        Parameter(
            name="world_gap_s",
            unit="s",
            words="least time between random blasts",
            attribute="gap",
            key=Key("world", "gap_s"),
            spread=Spread(1.0, "unit"),
            default=0.5,
            bounds=Bounds(at_least=0.0),
        ),
        Parameter(
            name="world_rate_hz",
            unit="1/s",
            words="rate of random blasts",
            attribute="rate",
            key=Key("world", "rate_hz"),
            spread=Spread(2.0, "factor"),
            default=0.25,
            bounds=POSITIVE,
        ),
    )
}
"""Numbers of a world of random blasts by their key in [world]: fixed, or a prior."""
