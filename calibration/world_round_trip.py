"""Do fits of random worlds give the truth back, and which sense buys how much?

    python -m calibration.world_round_trip autos [SECONDS [WORLDS [PROCESSES]]]
    python -m calibration.world_round_trip weights [SECONDS [WORLDS [PROCESSES]]]
    python -m calibration.world_round_trip > calibration/results/world_round_trip.txt

Worlds of one blast are drawn by `jblast.world`, one a seed, and read with all errors:
Student-t of the instruments, and what the laws scatter (subsets below).
Each subset of their readings is fitted with the priors that the world was drawn by, and
the truth is ranked among draws of the posterior, twice over: as `--posterior auto`
answers (part `autos`, which has to be run before), and, of a thousand
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

Autos: where the truth ranks, as `--posterior auto` answers. Each world's
fit goes as `auto` goes: its normal approximation, where importance sampling finds
nothing against it and all numbers are narrow; else walkers, from every optimum that
counts, until the quantiles are known to 0.05 sd.

A row a world is added to calibration/results/world_autos.csv, a few worlds of each
subset in turn; what the file holds already is not done again, and after so many seconds
none is begun. `calibration.world_round_trip` makes tables of it.

Weights: where the truth of a thousand random worlds ranks, by `fit_many`. All logs of a
part are fitted at once; about the optimum of each 16,000 draws, half of them Student-t,
are weighted by its posterior (Pareto smoothed), and the truth is ranked among them.

Rows are added to calibration/results/world_weights.csv, a part of one subset after
another; what the file holds already is not done again, and after so many seconds no
part is begun. `calibration.world_round_trip` makes tables of it.
"""

import csv
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure
from scipy.stats import kstest

from calibration import run_part
from calibration.sbc import WRONG, holm
from jblast.cli.jax_start import start_jax
from jblast.inference import Posterior, batch_of, fit_many
from jblast.inference.identifiability import Identifiability, identifiability
from jblast.inference.importance import (
    Importance,
    importance,
    laplace_holds,
    largest_log_sd,
    largest_quantile_error,
    pareto_smoothed,
    reaching,
)
from jblast.inference.mcmc import ensemble
from jblast.inference.mode.laplace import Laplace, laplace
from jblast.inference.mode.search import Optima, optima
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.parameters import Parameters, parameters_of
from jblast.inference.whitening import Whitened, densities, root_of
from jblast.observations import Observations
from jblast.observations.grouping import some_rows
from jblast.report.figure_style import BLUE, INK, VERMILLION, new_figure, quiet, titled
from jblast.scene import UncertainScene, WorldSpec
from jblast.scene.reader.scene import world_from_document
from jblast.scene.uncertain import Belief, value_of
from jblast.sensors import layout_of, resolve_laws
from jblast.sensors.law_choice import law_names, settled
from jblast.sensors.record import to_error_scale
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
        method: "laplace", "walk" or "weights".
        reached: Whether the method reached what it should: of a walk, that quantiles
            are known as well as wanted.
        k_hat: Of the weights of draws about the optimum.
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


DRAWS = 16_000
_information = eqx.filter_jit(information)


class Told(NamedTuple):
    """One world: its seed, its readings, and the numbers of its blast by name."""

    seed: int
    log: Observations
    truth: dict[str, float]


class Solved(NamedTuple):
    """The posterior of a world's blast by some of its readings, and its optima.

    Attributes:
        seed: Of the world, and of all that is random about its fit.
        posterior: Its density.
        found: Where searches ended.
        identified: What the readings tell.
        normal: The normal approximation about the best of them.
        truth: Where the truth lies, in the same coordinates.
    """

    seed: int
    posterior: Posterior
    found: Optima
    identified: Identifiability
    normal: Laplace
    truth: Float[np.ndarray, " free"]


class Fitted(NamedTuple):
    """What some readings of a world say of its blast.

    Attributes:
        parameters: What was unknown.
        drawn: Weighted draws of the posterior.
        truth: Where the truth lies, in the coordinates of the draws.
        covariance: The least that data and priors allow at the truth (Cramer and Rao).
    """

    parameters: Parameters
    drawn: Importance
    truth: Float[np.ndarray, " free"]
    covariance: Float[np.ndarray, "free free"]


AUTO_WORLDS = 200
AUTOS_AT_ONCE = 5
AUTO_DRAWS = 8000
AUTOS_KEPT = Path(__file__).parent / "results" / "world_autos.csv"


WEIGHTED_WORLDS, WEIGHTED_AT_ONCE = 1000, 100
WEIGHTS_KEPT = Path(__file__).parent / "results" / "world_weights.csv"


