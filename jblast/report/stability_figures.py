"""Figures of the failure modes of methods."""

from collections.abc import Callable, Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.registry import LAWS, Law, call
from jblast.report.figure_style import (
    BLUE,
    GRID,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.fit.figures import runs
from jblast.report.stability import boundary_words
from jblast.report.words import capitalised, quantity_words
from jblast.scene import Charge, Scene
from jblast.scene.charge import Burst
from jblast.sensors.calculator import scene_path, with_rows
from jblast.verification.stability.detectors import (
    COLOUR,
    PICK_SNRS as NOISES,
    SNRS,
    noise_shares,
    rotor_misses,
)
from jblast.verification.stability.failure import FailureMode
from jblast.verification.stability.flights import impulse_errors as pulse_errors
from jblast.verification.stability.laws import (
    FINE_SIGMA,
    SIGMA,
    TIMES,
)
from jblast.verification.stability.waveforms import (
    SHORT_STEP,
    impulse_errors,
    sod_end,
    wave_error,
)
from jblast.waves import sedov_taylor_energy

MAX_BARS = 14
"""Largest number of bars of failing cases: more would not fit the figure."""
MASS = 15.0
"""Charge mass of the map [kg]; scaled laws have the same map for every mass."""
Z = np.geomspace(0.02, 2e4, 1200)
"""Scaled distances drawn [m/kg^(1/3)]."""
DRAWN = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_impulse_pa_s",
    "positive_duration_s",
    "shock_radius_m",
)
"""Quantities of the map; the ranges of the remaining ones are equal to these."""
UNITS = {"m/kg^(1/3)": 1.0, "m/kg^(1/2)": MASS ** (1.0 / 2.0 - 1.0 / 3.0)}
"""Units of boundaries, in scaled distances of `MASS`."""
RESPONSE_COLOURS = {
    "marks": VERMILLION,
    "refuses": INK,
    "falls back": "#E69F00",
    "holds": "#009E73",
}
BURSTS: tuple[Burst, ...] = ("surface", "free-air")
BAR_HEIGHT = 0.56
"""Height of a bar of the map, in rows."""
LABEL_FACTOR = 1.9
"""Least ratio of two labelled distances on a bar: closer labels would overlap."""


