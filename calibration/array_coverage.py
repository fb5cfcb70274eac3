"""Arrays small and large beside the distance: do 90 % intervals contain the truth?

    python -m calibration.array_coverage --workers 16 --rows out/rows.csv
    python -m calibration.array_coverage --first 0 --last 50 --rows out/part.csv
    python -m calibration.array_coverage --from out/rows.csv > \
        calibration/results/array_coverage.txt

200 random layouts: 4 to 12 sensors in one to three clusters, aperture over range from
0.001 to 1 (uniform in the logarithm), range 20 m to 5 km. Mass, place and origin time
are free. The travel times, at scaled distances within the law, have errors of 1 %,
correlated between paths by a function and a length that differ from those of the fit:
exponential in the angle between directions and ln of the range, or von Karman (Matern
of order 5/6), with a length of 0.2 to 0.8, drawn for each layout; 1 % of the shot in
addition; independent normal errors of 20 us. A second set has the aperture above half
the range and independent errors of 1 %. Layouts are numbered, each with a random key of
its own, so that parts of them can be fitted separately.
"""

import argparse
import csv
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.special import gamma, kv

from jblast.cli.jax_start import start_jax

LAYOUTS = 200
INDEPENDENT = 60
"""Layouts of the second set, numbered after those of the first."""
SD = 0.01
SIGMA = 2e-5
FIELDS = ("number", "set", "form", "length", "sensors", "clusters", "aperture")
ANSWERS = ("answer", "east", "north", "time", "bearing", "exit", "east_width")


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
    import jax.numpy as jnp

    from jblast.waves import kingery_bulmash_arrival_time

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
    start_jax()
    import dataclasses

    from jblast.inference import fit
    from jblast.observations import observed
    from jblast.scene import Scene, UncertainScene, freed

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
        bearing = summary.derived["bearing_deg"]
        true = math.degrees(math.atan2(-middle[0], -middle[1]))
        off = (bearing.value - true + 180) % 360 - 180
        row["answer"] = "bearing"
        row["bearing"] = int(abs(off) <= 1.645 * bearing.sd)
        return row
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
        place = [r for r in of if r["answer"] == "place"]
        alone = [r for r in of if r["answer"] == "bearing"]
        lines.append(
            f"{label:28s} {len(of):4d} layouts; place {len(place):3d}: east "
            f"{share(place, 'east')}, north {share(place, 'north')}, time "
            f"{share(place, 'time')}; bearing alone {len(alone):3d}: "
            f"{share(alone, 'bearing')}"
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
    args = parser.parse_args()
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
