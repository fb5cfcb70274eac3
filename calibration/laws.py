"""Which laws there are, where they hold, and how far they lie apart.

    python -m calibration.laws          # writes laws.md and figures of DRAWN

Data: the registry of laws, jblast/waves/data/kingery_bulmash.csv. Every word of the
tables comes from the registry. Shown by docs/explanation/laws.md.
"""

import dataclasses
import io
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

import jblast.sensors.jolt  # registers the laws of jolts
import jblast.waves  # noqa: F401  registers the laws
from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_SOUND_SPEED
from jblast.files import write_text
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES
from jblast.registry import LAWS, call
from jblast.report.colours import COLOURS, INK, MUTED
from jblast.report.figures import log_ticks, new_figure, quiet, titled
from jblast.report.numbers import capitalised, quantity_words, unit_for
from jblast.scene import Air, Charge, Scene
from jblast.scene.charge import Burst
from jblast.sensors.calculator import Rows
from jblast.waves.laws.weak_shock import HUMIDITY

MASS = 15.0
"""Of the charge [kg]: scaled by its cube root, few laws depend on it."""
UNSCALED = ("weak_shock_iso", "wu_hao")
"""Those that do."""
SCALED_DISTANCE = np.geomspace(0.05, 1e4, 600)
DRAWN = ("peak_overpressure_pa", "air_arrival_s")
"""Quantities with a figure."""
PALETTE = (
    *(*COLOURS, INK, "#882255", "#E8308A", "#332288", "#999933", "#AA4499"),
    *("#8C510A", "#44AA99", "#661100", "#888888", "#117733", "#B8860B"),
    *("#3B6FB6", "#5E8C31"),
)
"""Colours of laws: those of Okabe and Ito, then mostly Tol's muted ones."""
LABEL_GAP = 0.062
"""Least distance of two labels, as a fraction of a panel's height: one line of text."""
BURSTS: tuple[Burst, Burst] = ("surface", "free-air")
ON_THE_GROUND = ("ford_2021",)
"""Laws whose range asks for no burst, found with charges on or near the ground."""
SPEEDS = {"air_arrival_s": STANDARD_SOUND_SPEED}
"""Arrivals are drawn over range/speed [m/s]: over decades of range they hide all."""
REFERENCES = ("shock_kinematics", "kingery_bulmash", "ufc_3_340_02")
"""The first that gives a quantity is what the others are compared with."""
MOST_APART = {"air_arrival_s": 15.0}
"""Where the comparison is cut off [%]; others at `CUT_OFF`."""
CUT_OFF = 45.0
LEAST_SLOWNESS = 0.03
"""Where arrivals are cut off, of that of sound: some laws start at no time at all."""


class Curve(NamedTuple):
    """One law along the x axis: its value in SI, and where it holds."""

    value: Float[np.ndarray, " point"]
    valid: Bool[np.ndarray, " point"]


Curves = Mapping[str, Curve]
"""By law name."""


RESULTS = Path(__file__).parent / "results"
DPI = 120
HEAD = """# The laws

Written by `python -m calibration.laws` from the registry, `jblast/registry.py`.

Z is the scaled distance R/W^(1/3) for W kilograms of TNT at sea level. The figures are
for dry air at 15 °C and 101325 Pa; arrivals are divided by the time that sound takes.
What the air absorbs in `weak_shock_iso` and Wu and Hao's laws are no functions of Z:
they are drawn for 15 kg, the absorption for 50 % relative humidity. A law without a set
for the other burst is missing there. The lower panels compare laws where both hold, and
are cut off at 45 %, at 15 % for arrivals: near the charge the laws of nuclear shots and
of point sources, whose own mass is nothing, are far from those of TNT.

In Python a law is `jblast.registry.law_for(QUANTITY, LAW).function`, and most are
functions of `jblast.waves`. The scatter is one standard deviation of what a whole shot
shares, and of each record.
"""


