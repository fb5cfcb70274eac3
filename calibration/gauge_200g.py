"""A side-on gauge 2 m from a 200 g charge, against Kingery and Bulmash.

Data: calibration/data/charge_200g_incident_2m.csv: what the author read off the record
and fitted to it; the samples themselves were not published. Neither the explosive, the
heights, the air, nor the delay of the trigger is told.
"""

import csv
from functools import cache
from math import exp, hypot, log, sqrt
from pathlib import Path
from typing import NamedTuple

import jax
from scipy.optimize import root_scalar

from jblast.constants import PSI
from jblast.scene.charge import EXPLOSIVES
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
)
from jblast.waves.waveform import (
    friedlander_decay,
    friedlander_impulse,
    modified_friedlander_pressure,
)

DATA = Path(__file__).parent / "data" / "charge_200g_incident_2m.csv"

BURSTS = ("free-air", "surface")
LAWS = {
    "peak": kingery_bulmash_pressure,
    "impulse": kingery_bulmash_impulse,
    "duration": kingery_bulmash_duration,
    "arrival": kingery_bulmash_arrival_time,
}
UNITS = {"peak": (1e-3, "kPa"), "impulse": (1.0, "Pa s")} | dict.fromkeys(
    ("duration", "arrival"), (1e3, "ms")
)


class Pulse(NamedTuple):
    """A positive phase [Pa, Pa s, s, -], and when it began after the trigger [s]."""

    peak: float
    impulse: float
    duration: float
    decay: float
    arrival: float


@cache
def table() -> dict[str, float]:
    """Read the record's numbers as printed, by name."""
    with DATA.open(encoding="utf-8") as lines:
        rows = csv.DictReader(line for line in lines if not line.startswith("#"))
        return {row["quantity"]: float(row["value"]) for row in rows}


def distance() -> float:
    """Return the range [m]."""
    return table()["range"]


def tnt_mass() -> float:
    """Return the charge by the author's TNT factor [kg]."""
    return table()["charge_mass"] * table()["tnt_factor_used_by_author"]


def as_read() -> Pulse:
    """Return what was read off the record: its largest and its first negative sample.

    The decay is the one that gives these three to a Friedlander pulse.
    """
    peak = PSI * table()["peak_overpressure_raw"]
    impulse = 1e-3 * PSI * table()["positive_impulse_simpson"]
    duration = 1e-3 * table()["positive_phase_duration_raw"]
    decay = float(friedlander_decay(peak, impulse, duration))
    return Pulse(peak, impulse, duration, decay, 1e-3 * table()["arrival_from_trigger"])


def fitted() -> Pulse:
    """Return the author's Friedlander pulse, which begins at the largest sample."""
    peak = PSI * table()["friedlander_fit_peak"]
    duration = 1e-3 * table()["friedlander_fit_tplus"]
    decay = table()["friedlander_fit_alpha"] * table()["friedlander_fit_tplus"]
    impulse = float(friedlander_impulse(peak, duration, decay))
    return Pulse(
        peak, impulse, duration, decay, 1e-3 * table()["peak_time_from_trigger"]
    )


def at_front() -> Pulse:
    """Return the same pulse continued back to the front, over the gauge's rise.

    A Friedlander pulse that begins earlier is one again: larger and longer.
    """
    late = fitted()
    lead = rise_time()
    longer = (late.duration + lead) / late.duration
    decay = late.decay * longer
    peak = late.peak * longer * exp(late.decay * lead / late.duration)
    duration = late.duration * longer
    impulse = float(friedlander_impulse(peak, duration, decay))
    return Pulse(peak, impulse, duration, decay, late.arrival - lead)


PULSES = {"as read": as_read, "fitted": fitted, "at the front": at_front}


def rise_time() -> float:
    """Return the time from the first positive to the largest sample [s]."""
    return 1e-3 * (table()["peak_time_from_trigger"] - table()["arrival_from_trigger"])


def noise() -> float:
    """Return the rms of the record about the author's fit [Pa]."""
    square = table()["friedlander_fit_chi_square"] / table()["friedlander_fit_samples"]
    return PSI * sqrt(square)


def end_slope() -> float:
    """Return how fast the fitted pressure falls where it ends [Pa/s]."""
    pulse = fitted()
    fall = jax.grad(modified_friedlander_pressure)(
        pulse.duration, pulse.peak, pulse.duration, pulse.decay
    )
    return -float(fall)


def predicted(quantity: str, burst: str, mass: float | None = None, **air) -> float:
    """Return what Kingery and Bulmash say, for the author's TNT mass unless told."""
    law = LAWS[quantity]
    return float(
        law(distance(), tnt_mass() if mass is None else mass, **air, burst=burst)
    )


def factor(quantity: str, burst: str, value: float) -> float:
    """Return the TNT factor at which Kingery and Bulmash agree with a reading."""
    found = root_scalar(
        lambda mass: predicted(quantity, burst, mass) - value, bracket=(0.01, 2.0)
    )
    return float(found.root) / table()["charge_mass"]


def nearest_explosive(burst: str) -> tuple[str, float]:
    """Return the explosive whose factors come nearest to those of what was read.

    Returns:
        Its name, and how far it is off: ln of peak and of impulse factor, together.
    """
    read = as_read()
    peak, impulse = (
        log(factor(name, burst, getattr(read, name))) for name in ("peak", "impulse")
    )
    off = {
        name: hypot(peak - log(told.pressure), impulse - log(told.impulse))
        for name, told in EXPLOSIVES.items()
    }
    name = min(off, key=off.__getitem__)
    return name, off[name]


def lowest_height(path_difference: float) -> float:
    """Return the height of charge and gauge at which the ground's echo is so late [m].

    Both stand equally high; the echo goes to the ground half way and up again.
    """
    half = distance() / 2
    return sqrt((half + path_difference / 2) ** 2 - half**2)
