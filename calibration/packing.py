"""How far apart do directions of a view set stand, beside what is possible?

    python -m calibration.packing > calibration/results/packing.txt

Packing distance, the least angle between two directions [deg]. On the hemisphere: the
lattices of `camera/bake/recipe.py`; "found" is the best of a few searches from random
and from lattice starts (seed 0), so that the best known there is at least that; "bound"
is what no packing exceeds, by areas. On the whole sphere, of which the thesis quotes
"up to 8 %" (Hardin, Michaels and Saff 2016): the plain Fibonacci lattice and the best
offset; "found" likewise, which for 8 points has the 74.8585 of Schuette and van der
Waerden (1951, as in Cohn's table of spherical codes), for 12 the icosahedron's 63.4349;
"bound" is Fejes Toth's. Gains are over the plain lattice. Writes
calibration/results/packing.png.
"""

import csv
import math
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import minimize

from jblast.report.figure_files import write_figure
from jblast.report.figure_style import COLOURS, INK, new_figure, quiet
from jblast.sensors.camera.bake.recipe import (
    GOLDEN_ANGLE,
    best_offset,
    fibonacci_lattice,
    hemisphere_bound,
    latitude_grid,
    offset_lattice,
    packing_distance,
    sphere_bound,
    spiral_lattice,
)

NUMBERS = (8, 12, 16, 24, 32, 48, 64, 96, 128, 256, 512)
SLOANE = Path(__file__).parent / "data" / "sloane_packings.csv"
SEARCHED = 64
"""Most points that are searched for: it takes as long as the cube of their number."""
POINTS = ("found", "best known (Sloane)")
"""What is drawn without a line."""
FIGURE = Path(__file__).parent / "results" / "packing.png"


def sphere_lattice(number: int, offset: float = 0.5) -> np.ndarray:
    """Return a Fibonacci lattice on the whole sphere."""
    index = np.arange(number)
    height = 1.0 - 2.0 * (index + offset) / (number - 1 + 2.0 * offset)
    return vectors(np.stack([np.arccos(height), GOLDEN_ANGLE * index]))


def vectors(angles: np.ndarray) -> np.ndarray:
    """Return unit vectors of angles from the zenith and of azimuths."""
    theta, phi = angles
    across = np.sin(theta)
    return np.stack([across * np.cos(phi), across * np.sin(phi), np.cos(theta)], -1)


def found(start: np.ndarray, lowest: float) -> float:
    """Return the packing distance that a search from a start reaches [rad].

    Repulsion by a power of the distance that grows: in the end the nearest two decide.
    """
    number = len(start)
    above, beside = np.triu_indices(number, 1)
    x = np.concatenate([np.arccos(start[:, 2]), np.arctan2(start[:, 1], start[:, 0])])
    bounds = [(0.0, lowest)] * number + [(None, None)] * number
    for power in (4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0):

        def energy(x, power=power):
            theta, phi = x.reshape(2, -1)
            place = vectors(x.reshape(2, -1))
            apart = place[above] - place[beside]
            logs = np.log(np.sum(apart**2, axis=1) + 1e-12)
            top = -logs.min()
            weights = np.exp(power * (-logs - top))
            total = weights.sum()
            pulls = (-2.0 * weights / total * np.exp(-logs))[:, None] * apart
            slope = np.zeros_like(place)
            np.add.at(slope, above, pulls)
            np.add.at(slope, beside, -pulls)
            down = [
                *(np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi)),
                -np.sin(theta),
            ]
            round_ = [-np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi)]
            by_theta = np.sum(slope * np.stack(down, -1), axis=1)
            by_phi = np.sum(slope[:, :2] * np.stack(round_, -1), axis=1)
            return top + math.log(total) / power, np.concatenate([by_theta, by_phi])

        options = {"maxiter": 400, "ftol": 1e-13, "gtol": 1e-9}
        x = minimize(
            energy, x, jac=True, method="L-BFGS-B", bounds=bounds, options=options
        ).x
    return packing_distance(vectors(x.reshape(2, -1)))


def best_found(number: int, lattice: np.ndarray, lowest: float) -> float:
    """Return the best of searches from the lattice and from random starts [rad]."""
    draw = np.random.default_rng(0)
    starts = [lattice]
    for _ in range(8 if number <= 16 else 2):
        start = draw.normal(size=(number, 3))
        if lowest < 2.0:
            start[:, 2] = np.abs(start[:, 2])
        starts.append(start / np.linalg.norm(start, axis=1, keepdims=True))
    return max(found(start, lowest) for start in starts)


def best_known() -> dict[int, float]:
    """Return Sloane's angle between so many points on the sphere [rad]."""
    lines = SLOANE.read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return {int(row["points"]): math.radians(float(row["angle_deg"])) for row in rows}


