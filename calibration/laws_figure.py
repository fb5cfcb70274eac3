"""One quantity by all its laws: what they give, and how far they lie apart."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibration.laws_curves import (
    MASS,
    SCALED_DISTANCE,
    SCALED_TIME,
    SPEEDS,
    UNSCALED,
    Curve,
    Curves,
)
from jblast.report.calculator.figures import draw_curve, law_colours, name_curves
from jblast.report.figure_style import (
    INK,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.words import Unit, capitalised, quantity_words, split_name, unit_for

REFERENCES = ("shock_kinematics", "kingery_bulmash", "ufc_3_340_02")
"""The first that gives a quantity is what the others are compared with."""
MOST_APART = {"air_arrival_s": 15.0, "shock_speed_m_s": 15.0}
"""Where the comparison is cut off [%]; others at `CUT_OFF`."""
CUT_OFF = 45.0
LEAST_SLOWNESS = 0.03
"""Where arrivals are cut off, of that of sound: some laws start at no time at all."""
ROOT = "kg$^{1/3}$"

Limits = tuple[float, float]


def law_figure(quantity: str, panels: Mapping[str, Curves]) -> Figure:
    """Draw a quantity, a column a burst; below, the laws against one of them.

    Args:
        quantity: Its name.
        panels: Its curves by burst.
    """
    over_time = quantity == "shock_radius_m"
    x = SCALED_TIME if over_time else SCALED_DISTANCE
    shown = _where_laws_hold(panels, x)
    x = x[shown]
    panels = {
        burst: {
            name: Curve(curve.value[shown], curve.valid[shown])
            for name, curve in curves.items()
        }
        for burst, curves in panels.items()
    }
    compared = {burst: _differences(curves) for burst, curves in panels.items()}
    rows = 2 if any(compared.values()) else 1
    figure = new_figure(5.6 * len(panels), 3.0 * rows + 1.0)
    grid = figure.subplots(rows, len(panels), squeeze=False)
    unit = _unit(quantity, panels)
    for axes, (burst, curves) in zip(grid[0], panels.items(), strict=True):
        scaled = {
            name: Curve(curve.value / unit.size, curve.valid)
            for name, curve in curves.items()
        }
        axes.set_yscale("log")
        _panel(axes, x, scaled, _value_limits(quantity, panels, unit))
        axes.set_ylabel(_label(quantity, unit))
        log_ticks(axes.yaxis, axes.get_ylim())
        titled(axes, "" if over_time else f"{capitalised(burst)} burst")
    limits = _difference_limits(quantity, compared) if rows == 2 else (0.0, 0.0)
    for column, (burst, differences) in zip(grid.T, compared.items(), strict=True):
        axes = column[-1]
        if differences:
            reference = _reference(panels[burst])
            _panel(axes, x, differences, limits, reference)
            axes.set_ylabel(f"% above {reference}")
        elif rows == 2:
            axes.set_axis_off()
            axes.text(0.5, 0.5, "one law only", ha="center", fontsize=9, color=MUTED)
            axes = column[0]
        axes.set_xlabel(f"time (s/{ROOT})" if over_time else f"Z (m/{ROOT})")
    title = capitalised(quantity_words(quantity))
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, color=INK)
    figure.supxlabel(_key(quantity, panels), fontsize=9, color=MUTED)
    return figure


def _panel(
    axes: Axes,
    x: Float[np.ndarray, " point"],
    curves: Curves,
    limits: Limits,
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
    for name, curve in curves.items():
        if name == reference:
            axes.plot(x, curve.value, color=colours[name], linewidth=5.0, alpha=0.35)
        else:
            draw_curve(axes, x, curve.value, curve.valid, colours[name])
        last = np.flatnonzero(np.isfinite(curve.value))[-1]
        ends[name] = (float(x[last]), float(curve.value[last]))
    name_curves(axes, ends, colours)


def _where_laws_hold(
    panels: Mapping[str, Curves], x: Float[np.ndarray, " point"]
) -> slice:
    """Return the stretch of x in which some law of the quantity holds."""
    valid = [curve.valid for curves in panels.values() for curve in curves.values()]
    held = np.flatnonzero(np.any(valid, axis=0))
    return slice(int(held[0]), int(held[-1]) + 1)


def _reference(curves: Curves) -> str:
    """Return the law that others of a panel are compared with, "" if none."""
    return next((name for name in REFERENCES if name in curves), "")


def _differences(curves: Curves) -> Curves:
    """Return each law over the reference less one, where both hold [%]."""
    reference = _reference(curves)
    if not reference:
        return {}
    against = curves[reference]
    found = {}
    for name, curve in curves.items():
        both = curve.valid & against.valid
        if both.any():
            per_cent = 100.0 * (curve.value / against.value - 1.0)
            found[name] = Curve(np.where(both, per_cent, np.nan), np.ones_like(both))
    return found if len(found) > 1 else {}


def _unit(quantity: str, panels: Mapping[str, Curves]) -> Unit:
    if quantity in SPEEDS:
        return Unit("", 1.0)
    return unit_for(quantity, float(np.median(_valid_values(panels))))


def _valid_values(panels: Mapping[str, Curves]) -> Float[np.ndarray, " value"]:
    every = [curve for curves in panels.values() for curve in curves.values()]
    return np.concatenate([curve.value[curve.valid] for curve in every])


def _value_limits(quantity: str, panels: Mapping[str, Curves], unit: Unit) -> Limits:
    values = _valid_values(panels) / unit.size
    if quantity in SPEEDS:
        values = values[values > LEAST_SLOWNESS]
    margin = 1.1 if values.max() < 20.0 * values.min() else 1.5
    return float(values.min()) / margin, float(values.max()) * margin


def _difference_limits(quantity: str, compared: Mapping[str, Curves]) -> Limits:
    every = [curve.value for curves in compared.values() for curve in curves.values()]
    low, high = min(float(np.nanmin(every)), -1.0), max(float(np.nanmax(every)), 1.0)
    margin = 0.08 * (high - low)
    most = MOST_APART.get(quantity, CUT_OFF)
    return max(low - margin, -most), min(high + margin, most)


def _label(quantity: str, unit: Unit) -> str:
    if quantity in SPEEDS:
        return f"arrival × {SPEEDS[quantity]:g} m/s / R"
    if split_name(quantity)[1] in ("_s", "_pa_s", "_m"):
        return f"{unit.symbol}/{ROOT}"
    return unit.symbol


def _key(quantity: str, panels: Mapping[str, Curves]) -> str:
    parts = ["solid: where the law holds", "dashed: outside its range"]
    parts += [
        f"{name}: {MASS:g} kg"
        for name in UNSCALED
        if any(name in curves for curves in panels.values())
    ]
    if quantity == "shock_radius_m":
        parts.append("all but sedov_taylor: arrivals read the other way round")
    if len(panels) > 1:
        return "    ".join(parts)
    return "    ".join(parts[:2]) + "\n" + "    ".join(parts[2:])
