"""Do fits of random worlds give the truth back, and which sense buys how much?

    python -m calibration.world_round_trip fits [SECONDS [WORLDS [PROCESSES]]]
    python -m calibration.world_round_trip weights [SECONDS [WORLDS [PROCESSES]]]
    python -m calibration.world_round_trip > calibration/results/world_round_trip.txt

Worlds of one blast are drawn by `jblast.world`, one a seed, and read with all errors:
Student-t of the instruments, and what the laws scatter (subsets below).
Each subset of their readings is fitted with the priors that the world was drawn by, and
the truth is ranked among draws of the posterior, twice over: by the weighted draws of
`jblast fit` (part `fits`, which has to be run before), and, of a thousand
worlds, by `fit_many` with importance weights (part `weights`, likewise).
If intervals are right, ranks are uniform (Kolmogorov and Smirnov, Holm's correction
over all of a table).
Sharpness is the posterior sd of ln(mass), its median over the worlds, beside the least
sd that data and priors allow (Cramer and Rao, of the same worlds at their truths, in
coordinates in which priors are normal: of what is known by its prior alone it is no
strict bound), and beside the prior's. Writes calibration/results/world_round_trip.png.

Subsets. Three stations about the place see the flash, feel the ground, hear the bang
and its peak; a vehicle that hovers beside it, in worlds of the same blasts, sees the
flash and is jolted (when, how much and whereto, by what its IMU leaves of it).

Fits: a row a world is added to calibration/results/world_fits.csv, a few worlds of each
subset in turn; what the file holds already is not done again, and after so many seconds
none is begun.

Weights: all logs of a part are fitted at once by `fit_many`; 4,000 Student-t draws
about the optimum of each are weighted by its exact posterior (Pareto smoothed), and the
truth is ranked among them. Rows are added to calibration/results/world_weights.csv in
the same way.

To measure again, remove the files.
"""

import csv
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure
from scipy.stats import kstest

from calibration import run_part
from calibration.sbc import WRONG, holm
from jblast.cli.jax_start import start_jax
from jblast.inference import batch_of, fit_many, solve
from jblast.inference.answer import Answer as AtNumbers
from jblast.inference.density import Density, density_of
from jblast.inference.posterior.parameters import Parameters
from jblast.inference.sample import RELIABLE, Mixture, pareto_smoothed
from jblast.observations import Observations
from jblast.observations.table import some_rows
from jblast.report.colours import BLUE, INK, VERMILLION
from jblast.report.figures import new_figure, quiet, titled
from jblast.scene import UncertainScene, WorldSpec
from jblast.scene.reader import world_from_document
from jblast.scene.uncertain import value_of
from jblast.world import arrivals_of, draw_world, readings_of, scene_of_one_blast

RECORDS = {
    "flash_time_s": 1e-3,
    "ground_arrival_s": 1e-3,
    "air_arrival_s": 1e-3,
    "peak_overpressure_pa": "5%",
}
PLACES = {"east": [50, 0, 1.5], "north": [-20, 45, 1.5], "west": [-30, -40, 1.5]}
DOCUMENT: dict[str, Any] = {
    "world": {
        "count": 1,
        "region_m": {"box": [[-10, -10, 0], [10, 10, 0]]},
        "mass_kg": {"uniform": [5, 15]},
        "time_s": [0.5, 2.0],
    },
    "sensor": [
        {"name": name, "position_m": place, "records": RECORDS}
        for name, place in PLACES.items()
    ],
}
JOLTED = {
    "flash_time_s": 1e-3,
    "air_arrival_s": 1e-3,
    "jolt_velocity_m_s": "3%",
    "jolt_bearing_rad": 0.02,
    "jolt_elevation_rad": 0.02,
}
"""What an IMU of 1 kHz leaves of a jolt (`calibration.jolts`), and a flash."""
BY_AIR: dict[str, Any] = {
    "world": DOCUMENT["world"],
    "vehicle": {"model": "hummingbird", "position_m": [25.0, 5.0, 4.0]},
    "sensor": [
        {"name": "imu", "kind": "imu", "mount": "vehicle", "records": JOLTED},
    ],
}
SUBSETS = {
    "three microphones": ("air_arrival_s",),
    "flash + air": ("flash_time_s", "air_arrival_s"),
    "flash + ground + air": ("flash_time_s", "ground_arrival_s", "air_arrival_s"),
    "pressure + arrival": ("air_arrival_s", "peak_overpressure_pa"),
    "jolt + flash": tuple(JOLTED),
}
PARTS = (DOCUMENT, tuple(SUBSETS)[:4]), (BY_AIR, tuple(SUBSETS)[4:])
"""A document of worlds, and which subsets are of it."""


