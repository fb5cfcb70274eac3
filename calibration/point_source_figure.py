"""The decay of a point source by the solver, what it differs by, and its profiles."""

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from calibration.point_source_references import END, hancock, law_over
from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.waves.euler import (
    Decay,
    IdealGas,
    cell_centres,
    point_source_march,
    primitives,
)
from jblast.waves.euler.run import March
from jblast.waves.laws.point_source import log_overpressure_ratio

PROFILES = (0.3, 1.0, 3.0, 10.0)
"""Radii of the shock whose profiles are drawn, lambda."""


def point_source_figure(decay: Decay, run: March) -> Figure:
    """Draw four plots: decay, differences, profiles, and the last profile's wave.

    Args:
        decay: The solver's, between the nodes of its table.
        run: To lambda = 100.
    """
    figure = new_figure(11.0, 8.0)
    (above, apart), (inside, wave) = figure.subplots(2, 2)
    above.loglog(decay.scaled, decay.overpressure_ratio, color=BLUE)
    log_scaled, log_ratio, _ = hancock(0.1, END)
    above.loglog(
        np.exp(log_scaled), np.exp(log_ratio), "o", color=VERMILLION, markersize=5
    )
    above.set_ylabel("p/P0")
    titled(above, "Decay", "line: solver; dots: blast-ips, table S1x4")
    pressure, _ = law_over(decay)
    apart.semilogx(decay.scaled, 1e6 * pressure, color=INK, linewidth=0.9)
    curve = np.asarray(log_overpressure_ratio(jnp.asarray(log_scaled)))
    apart.semilogx(
        np.exp(log_scaled),
        1e6 * np.expm1(curve - log_ratio),
        "o",
        color=VERMILLION,
        markersize=5,
    )
    apart.set_ylabel("point_source over it - 1, millionths")
    titled(apart, "Between the nodes", "line: over the solver; dots: over S1x4")
    for axes in (above, apart):
        axes.set_xlabel(r"$\lambda$")
        log_ticks(axes.xaxis, (0.1, 100.0))
    for number, end in enumerate(PROFILES):
        short = point_source_march(400, end)
        place, pressure = _profile(short)
        inside.plot(
            place / end,
            (pressure - 1.0) / (short.history.front_pressure[-1] - 1.0),
            color=BLUE,
            alpha=1.0 - 0.22 * number,
            label=rf"$\lambda$ = {end:g}",
        )
    inside.set_ylim(-0.6, 1.05)
    inside.set_xlabel("r/R")
    inside.set_ylabel("p over that at the shock")
    inside.legend(frameon=False, fontsize=9)
    titled(inside, "Profiles", "overpressures")
    place, pressure = _profile(run)
    end = float(run.state.clock)
    wave.plot(place - end, 1e3 * (pressure - 1.0), ".-", color=BLUE, markersize=3)
    wave.axhline(0.0, color=MUTED, linewidth=0.8)
    wave.set_xlim(-4.0, 0.1)
    wave.set_xlabel(r"$r - R$ in units of $(E/P_0)^{1/3}$")
    wave.set_ylabel("p/P0, thousandths")
    titled(wave, rf"The wave at $\lambda$ = {end:g}", "dots: cells")
    for axes in (above, apart, inside, wave):
        quiet(axes)
    return figure


def _profile(run: March) -> tuple[np.ndarray, np.ndarray]:
    cells = primitives(run.state, IdealGas())
    return np.asarray(cell_centres(run.state.radius, "spherical")), np.asarray(
        cells.pressure
    )
