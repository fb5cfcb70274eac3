"""A side-on gauge 2 m from a 200 g charge, against Kingery and Bulmash.

    python -m calibration.gauge_200g    # draws calibration/results/gauge_200g.png

Data: calibration/data/charge_200g_incident_2m.csv: what the author read off the record
and fitted to it; the samples themselves were not published. Neither the explosive, the
heights, the air, nor the delay of the trigger is told.

The text of the record, of which every number is computed, is part 1 of
`results/gauges.txt`. In the figure the record is the author's Friedlander fit, since
the samples were not published, and the points that were read off them. The laws'
waves are moved to its arrival.
"""

import csv
import textwrap
from functools import cache
from math import exp, hypot, log, sqrt
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import root_scalar

from jblast.cli.jax_start import start_jax
from jblast.constants import PSI
from jblast.report.colours import BLUE, INK, VERMILLION
from jblast.report.figures import new_figure, quiet, titled
from jblast.scene.charge import EXPLOSIVES
from jblast.waves.friedlander import friedlander_decay, impulse_fraction
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
    kingery_bulmash_shock_speed,
)
from jblast.waves.laws.kinney_graham import kinney_graham_duration
from jblast.waves.pulse import (
    blast_pulse,
    friedlander_pressure,
)
from jblast.waves.scaling import scaled_distance

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


THIN_AIR = 85e3
"""What the air may have been [Pa]: some 1500 m up."""


