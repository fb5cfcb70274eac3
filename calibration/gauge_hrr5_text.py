"""What the arrivals of HRR-5 say, as text: every number in it is computed."""

import textwrap

import numpy as np

from calibration.gauge_hrr5 import (
    Arrivals,
    Fitted,
    arrivals,
    chance_of_gain,
    fitted,
    spread,
)
from jblast.constants import STANDARD_SOUND_SPEED, STANDARD_TEMPERATURE

PICKS = {"peak": "peak of F", "onset": "onset"}
MODELS = {1: "still, 15 C", 2: "still, fitted", 3: "wind, fitted"}
"""By how many of `gauge_hrr5.UNKNOWNS` are free."""

ARRIVAL_SD = 10.0
"""What the start of a window may be worth [s]: about what is left of the onsets."""

INFRAPY_ORIGIN = (55.9, 91.4)
"""Origin time and its error by InfraPy's location [s past 23:00]: see the data."""

SECTOR = 90.0
"""Arrays whose bearings differ by more from west are the northern ones [degrees]."""


def fits() -> dict[tuple[str, int], Fitted]:
    """Return every fit of the table, by pick and number of unknowns."""
    return {
        (pick, free): fitted(arrivals(pick), free) for pick in PICKS for free in MODELS
    }


def hrr5_table() -> str:
    """Return the residuals before and after wind."""
    heard = arrivals("peak")
    lines = [
        "  arrival    air            c m/s  wind N  origin s   "
        + "".join(f"{name:>7s}" for name in heard.array)
        + "    rms s"
    ]
    for (pick, free), one in fits().items():
        origin, speed, north, _ = one.value
        lines.append(
            f"  {PICKS[pick]:10s} {MODELS[free]:14s} {speed:5.1f} {north:7.1f} "
            f"{origin:9.1f}   "
            + "".join(f"{left:+7.1f}" for left in one.residual)
            + f"{one.rms:9.1f}"
        )
    return "\n".join(lines)


def northern() -> tuple[Arrivals, np.ndarray, np.ndarray]:
    """Return the northern arrays, how late they are, and the wind that would take.

    Late against the western onsets: still air, speed fitted.
    """
    again, west = arrivals("again"), fitted(arrivals("onset"), 2)
    away = np.abs((again.bearing - 270 + 180) % 360 - 180) > SECTOR
    heard = Arrivals(
        tuple(np.array(again.array)[away].tolist()),
        *(column[away] for column in again[1:]),
    )
    origin, speed = west.value[:2]
    late = heard.time - origin - heard.distance / speed
    along = heard.distance / (heard.time - origin) - speed
    # measured bearings differ by a degree: the wind along them is nearly all north
    return heard, late, along / np.cos(np.radians(heard.bearing))


def twice() -> list[tuple[str, float]]:
    """Return by how much the second detection is later than the first [s]."""
    first, again = arrivals("peak"), arrivals("again")
    times = dict(zip(again.array, again.time, strict=True))
    return [
        (name, float(times[name[:3]] - time))
        for name, time in zip(first.array, first.time, strict=True)
    ]


def hrr5_explanation() -> str:
    """Return what explains the rest."""
    told, onset = fits(), arrivals("onset")
    lead = arrivals("peak").time - onset.time
    latest = int(np.argmax(lead))
    still, windy = told["onset", 2], told["onset", 3]
    peak_still, peak_windy = told["peak", 2], told["peak", 3]
    sd = ARRIVAL_SD * spread(onset, windy.value, 4)
    speed = still.value[1]
    warmth = (speed / STANDARD_SOUND_SPEED) ** 2 * STANDARD_TEMPERATURE - 273.15
    away, late, wind = northern()
    celerity = onset.distance / (onset.time - INFRAPY_ORIGIN[0])
    drift = speed * np.sin(np.radians(away.turned))
    again = ", ".join(f"{name} {later:+.0f}" for name, later in twice())
    paragraphs = (
        f"The pick explains most: F peaks anywhere in a wave train of minutes, "
        f"{lead.min():.0f} to {lead.max():.0f} s after the start of its window (last "
        f"at "
        f"{onset.array[latest]}). With the starts for arrivals the rms in still air of "
        f"fitted speed goes from {peak_still.rms:.0f} to {still.rms:.0f} s. The same "
        f"explosion detected anew moves the peaks by, in seconds: {again}.",
        f"Wind explains nothing that five arrays in a western sector can tell: freeing "
        f"its northern part brings {peak_still.rms:.1f} to {peak_windy.rms:.1f} s "
        f"(peaks) "
        f"and {still.rms:.1f} to {windy.rms:.1f} s (onsets), which an unknown of no "
        f"meaning does with a chance of {chance_of_gain(peak_still, peak_windy):.2f} "
        f"and "
        f"{chance_of_gain(still, windy):.2f}; it comes out as {windy.value[2]:.0f} +- "
        f"{ARRIVAL_SD * windy.sd[2]:.0f} m/s for onsets good to {ARRIVAL_SD:.0f} s. "
        f"Its eastern part is kept at zero: bearings of {onset.bearing.min():.0f} to "
        f"{onset.bearing.max():.0f} degrees do not tell it from the speed of sound "
        f"(both freed: +- {sd[3]:.0f} and +- {sd[1]:.0f} m/s).",
        f"The fitted {speed:.0f} +- {ARRIVAL_SD * still.sd[1]:.0f} m/s is the speed at "
        f"which the wave swept the ground, wind included: the arrays measured "
        f"{onset.trace_speed.min():.0f} to {onset.trace_speed.max():.0f} m/s of their "
        f"own; in still dry air it would take {warmth:.0f} C. The way up into the "
        f"stratosphere and down again is in the fitted origin time, which is therefore "
        f"late: {still.value[0]:.0f} s. InfraPy, which puts the slowness of such ways "
        f"into its location, has {INFRAPY_ORIGIN[0]:.0f} +- {INFRAPY_ORIGIN[1]:.0f} s; "
        f"from there the onsets came at {celerity.min():.0f} to {celerity.max():.0f} "
        f"m/s. The true one is in no file.",
        f"To the north, off the stratosphere's duct as InfraPy's page has it, sound is "
        f"another phase: {' and '.join(away.array)}, a degree apart, peak "
        f"{late[0]:.0f} and {late[1]:.0f} s after the western line; in the west no "
        f"peak "
        f"trails its window's start by more than {lead.max():.0f} s. Wind from the "
        f"north would have to blow {-wind[0]:.0f} and {-wind[1]:.0f} m/s, two answers "
        f"for one air; back azimuths turned by {away.turned[0]:+.1f} and "
        f"{away.turned[1]:+.1f} degrees speak of a crosswind of {drift[0]:.0f} m/s.",
        f"What is left of the onsets, {still.rms:.0f} s or "
        f"{100 * still.rms / np.mean(onset.time - still.value[0]):.1f} % of the fitted "
        f"travel time, is what windows drawn to a few seconds to tens of seconds can "
        f"hold; that their starts were taken for arrivals was decided after the peaks "
        f"had been seen not to fit.",
    )
    return "\n".join(textwrap.fill(text, 88) for text in paragraphs)


def hrr5_text() -> str:
    """Return everything that is printed of HRR-5."""
    heard = arrivals("peak")
    title = (
        f"HRR-5: {len(heard.array)} arrays {heard.distance.min() / 1e3:.0f} to "
        f"{heard.distance.max() / 1e3:.0f} km to the west, origin time free\n"
        "measured less predicted [s]; origin in seconds past 23:00 UTC"
    )
    return "\n".join((title, hrr5_table(), "", hrr5_explanation()))
