"""Arrays small and large beside the distance: do 90 % intervals contain the truth?

    python -m calibration.array_coverage --workers 16 --rows out/rows.csv
    python -m calibration.array_coverage --first 0 --last 50 --rows out/part.csv
    python -m calibration.array_coverage --from out/rows.csv > \
        calibration/results/array_coverage.txt
    python -m calibration.array_coverage --grid > calibration/results/array_grid.txt

200 random layouts: 4 to 12 sensors in one to three clusters, aperture over range from
0.001 to 1 (uniform in the logarithm), range 20 m to 5 km. Mass, place and origin time
are free. The travel times, at scaled distances within the law, have errors of 1 %,
correlated between paths by a function and a length that differ from those of the fit:
exponential in the angle between directions and ln of the range, or von Karman (Matern
of order 5/6), with a length of 0.2 to 0.8, drawn for each layout; 1 % of the shot in
addition; independent normal errors of 20 us. A second set has the aperture above half
the range and independent errors of 1 %. Layouts are numbered, each with a random key of
its own, so that parts of them can be fitted separately.

Where an array cannot distinguish two bearings, as with a line of sensors, the true one
has to be inside either interval.

With `--grid` the fit is not used. For every fifth layout the posterior is summed over a
grid of ln of the range (steps of 0.2, from 0.3 to 1,000 widths of the array), bearing
(1 degree) and ln of the mass (scaled distances of 0.3 to 100 m/kg^(1/3)), flat in all
three and in the origin time, which is integrated in closed form. Errors are normal,
correlated between paths by the four equally probable functions of
`jblast.sensors.path_scatter`, and of 1 % of the shot. A range that is uncertain there
cannot be identified by a fit of the same model.
"""

import argparse
import csv
import dataclasses
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.special import gamma, kv

from jblast.cli.jax_start import start_jax

start_jax()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
from jax.scipy.linalg import solve_triangular  # noqa: E402
from jax.scipy.special import logsumexp  # noqa: E402

from jblast.inference import fit  # noqa: E402
from jblast.observations import observed  # noqa: E402
from jblast.scene import Scene, UncertainScene, freed  # noqa: E402
from jblast.sensors.path_scatter import KERNELS, correlations, embedded  # noqa: E402
from jblast.waves import kingery_bulmash_arrival_time  # noqa: E402

LAYOUTS = 200
INDEPENDENT = 60
"""Layouts of the second set, numbered after those of the first."""
SD = 0.01
SIGMA = 2e-5
FIELDS = ("number", "set", "form", "length", "sensors", "clusters", "aperture")
EACH = 5
"""Every fifth layout is summed over the grid."""
STEP = 0.2
NEAREST, FARTHEST = 0.3, 1000.0
BEARINGS, MASSES = 360, 33
SCALED_RANGES = 0.3, 100.0
WIDE = 5.0
"""A range whose 90 % interval spans a larger factor counts as unknown."""
ANSWERS = (
    *("answer", "east", "north", "time", "bearing", "bearings"),
    *("range", "exit", "east_width"),
)


def layout(rng: np.random.Generator, *, large: bool):
    """Return sensors, charge and clusters; the charge lies at the origin.

    Args:
        rng: Source of random numbers.
        large: Whether the aperture is above half the range, in one cluster.
    """
    sensors = int(rng.integers(4, 13))
    clusters = 1 if large else int(rng.integers(1, 4))
    low = math.log10(0.5) if large else -3.0
    aperture = 10 ** rng.uniform(low, 0.0)
    reach = 10 ** rng.uniform(math.log10(20.0), math.log10(5000.0))
    places = rng.uniform(-0.5, 0.5, (sensors, 2))
    if clusters > 1:
        middles = rng.uniform(-0.5, 0.5, (clusters, 2))
        size = 10 ** rng.uniform(-2.0, -0.5)
        places = middles[np.arange(sensors) % clusters] + size * places
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1).max()
    places = (places - places.mean(axis=0)) * aperture / apart * reach
    angle = rng.uniform(0, 2 * np.pi)
    return places + reach * np.array([np.cos(angle), np.sin(angle)]), clusters, aperture


