"""The figure of `calibration.detector_limits`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jblast.report.figures import new_figure, quiet, titled, write_figure


def draw(
    found,
    path: Path,
    snrs: Sequence[float],
    loud: Sequence[float],
    levels: Sequence[float],
) -> None:
    """Draw rates, arrivals, misses and costs.

    Args:
        found: What `calibration.detector_limits.measured` returns.
        path: Where to.
        snrs: 2E/N0 of the rates [dB].
        loud: 2E/N0 of the arrivals [dB].
        levels: Of the bangs, rms over rms [dB].
    """
    figure = new_figure(10.0, 7.6)
    (rates, arrivals), (misses, costs) = figure.subplots(2, 2)
    for false, (seen, bound) in found.rates.items():
        (line,) = rates.plot(snrs, bound, label=f"{false:.0e}")
        rates.plot(snrs, seen, "o", color=line.get_color(), markersize=4)
    titled(rates, "Found at a known time", "lines: Neyman and Pearson")
    rates.set(xlabel="2E/N0 [dB]", ylabel="share found")
    rates.legend(title="false alarms", frameon=False, fontsize=8)
    for name, pairs in found.arrivals.items():
        ratio, mean = np.array(pairs).T
        (line,) = arrivals.plot(loud, ratio, "o-", label=f"{name} front, deviation")
        color = line.get_color()
        arrivals.plot(loud, np.abs(mean), ":", color=color, label=f"{name}, mean")
    arrivals.axhspan(0.9, 1.1, alpha=0.12)
    titled(arrivals, "Error of the arrival over the bound", "Cramér and Rao")
    arrivals.set(xlabel="2E/N0 [dB]", ylabel="over the bound", ylim=(0, 1.4))
    arrivals.legend(frameon=False, fontsize=8, loc="center right")
    for name, shares in found.misses.items():
        misses.plot(levels, shares, "o-", label=name)
    titled(misses, "Bang of 1 s in birdsong", "1 % false alarms of 3 s")
    misses.set(xlabel="rms over rms [dB]", ylabel="share missed", ylim=(-0.02, 1.02))
    misses.legend(frameon=False, fontsize=8, loc=(0.02, 0.4))
    costs.barh(list(found.costs), list(found.costs.values()))
    titled(costs, "Compute for a second", "48 kHz, a core")
    costs.set(xlabel="ms", ylabel="template")
    for axes in (rates, arrivals, misses, costs):
        quiet(axes)
    write_figure(figure, path)
