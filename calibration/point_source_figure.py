"""The decay of a point source by the solver, what it differs by, and its profiles."""

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

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
from jblast.waves.euler.march import March
from jblast.waves.point_source_front import log_overpressure_ratio, point_source_nodes

PROFILES = (0.3, 1.0, 3.0, 10.0)
"""Radii of the shock whose profiles are drawn, lambda."""


def point_source_figure(decay: Decay, run: March) -> Figure:
    """Draw four plots: decay, differences, profiles, and the last profile's wave.

    Args:
        decay: The solver's, at nodes.
        run: To lambda = 100.
    """
    figure = new_figure(11.0, 8.0)
    (above, apart), (inside, wave) = figure.subplots(2, 2)
    above.loglog(decay.scaled, decay.overpressure_ratio, color=BLUE)
    printed = np.array(point_source_nodes()[:-2])
    curve = np.exp(np.asarray(log_overpressure_ratio(jnp.log(printed))))
    above.loglog(printed, curve, "o", color=VERMILLION, markersize=5)
    above.set_ylabel("p/P0")
    titled(above, "Decay", "line: solver; dots: printed")
    fine = np.geomspace(0.1, 100.0, 500)
    solver = np.exp(np.asarray(decay.pressure_curve().value(jnp.log(fine))))
    now = np.exp(np.asarray(log_overpressure_ratio(jnp.log(fine))))
    apart.semilogx(fine, 100.0 * (now / solver - 1.0), color=INK)
    at_nodes = np.exp(np.asarray(decay.pressure_curve().value(jnp.log(printed))))
    apart.semilogx(
        printed, 100.0 * (curve / at_nodes - 1.0), "o", color=VERMILLION, markersize=5
    )
    apart.set_ylabel("over the solver - 1 [%]")
    titled(apart, "Interpolated now", "dots: the printed values")
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
