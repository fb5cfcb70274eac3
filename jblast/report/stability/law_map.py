"""The map of laws: over which scaled distances each holds, and where it breaks."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.registry import LAWS, Law, call
from jblast.report.figure_style import BLUE, GRID, INK, MUTED, VERMILLION, titled
from jblast.report.fit.figures.recordings import runs
from jblast.report.words import capitalised, quantity_words
from jblast.scene import Charge, Scene
from jblast.scene.charge import Burst
from jblast.sensors.calculator.question import scene_path, with_rows
from jblast.verification.stability.failure import FailureMode
from jblast.waves import sedov_taylor_energy

MASS = 15.0
"""Charge of the map [kg]; laws that scale are the same for every other."""
Z = np.geomspace(0.02, 2e4, 1200)
"""Scaled distances drawn [m/kg^(1/3)]."""
DRAWN = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_impulse_pa_s",
    "positive_duration_s",
    "shock_radius_m",
)
"""Quantities of the map; the others have the same ends as these."""
UNITS = {"m/kg^(1/3)": 1.0, "m/kg^(1/2)": MASS ** (1.0 / 2.0 - 1.0 / 3.0)}
"""What a boundary's unit is in scaled distances of `MASS`."""
RESPONSE_COLOURS = {
    "marks": VERMILLION,
    "refuses": INK,
    "falls back": "#E69F00",
    "holds": "#009E73",
}
THICK = 0.56
APART = 1.9
"""Numbers on one bar stand at least this factor apart."""


def law_map(axes: Axes, modes: Sequence[FailureMode]) -> None:
    """Draw a bar a law and quantity, and tick where it fails.

    Args:
        axes: Where.
        modes: Of the area "laws"; those of scaled distances are drawn.
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
            holds = holds_at(law)
            _bar(axes, row, holds)
            method = f"{quantity} by {law.name}"
            _ticks(axes, row, [mode for mode in modes if mode.method == method], holds)
            places.append(row)
            names.append(law.name)
            row += 1.0
        row += 0.25
    axes.set_xscale("log")
    axes.set(xlim=(Z[0], Z[-1]), ylim=(row - 0.4, -0.8))
    axes.set_yticks(places, names)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(which="both", color=MUTED, labelcolor=INK, labelsize=9)
    axes.tick_params(axis="y", length=0)
    axes.grid(True, axis="x", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("scaled distance Z (m/kg$^{1/3}$)", fontsize=10, color=INK)
    titled(axes, "Laws: where each holds")


@eqx.filter_jit
def _valid(law: Law, path) -> Bool[jax.Array, " point"]:
    return jnp.broadcast_to(call(law.valid, path), path.slant_range.shape)


def holds_at(law: Law) -> Bool[np.ndarray, " point"]:
    """Return at which of `Z` a law holds for one of the bursts at least."""
    bursts: tuple[Burst, ...] = ("surface", "free-air")
    return np.any([_holds(law, burst) for burst in bursts], axis=0)


def _holds(law: Law, burst: Burst) -> Bool[np.ndarray, " point"]:
    distance = jnp.asarray(Z * MASS ** (1.0 / 3.0))
    path = scene_path(Scene(charge=Charge(mass_kg=MASS, burst=burst)))
    path = with_rows(path, distance, jnp.full(distance.shape, MASS))
    # when the strong shock of a point source is there
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
            THICK if good else 0.3 * THICK,
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
    """Tick boundaries, each with its figure unless it would run into the one before."""
    named = 0.0
    here = [mode for mode in modes if mode.unit in UNITS]
    for mode in sorted(here, key=lambda mode: mode.boundary * UNITS[mode.unit]):
        z = mode.boundary * UNITS[mode.unit]
        colour = RESPONSE_COLOURS[mode.response]
        axes.plot([z, z], [row - 0.42, row + 0.42], color=colour, linewidth=2.0)
        if z < APART * named:
            continue
        named = z
        starts = not holds[z / APART > Z].any()  # room to the left
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
