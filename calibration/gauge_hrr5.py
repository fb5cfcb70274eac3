"""HRR-5: infrasound of 45 t of explosive, heard 234 to 471 km away, against sound.

Data: calibration/data/hrr5_infrasound_arrivals.csv, and hrr5_infrapy_detections.csv,
where the same explosion was detected anew. When it went off is in neither, so the
origin time is an unknown of every fit, in seconds past 23:00 UTC.
"""

import csv
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.stats import f as f_distribution

from calibration.geodesic import geodesic
from jblast.constants import STANDARD_SOUND_SPEED
from jblast.waves.laws.acoustic import acoustic_arrival_time
from jblast.waves.propagation import effective_sound_speed

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