class Answer(NamedTuple):
    """One world's answer by one subset of its readings.

    Attributes:
        subset: Name of it.
        world: Its seed.
        method: "weighted" or "weights".
        reached: Whether the method reached what it should: of `fit_many`, an optimum;
            of weighted draws, enough of them about a mode that was met twice.
        k_hat: Of the weights of draws.
        sd: Of ln(mass).
        least: What data and priors allow at best of it.
        rank: Share of the posterior below the truth: east, north, mass, time.
    """

    subset: str
    world: int
    method: str
    reached: bool
    k_hat: float
    sd: float
    least: float
    rank: tuple[float, ...]


DRAWS = 4000


class Told(NamedTuple):
    """One world: its seed, its readings, and the numbers of its blast by name."""

    seed: int
    log: Observations
    truth: dict[str, float]


class Fitted(NamedTuple):
    """What some readings of a world say of its blast.

    Attributes:
        parameters: What was unknown.
        z: Draws of the posterior, in fitted coordinates.
        weights: Their weights.
        truth: Where the truth lies, in the same coordinates.
        covariance: The least that data and priors allow at the truth (Cramer and Rao).
        reached: Whether the method reached what it should.
        k_hat: Of the weights.
    """

    parameters: Parameters
    z: Float[np.ndarray, "draw free"]
    weights: Float[np.ndarray, " draw"]
    truth: Float[np.ndarray, " free"]
    covariance: Float[np.ndarray, "free free"]
    reached: bool
    k_hat: float


WORLDS, AT_ONCE = 200, 5
FITS_KEPT = Path(__file__).parent / "results" / "world_fits.csv"


WEIGHTED_WORLDS, WEIGHTED_AT_ONCE = 1000, 100
WEIGHTS_KEPT = Path(__file__).parent / "results" / "world_weights.csv"


NAMES = ("charge_east_m", "charge_north_m", "charge_mass_kg", "origin_time_s")
RESULTS = Path(__file__).parent / "results"


class RoundTrip(NamedTuple):
    """What became of the worlds by one subset of readings.

    Attributes:
        rank: Share of the posterior below the truth.
        sd: Posterior sd of ln(mass).
        least: What data and priors allow at best at the truth.
        good: Whether the answer is to be believed: it reached what it should, with
            reliable weights.
    """

    rank: Float[np.ndarray, "world free"]
    sd: Float[np.ndarray, " world"]
    least: Float[np.ndarray, " world"]
    good: Float[np.ndarray, " world"]


def by_subset(rows: Sequence[Answer]) -> dict[str, RoundTrip]:
    """Put answers together."""
    found = {}
    for subset in SUBSETS:
        some = sorted((r for r in rows if r.subset == subset), key=lambda r: r.world)
        if not some:
            continue
        good = [r.reached and r.k_hat <= RELIABLE for r in some]
        found[subset] = RoundTrip(
            np.array([r.rank for r in some]),
            np.array([r.sd for r in some]),
            np.array([r.least for r in some]),
            np.array(good),
        )
    return found


def inside(rank: Float[np.ndarray, " world"]) -> float:
    """Return the share of truths inside the 90 % interval."""
    return float(np.mean((rank > 0.05) & (rank < 0.95)))


