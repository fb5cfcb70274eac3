"""HRR-5: infrasound of 45 t of explosive, heard 234 to 471 km away, against sound.

Data: calibration/data/hrr5_infrasound_arrivals.csv, and hrr5_infrapy_detections.csv,
where the same explosion was detected anew. When it went off is in neither, so the
origin time is an unknown of every fit, in seconds past 23:00 UTC.

The text, of which every number is computed, is part 3 of `calibration.gauges`.
"""

import csv
import textwrap
from datetime import datetime
from math import atan, atan2, cos, degrees, hypot, radians, sin, tan
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.stats import f as f_distribution

from jblast.constants import STANDARD_SOUND_SPEED, STANDARD_TEMPERATURE
from jblast.waves.laws.acoustic import acoustic_arrival_time
from jblast.waves.propagation import effective_sound_speed

EQUATOR = 6_378_137.0
"""Radius of the equator [m]. WGS 84."""

FLATTENING = 1 / 298.257223563
"""Of the ellipsoid [-]. WGS 84."""

GEODESIC_STEPS = 20
"""Each gains about three digits."""


class Geodesic(NamedTuple):
    """The shortest way between two places.

    Attributes:
        length: [m].
        bearing: At the first place, towards the second [degrees east of north].
        back_bearing: At the second place, towards the first.
    """

    length: float
    bearing: float
    back_bearing: float


DATA = Path(__file__).parent / "data"
SOURCE = (33.5377, -106.333961)
"""Latitude and longitude of the explosion, as in the head of the data."""

START = np.datetime64("2012-08-27T23:00:00")
UNKNOWNS = ("origin_time_s", "air_sound_speed_m_s", "wind_north_m_s", "wind_east_m_s")
GUESS = np.array([200.0, STANDARD_SOUND_SPEED, 0.0, 0.0])
STEPS = 20
"""Of Gauss and Newton; the fourth is at rounding."""


class Arrivals(NamedTuple):
    """One row an array of microphones.

    Attributes:
        array: Its name.
        distance: From the explosion [m].
        bearing: From the explosion [degrees east of north].
        time: When it was heard [s past 23:00 UTC].
        turned: Measured back azimuth less the direction of the explosion [degrees].
        trace_speed: Speed of the wave along the ground, over the array [m/s].
    """

    array: tuple[str, ...]
    distance: np.ndarray
    bearing: np.ndarray
    time: np.ndarray
    turned: np.ndarray
    trace_speed: np.ndarray


class Fitted(NamedTuple):
    """Still or moving air, by least squares.

    Attributes:
        value: Of all `UNKNOWNS`, the freed ones first.
        sd: Of the freed ones, for arrivals good to 1 s.
        residual: Measured less predicted [s].
        rms: Of the residuals [s].
    """

    value: np.ndarray
    sd: np.ndarray
    residual: np.ndarray
    rms: float


PICKS = {"peak": "peak of F", "onset": "onset"}
MODELS = {1: "still, 15 C", 2: "still, fitted", 3: "wind, fitted"}
"""By how many of `gauge_hrr5.UNKNOWNS` are free."""

ARRIVAL_SD = 10.0
"""What the start of a window may be worth [s]: about what is left of the onsets."""

INFRAPY_ORIGIN = (55.9, 91.4)
"""Origin time and its error by InfraPy's location [s past 23:00]: see the data."""

SECTOR = 90.0
"""Arrays whose bearings differ by more from west are the northern ones [degrees]."""


def arrivals(pick: str) -> Arrivals:
    """Read the arrivals: "peak" of the F-statistic, "onset" of its window, "again"."""
    name = "infrapy_detections" if pick == "again" else "infrasound_arrivals"
    with (DATA / f"hrr5_{name}.csv").open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    ways = [geodesic(*SOURCE, float(row["lat"]), float(row["lon"])) for row in rows]
    column = "time_utc" if pick == "again" else "peakF_utc"
    times = np.array([datetime.fromisoformat(row[column]) for row in rows], "M8[s]")
    ahead = np.array([float(row["start_s"]) if pick == "onset" else 0 for row in rows])
    seen = np.array([float(row["back_azimuth_deg"]) for row in rows])
    true = np.array([way.back_bearing for way in ways])
    return Arrivals(
        array=tuple(row["station"] for row in rows),
        distance=np.array([way.length for way in ways]),
        bearing=np.array([way.bearing for way in ways]),
        time=(times - START) / np.timedelta64(1, "s") + ahead,
        turned=(seen - true + 180) % 360 - 180,
        trace_speed=np.array([float(row["trace_velocity_m_s"]) for row in rows]),
    )


