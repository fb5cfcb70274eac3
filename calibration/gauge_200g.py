"""A side-on gauge 2 m from a 200 g charge, against Kingery and Bulmash.

    python -m calibration.gauge_200g    # draws calibration/results/gauge_200g.png

Data: calibration/data/charge_200g_incident_2m.csv: what the author read off the record
and fitted to it; the samples themselves were not published. Neither the explosive, the
heights, the air, nor the delay of the trigger is told.

In the figure the record is the author's Friedlander fit, since the samples were not
published, and the points that were read off them. The laws' waves are moved to its
arrival. What explains the difference is part 1 of `results/gauges.txt`.
"""

from functools import cache
from math import exp
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from calibration import table_rows
from jblast.cli.jax_start import start_jax
from jblast.constants import PSI
from jblast.report.colours import BLUE, INK, VERMILLION
from jblast.report.figures import new_figure, quiet, titled
from jblast.waves.friedlander import friedlander_decay, impulse_fraction
from jblast.waves.pulse import (
    blast_pulse,
    friedlander_pressure,
)

DATA = Path(__file__).parent / "data" / "charge_200g_incident_2m.csv"


class Pulse(NamedTuple):
    """A positive phase [Pa, Pa s, s, -], and when it began after the trigger [s]."""

    peak: float
    impulse: float
    duration: float
    decay: float
    arrival: float


OUTPUT = Path(__file__).parent / "results" / "gauge_200g.png"
LAST = 8e-3
"""Where the plot ends [s after the arrival]."""


@cache
def table() -> dict[str, float]:
    """Read the record's numbers as printed, by name."""
    return {row["quantity"]: float(row["value"]) for row in table_rows(DATA)}


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
    # from the first positive to the largest sample
    lead = 1e-3 * (table()["peak_time_from_trigger"] - table()["arrival_from_trigger"])
    longer = (late.duration + lead) / late.duration
    decay = late.decay * longer
    peak = late.peak * longer * exp(late.decay * lead / late.duration)
    duration = late.duration * longer
    impulse = peak * duration * float(impulse_fraction(np.asarray(decay)))
    return Pulse(peak, impulse, duration, decay, late.arrival - lead)


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
    label = "record: Friedlander fit of its author"
    axes.plot(1e3 * seen, 1e-3 * np.asarray(pulse), "--", color=INK, label=label)
    rise = table()["peak_time_from_trigger"] - table()["arrival_from_trigger"]
    times, label = (0.0, rise, 1e3 * read.duration), "record: first, largest and last "
    label += "positive sample"
    axes.plot(times, (0.0, 1e-3 * read.peak, 0.0), "o", color=INK, ms=4, label=label)
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