def correlation(places: np.ndarray, form: str, length: float) -> np.ndarray:
    """Return the correlation of the scatter between paths from the origin."""
    reach = np.linalg.norm(places, axis=1)
    unit = places / reach[:, None]
    angle = np.arccos(np.clip(unit @ unit.T, -1, 1))
    apart = np.hypot(angle, np.log(reach)[:, None] - np.log(reach)[None, :])
    if form == "independent":
        return np.eye(len(places))
    if form == "exponential":
        return np.exp(-apart / length)
    x = np.maximum(apart / (0.6 * length), 1e-9)
    order = 5 / 6
    return 2 ** (1 - order) / gamma(order) * x**order * kv(order, x)


class Simulated(NamedTuple):
    """One layout with its times; the charge lies at the origin.

    Attributes:
        form: Name of the correlation of its errors; see `correlation`.
        length: Of the correlation.
        reach: From the charge to each sensor [m].
    """

    places: np.ndarray
    clusters: int
    aperture: float
    form: str
    length: float
    reach: np.ndarray
    times: np.ndarray


def simulated(number: int) -> Simulated:
    """Return a layout by its number, with times drawn for it."""
    rng = np.random.default_rng([38, number])
    large = number >= LAYOUTS
    places, clusters, aperture = layout(rng, large=large)
    form = "independent" if large else str(rng.choice(["exponential", "von Karman"]))
    length = float(10 ** rng.uniform(math.log10(0.2), math.log10(0.8)))
    reach = np.linalg.norm(places, axis=1)
    # a scaled distance of 3 to 30 m/kg^(1/3) at the nearest sensor, within the law
    mass = (reach.min() / 10 ** rng.uniform(math.log10(3.0), math.log10(20.0))) ** 3
    travel = np.asarray(kingery_bulmash_arrival_time(jnp.asarray(reach), mass))
    root = np.linalg.cholesky(
        correlation(places, form, length) + 1e-12 * np.eye(len(reach))
    )
    scatter = SD * (root @ rng.standard_normal(len(reach)) + rng.standard_normal())
    times = 1.0 + travel * (1 + scatter) + SIGMA * rng.standard_normal(len(reach))
    return Simulated(places, clusters, aperture, form, length, reach, times)


def one(number: int) -> dict:
    """Fit one simulated log, and return whether its intervals contain the truth."""
    case = simulated(number)
    places, reach, times = case.places, case.reach, case.times
    middle = places.mean(axis=0)
    log = observed(
        [f"m{i}" for i in range(len(reach))],
        ["air_arrival_s"] * len(reach),
        times,
        [SIGMA] * len(reach),
        position=np.column_stack([places - middle, 0 * reach]),
    )
    scene = dataclasses.replace(Scene(), law=(("air_arrival_s", "kingery_bulmash"),))
    names = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")
    found = fit(log, freed(UncertainScene(scene), list(names)))
    row = dict(
        zip(
            FIELDS,
            (
                *(number, int(number >= LAYOUTS), case.form, case.length),
                *(len(reach), case.clusters, case.aperture),
            ),
            strict=True,
        )
    )
    summary = found.summary
    row |= {name: "" for name in ANSWERS} | {"exit": found.exit_code}
    if "bearing_deg" in summary.derived:
        true = math.degrees(math.atan2(-middle[0], -middle[1]))
        row["answer"] = "bearing"
        row["bearing"] = 0
        for name in ("bearing_deg", "other_bearing_deg"):
            bearing = summary.derived.get(name)
            if bearing is not None:
                off = (true - bearing.q50 + 180) % 360 - 180
                inside = bearing.q05 <= bearing.q50 + off <= bearing.q95
                row["bearing"] |= int(inside)
                row["bearings"] = 1 + (name == "other_bearing_deg")
        distance = summary.derived["range_m"]
        farthest = math.inf if math.isnan(distance.q95) else distance.q95
        row["range"] = int(distance.q05 <= math.hypot(*middle) <= farthest)
        return row
    if not all(summary.estimates[name].identified for name in names[1:3]):
        return row | {"answer": "none"}
    row["answer"] = "place"
    truth = {"east": -middle[0], "north": -middle[1], "time": 1.0}
    for short, name in zip(truth, names[1:], strict=True):
        estimate = summary.estimates[name]
        row[short] = int(estimate.q05 <= truth[short] <= estimate.q95)
    east = summary.estimates["charge_east_m"]
    row["east_width"] = (east.q95 - east.q05) / reach.mean()
    return row