def known_for(number: int, known: dict[int, float]) -> tuple[float, bool]:
    """Return the best known angle [rad], and whether it is of more points; else NaN."""
    more = [points for points in known if points >= number]
    if not more:
        return math.nan, False
    return known[min(more)], min(more) > number


def best_of(offsets: np.ndarray, lattice: Callable[[float], np.ndarray]) -> float:
    """Return the greatest packing distance of a lattice over its offset [rad]."""
    return max(packing_distance(lattice(float(offset))) for offset in offsets)


def main() -> None:
    """Print both tables and draw the first."""
    rows = []
    print("  hemisphere                              packing distance [deg]")
    print("  views  plain  offset (at)  gain   spiral   grid   found   bound")
    for n in NUMBERS:
        plain = packing_distance(fibonacci_lattice(n))
        offset = packing_distance(offset_lattice(n))
        searched = math.nan
        if n <= SEARCHED:
            searched = best_found(n, offset_lattice(n), math.pi / 2)
        row = [plain, offset, packing_distance(spiral_lattice(n))]
        row += [packing_distance(latitude_grid(n)), searched, hemisphere_bound(n)]
        rows.append(row)
        deg = [math.degrees(value) for value in row]
        told = f"{deg[4]:7.2f}" if n <= SEARCHED else "      -"
        print(
            f"  {n:5d} {deg[0]:6.2f} {deg[1]:6.2f} ({best_offset(n):4.2f})"
            f" {100 * (offset / plain - 1):4.1f} % {deg[2]:7.2f} {deg[3]:6.2f} {told}"
            f" {deg[5]:7.2f}"
        )
    print("\n  whole sphere                   packing distance [deg]")
    print("  views  plain  offset  gain   found      known     bound")
    known, spheres = best_known(), []
    for n in NUMBERS:
        plain = packing_distance(sphere_lattice(n))
        offset = best_of(
            np.arange(0.0, 5.001, 0.02), lambda e, n=n: sphere_lattice(n, e)
        )
        searched = best_found(n, sphere_lattice(n), math.pi) if n <= SEARCHED else None
        best, of_more = known_for(n, known)
        spheres.append([plain, offset, searched or math.nan, best, sphere_bound(n)])
        told = f"{math.degrees(searched):7.4f}" if searched else "      -"
        sloane = f"{math.degrees(best):7.4f}" if math.isfinite(best) else "      -"
        print(
            f"  {n:5d} {math.degrees(plain):6.2f} {math.degrees(offset):7.2f}"
            f" {100 * (offset / plain - 1):4.1f} % {told} {'>=' if of_more else '  '}"
            f"{sloane} {math.degrees(sphere_bound(n)):7.4f}"
        )
    draw_figure(np.array(rows), np.array(spheres))


def draw_figure(rows: np.ndarray, spheres: np.ndarray) -> None:
    """Draw packing distances times the root of the number, so that they are level."""
    figure = new_figure(11.0, 4.4)
    half, whole = figure.subplots(1, 2)
    names = ("plain Fibonacci", "offset Fibonacci", "spiral", "latitude grid", "found")
    lines = [*zip(names, rows.T[:5], COLOURS, strict=False)]
    draw_lines(half, lines, rows[:, 5], "bound by area")
    half.set_ylim(0.0, 4.9)
    half.set_xlabel("views on the hemisphere")
    names = ("plain Fibonacci", "offset Fibonacci", "found", "best known (Sloane)")
    colours = (*COLOURS[:2], COLOURS[4], INK)
    draw_lines(
        whole,
        [*zip(names, spheres.T[:4], colours, strict=True)],
        spheres[:, 4],
        "bound by Fejes Tóth",
    )
    whole.set_ylim(2.7, 4.3)
    whole.set_xlabel("points on the whole sphere")
    write_figure(figure, FIGURE)


def draw_lines(
    axes: Axes,
    lines: Iterable[tuple[str, np.ndarray, str]],
    bound: np.ndarray,
    why: str,
) -> None:
    """Draw distances by number: lattices as lines, packings as points."""
    root = np.sqrt(NUMBERS)
    for name, distances, colour in lines:
        marker = "x" if name.startswith("best known") else "o"
        line = "-" if name not in POINTS else ""
        axes.plot(
            NUMBERS,
            distances * root,
            marker=marker,
            linestyle=line,
            color=colour,
            label=name,
        )
    axes.plot(NUMBERS, bound * root, "--", color=INK, label=why)
    axes.set_xscale("log", base=2)
    axes.set_xticks(NUMBERS[::2], [str(n) for n in NUMBERS[::2]])
    axes.set_ylabel("least angle × √number [rad]")
    quiet(axes)
    axes.legend(frameon=False, fontsize=9, ncols=2, loc="upper right")


if __name__ == "__main__":
    main()