def laws_text() -> str:
    """Return the page."""
    parts, quantities = [HEAD], QUANTITIES | DERIVED_QUANTITIES
    for quantity, one in quantities.items():
        laws = [law for law in LAWS.values() if law.quantity == quantity]
        if not laws:
            continue
        title = capitalised(quantity_words(quantity))
        lines = [f"## {title}", "", f"`{quantity}`: {one.meaning}.", ""]
        if quantity in DRAWN:
            lines += [f"![{title} by every law](laws_{quantity}.png)", ""]
        lines += ["| law | range | source | scatter |", "|---|---|---|---|"]
        lines += [
            f"| `{law.name}` | {law.range} | {law.source} | "
            f"{law.scatter_words().removeprefix('scatter ')} |"
            for law in sorted(laws, key=lambda law: law.name)
        ]
        parts.append("\n".join(lines) + "\n")
    unknown = {quantity for quantity, _ in LAWS} - {*quantities}
    assert not unknown, f"quantities.py has no {unknown}"
    return "\n".join(parts)


def _save(figure: Figure, file: Path) -> None:
    """Write a figure in few colours: a third of the bytes."""
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=DPI)
    image = Image.open(drawn).convert("RGB")
    image.quantize(256, dither=Image.Dither.NONE).save(file, optimize=True)


def main() -> None:
    """Write it."""
    start_jax()
    for quantity in DRAWN:
        file = RESULTS / f"laws_{quantity}.png"
        _save(law_figure(quantity, panels(quantity)), file)
        print(f"wrote {file.name}, {file.stat().st_size / 1e3:.0f} kB")
    write_text(RESULTS / "laws.md", laws_text())
    print("wrote laws.md")


def law_figure(quantity: str, panels: Mapping[str, Curves]) -> Figure:
    """Draw a quantity, a column a burst; below, the laws against one of them.

    Args:
        quantity: Its name.
        panels: Its curves by burst.
    """
    every = [curve for curves in panels.values() for curve in curves.values()]
    held = np.flatnonzero(np.any([curve.valid for curve in every], axis=0))
    shown = slice(int(held[0]), int(held[-1]) + 1)
    x = SCALED_DISTANCE[shown]
    values = np.concatenate([curve.value[curve.valid] for curve in every])
    if quantity in SPEEDS:
        size, label = 1.0, f"arrival × {SPEEDS[quantity]:g} m/s / R"
        values = values[values > LEAST_SLOWNESS]
    else:
        unit = unit_for(quantity, float(np.median(values)))
        size, label = unit.size, unit.symbol
    figure = new_figure(5.6 * len(panels), 7.0)
    grid = figure.subplots(2, len(panels), squeeze=False)
    margin = 1.1 if values.max() < 20.0 * values.min() else 1.5
    limits = values.min() / size / margin, values.max() / size * margin
    compared = {burst: _differences(curves, shown) for burst, curves in panels.items()}
    apart = [y for differences in compared.values() for y in differences.values()]
    low, high = min(float(np.nanmin(apart)), -1.0), max(float(np.nanmax(apart)), 1.0)
    wider, most = 0.08 * (high - low), MOST_APART.get(quantity, CUT_OFF)
    differ = max(low - wider, -most), min(high + wider, most)
    for (above, below), (burst, curves) in zip(grid.T, panels.items(), strict=True):
        above.set_yscale("log")
        scaled = {
            name: Curve(curve.value[shown] / size, curve.valid[shown])
            for name, curve in curves.items()
        }
        _panel(above, x, scaled, limits)
        above.set_ylabel(label)
        log_ticks(above.yaxis, above.get_ylim())
        titled(above, f"{capitalised(burst)} burst")
        reference, solid = _reference(curves), np.ones(x.shape, bool)
        differences = {name: Curve(y, solid) for name, y in compared[burst].items()}
        _panel(below, x, differences, differ, reference)
        below.set_ylabel(f"% above {reference}")
        below.set_xlabel("Z (m/kg$^{1/3}$)")
    title = capitalised(quantity_words(quantity))
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, color=INK)
    key = ["solid: where the law holds", "dashed: outside its range"]
    names = {name for curves in panels.values() for name in curves}
    key += [f"{name}: {MASS:g} kg" for name in UNSCALED if name in names]
    figure.supxlabel("    ".join(key), fontsize=9, color=MUTED)
    return figure