def table(found: dict[str, RoundTrip]) -> str:
    """Return ranks and sharpness."""
    rows = [
        (f"{subset:24}{name:18}{len(one.sd):7d}", one.rank[:, i], one.good)
        for subset, one in found.items()
        for i, name in enumerate(NAMES)
    ]
    lines = [f"{'':42}{'worlds':>7}{'inside':>8}{'p':>8}{'Holm':>8}{'of good':>9}"]
    p = np.array([kstest(rank, "uniform").pvalue for _, rank, _ in rows])
    for (name, rank, good), one, corrected in zip(rows, p, holm(p), strict=True):
        told = f"{inside(rank):8.3f}{one:8.3f}{corrected:8.3f}{inside(rank[good]):9.3f}"
        lines.append(name + told)
    least = holm(p).min()
    verdict = "not uniform" if least < WRONG else "nothing against uniform"
    lines += [f"smallest of {len(p)} tests {least:.3f}: {verdict}", ""]
    lines += [f"sd of ln(mass){'':10}{'fits':>8}{'bound':>8}{'good':>8}"]
    lines += [
        f"{subset:24}{np.median(one.sd):8.3f}{np.median(one.least):8.3f}"
        f"{np.mean(one.good):8.3f}"
        for subset, one in found.items()
    ]
    prior = np.log(np.random.default_rng(0).uniform(5, 15, 100_000)).std()
    return "\n".join([*lines, f"{'prior':24}{prior:8.3f}"])


def figure(found: dict[str, RoundTrip]) -> Figure:
    """Draw each subset's ranks, and its sharpness beside the bound."""
    drawn = new_figure(9.0, 3.8)
    left, right = drawn.subplots(1, 2, width_ratios=(1, 1.2))
    for one in found.values():
        share = (np.arange(len(one.sd)) + 0.5) / len(one.sd)
        for rank in one.rank.T:
            left.plot(np.sort(rank), share, color=BLUE, linewidth=0.8, alpha=0.6)
    left.plot([0, 1], [0, 1], color=INK, linewidth=0.8)
    left.set_xlabel("rank of the truth")
    left.set_ylabel("share of worlds")
    titled(left, "Ranks")
    places = np.arange(len(found))[::-1]
    fits = [one.sd for one in found.values()]
    for place, sds in zip(places, fits, strict=True):
        low, middle, high = np.quantile(sds, (0.05, 0.5, 0.95))
        right.plot([low, high], [place, place], color=BLUE, linewidth=2.0)
        label = "fits, 90 %" if place == places[0] else None
        right.plot(middle, place, "o", color=BLUE, label=label)
    bounds = [np.median(one.least) for one in found.values()]
    right.plot(bounds, places, "|", color=VERMILLION, markersize=18, label="bound")
    right.set_yticks(places, list(found))
    right.set_ylim(-0.6, len(found) - 0.4)
    right.set_xlim(left=0.0)
    right.set_xlabel("sd of ln(mass)")
    drawn.legend(frameon=False, fontsize=9, loc="outside lower center", ncols=2)
    titled(right, "Sharpness")
    for axes in (left, right):
        quiet(axes)
    return drawn


def main() -> None:
    """Print both tables, write the figure of the first."""
    one_by_one, many = (by_subset(kept(file)) for file in (FITS_KEPT, WEIGHTS_KEPT))
    if not (one_by_one and many):
        raise SystemExit("run the parts fits and weights first")
    print("By jblast fit: worlds of one blast, all errors\n")
    print(table(one_by_one))
    print("\nBy fit_many and importance weights\n")
    print(table(many))
    figure(one_by_one).savefig(RESULTS / "world_round_trip.png", dpi=150)