def predicted(value: Float[Array, "4"], heard: Arrivals) -> Float[Array, " array"]:
    """Return when sound arrives [s past 23:00 UTC], the unknowns given."""
    origin, sound_speed, north, east = value
    angle = np.radians(heard.bearing)
    along = north * jnp.cos(angle) + east * jnp.sin(angle)
    speed = effective_sound_speed(sound_speed, along)
    return origin + acoustic_arrival_time(heard.distance, speed)


def fitted(heard: Arrivals, free: int) -> Fitted:
    """Fit the first so many of `UNKNOWNS`; the others stay at their guess."""
    value = GUESS.copy()
    for _ in range(STEPS):
        residual = heard.time - np.asarray(predicted(jnp.asarray(value), heard))
        value[:free] += np.linalg.lstsq(slopes(heard, value, free), residual)[0]
    residual = heard.time - np.asarray(predicted(jnp.asarray(value), heard))
    rms = float(np.sqrt(np.mean(residual**2)))
    return Fitted(value, spread(heard, value, free), residual, rms)


def slopes(heard: Arrivals, value: np.ndarray, free: int) -> np.ndarray:
    """Return the derivative of each arrival by each of the freed unknowns."""
    by_all = jax.jacfwd(lambda some: predicted(some, heard))(jnp.asarray(value))
    return np.asarray(by_all)[:, :free]


def spread(heard: Arrivals, value: np.ndarray, free: int) -> np.ndarray:
    """Return the standard deviations of what is freed, for arrivals good to 1 s."""
    moved = slopes(heard, value, free)
    return np.sqrt(np.diag(np.linalg.inv(moved.T @ moved)))


def chance_of_gain(less: Fitted, more: Fitted) -> float:
    """Return the chance that one unknown of no meaning gains as much (F-test)."""
    freedom = len(more.residual) - len(more.sd)
    gain = less.rms**2 / more.rms**2 - 1
    return float(f_distribution.sf(gain * freedom, 1, freedom))


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


def geodesic(
    latitude: float, longitude: float, to_latitude: float, to_longitude: float
) -> Geodesic:
    """Return the way from one place to another, all in degrees."""
    polar = EQUATOR * (1 - FLATTENING)
    u = atan((1 - FLATTENING) * tan(radians(latitude)))  # reduced latitudes
    v = atan((1 - FLATTENING) * tan(radians(to_latitude)))
    difference = turn = radians(to_longitude - longitude)
    for _ in range(GEODESIC_STEPS):
        way = _on_sphere(u, v, turn)
        c = FLATTENING / 16 * way.cos2 * (4 + FLATTENING * (4 - 3 * way.cos2))
        bend = way.middle + c * cos(way.arc) * (2 * way.middle**2 - 1)
        less = (1 - c) * FLATTENING * way.sin_azimuth
        turn = difference + less * (way.arc + c * sin(way.arc) * bend)
    way = _on_sphere(u, v, turn)
    w = way.cos2 * (EQUATOR**2 - polar**2) / polar**2
    a = 1 + w / 16384 * (4096 + w * (-768 + w * (320 - 175 * w)))
    b = w / 1024 * (256 + w * (-128 + w * (74 - 47 * w)))
    twice = 2 * way.middle**2 - 1
    tail = b / 6 * way.middle * (4 * sin(way.arc) ** 2 - 3) * (4 * way.middle**2 - 3)
    less = b * sin(way.arc) * (way.middle + b / 4 * (cos(way.arc) * twice - tail))
    back = _on_sphere(v, u, -turn)
    return Geodesic(
        length=polar * a * (way.arc - less),
        bearing=degrees(way.bearing) % 360,
        back_bearing=degrees(back.bearing) % 360,
    )


class _Arc(NamedTuple):
    """The way on the auxiliary sphere.

    Attributes:
        arc: Its angle [rad].
        bearing: Where it starts [rad].
        sin_azimuth: Sine of its azimuth at the equator.
        cos2: Square of that azimuth's cosine.
        middle: Cosine of twice the angle from the equator to its midpoint.
    """

    arc: float
    bearing: float
    sin_azimuth: float
    cos2: float
    middle: float


def _on_sphere(u: float, v: float, turn: float) -> _Arc:
    """Return the way between reduced latitudes, a difference in longitude apart."""
    east = cos(v) * sin(turn)
    north = cos(u) * sin(v) - sin(u) * cos(v) * cos(turn)
    cos_arc = sin(u) * sin(v) + cos(u) * cos(v) * cos(turn)
    sin_arc = hypot(east, north)
    sin_azimuth = cos(u) * east / sin_arc
    cos2 = 1 - sin_azimuth**2
    return _Arc(
        arc=atan2(sin_arc, cos_arc),
        bearing=atan2(east, north),
        sin_azimuth=sin_azimuth,
        cos2=cos2,
        middle=cos_arc - 2 * sin(u) * sin(v) / cos2,
    )