def _panel(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    curves: Curves,
    limits: tuple[float, float],
    reference: str = "",
) -> None:
    """Draw curves and their names; a reference is broad, so others on it are seen."""
    colours = law_colours()
    quiet(axes)
    axes.set_xscale("log")
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(*limits)
    log_ticks(axes.xaxis, axes.get_xlim())
    ends = {}
    for name, (value, valid) in curves.items():
        colour = colours[name]
        if name == reference:
            axes.plot(x, value, color=colour, linewidth=5.0, alpha=0.35)
        else:
            draw_curve(axes, x, value, valid, colour)
        last = np.flatnonzero(np.isfinite(value))[-1]
        ends[name] = (float(x[last]), float(value[last]))
    name_curves(axes, ends, colours)


def law_colours() -> dict[str, str]:
    """Return a colour for each drawn law, the same in every figure."""
    names = sorted({law.name for law in LAWS.values() if law.quantity in DRAWN})
    return dict(zip(names, PALETTE, strict=False))


def draw_curve(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    value: Float[np.ndarray, " point"],
    valid: Bool[np.ndarray, " point"],
    colour: str,
) -> None:
    """Draw a law, solid within its range of validity and thin and dashed outside."""
    inside = np.where(valid, value, np.nan)
    axes.plot(x, inside, color=colour, linewidth=1.7, zorder=3)
    axes.plot(x, value, "--", color=colour, linewidth=1.0, alpha=0.55)


def name_curves(
    axes: Axes, ends: Mapping[str, tuple[float, float]], colours: Mapping[str, str]
) -> None:
    """Write names of curves to the right of a panel, without overlaps."""
    corner = axes.transAxes.inverted()
    places = corner.transform(axes.transData.transform(np.array(list(ends.values()))))
    # a curve may end above the panel, or in NaN: its name stays at the edge
    places = np.clip(np.nan_to_num(places), 0.0, 1.0)
    least, top = 0.0, 1.0 - LABEL_GAP * (len(ends) - 1)
    for i in np.argsort(places[:, 1], kind="stable"):
        height = max(least, min(places[i, 1], top))
        least, top = height + LABEL_GAP, top + LABEL_GAP
        name = list(ends)[i]
        line = {"arrowstyle": "-", "color": colours[name], "lw": 0.6, "alpha": 0.6}
        axes.annotate(
            name,
            xy=(places[i, 0], places[i, 1]),
            xytext=(1.05, height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            fontsize=8.5,
            color=colours[name],
            va="center",
            annotation_clip=False,
            arrowprops=line | {"relpos": (0.0, 0.5), "shrinkA": 1, "shrinkB": 0},
        )


def _reference(curves: Curves) -> str:
    """Return the law that others of a panel are compared with."""
    return next(name for name in REFERENCES if name in curves)


def _differences(curves: Curves, shown: slice) -> dict[str, np.ndarray]:
    """Return each law over the reference less one, where both hold [%]."""
    against, found = curves[_reference(curves)], {}
    for name, curve in curves.items():
        both = (curve.valid & against.valid)[shown]
        if both.any():
            ratio = (curve.value / against.value)[shown]
            found[name] = np.where(both, 100.0 * (ratio - 1.0), np.nan)
    return found


def panels(quantity: str) -> dict[str, Curves]:
    """Return the curves of a quantity by burst, without laws valid nowhere there."""
    return {burst: _curves(quantity, burst) for burst in BURSTS}


def _curves(quantity: str, burst: Burst) -> Curves:
    """Return the laws from a charge of TNT in dry standard air, on granite.

    Air without any vapour absorbs much more than any outdoors: absorption is that at
    `HUMIDITY`.
    """
    scene = Scene(Charge(burst=burst), air=Air(relative_humidity=0.0))
    ranges = np.cbrt(MASS) * SCALED_DISTANCE
    path = Rows(scene, ranges, np.full_like(ranges, MASS)).path()
    path = dataclasses.replace(path, relative_humidity=jnp.asarray(HUMIDITY))
    factor = SPEEDS[quantity] / ranges if quantity in SPEEDS else 1.0
    found = {}
    laws = (law for law in LAWS.values() if law.quantity == quantity)
    for law in sorted(laws, key=lambda law: law.name):
        if burst == "free-air" and law.name in ON_THE_GROUND:
            continue
        value = factor * np.asarray(call(law.function, path))
        valid = np.broadcast_to(np.asarray(call(law.valid, path)), value.shape)
        if valid.any():
            found[law.name] = Curve(value, valid)
    return found


if __name__ == "__main__":
    main()