def kept(path: Path) -> list[Answer]:
    """Return what was found before."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return [
            Answer(
                subset,
                int(world),
                method,
                reached == "True",
                float(k_hat),
                float(sd),
                float(least),
                tuple(map(float, rank)),
            )
            for subset, world, method, reached, k_hat, sd, least, *rank in list(
                csv.reader(file)
            )[1:]
        ]


def add(path: Path, answers: Iterable[Answer]) -> None:
    """Write rows behind the others."""
    fresh = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if fresh:
            writer.writerow((*Answer._fields[:-1], "east", "north", "mass", "time"))
        for *first, rank in answers:
            numbers = (f"{x:.6g}" for x in (*first[4:], *rank))
            writer.writerow((*first[:4], *numbers))


def go_on(
    path: Path,
    subsets: Sequence[str],
    worlds: int,
    at_once: int,
    answers: Callable[[str, Sequence[int]], list[Answer]],
    seconds: float,
    processes: int,
) -> None:
    """Answer what a file does not hold yet, few worlds of each subset in turn.

    Args:
        path: The file.
        subsets: Which.
        worlds: Seeds 0 to so many.
        at_once: Worlds of a subset before the next subset's turn.
        answers: Answers some worlds by a subset.
        seconds: After which none is begun.
        processes: That answer beside each other.
    """
    end = time.monotonic() + seconds
    done = {(one.subset, one.world) for one in kept(path)}
    left = []
    for first in range(0, worlds, at_once):
        for subset in subsets:
            seeds = range(first, min(first + at_once, worlds))
            some = [seed for seed in seeds if (subset, seed) not in done]
            left += [(subset, some)] if some else []
    with get_context("spawn").Pool(processes, initializer=start_jax) as pool:
        waiting = [pool.apply_async(answers, task) for task in left[:processes]]
        for task in [*left[processes:], *[None] * processes]:
            if not waiting:
                return
            add(path, waiting.pop(0).get())
            if task is not None and time.monotonic() < end:
                waiting.append(pool.apply_async(answers, task))


def answer(subset: str, world: Told, method: str, fitted: Fitted) -> Answer:
    """Return the row of a fit."""
    names, beliefs = fitted.parameters.names, fitted.parameters.beliefs
    at = names.index("charge_mass_kg")

    def ln_mass(z: Array) -> Array:
        return jnp.log(beliefs[at].constrain(z))

    ln = np.asarray(ln_mass(jnp.asarray(fitted.z[:, at])))
    sd = float(np.sqrt(fitted.weights @ np.square(ln - fitted.weights @ ln)))
    slope = float(jax.grad(ln_mass)(jnp.asarray(fitted.truth[at])))
    least = slope * float(np.sqrt(fitted.covariance[at, at]))
    rank = tuple(float(x) for x in fitted.weights @ (fitted.z < fitted.truth))
    about = method, fitted.reached, fitted.k_hat
    return Answer(subset, world.seed, *about, sd, least, rank)


def told_and_scene(
    subset: str, seeds: Sequence[int]
) -> tuple[list[Told], UncertainScene]:
    """Draw worlds and read them; return them, and the scene to fit."""
    document = next(document for document, subsets in PARTS if subset in subsets)
    uncertain, spec = world_from_document(document, "world_round_trip")
    one = scene_of_one_blast(uncertain, spec)
    return worlds(uncertain, spec, tuple(one.beliefs), seeds), one


def rows_of(world: Told, quantities: tuple[str, ...]) -> Observations:
    """Return the readings of some quantities."""
    return some_rows(world.log, np.flatnonzero(np.isin(world.log.quantity, quantities)))


def fit_answers(subset: str, seeds: Sequence[int]) -> list[Answer]:
    """Draw worlds, read them, and fit them by a subset."""
    told, one = told_and_scene(subset, seeds)
    return [
        answer(subset, world, "weighted", fitted)
        for world, fitted in zip(told, fits(told, one, SUBSETS[subset]), strict=True)
    ]


def fit_worlds(seconds: int = 540, count: int = WORLDS, processes: int = 1) -> None:
    """Answer world after world until the time is up."""
    go_on(FITS_KEPT, tuple(SUBSETS), count, AT_ONCE, fit_answers, seconds, processes)


def weighted_answers(subset: str, seeds: Sequence[int]) -> list[Answer]:
    """Fit worlds at once by a subset, and weight draws about each optimum."""
    told, one = told_and_scene(subset, seeds)
    logs = [rows_of(world, SUBSETS[subset]) for world in told]
    fits_of = fit_many(one, *batch_of(logs, one))
    places, spread = np.asarray(fits_of.z), np.asarray(fits_of.covariance)
    settled = np.asarray(fits_of.converged)
    found = []
    for i, (world, log) in enumerate(zip(told, logs, strict=True)):
        if not (np.isfinite(spread[i]).all() and np.isfinite(places[i]).all()):
            raise ValueError(f"{subset}, world {world.seed}: expected an optimum")
        density = density_of(log, one)
        z, weights, k_hat = weighted(density, places[i], spread[i], world.seed)
        fitted = Fitted(
            density.parameters,
            z,
            weights,
            *at_truth(density, world.truth),
            bool(settled[i]),
            k_hat,
        )
        found.append(answer(subset, world, "weights", fitted))
    return found


def weights(
    seconds: int = 540, count: int = WEIGHTED_WORLDS, processes: int = 1
) -> None:
    """Answer part after part until the time is up."""
    go_on(
        WEIGHTS_KEPT,
        tuple(SUBSETS),
        count,
        WEIGHTED_AT_ONCE,
        weighted_answers,
        seconds,
        processes,
    )


def worlds(
    uncertain: UncertainScene,
    spec: WorldSpec,
    names: Sequence[str],
    seeds: Iterable[int],
) -> list[Told]:
    """Draw worlds, one a seed, and read them."""
    found = []
    for seed in seeds:
        world = draw_world(uncertain, spec, seed)
        log, _ = readings_of(world, arrivals_of(world.scene), np.inf)
        assert log is not None
        truth = {name: float(np.asarray(value_of(world.scene, name))) for name in names}
        found.append(Told(seed, replace(log, shot=("",) * len(log)), truth))
    return found


def at_truth(
    density: Density, truth: dict[str, float]
) -> tuple[Float[np.ndarray, " free"], Float[np.ndarray, "free free"]]:
    """Return where the truth lies, and the least covariance there."""
    values = np.array([truth[name] for name in density.parameters.names])
    known = AtNumbers(density, values, np.zeros(len(values)))  # sds unknown
    return known.z, known.inverse.covariance


def weighted(
    density: Density,
    z: Float[np.ndarray, " free"],
    covariance: Float[np.ndarray, "free free"],
    seed: int,
) -> tuple[Float[np.ndarray, "draw free"], Float[np.ndarray, " draw"], float]:
    """Return draws about an optimum, weights by the exact posterior, and k-hat.

    Every number has a prior that is not normal: the coordinates of the density are then
    those of the fit.
    """
    rng = np.random.default_rng(seed)
    mixture = Mixture(z[None], np.linalg.cholesky(covariance)[None])
    drawn = mixture.draw(DRAWS, rng)
    height, gain, *_ = density.exact(drawn, rng)
    log_ratio = height + gain - mixture.log_density(drawn)
    log_weights, k_hat = pareto_smoothed(log_ratio)
    return drawn, np.exp(log_weights), k_hat


def fits(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Fitted]:
    """Fit some quantities of every world."""
    for world in told:
        found = solve(rows_of(world, quantities), one, seed=world.seed)
        yield Fitted(
            found.density.parameters,
            found.identified.z,
            found.draws.weights,
            *at_truth(found.density, world.truth),
            found.draws.reliable,
            found.draws.k_hat,
        )


if __name__ == "__main__":
    run_part(
        {
            "table": main,
            "fits": lambda: fit_worlds(*map(int, sys.argv[1:])),
            "weights": lambda: weights(*map(int, sys.argv[1:])),
        }
    )
