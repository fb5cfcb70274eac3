"""Panels of the stability map beside the laws: a curve that breaks, and where."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes

from jblast.report.figure_style import BLUE, INK, MUTED, VERMILLION, quiet, titled
from jblast.report.stability.law_map import RESPONSE_COLOURS
from jblast.report.stability.text import boundary_words
from jblast.verification.stability.detectors import SNRS, rotor_misses
from jblast.verification.stability.failure import FailureMode
from jblast.verification.stability.flights.pulses import impulse_errors as pulse_errors
from jblast.verification.stability.laws.clocks import FINE, SIGMA, TIMES
from jblast.verification.stability.laws.gradients import MOST_SAMPLES, slope_felt
from jblast.verification.stability.laws.shock_solver import SHORT, sod_end, wave_error
from jblast.verification.stability.laws.waveforms import impulse_errors
from jblast.verification.stability.records import (
    COLOUR,
    SNRS as NOISES,
    noise_shares,
)

MOST_BARS = 14


def wave_forms(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the error of the pulse's impulse against its decay."""
    decay, bare, ours = impulse_errors()
    floor = np.finfo(np.float32).eps / 4.0
    width = 25  # rounding errors jump: the largest of neighbours is what counts
    highest = [part.max() for part in np.array_split(bare, len(bare) // width)]
    middle = [part.mean() for part in np.array_split(decay, len(decay) // width)]
    kept = [part.max() for part in np.array_split(ours, len(ours) // width)]
    axes.loglog(middle, np.maximum(highest, floor), color=VERMILLION, linewidth=1.8)
    axes.loglog(middle, np.maximum(kept, floor), color=BLUE, linewidth=1.8)
    axes.text(6e-5, 3e2, "closed form", color=VERMILLION, fontsize=9)
    axes.text(2e-5, 4e-7, "jblast", color=BLUE, fontsize=9)
    _line(axes, modes[0].boundary, f"b = {modes[0].boundary:.2g}")
    axes.set(xlabel="decay b", ylabel="relative error")
    quiet(axes)
    titled(axes, "Impulse of a pulse, float32")


def gradients(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw how much of the misfit's slope is seen against the rise of the front."""
    samples = range(MOST_SAMPLES // 2 + 1)
    felt = [100.0 * slope_felt(n) for n in samples]
    axes.axhline(100.0, color=MUTED, linewidth=1.0)
    axes.plot(samples, felt, "o-", color=BLUE, markersize=4)
    axes.plot(0, felt[0], "o", color=VERMILLION)
    axes.annotate(
        f"sharp front: {felt[0]:.0f} %",
        (0, felt[0]),
        xytext=(8, 0),
        textcoords="offset points",
        color=VERMILLION,
        fontsize=9,
        va="center",
    )
    axes.set(
        xlabel="samples in the rise of the front", ylabel="seen by the gradient (%)"
    )
    axes.set_ylim(0.0, 120.0)
    quiet(axes)
    titled(axes, "Misfit's slope in the arrival")


def clocks(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the steps of a clock against its time."""
    time = 2.0 ** np.arange(0, 36)
    for dtype, sigma, colour in (
        (np.float32, SIGMA, VERMILLION),
        (np.float64, FINE, BLUE),
    ):
        name = np.dtype(dtype).name
        steps = np.spacing(time.astype(dtype)).astype(float)
        axes.loglog(time, steps, color=colour, linewidth=1.8)
        axes.text(2e6, 2e7 * steps[0], f"{name} ", color=colour, fontsize=9, ha="right")
        axes.axhline(sigma, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
        axes.text(3e5, 1.4 * sigma, f"sigma = {sigma:g} s", color=MUTED, fontsize=8)
    for words, at in TIMES.items():
        axes.axvline(at, color="#c8c8c8", linewidth=0.9, zorder=0)
        axes.text(at, 3e3, f"{words} ", color=MUTED, fontsize=8, ha="right", va="top")
    for mode in modes:
        sigma = SIGMA if "float32" in mode.method else FINE
        axes.plot(
            mode.boundary, sigma, "o", color=RESPONSE_COLOURS[mode.response], zorder=4
        )
    axes.set(xlabel="time on the clock (s)", ylabel="step (s)")
    axes.set_ylim(1e-17, 5e3)
    quiet(axes)
    titled(axes, "Clock times", "dots: refused from here")


def solver(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the error of the shock solver against the length of its steps."""
    fraction = np.concatenate([np.linspace(SHORT, 1.0, 10), np.arange(1.02, 1.3, 0.02)])
    least = wave_error(SHORT), sod_end(SHORT)[1]
    smooth = [wave_error(float(c)) / least[0] for c in fraction]
    sod = [
        error / least[1] if alive else np.inf for alive, error in map(sod_end, fraction)
    ]
    for name, values, colour, side in (
        ("smooth wave ", np.array(smooth), BLUE, "right"),
        (" Sod's tube", np.array(sod), VERMILLION, "left"),
    ):
        alive = np.isfinite(values)
        axes.semilogy(fraction[alive], values[alive], color=colour, linewidth=1.8)
        last = float(fraction[alive][-1]), float(values[alive][-1])
        axes.plot(*last, "x", color=colour, markersize=8, markeredgewidth=2.0)
        axes.text(*last, f" {name} ", color=colour, fontsize=9, ha=side, va="center")
    axes.axvspan(1.0, 1.6, color="#eeeeee", zorder=0)
    axes.text(1.58, 0.75, "refused", color=INK, fontsize=9, ha="right")
    axes.set(
        xlim=(0.0, 1.6), xlabel="step, of the stable one", ylabel="error, relative"
    )
    axes.set_ylim(0.65, 30.0)
    axes.set_yticks([1.0, 2.0, 5.0, 10.0, 20.0], ["1", "2", "5", "10", "20"])
    axes.minorticks_off()
    quiet(axes)
    titled(axes, "Shock solver", "crosses: lost beyond")


def flights(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the error of a blast's impulse against the step."""
    ratio, bare, ours = pulse_errors()
    axes.loglog(ratio, np.maximum(bare, 1e-9), color=VERMILLION, linewidth=1.8)
    axes.loglog(ratio, np.maximum(ours, 1e-9), color=BLUE, linewidth=1.8)
    axes.text(3.0, 0.02 * bare.max(), "a force", color=VERMILLION, fontsize=9)
    axes.text(3.0, 0.02 * ours.max(), "jblast", color=BLUE, fontsize=9)
    at = next(e.boundary for e in modes if e.unit.startswith("positive phases"))
    _line(axes, at, f"{at:.2g}")
    axes.set(xlabel="step, of the positive phase", ylabel="error of the impulse")
    quiet(axes)
    titled(axes, "Blast on a vehicle")


def detectors(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw what beside wind and a rotor is missed against the loudness of a blast."""
    plain, ours = rotor_misses()
    axes.plot(SNRS, plain, color=VERMILLION, linewidth=1.8)
    axes.plot(SNRS, ours, color=BLUE, linewidth=1.8)
    axes.text(SNRS[1], 0.8, "plain normalised", color=VERMILLION, fontsize=9)
    axes.text(SNRS[1], 0.05, "jblast", color=BLUE, fontsize=9)
    at = next(e.boundary for e in modes if e.unit.startswith("dB, 2E/N0, and"))
    _line(axes, at, f"{at:.2g} dB")
    axes.set(xlabel="2E/N0 of the blast (dB)", ylabel="share missed")
    quiet(axes)
    titled(axes, "Matched filters beside a rotor")


def records(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw what share of picks is far off against the noise of a record."""
    for colour, hue, words in ((0.0, BLUE, "white"), (COLOUR, VERMILLION, "coloured")):
        found = noise_shares(colour)
        axes.semilogx(NOISES, found.failed, color=hue, linewidth=1.8, label=words)
        axes.semilogx(
            NOISES, found.unmarked, color=hue, linewidth=1.8, linestyle=(0, (1, 1.5))
        )
    at = max(mode.boundary for mode in modes if mode.unit.startswith("peak over"))
    _line(axes, at, f"{at:g}")
    axes.text(60.0, 0.04, "dotted: called good", color=MUTED, fontsize=9)
    axes.legend(frameon=False, fontsize=9, labelcolor=MUTED, title="noise")
    axes.set(xlabel="peak over noise", ylabel="share lost or far off", ylim=(-0.03, 1))
    quiet(axes)
    titled(axes, "Picks of pressure records")


def shares(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw what share of cases fails, a bar a failure mode whose unit counts cases."""
    counted = [mode for mode in modes if mode.cases][:MOST_BARS]
    for row, mode in enumerate(counted):
        share = 100.0 * mode.boundary / mode.cases
        axes.barh(row, share, 0.36, color=RESPONSE_COLOURS[mode.response], alpha=0.8)
        for x, y, words in (
            (0.0, row - 0.36, f"{mode.method}: {mode.failure}"),
            (share + 1.0, row, boundary_words(mode)),
        ):
            axes.text(x, y, words, va="center", fontsize=8.5, color=INK)
    for response in dict.fromkeys(mode.response for mode in counted):
        axes.barh(
            0.0,
            0.0,
            color=RESPONSE_COLOURS[response],
            alpha=0.8,
            label=f"jblast {response}",
        )
    axes.legend(loc="upper right", frameon=False, fontsize=9, labelcolor=MUTED)
    axes.set_yticks([])
    axes.set(xlim=(0.0, 110.0), ylim=(len(counted) - 0.5, -0.8))
    axes.set_xticks([0, 25, 50, 75, 100])
    axes.set_xlabel("share that fails (%)")
    quiet(axes)
    axes.grid(False, axis="y")
    titled(axes, "Cases that fail")


PANELS: dict[str, Callable[[Axes, Sequence[FailureMode]], None]] = {
    "wave forms": wave_forms,
    "gradients": gradients,
    "clocks": clocks,
    "solver": solver,
    "flights": flights,
    "detectors": detectors,
    "records": records,
}
"""By area; those that count cases share one panel."""


def _line(axes: Axes, at: float, words: str) -> None:
    axes.axvline(at, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.text(
        *(at, 0.96),
        f" {words}",
        transform=axes.get_xaxis_transform(),
        fontsize=9,
        color=INK,
        va="top",
    )