def table(rows: list[dict]) -> list[str]:
    """Return the counts of kept rows."""
    lines = []

    def share(of: list[dict], name: str) -> str:
        values = [float(r[name]) for r in of if r[name] != ""]
        return f"{100 * np.mean(values):3.0f} %" if values else "    -"

    for label, of in (
        ("correlated, all", [r for r in rows if not int(r["set"])]),
        *(
            (
                f"  {form}",
                [r for r in rows if not int(r["set"]) and r["form"] == form],
            )
            for form in ("exponential", "von Karman")
        ),
        *(
            (
                f"  aperture/range {low:g} to {high:g}",
                [
                    r
                    for r in rows
                    if not int(r["set"]) and low <= float(r["aperture"]) < high
                ],
            )
            for low, high in ((0.001, 0.01), (0.01, 0.1), (0.1, 1.01))
        ),
        ("independent, above 0.5", [r for r in rows if int(r["set"])]),
    ):
        if not of:
            continue
        place = [r for r in of if r["answer"] == "place"]
        alone = [r for r in of if r["answer"] == "bearing"]
        none = sum(r["answer"] == "none" for r in of)
        two = sum(str(r.get("bearings")) == "2" for r in alone)
        lines.append(
            f"{label:28s} {len(of):4d} layouts; place {len(place):3d}: east "
            f"{share(place, 'east')}, north {share(place, 'north')}, time "
            f"{share(place, 'time')}; bearing alone {len(alone):3d} ({two} with two): "
            f"{share(alone, 'bearing')}, range {share(alone, 'range')}; neither {none}"
        )
    numbers = sorted(int(r["number"]) for r in rows)
    lines.append(
        f"layouts {numbers[0]} to {numbers[-1]} of {LAYOUTS} and {INDEPENDENT} more"
    )
    return lines


@jax.jit
def at_range(places, times, distance, kernel):
    """Return ln of the likelihood at one range, by mass and bearing."""
    turn = 2 * jnp.pi * jnp.arange(BEARINGS) / BEARINGS
    charge = places.mean(axis=0) + distance * jnp.stack(
        [jnp.sin(turn), jnp.cos(turn)], axis=1
    )
    toward = charge[:, None] - places[None]
    reach = jnp.linalg.norm(toward, axis=2)

    def correlation(toward, reach):
        flat = jnp.concatenate([toward, jnp.zeros_like(reach)[:, None]], axis=1)
        place, _ = embedded(flat, reach)
        return correlations(place, place, kernel) + 1.0  # and the shot

    shared = jax.vmap(correlation)(toward, reach)

    def of_mass(log_z):
        mass = (distance / jnp.exp(log_z)) ** 3
        travel = kingery_bulmash_arrival_time(reach.ravel(), mass).reshape(reach.shape)
        covariance = SD**2 * shared * travel[:, :, None] * travel[:, None, :]
        root = jnp.linalg.cholesky(covariance + SIGMA**2 * jnp.eye(reach.shape[1]))

        def white(rows):
            return solve_triangular(root, rows[..., None], lower=True)[..., 0]

        one, left = white(jnp.ones_like(travel)), white(times - travel)
        known = jnp.sum(one**2, axis=1)
        misfit = jnp.sum(left**2, axis=1) - jnp.sum(one * left, axis=1) ** 2 / known
        size = jnp.sum(jnp.log(jnp.diagonal(root, axis1=1, axis2=2)), axis=1)
        found = -0.5 * (misfit + jnp.log(known)) - size
        return jnp.where(jnp.isfinite(found), found, -jnp.inf)

    low, high = np.log(SCALED_RANGES)
    return jax.lax.map(of_mass, jnp.linspace(low, high, MASSES))