OUTPUT = Path(__file__).parent / "results" / "gauge_200g.png"
LAST = 8e-3
"""Where the plot ends [s after the arrival]."""


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
    impulse = peak * duration * float(impulse_fraction(np.asarray(decay)))
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
    impulse = peak * duration * float(impulse_fraction(np.asarray(decay)))
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
    fall = jax.grad(friedlander_pressure)(
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


def pulses_table() -> str:
    """Return the readings beside the law of both bursts."""
    pulses = {name: made() for name, made in PULSES.items()}
    columns = (*pulses, *(f"KB {burst}" for burst in BURSTS))
    lines = [f"  {'':14s}" + "".join(f"{name:>15s}" for name in columns)]
    for quantity, (unit, name) in UNITS.items():
        seen = [getattr(pulse, quantity) for pulse in pulses.values()]
        told = [predicted(quantity, burst) for burst in BURSTS]
        lines.append(
            f"  {f'{quantity} [{name}]':14s}"
            + "".join(f"{unit * value:15.3f}" for value in (*seen, *told))
        )
    decays = "".join(f"{pulse.decay:15.3f}" for pulse in pulses.values())
    lines.append(f"  {'decay b [-]':14s}{decays}")
    return "\n".join(lines)


def ratios_table() -> str:
    """Return observed over predicted, and the TNT factor that would make it one."""
    head = f"  {'':10s}" + "".join(f"{burst:>20s}" for burst in BURSTS for _ in (0, 1))
    lines = [
        head,
        f"  {'':10s}" + f"{'seen/KB':>20s}{'factor for 1':>20s}" * len(BURSTS),
    ]
    for quantity in LAWS:
        cells = ""
        for burst in BURSTS:
            told = predicted(quantity, burst)
            seen = [getattr(pulse(), quantity) for pulse in (as_read, at_front)]
            pairs = (
                [value / told for value in seen],
                [factor(quantity, burst, value) for value in seen],
            )
            for low, high in pairs:
                both = (
                    f"{low:.2f} {high:.2f}" if quantity != "arrival" else f"{low:.2f}"
                )
                cells += f"{both:>20s}"
        lines.append(f"  {quantity:10s}{cells}")
    return "\n".join(lines)


def explanation() -> str:
    """Return what explains the rest."""
    read, front, late = as_read(), at_front(), fitted()
    name, off = nearest_explosive("free-air")
    other, other_off = nearest_explosive("surface")
    told, mass = EXPLOSIVES[name], table()["charge_mass"]
    peak = predicted("peak", "free-air", told.pressure * mass)
    impulse = predicted("impulse", "free-air", told.impulse * mass)
    speed = float(kingery_bulmash_shock_speed(distance(), tnt_mass(), burst="free-air"))
    early = predicted("arrival", "free-air", told.pressure * mass) - read.arrival
    by_peak = factor("peak", "surface", read.peak) * mass
    early_ground = predicted("arrival", "surface", by_peak) - read.arrival
    long = predicted("duration", "free-air", told.impulse * mass)
    graham = float(kinney_graham_duration(distance(), told.impulse * mass))
    thin = {
        quantity: predicted(quantity, "free-air", ambient_pressure=THIN_AIR)
        / predicted(quantity, "free-air")
        - 1
        for quantity in ("peak", "impulse", "duration")
    }
    blur = noise() / end_slope()
    gap = late.arrival + late.duration - (read.arrival + read.duration)
    missed = end_slope() * gap**2 / 2
    echo = speed * read.duration
    paragraphs = (
        f"Burst and explosive: on the ground the charge would be worth "
        f"{factor('peak', 'surface', read.peak):.2f} of TNT by its peak and "
        f"{factor('impulse', 'surface', read.impulse):.2f} by its impulse; the nearest "
        f"explosive of the library, {other}, is {100 * other_off:.0f} % off (in ln). "
        f"In "
        f"free air {factor('peak', 'free-air', read.peak):.2f} and "
        f"{factor('impulse', 'free-air', read.impulse):.2f}: {name} has "
        f"{told.pressure:.2f} and {told.impulse:.2f}, {100 * off:.0f} % off. With "
        f"these "
        f"the reading over the law is {read.peak / peak:.2f} for the peak and "
        f"{read.impulse / impulse:.2f} for the impulse. That it was {name} and stood "
        f"free is inferred: no explosive and no height is told.",
        f"Gauge: {1e6 * rise_time():.0f} us from the first positive to the largest "
        f"sample are {1e3 * speed * rise_time():.0f} mm of the front's way, the size "
        f"of "
        f"a gauge. What it misses meanwhile is what the fit puts back at the front: "
        f"{100 * (front.peak / late.peak - 1):.0f} % over the author's peak, "
        f"{100 * (front.peak / read.peak - 1):.0f} % over the largest sample.",
        f"Duration: the law's {1e3 * long:.2f} ms ({name}, by impulse) are long, the "
        f"record ends after {100 * read.duration / long:.0f} to "
        f"{100 * front.duration / long:.0f} % of it; Kinney and Graham say "
        f"{1e3 * graham:.2f} ms, {'short' if graham < read.duration else 'long'}. The "
        f"end is where a pressure that falls slowly crosses zero: the record's rms "
        f"about its fit, {1e-3 * noise():.2f} kPa, is {1e3 * blur:.2f} ms there, and "
        f"the first negative sample comes {1e3 * gap:.2f} ms before the fit's zero. "
        f"What lies between is {100 * missed / read.impulse:.1f} % of the impulse.",
        f"Arrival: {1e3 * early:.2f} ms before the law of {name}, which no factor "
        f"explains: it would take {factor('arrival', 'free-air', read.arrival):.2f}. "
        f"Nor does the ground: there, at the factor of the peak, it is "
        f"{1e3 * early_ground:.2f} ms. A trigger so much after the detonation would; "
        f"its delay is not told.",
        f"Echo: the record keeps within {100 * noise() / late.peak:.1f} % of its peak "
        f"(rms) of one smooth pulse, so the ground's echo came after its "
        f"{1e3 * read.duration:.2f} ms. At the speed of the front, {speed:.0f} m/s, "
        f"charge and gauge then stood {lowest_height(echo):.1f} m up or higher, if "
        f"equally "
        f"high. Air: not told; at {1e-3 * THIN_AIR:.0f} kPa the law moves by "
        f"{100 * thin['peak']:+.0f} % (peak), {100 * thin['impulse']:+.0f} % (impulse) "
        f"and {100 * thin['duration']:+.0f} % (duration).",
    )
    return "\n".join(textwrap.fill(text, 88) for text in paragraphs)


def text_200g() -> str:
    """Return everything that is printed of the 200 g record."""
    z = float(scaled_distance(distance(), tnt_mass()))
    title = (
        f"{1e3 * table()['charge_mass']:.0f} g at {distance():.0f} m, TNT factor "
        f"{table()['tnt_factor_used_by_author']:.1f} by its author: Z = {z:.2f}; "
        "arrival from the trigger.\nSimpson's impulse; samples were not published"
    )
    ratios = "seen over law at that mass, as read and at the front; then the TNT factor"
    return "\n".join((title, pulses_table(), ratios, ratios_table(), "", explanation()))


def figure() -> Figure:
    """Return the plot."""
    read, front = as_read(), at_front()
    time = np.linspace(0.0, LAST, 2000)
    plot = new_figure(7.0, 3.8)
    axes = plot.add_subplot()
    for burst, colour in (("free-air", BLUE), ("surface", VERMILLION)):
        pulse = blast_pulse(distance(), tnt_mass(), burst=burst)
        told = pulse.pressure(time + pulse.arrival_time)
        label = f"Kingery and Bulmash, {burst}"
        axes.plot(1e3 * time, 1e-3 * np.asarray(told), color=colour, label=label)
    seen = time[time <= front.duration]
    pulse = friedlander_pressure(seen, front.peak, front.duration, front.decay)
    axes.plot(
        1e3 * seen,
        1e-3 * np.asarray(pulse),
        color=INK,
        linestyle="--",
        label="record: Friedlander fit of its author",
    )
    rise = table()["peak_time_from_trigger"] - table()["arrival_from_trigger"]
    axes.plot(
        (0.0, rise, 1e3 * read.duration),
        (0.0, 1e-3 * read.peak, 0.0),
        "o",
        color=INK,
        markersize=4,
        label="record: first, largest and last positive sample",
    )
    axes.set_xlabel("time since arrival [ms]")
    axes.set_ylabel("overpressure [kPa]")
    quiet(axes)
    grams, factor = 1e3 * table()["charge_mass"], table()["tnt_factor_used_by_author"]
    titled(axes, f"{grams:.0f} g at {distance():.0f} m", f"TNT factor {factor:.1f}")
    axes.legend(frameon=False, fontsize=8)
    return plot


def main() -> None:
    """Write it."""
    start_jax()
    figure().savefig(OUTPUT)
    print(f"wrote {OUTPUT.name}")


if __name__ == "__main__":
    main()
