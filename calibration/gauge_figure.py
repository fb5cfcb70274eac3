"""Draw the 200 g record beside the waves of Kingery and Bulmash.

    python -m calibration.gauge_figure

Writes calibration/results/gauge_200g.png. The record is the author's Friedlander fit,
since the samples were not published, and the points that were read off them. The laws'
waves are moved to its arrival.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from calibration.gauge_200g import (
    as_read,
    at_front,
    distance,
    table,
    tnt_mass,
)
from jblast.cli.jax_start import start_jax
from jblast.report.figure_style import BLUE, INK, VERMILLION, new_figure, quiet, titled
from jblast.waves.waveform import (
    blast_pressure,
    blast_pulse,
    modified_friedlander_pressure,
)

OUTPUT = Path(__file__).parent / "results" / "gauge_200g.png"
LAST = 8e-3
"""Where the plot ends [s after the arrival]."""


def figure() -> Figure:
    """Return the plot."""
    read, front = as_read(), at_front()
    time = np.linspace(0.0, LAST, 2000)
    plot = new_figure(7.0, 3.8)
    axes = plot.add_subplot()
    for burst, colour in (("free-air", BLUE), ("surface", VERMILLION)):
        since = time + blast_pulse(distance(), tnt_mass(), burst=burst).arrival_time
        told = blast_pressure(since, distance(), tnt_mass(), burst=burst)
        label = f"Kingery and Bulmash, {burst}"
        axes.plot(1e3 * time, 1e-3 * np.asarray(told), color=colour, label=label)
    seen = time[time <= front.duration]
    pulse = modified_friedlander_pressure(seen, front.peak, front.duration, front.decay)
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
