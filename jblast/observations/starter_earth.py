"""The parts of a first scene that say where on the Earth it is, and by which clocks."""

import json

import numpy as np

from jblast.observations.default_scene import clocks_to_free
from jblast.observations.table import CLOCK_TIMES, Observations
from jblast.observations.times.clocks import has_common_clock
from jblast.parameter_table import ALTITUDES


def place_tables(observations: Observations) -> list[str]:
    """Return the table [place]: as the log has it, or to be filled in."""
    frame = observations.frame
    if frame is not None:
        return [
            "[place]  # where east, north, up are zero: the middle of the sensors\n"
            f"lat_deg = {frame.lat_deg!r}\nlon_deg = {frame.lon_deg!r}\n"
            f"alt_m = {frame.alt_m!r}\n"
        ]
    return [
        "# [place]  # of the origin, where the answer is wanted in degrees\n"
        "# lat_deg = LATITUDE\n# lon_deg = LONGITUDE\n# alt_m = 0.0\n"
    ]


def air_table(observations: Observations) -> str:
    """Return the table [air], of the height of the sensors if the log tells it."""
    frame = observations.frame
    lines = ["temperature_k = 288.15", "pressure_pa = 101325.0"]
    other = "# altitude_m = 1500  # instead of the temperature and pressure above"
    if frame is not None and frame.alt_m and ALTITUDES.allows(frame.alt_m):
        lines = [f"# {line}" for line in lines]
        other = f"altitude_m = {frame.alt_m!r}  # instead of the two above"
    return "\n".join(
        [
            "[air]",
            *lines,
            "relative_humidity = 0.5",
            other,
            '# sound_speed_m_s = "free"  # only where it was measured, or is to be '
            "fitted",
            "wind_m_s = [0.0, 0.0]  # towards east, north; each may be free",
            "# wind_m_s = [{ normal = [0, 5] }, { normal = [0, 5] }]  # if not known",
            "",
        ]
    )


def clock_tables(observations: Observations) -> list[str]:
    """Return a table [[clock]] for each clock but that by which the others are set.

    Those that the log sets (`clocks_to_free`) are free, the others are commented out.
    """
    timed = np.flatnonzero(np.isin(observations.quantity, CLOCK_TIMES))
    clocks = observations.clocks()
    names = list(dict.fromkeys(clocks[row] for row in timed))
    named = [clock for clock in dict.fromkeys(observations.clock) if clock]
    set_by, whose = "", "the common clock"
    if has_common_clock(observations):
        names = [name for name in names if name in named]
    elif names:
        set_by = named[0] if named else names[0]
        whose = toml_text(set_by)  # a name may hold anything
        names = [name for name in names if name != set_by]
    free = clocks_to_free(observations)
    tables = []
    for name in names:
        mark = "" if name in free else "# "
        why = "set by its flash and bang" if name in free else "if it does not agree"
        tables.append(
            f"{mark}[[clock]]  # {why}\n"
            f"{mark}name = {toml_text(name)}\n"
            f'{mark}offset_s = "free"  # its time minus that of {whose}; or a number, '
            "or { normal = [0, 2] }\n"
        )
    return tables


def toml_text(text: str) -> str:
    """Return text as a TOML string: JSON's escapes, and one that JSON leaves out."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