def stability_figure(modes: Mapping[str, Sequence[FailureMode]]) -> Figure:
    """Draw the laws over scaled distance, and a panel for each other area.

    Args:
        modes: Failure modes by area; only measured areas are drawn.
    """
    beside = [area for area in PANELS if area in modes]
    every = [mode for found in modes.values() for mode in found]
    counts = sum(bool(mode.cases) for mode in every)
    mapped = "laws" in modes
    rows = -(-len(beside) // 2)
    heights = [1.0] * rows + [0.28 * counts] * bool(counts)
    height = max(10.5, 1.9 * sum(heights))
    figure = new_figure(8.0 * mapped + 8.6 * bool(beside or counts) or 8.0, height)
    columns = ([0.92] if mapped else []) + ([1.0] if beside or counts else [])
    parts = figure.subfigures(
        1, max(len(columns), 1), squeeze=False, width_ratios=columns or None
    )
    parts = list(parts[0])
    if mapped:
        axes = parts.pop(0).subplots()
        law_map(axes, modes["laws"])
        _key(axes)
    if not parts:
        return figure
    grid = parts[0].add_gridspec(len(heights) or 1, 2, height_ratios=heights or None)
    for place, area in enumerate(beside):
        # the last of an odd number of panels spans both columns
        alone = place % 2 == 0 and place == len(beside) - 1
        across = slice(None) if alone else place % 2
        PANELS[area](parts[0].add_subplot(grid[place // 2, across]), modes[area])
    if counts:
        shares(parts[0].add_subplot(grid[-1, :]), every)
    return figure


def _key(axes) -> None:
    entries = [
        Patch(color=BLUE, alpha=0.75, label="valid"),
        Patch(color="#d8d8d8", label="extrapolated, marked"),
    ]
    entries += [
        Line2D([], [], color=RESPONSE_COLOURS[response], linewidth=2.0, label=words)
        for response, words in (("marks", "limit: marked"), ("holds", "limit avoided"))
    ]
    axes.legend(
        handles=entries,
        loc="upper center",
        bbox_to_anchor=(0.45, -0.06),
        ncols=4,
        frameon=False,
        fontsize=9,
        labelcolor=MUTED,
    )


def wave_forms(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the error of the pulse's impulse against its decay."""
    decay, bare, ours = impulse_errors()
    # an error of exactly 0 has no logarithm: it is drawn below one rounding step
    floor = np.finfo(np.float32).eps / 4.0
    # rounding errors fluctuate from point to point: the largest of 25 is drawn
    width = 25
    highest = [part.max() for part in np.array_split(bare, len(bare) // width)]
    middle = [part.mean() for part in np.array_split(decay, len(decay) // width)]
    lowest = [part.max() for part in np.array_split(ours, len(ours) // width)]
    axes.loglog(middle, np.maximum(highest, floor), color=VERMILLION, linewidth=1.8)
    axes.loglog(middle, np.maximum(lowest, floor), color=BLUE, linewidth=1.8)
    axes.text(6e-5, 3e2, "closed form", color=VERMILLION, fontsize=9)
    axes.text(2e-5, 4e-7, "jblast", color=BLUE, fontsize=9)
    _line(axes, modes[0].boundary, f"b = {modes[0].boundary:.2g}")
    axes.set(xlabel="decay b", ylabel="relative error")
    quiet(axes)
    titled(axes, "Impulse of a pulse, float32")


def clocks(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the steps of a clock against its time."""
    time = 2.0 ** np.arange(0, 36)
    for dtype, sigma, colour in (
        (np.float32, SIGMA, VERMILLION),
        (np.float64, FINE_SIGMA, BLUE),
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
        sigma = SIGMA if "float32" in mode.method else FINE_SIGMA
        axes.plot(
            mode.boundary, sigma, "o", color=RESPONSE_COLOURS[mode.response], zorder=4
        )
    axes.set(xlabel="time on the clock (s)", ylabel="step (s)")
    axes.set_ylim(1e-17, 5e3)
    quiet(axes)
    titled(axes, "Clock times", "dots: refused from here")


def solver(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the error of the shock solver against its step."""
    fraction = np.concatenate(
        [np.linspace(SHORT_STEP, 1.0, 10), np.arange(1.02, 1.3, 0.02)]
    )
    least = wave_error(SHORT_STEP), sod_end(SHORT_STEP)[1]
    # relative to the error of a short step: both cases then share an axis
    smooth = [wave_error(float(c)) / least[0] for c in fraction]
    sod = [
        error / least[1] if alive else np.inf for alive, error in map(sod_end, fraction)
    ]
    for name, values, colour, side in (
        ("smooth wave ", np.array(smooth), BLUE, "right"),
        (" Sod's tube", np.array(sod), VERMILLION, "left"),
    ):
        # a run that diverges has no error: the line ends in a cross
        alive = np.isfinite(values)
        axes.semilogy(fraction[alive], values[alive], color=colour, linewidth=1.8)
        last = float(fraction[alive][-1]), float(values[alive][-1])
        axes.plot(*last, "x", color=colour, markersize=8, markeredgewidth=2.0)
        axes.text(*last, f" {name} ", color=colour, fontsize=9, ha=side, va="center")
    axes.axvspan(1.0, 1.6, color="#eeeeee", zorder=0)
    axes.text(1.58, 0.75, "refused", color=INK, fontsize=9, ha="right")
    axes.set(xlim=(0.0, 1.6), xlabel="step / stable step", ylabel="relative error")
    axes.set_ylim(0.65, 30.0)
    axes.set_yticks([1.0, 2.0, 5.0, 10.0, 20.0], ["1", "2", "5", "10", "20"])
    axes.minorticks_off()
    quiet(axes)
    titled(axes, "Shock solver", "crosses: diverges beyond")


def flights(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the error of a blast's impulse against the step."""
    ratio, bare, ours = pulse_errors()
    # errors of 0 are drawn at 1e-9, as they have no logarithm
    axes.loglog(ratio, np.maximum(bare, 1e-9), color=VERMILLION, linewidth=1.8)
    axes.loglog(ratio, np.maximum(ours, 1e-9), color=BLUE, linewidth=1.8)
    axes.text(3.0, 0.02 * bare.max(), "force per step", color=VERMILLION, fontsize=9)
    axes.text(3.0, 0.02 * ours.max(), "jblast", color=BLUE, fontsize=9)
    at = next(e.boundary for e in modes if e.unit.startswith("positive phases"))
    _line(axes, at, f"{at:.2g}")
    axes.set(xlabel="step / positive duration", ylabel="error of the impulse")
    quiet(axes)
    titled(axes, "Blast on a vehicle")


def detectors(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the share of missed blasts in wind and rotor noise against their SNR."""
    plain, ours = rotor_misses()
    axes.plot(SNRS, plain, color=VERMILLION, linewidth=1.8)
    axes.plot(SNRS, ours, color=BLUE, linewidth=1.8)
    axes.text(SNRS[1], 0.8, "plain normalised", color=VERMILLION, fontsize=9)
    axes.text(SNRS[1], 0.05, "jblast", color=BLUE, fontsize=9)
    at = next(e.boundary for e in modes if e.unit.startswith("dB, 2E/N0, and"))
    _line(axes, at, f"{at:.2g} dB")
    axes.set(xlabel="2E/N0 of the blast (dB)", ylabel="share missed")
    quiet(axes)
    titled(axes, "Matched filters in rotor noise")


def records(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the share of picks with large errors against the noise of a record."""
    for colour, hue, words in ((0.0, BLUE, "white"), (COLOUR, VERMILLION, "coloured")):
        found = noise_shares(colour)
        axes.semilogx(NOISES, found.failed, color=hue, linewidth=1.8, label=words)
        axes.semilogx(
            NOISES, found.unmarked, color=hue, linewidth=1.8, linestyle=(0, (1, 1.5))
        )
    at = max(mode.boundary for mode in modes if mode.unit.startswith("peak over"))
    _line(axes, at, f"{at:g}")
    axes.text(60.0, 0.04, "dotted: rated good", color=MUTED, fontsize=9)
    axes.legend(frameon=False, fontsize=9, labelcolor=MUTED, title="noise")
    axes.set(
        xlabel="peak / noise",
        ylabel="share missed or with large error",
        ylim=(-0.03, 1),
    )
    quiet(axes)
    titled(axes, "Picks of pressure records")


def shares(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw the share of failing cases, a bar for each failure mode with cases."""
    counted = [mode for mode in modes if mode.cases][:MAX_BARS]
    for row, mode in enumerate(counted):
        share = 100.0 * mode.boundary / mode.cases
        axes.barh(row, share, 0.36, color=RESPONSE_COLOURS[mode.response], alpha=0.8)
        # the name stands above its bar, where long ones have the whole width
        for x, y, words in (
            (0.0, row - 0.36, f"{mode.method}: {mode.failure}"),
            (share + 1.0, row, boundary_words(mode)),
        ):
            axes.text(x, y, words, va="center", fontsize=8.5, color=INK)
    # bars of no length make one entry of the key for each response
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
    "clocks": clocks,
    "solver": solver,
    "flights": flights,
    "detectors": detectors,
    "records": records,
}
"""Function that draws an area; failure modes with cases share one more panel."""


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


def law_map(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw a bar for each law and quantity, with ticks at its failure modes.

    Args:
        axes: Axes of the map.
        modes: Failure modes of the area "laws"; those in scaled distance are drawn.
    """
    row, places, names = 0.0, [], []
    for quantity in DRAWN:
        axes.text(
            *(0.0, row),
            f"  {capitalised(quantity_words(quantity))}",
            transform=axes.get_yaxis_transform(),
            fontsize=9.5,
            fontweight="bold",
            color=INK,
            va="center",
        )
        row += 1.0
        for law in (law for law in LAWS.values() if law.quantity == quantity):
            # a law counts as valid at `Z` if it is so for at least one kind of burst
            holds = np.any([_holds(law, burst) for burst in BURSTS], axis=0)
            _bar(axes, row, holds)
            method = f"{quantity} by {law.name}"
            _ticks(axes, row, [mode for mode in modes if mode.method == method], holds)
            places.append(row)
            names.append(law.name)
            row += 1.0
        row += 0.25
    axes.set_xscale("log")
    # inverted: the first quantity is at the top
    axes.set(xlim=(Z[0], Z[-1]), ylim=(row - 0.4, -0.8))
    axes.set_yticks(places, names)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(which="both", color=MUTED, labelcolor=INK, labelsize=9)
    axes.tick_params(axis="y", length=0)
    axes.grid(True, axis="x", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("scaled distance Z (m/kg$^{1/3}$)", fontsize=10, color=INK)
    titled(axes, "Range of validity of each law")


@eqx.filter_jit
def _valid(law: Law, path) -> Bool[jax.Array, " point"]:
    return jnp.broadcast_to(call(law.valid, path), path.slant_range.shape)


def _holds(law: Law, burst: Burst) -> Bool[np.ndarray, " point"]:
    distance = jnp.asarray(Z * MASS ** (1.0 / 3.0))
    path = scene_path(Scene(charge=Charge(mass_kg=MASS, burst=burst)))
    path = with_rows(path, distance, jnp.full(distance.shape, MASS))
    # laws of the shock radius need a time: that of the strong point-source shock
    energy = sedov_taylor_energy(distance, 1.0, path.air_density, path.sedov_gamma)
    time = jnp.sqrt(energy / (TNT_SPECIFIC_ENERGY * MASS))
    path = eqx.tree_at(lambda p: p.time_since_detonation, path, time)
    return np.asarray(_valid(law, path))


def _bar(axes: Axes, row: float, holds: Bool[np.ndarray, " point"]) -> None:
    for start, stop, good in runs(holds):
        low, high = Z[start], Z[stop - 1]
        axes.barh(
            row,
            high - low,
            BAR_HEIGHT if good else 0.3 * BAR_HEIGHT,
            left=low,
            color=BLUE if good else "#d8d8d8",
            alpha=0.75 if good else 1.0,
            linewidth=0,
        )


def _ticks(
    axes: Axes,
    row: float,
    modes: Sequence[FailureMode],
    holds: Bool[np.ndarray, " point"],
) -> None:
    """Draw ticks at boundaries, with labels unless these would overlap."""
    named = 0.0
    here = [mode for mode in modes if mode.unit in UNITS]
    # from left to right: a label is compared with its left neighbour
    for mode in sorted(here, key=lambda mode: mode.boundary * UNITS[mode.unit]):
        z = mode.boundary * UNITS[mode.unit]
        colour = RESPONSE_COLOURS[mode.response]
        axes.plot([z, z], [row - 0.42, row + 0.42], color=colour, linewidth=2.0)
        if z < LABEL_FACTOR * named:
            continue
        named = z
        # left of the first valid distance the bar is empty, and a label has room
        starts = not holds[z / LABEL_FACTOR > Z].any()
        axes.annotate(
            f"{z:.2g}",
            (z, row),
            xytext=(-4 if starts else 4, 0),
            textcoords="offset points",
            fontsize=8,
            color=INK,
            ha="right" if starts else "left",
            va="center",
            bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"},
        )