NAMES = ("charge_east_m", "charge_north_m", "charge_mass_kg", "origin_time_s")
GOOD_K = 0.7
"""Below this k-hat weights may be believed (Vehtari et al. 2024)."""
RESULTS = Path(__file__).parent / "results"


class RoundTrip(NamedTuple):
    """What became of the worlds by one subset of readings.

    Attributes:
        rank: Share of the posterior below the truth.
        sd: Posterior sd of ln(mass).
        least: What data and priors allow at best at the truth.
        good: Whether the answer is to be believed: the walk is long enough, or the
            weights' k-hat is below 0.7.
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
        good = [r.reached if r.method == "walk" else r.k_hat < GOOD_K for r in some]
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
    autos, many = (by_subset(kept(file)) for file in (AUTOS_KEPT, WEIGHTS_KEPT))
    if not (autos and many):
        raise SystemExit("run the parts autos and weights first")
    print("As --posterior auto answers: worlds of one blast, all errors\n")
    print(table(autos))
    print("\nBy fit_many and importance weights\n")
    print(table(many))
    figure(autos).savefig(RESULTS / "world_round_trip.png", dpi=150)


def log_slope(belief: Belief, z: Float[Array, ""]) -> tuple[Array, Array]:
    """Return the logarithm of a positive number, and how it goes with z."""
    return jax.value_and_grad(lambda z: jnp.log(belief.constrain(z)))(z)


_log_slopes = jax.jit(jax.vmap(log_slope, (None, 0)))


def sharpness(
    parameters: Parameters,
    z: Float[np.ndarray, "draw free"],
    weights: Float[np.ndarray, " draw"],
    truth: Float[np.ndarray, " free"],
    least: Float[np.ndarray, "free free"],
) -> tuple[float, float]:
    """Return the sd of ln(mass) by weighted draws, and the least by a covariance."""
    mass = parameters.names.index("charge_mass_kg")
    places = jnp.asarray([*z[:, mass], truth[mass]])
    ln, slope = map(np.asarray, _log_slopes(parameters.beliefs[mass], places))
    ln = ln[:-1]
    sd = np.sqrt(weights @ np.square(ln - weights @ ln))
    return float(sd), float(slope[-1] * np.sqrt(least[mass, mass]))


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


def answer(subset: str, solved: Solved) -> Answer:
    """Answer one world as `auto` does."""
    seed, posterior, found, identified, normal, truth = solved
    if len(identified.null):
        raise ValueError(f"{subset}, world {seed}: expected all to be identified")
    weighted = importance(posterior, normal, seed=seed)
    if laplace_holds(
        weighted.k_hat,
        largest_log_sd(posterior, normal),
        largest_quantile_error(weighted, normal),
    ):
        method, reached = "laplace", normal.converged
        z = normal.draws(AUTO_DRAWS, np.random.default_rng(seed))
    else:
        walk = ensemble(posterior, normal, identified, found, seed=seed)
        method, reached, z = "walk", walk.converged, walk.draws(AUTO_DRAWS)
    alike = np.full(len(z), 1 / len(z))
    sd, least = sharpness(
        posterior.parameters, z, alike, truth, least_at(posterior, truth)
    )
    rank = tuple(float(x) for x in np.mean(z < truth, axis=0))
    return Answer(subset, seed, method, reached, weighted.k_hat, sd, least, rank)


def auto_answers(subset: str, seeds: Sequence[int]) -> list[Answer]:
    """Draw worlds, read them, and answer them by a subset."""
    document = next(document for document, subsets in PARTS if subset in subsets)
    uncertain, spec = world_from_document(document, "world_round_trip")
    one = scene_of_one_blast(uncertain, spec)
    told = worlds(uncertain, spec, tuple(one.beliefs), seeds)
    solved = solutions(told, one, SUBSETS[subset])
    return [answer(subset, world) for world in solved]


def autos(seconds: int = 540, count: int = AUTO_WORLDS, processes: int = 1) -> None:
    """Answer world after world until the time is up."""
    go_on(
        AUTOS_KEPT,
        tuple(SUBSETS),
        count,
        AUTOS_AT_ONCE,
        auto_answers,
        seconds,
        processes,
    )


def weighted_answers(subset: str, seeds: Sequence[int]) -> list[Answer]:
    """Fit worlds at once by a subset, and weight draws about each optimum."""
    document = next(document for document, subsets in PARTS if subset in subsets)
    uncertain, spec = world_from_document(document, "world_round_trip")
    one = scene_of_one_blast(uncertain, spec)
    told = worlds(uncertain, spec, tuple(one.beliefs), seeds)
    quantities = SUBSETS[subset]
    rows = np.flatnonzero(np.isin(told[0].log.quantity, quantities))
    logs = [some_rows(world.log, rows) for world in told]
    fitted = fit_many(one, *batch_of(logs, one))
    places, spread = np.asarray(fitted.z), np.asarray(fitted.covariance)
    settled = np.asarray(fitted.converged)
    found, densities = [], posteriors(told, one, quantities)
    for i, (world, posterior) in enumerate(zip(told, densities, strict=True)):
        if not (np.isfinite(spread[i]).all() and np.isfinite(places[i]).all()):
            raise ValueError(f"{subset}, world {world.seed}: expected an optimum")
        truth = truth_of(posterior.parameters, world.truth)
        root = np.linalg.cholesky(spread[i])
        drawn = weighted(posterior, places[i], root, world.seed)
        sd, least = sharpness(
            posterior.parameters,
            drawn.z,
            drawn.weights,
            truth,
            least_at(posterior, truth),
        )
        rank = tuple(float(x) for x in drawn.weights @ (drawn.z < truth))
        about = subset, world.seed, "weights", bool(settled[i]), drawn.k_hat
        found.append(Answer(*about, sd, least, rank))
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


def truth_of(parameters: Parameters, truth: dict[str, float]) -> np.ndarray:
    """Return where numbers lie, in the coordinates of a fit."""
    both = zip(parameters.names, parameters.beliefs, strict=True)
    return np.array([belief.unconstrain(truth[name]) for name, belief in both])


def posteriors(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Posterior]:
    """Return the posterior by some quantities of every world, with a scene's priors.

    One program does for all.
    """
    rows = np.flatnonzero(np.isin(told[0].log.quantity, quantities))
    first = some_rows(told[0].log, rows)
    scene, layout = settled(one.scene, layout_of(first, one.scene))
    parameters = parameters_of(replace(one, scene=scene))
    laws = tuple(sorted(law_names(resolve_laws(scene, layout)).items()))
    for world in told:
        some = some_rows(world.log, rows)
        yield Posterior(
            parameters,
            layout,
            to_error_scale(some.value, some.quantity),
            jnp.asarray(some.error_scale()),
            laws,
        )


def solutions(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Solved]:
    """Search the posteriors by some quantities of every world."""
    densities_of = posteriors(told, one, quantities)
    for world, posterior in zip(told, densities_of, strict=True):
        found = optima(jax.random.key(world.seed), posterior)
        z = np.asarray(found.z[0])
        identified = identifiability(posterior, z)
        normal = laplace(posterior, z, identified.identified_basis)
        at = truth_of(posterior.parameters, world.truth)
        yield Solved(world.seed, posterior, found, identified, normal, at)


def least_at(
    posterior: Posterior, truth: Float[np.ndarray, " free"]
) -> Float[np.ndarray, "free free"]:
    """Return the least covariance that data and priors allow at the truth."""
    return np.linalg.inv(np.asarray(_information(posterior, jnp.asarray(truth))))


def weighted(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    root: Float[np.ndarray, "free free"],
    seed: int,
) -> Importance:
    """Weight draws about an optimum so that they follow the posterior.

    Half of them are Student-t, which reach as far as one reading's errors do.

    Args:
        posterior: The posterior.
        z: The optimum.
        root: Of the covariance of its normal approximation.
        seed: Of the draws.
    """
    w, log_drawn, _ = reaching(DRAWS, z.size, np.random.default_rng(seed))
    density = Whitened(posterior, jnp.asarray(z), jnp.asarray(root))
    value = np.asarray(densities(density, jnp.asarray(w)))
    log_weights, k_hat = pareto_smoothed(value - log_drawn)
    weights = np.exp(log_weights)
    return Importance(z + w @ root.T, weights, k_hat, float(1 / np.sum(weights**2)))


def fits(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Fitted]:
    """Fit some quantities of every world: draws about the optimum, weighted."""
    for world in solutions(told, one, quantities):
        drawn = weighted(
            world.posterior, world.normal.z, root_of(world.normal), world.seed
        )
        least = least_at(world.posterior, world.truth)
        yield Fitted(world.posterior.parameters, drawn, world.truth, least)


if __name__ == "__main__":
    run_part(
        {
            "table": main,
            "autos": lambda: autos(*map(int, sys.argv[1:])),
            "weights": lambda: weights(*map(int, sys.argv[1:])),
        }
    )