def grid_row(number: int) -> dict[str, float]:
    """Return the intervals of one layout, and whether they contain the truth."""
    case = simulated(number)
    places, times = jnp.asarray(case.places), jnp.asarray(case.times)
    apart = case.places[:, None] - case.places[None]
    width = float(np.linalg.norm(apart, axis=-1).max())
    log_range = np.arange(math.log(NEAREST * width), math.log(FARTHEST * width), STEP)
    kernels = jnp.eye(len(KERNELS))
    of_each = np.array(
        [
            logsumexp(
                jnp.stack([at_range(places, times, math.exp(r), k) for k in kernels]),
                axis=(0, 1),
            )
            for r in log_range
        ]
    )
    weight = np.exp(of_each - of_each.max())
    weight /= weight.sum()
    low, high = np.exp(np.interp([0.05, 0.95], weight.sum(axis=1).cumsum(), log_range))
    east, north = case.places.mean(axis=0)  # the charge is the origin
    true = math.hypot(east, north)
    bearing = np.arange(BEARINGS) * 2 * math.pi / BEARINGS
    middle = np.angle(weight.sum(axis=0) @ np.exp(1j * bearing))
    off = (bearing - middle + math.pi) % (2 * math.pi) - math.pi
    order = np.argsort(off)
    left, right = np.interp(
        [0.05, 0.95], weight.sum(axis=0)[order].cumsum(), off[order]
    )
    aside = math.atan2(-east, -north) - middle
    aside = (aside + math.pi) % (2 * math.pi) - math.pi
    half_a_step = math.pi / BEARINGS
    return {
        "aperture": case.aperture,
        "range": low <= true <= high,
        "bearing": left - half_a_step <= aside <= right + half_a_step,
        "factor": high / low,
    }


def grid_table() -> list[str]:
    """Return how often intervals of the grid contain the truth, and known ranges."""
    rows = [grid_row(number) for number in range(1, LAYOUTS, EACH)]
    lines = []
    for label, low, high in (
        ("all", 0.0, math.inf),
        ("aperture/range below 0.1", 0.0, 0.1),
        ("aperture/range above 0.1", 0.1, math.inf),
    ):
        of = [r for r in rows if low <= r["aperture"] < high]
        known = sum(r["factor"] <= WIDE for r in of)
        lines.append(
            f"{label:26s} {len(of):3d} layouts; 90 % intervals contain range "
            f"{100 * np.mean([r['range'] for r in of]):3.0f} %, bearing "
            f"{100 * np.mean([r['bearing'] for r in of]):3.0f} %; range known within a "
            f"factor of {WIDE:g} in {known}"
        )
    return lines


def main() -> None:
    """Fit a range of layouts, or count kept rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=LAYOUTS + INDEPENDENT)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--rows", type=Path)
    parser.add_argument("--from", dest="kept", type=Path, nargs="*")
    parser.add_argument("--grid", action="store_true")
    args = parser.parse_args()
    if args.grid:
        print("\n".join(grid_table()))
        return
    if args.kept:
        rows = [row for path in args.kept for row in csv.DictReader(path.open())]
    else:
        numbers = range(args.first, args.last)
        rows = []
        with ProcessPoolExecutor(args.workers, mp_context=get_context("spawn")) as pool:
            for row in pool.map(one, numbers):
                rows.append(row)
                print(row, file=sys.stderr, flush=True)
        if args.rows:
            with args.rows.open("w", newline="") as file:
                writer = csv.DictWriter(file, [*FIELDS, *ANSWERS])
                writer.writeheader()
                writer.writerows(rows)
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
