"""Draw the recordings of ground motion beside the law, by range and by burial."""

from collections.abc import Mapping
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from calibration.ground_motion_fit import read_records
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import COLOURS, INK, MARKERS, new_figure, quiet, titled
from jblast.waves.laws.ground_motion import GroundMotionCurve, log_curve

AXES = {
    "ground_displacement_m": (
        "peak displacement over W$^{1/3}$ [m/kg$^{1/3}$]",
        "displacement",
    ),
    "ground_peak_velocity_m_s": ("peak velocity [m/s]", "velocity"),
}
ABOVE, BURIED = 0.5, -1.0
"""Scaled heights that curves are drawn for [m/kg^(1/3)]."""


def draw(curves: Mapping[str, GroundMotionCurve], path: Path) -> None:
    """Write the figure: each quantity by range, and its coupling by burial."""
    records = read_records()
    log_range, height = map(np.asarray, records.place())
    figure = new_figure(10.0, 7.6)
    panels = figure.subplots(2, 2)
    z = np.geomspace(20.0, 1000.0, 50)
    x = np.linspace(-1.6, 1.0, 400)
    for (by_range, by_burial), (quantity, curve) in zip(
        panels, curves.items(), strict=True
    ):
        label, word = AXES[quantity]
        value, b = records.log_value[quantity], np.asarray(curve.coefficients)
        for site, colour, marker in zip(
            np.unique(records.site), COLOURS, MARKERS, strict=False
        ):
            mine = records.site == site
            buried = mine & (height < float(b[4]))
            for rows, face in ((mine & ~buried, "none"), (buried, colour)):
                by_range.plot(
                    np.exp(log_range[rows]),
                    np.exp(value[rows]),
                    marker,
                    color=colour,
                    markerfacecolor=face,
                    markersize=5,
                )
            at_100 = value - float(b[1]) * (log_range - np.log(100.0))
            by_burial.plot(
                height[mine],
                np.exp(at_100[mine]),
                marker,
                color=colour,
                markerfacecolor="none",
                markersize=5,
                label=site,
            )
        for level, style in ((BURIED, "-"), (ABOVE, "--")):
            line = log_curve(curve.coefficients, jnp.log(z), jnp.full(z.shape, level))
            by_range.plot(z, np.exp(line), style, color=INK)
        at_100 = jnp.full(x.shape, jnp.log(100.0))
        line = log_curve(curve.coefficients, at_100, jnp.asarray(x))
        by_burial.plot(x, np.exp(line), color=INK)
        by_range.set(xscale="log", yscale="log", ylabel=label)
        by_range.set_xlabel("R/W$^{1/3}$ [m/kg$^{1/3}$]")
        by_burial.set(yscale="log", xlabel="h/W$^{1/3}$ [m/kg$^{1/3}$]")
        titled(by_range, word, "filled: buried; line: buried, dashed: above")
        titled(by_burial, f"{word}, taken to 100 m/kg$^{{1/3}}$")
        by_burial.legend(frameon=False, fontsize=9)
        for axes in (by_range, by_burial):
            quiet(axes)
    write_figure(figure, path)
