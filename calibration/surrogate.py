"""Smooth event counts: how far they are off the hard ones, and what that does to a fit.

Run `python -m calibration.surrogate`; it prints a table and draws
`results/charts/surrogate.png`. The film is a fireball of 100 kg from 80 m, 250 frames/s
(`jblast.study.event_inversion`); its events are an ideal camera's.
"""

import time
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from matplotlib.ticker import NullLocator

from jblast.cli.jax_start import start_jax
from jblast.report.figure_style import (
    BLUE,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.sensors.camera.events.ideal import smooth_counts
from jblast.study.event_inversion import (
    MASS,
    MAX_EVENTS,
    STAGES,
    START,
    THRESHOLDS,
    TIMES,
    EventFit,
    coordinates,
    fit_events,
    log_frames,
    true_counts,
    true_frames,
)

TEMPERATURES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
STUCK = 0.5
"""Events a fit leaves, root mean square, that has not found the film."""
UNSMOOTHED = 0.1e-3
"""Shorter than a frame [s]."""
BESIDE = (1.05, 2e-3)
"""Factor of size, and seconds, from which each temperature alone is tried."""
POOR = ((1.2, 0.05), (1.2, -0.05), (0.8, 0.05), (0.8, -0.05))
"""Factor of size, and seconds, by which a start is off."""
FIGURE = Path(__file__).parent / "results" / "charts" / "surrogate.png"


class Bias(NamedTuple):
    """What one temperature does.

    Attributes:
        temperature: Of the counts.
        extra: Events of the film over those there are, less one [-].
        off: Root mean square of a pixel's sum of events, less the true one.
        radius: Of the fireball, as a fit finds it, over the true one, less one [-].
        start: As a fit finds it, less the true one [s].
        misfit: Root mean square of what the fit leaves, in events.
        converged: Whether the fit did.
    """

    temperature: float
    extra: float
    off: float
    radius: float
    start: float
    misfit: float
    converged: bool

    @property
    def mark(self) -> str:
        """Return what is wrong with the fit, if anything."""
        if not self.converged:
            return "not converged"
        return "stuck where it began" if self.misfit > STUCK else ""


def ends(found: EventFit) -> tuple[float, float]:
    """Return by how much a fit's radius [-] and start [s] are off."""
    mass = np.exp(found.values[0])
    return float(np.cbrt(mass / MASS) - 1.0), float(0.1 * found.values[1] - START)


def bias(counts: np.ndarray, temperature: float) -> Bias:
    """Measure one temperature."""
    frames = true_frames(jnp.asarray(TIMES))
    up, down = smooth_counts(frames, THRESHOLDS, temperature, most=MAX_EVENTS)
    extra = float(jnp.sum(up + down)) / np.abs(counts).sum() - 1.0
    off = np.asarray(jnp.cumsum(up - down, axis=0)) - np.cumsum(counts, axis=0)
    found = fit_events(
        log_frames,
        coordinates(MASS * BESIDE[0] ** 3, START + BESIDE[1]),
        counts,
        TIMES,
        THRESHOLDS,
        stages=((temperature, UNSMOOTHED),),
    )
    rms = float(np.sqrt(np.mean(off**2)))
    fitted = *ends(found), found.misfit, found.converged
    return Bias(temperature, extra, rms, *fitted)


def main() -> None:
    """Print both tables and draw the figure."""
    start_jax()
    counts = true_counts()
    rows = [bias(counts, temperature) for temperature in TEMPERATURES]
    print(f"Smooth counts of a fireball's film, {np.abs(counts).sum():,} events\n")
    print(
        f"{'temperature':>11}{'events':>10}{'off, rms':>10}{'radius':>12}{'start':>12}"
    )
    for row in rows:
        print(
            f"{row.temperature:11g}{row.extra:+10.2%}{row.off:10.3f}"
            f"{row.radius:+12.4%}{1e6 * row.start:+9.1f} us  {row.mark}".rstrip()
        )
    print("(radius and start from 5 % and 2 ms beside, at one temperature)")
    print("\nFound from events alone, from poor starts\n")
    print(f"{'start':>20}{'radius off':>12}{'start off':>12}{'steps':>7}{'seconds':>9}")
    for size, late in POOR:
        begin = time.perf_counter()
        found = fit_events(
            log_frames,
            coordinates(MASS * size**3, START + late),
            counts,
            TIMES,
            THRESHOLDS,
            stages=STAGES,
        )
        took = time.perf_counter() - begin
        radius, start = ends(found)
        words = f"{size - 1:+.0%}, {1e3 * late:+.0f} ms"
        off = f"{radius:+12.4%}{1e6 * start:+9.1f} us"
        mark = "" if found.converged else "  not converged"
        print(f"{words:>20}{off}{found.steps:7}{took:9.1f}{mark}")
    draw(rows)


def draw(rows: list[Bias]) -> None:
    """Draw what is off against the temperature."""
    figure = new_figure(10.0, 3.3)
    at = [row.temperature for row in rows]
    panels = (
        (
            "Events of the film",
            "too many or too few (%)",
            [100 * r.extra for r in rows],
        ),
        ("Radius that a fit finds", "off (%)", [100 * r.radius for r in rows]),
        ("Start that a fit finds", "off (us)", [1e6 * r.start for r in rows]),
    )
    grid = figure.subplots(1, len(panels))
    for axes, (name, label, values) in zip(grid, panels, strict=True):
        fitted = axes is not grid[0]
        axes.loglog(at, np.abs(values), color=MUTED, linewidth=1.0, zorder=1)
        for row, value in zip(rows, values, strict=True):
            colour = VERMILLION if value > 0 else BLUE
            inside = "white" if fitted and row.mark else colour
            style = {"color": colour, "markersize": 6, "markerfacecolor": inside}
            axes.plot(row.temperature, abs(value), "o", **style)
        axes.set(xlabel="temperature (thresholds)", ylabel=label)
        axes.set_xticks(at, [f"{temperature:g}" for temperature in at])
        axes.xaxis.set_minor_locator(NullLocator())
        titled(axes, name)
        quiet(axes)
    for colour, words, height in ((VERMILLION, "more", 0.9), (BLUE, "less", 0.81)):
        grid[0].text(0.05, height, words, color=colour, transform=grid[0].transAxes)
    if any(row.mark for row in rows):
        words, corner = "hollow: no fit", grid[1].transAxes
        grid[1].text(0.97, 0.9, words, color=MUTED, ha="right", transform=corner)
    figure.savefig(FIGURE)


if __name__ == "__main__":
    main()
