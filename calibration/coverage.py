"""Is a 90 % interval right for 90 % of blasts? Each question is a part.

    python -m calibration.coverage [LOGS] > calibration/results/sbc.txt
    python -m calibration.coverage seven [LOGS] > calibration/results/coverage.txt
    python -m calibration.coverage bounds [LOGS] > calibration/results/lower_bounds.txt
    python -m calibration.coverage worlds [LOGS]
    python -m calibration.coverage runs [WORLDS]

A log with known truth is simulated, fitted by weighted draws with the errors that it
was simulated with, and the truth is ranked among 99 of the draws. "inside" is the share
of truths inside the 90 % interval.

coverage scenes: truths are drawn from the priors of each file in
`calibration/scenes/`. If intervals are right, ranks are then uniform: chi-squared in 20
bins (10 for few logs), with Holm's correction over all unknowns of all cases.
Simulation-based calibration (Talts, Betancourt, Simpson, Vehtari & Gelman 2018,
arXiv:1804.06788). Writes calibration/results/sbc.png and sbc.csv (every rank). Drawn is
the share of truths that rank below r, less the share expected. Inside the grey band lie
95 % of all curves that uniform ranks make, each as a whole (Saeilynoja, Buerkner &
Vehtari 2022, Stat. Comput. 32:32), found by simulation.

coverage worlds: likewise of random worlds of one blast (`jblast.world`), read by
stations and by a vehicle, by subsets of their readings.

coverage seven: one truth and no prior; seven microphones, four unknowns, seed 11.

coverage bounds: likewise, and what clipped peaks are worth. Eight gauges 12 to 90 m
from 15 kg with a full scale of 20 kPa: what would have been read without it, clipped
values as lower bounds, left out, and as readings; seed 19.

coverage runs: worlds of four blasts (`scenes/random_blasts.toml`), recorded by `jblast
world`, picked and fitted as by `--fit`; once with laws that are exact, as the records
are, and once with the scatter of real blasts, which the records do not have.
"""

import json
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int
from matplotlib.figure import Figure
from scipy.stats import chisquare

from calibration import run_part
from calibration.cases import MICROPHONE_LAWS, POSITIONS, TRUTH, scene_with
from jblast.cli.jax_start import start_jax
from jblast.files import table_text, write_text
from jblast.inference import Fit, fit_each
from jblast.inference.density import density_of
from jblast.inference.fitting.suspects import LEFT_OUT_SIGMA
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.sample import solve
from jblast.observations import Observations, read
from jblast.observations.grouping import by_shot
from jblast.observations.table import some_rows
from jblast.report.colours import BLUE, INK
from jblast.report.figures import new_figure, quiet, titled
from jblast.report.world import run_world
from jblast.scene import (
    Scene,
    Sensor,
    UncertainScene,
    freed,
    read_scene,
    with_laws,
    with_values,
)
from jblast.scene.reader import world_from_document
from jblast.scene.uncertain import value_of
from jblast.sensors import observe, planned_layout, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import readings, written
from jblast.study.statistics import wilson_interval
from jblast.world import (
    arrivals_of,
    draw_world,
    readings_of,
    scene_of_one_blast,
    scene_to_fit,
)

SCENES = Path(__file__).parent / "scenes"
RESULTS = Path(__file__).parent / "results"
DRAWS = 99
"""So many posterior draws a truth is ranked among: its rank is 0 to 99."""
CURVES = 4000
"""Sets of uniform ranks simulated for the band."""
BINS = (20, 10)
"""The first of which five ranks a bin are expected; fewer ranks are not tested."""
WRONG = 0.05
"""Chance at which right intervals are called wrong, for all tests together."""
AT_ONCE = 25
"""Logs that a process takes at a time."""


class Log(NamedTuple):
    """A log with the scene to fit and the truth by name."""

    log: Observations
    scene: UncertainScene
    truth: Mapping[str, float]


class Ranked(NamedTuple):
    """What became of one log.

    Attributes:
        rank: Of the truth among draws, by name.
        width: Factor between the ends of the mass's 90 % interval.
        median: Of the mass over its truth.
        reliable: Whether the weights can be believed.
        effective: Effective number of draws.
    """

    rank: dict[str, int]
    width: float
    median: float
    reliable: bool
    effective: float


@cache
def by_priors(name: str) -> Callable[[int], Log]:
    """Return what draws a truth by the priors of a scene's file, and a log of it."""
    scene = read_scene(SCENES / f"{name}.toml")
    layout, sigma, sensors = planned_layout(scene.scene)
    laws = law_names(resolve_laws(scene.scene, layout))
    scene = with_laws(scene, laws)
    parameters = parameters_of(scene)

    @eqx.filter_jit
    def simulated(key):
        of_truth, of_errors = jax.random.split(key)
        # every prior is normal in its coordinate
        z = jax.random.normal(of_truth, (len(parameters.names),))
        values = observe(of_errors, parameters.scene_at(z), layout, laws, sigma)
        return parameters.values(z), values

    def log(seed: int) -> Log:
        truth, values = simulated(jax.random.key(seed))
        numbers = np.asarray(values), np.asarray(sigma)
        log = written(scene.scene, layout, *numbers, sensors)
        return Log(log, scene, {name: float(x) for name, x in truth.items()})

    return log


ON_THE_GROUND: dict[str, Any] = {
    "world": {
        "count": 1,
        "region_m": {"box": [[-10, -10, 0], [10, 10, 0]]},
        "mass_kg": {"uniform": [5, 15]},
        "time_s": [0.5, 2.0],
    },
    "sensor": [
        {
            "name": name,
            "position_m": place,
            "records": {
                "flash_time_s": 1e-3,
                "ground_arrival_s": 1e-3,
                "air_arrival_s": 1e-3,
                "peak_overpressure_pa": "5%",
            },
        }
        for name, place in (
            ("east", [50, 0, 1.5]),
            ("north", [-20, 45, 1.5]),
            ("west", [-30, -40, 1.5]),
        )
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
    "world": ON_THE_GROUND["world"],
    "vehicle": {"model": "hummingbird", "position_m": [25.0, 5.0, 4.0]},
    "sensor": [{"name": "imu", "kind": "imu", "mount": "vehicle", "records": JOLTED}],
}
SUBSETS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "three microphones": (ON_THE_GROUND, ("air_arrival_s",)),
    "flash + air": (ON_THE_GROUND, ("flash_time_s", "air_arrival_s")),
    "flash + ground + air": (
        ON_THE_GROUND,
        ("flash_time_s", "ground_arrival_s", "air_arrival_s"),
    ),
    "pressure + arrival": (ON_THE_GROUND, ("air_arrival_s", "peak_overpressure_pa")),
    "jolt + flash": (BY_AIR, tuple(JOLTED)),
}


@cache
def by_world(name: str) -> Callable[[int], Log]:
    """Return what draws a world of one blast, and some of its readings."""
    document, quantities = SUBSETS[name]
    uncertain, spec = world_from_document(document, "coverage")
    scene = scene_of_one_blast(uncertain, spec)

    def log(seed: int) -> Log:
        world = draw_world(uncertain, spec, seed)
        log, _ = readings_of(world, arrivals_of(world.scene), np.inf)
        assert log is not None
        log = some_rows(log, np.flatnonzero(np.isin(log.quantity, quantities)))
        truth = {n: float(np.asarray(value_of(world.scene, n))) for n in scene.beliefs}
        return Log(replace(log, shot=("",) * len(log)), scene, truth)

    return log


SEVEN = (*POSITIONS, (-90, -60), (30, 150))
"""East and north of each microphone [m]."""


@cache
def by_seven(_: str) -> Callable[[int], Log]:
    """Return what simulates a log of seven microphones."""
    scene = with_laws(
        UncertainScene(scene_with(scatter=True, positions=SEVEN)), MICROPHONE_LAWS
    )
    asked = freed(scene, list(TRUTH))
    keys = jax.random.split(jax.random.key(11), 10_000)
    return lambda seed: Log(readings(keys[seed], asked.scene), asked, TRUTH)


FULL_SCALE = 20e3
"""Of every gauge [Pa]."""
CLIPPED_TRUTH = {"charge_mass_kg": 15.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
GAUGES = (
    *((12, 0), (-9, 10), (3, -14), (-16, -6)),
    *((22, 24), (-35, 30), (20, -60), (90, 9)),
)
"""East and north of each gauge [m]."""
PEAK = "peak_overpressure_pa"
WAYS = ("no full scale", "lower bounds", "left out", "as readings")


@cache
def by_gauges(way: str) -> Callable[[int], Log]:
    """Return what simulates a log of gauges, and what is made of clipped rows."""
    sensors = tuple(
        Sensor(f"g{i}", jnp.array([*place, 0.0]), records=((PEAK, 0.05),))
        for i, place in enumerate(GAUGES)
    )
    known = with_values(Scene(sensors=sensors), CLIPPED_TRUTH)
    laws = with_laws(UncertainScene(known), {PEAK: "kingery_bulmash"})
    asked = freed(laws, list(CLIPPED_TRUTH))
    keys = jax.random.split(jax.random.key(19), 10_000)

    def log(seed: int) -> Log:
        full = readings(keys[seed], asked.scene)
        clipped = full.value >= FULL_SCALE
        value, share = np.minimum(full.value, FULL_SCALE), full.sigma / full.value
        # rows that no error limits: logs keep one layout, so one program fits all
        loose = np.where(clipped, LEFT_OUT_SIGMA, share)
        log = {
            "no full scale": full,
            "lower bounds": replace(
                full, value=value, sigma=share * value, lower_bound=clipped
            ),
            "left out": replace(full, value=value, sigma=loose * value),
            "as readings": replace(full, value=value, sigma=share * value),
        }[way]
        return Log(log, asked, CLIPPED_TRUTH)

    return log


Case = tuple[Callable[[str], Callable[[int], Log]], str]


def rank(case: Case, seed: int) -> Ranked:
    """Simulate a log of a case, fit it, and rank the truth by the posterior."""
    made, name = case
    log, scene, truth = made(name)(seed)
    density, draws = solve(density_of(log, scene), seed)
    names = density.parameters.names
    few = draws.values[draws.resampled(DRAWS, seed)]
    ranks = {n: int(np.sum(few[:, i] < truth[n])) for i, n in enumerate(names)}
    mass = draws.values[draws.resampled(1000, seed), names.index("charge_mass_kg")]
    low, middle, high = np.quantile(mass, (0.05, 0.5, 0.95))
    off = middle / truth["charge_mass_kg"]
    return Ranked(ranks, high / low, off, bool(draws.reliable), float(draws.effective))


def rank_all(cases: Iterable[Case], logs: int) -> dict[str, list[Ranked]]:
    """Rank the truths of every case, on all cores."""
    cases = list(cases)
    parts = [(case, seed) for case in cases for seed in range(logs)]
    found: dict[str, list[Ranked]] = {name: [] for _, name in cases}
    spawn = get_context("spawn")
    with ProcessPoolExecutor(cpu_count(), spawn, start_jax) as pool:
        answers = pool.map(rank, *zip(*parts, strict=True), chunksize=AT_ONCE)
        for ((_, name), seed), answer in zip(parts, answers, strict=True):
            found[name].append(answer)
            if seed % AT_ONCE == AT_ONCE - 1:
                print(f"{name}: {seed + 1} of {logs} logs", file=sys.stderr, flush=True)
    return found


def chance(ranks: Int[np.ndarray, " log"]) -> float:
    """Return the chance that uniform ranks are as uneven; nan of too few."""
    bins = next((bins for bins in BINS if len(ranks) >= 5 * bins), 0)
    if not bins:
        return np.nan
    counts = np.bincount(ranks * bins // (DRAWS + 1), minlength=bins)
    return float(chisquare(counts).pvalue)


def holm(p: Float[np.ndarray, " test"]) -> Float[np.ndarray, " test"]:
    """Correct p-values for their number (Holm 1979, Scand. J. Statist. 6:65)."""
    order = np.argsort(p)
    scaled = (len(p) - np.arange(len(p))) * p[order]
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return corrected


def ranks_of(answers: list[Ranked]) -> dict[str, Int[np.ndarray, " log"]]:
    """Return the ranks of each unknown."""
    return {n: np.array([one.rank[n] for one in answers]) for n in answers[0].rank}


def table(found: Mapping[str, list[Ranked]], *, drawn: bool = True) -> str:
    """Return the table.

    Args:
        found: By case.
        drawn: Whether truths were drawn from the priors, so that ranks are uniform.
    """
    rows = [
        (f"{case:24}{name:22}", ranks)
        for case, answers in found.items()
        for name, ranks in ranks_of(answers).items()
    ]
    p = np.array([chance(ranks) if drawn else np.nan for _, ranks in rows])
    tested = np.isfinite(p)
    corrected = np.full(len(p), np.nan)
    corrected[tested] = holm(p[tested])
    lines = [f"{'':46}{'logs':>5}{'inside':>8}{'p':>8}{'Holm':>8}"]
    for (name, ranks), one, all_in_all in zip(rows, p, corrected, strict=True):
        told = f"{one:8.3f}{all_in_all:8.3f}" if one == one else ""
        inside = np.mean((ranks >= 5) & (ranks < 95))
        lines.append(f"{name}{len(ranks):5d}{inside:8.3f}{told}")
    if tested.any():
        least = np.min(corrected[tested])
        verdict = "not uniform" if least < WRONG else "nothing against uniform"
        lines.append(f"smallest of {tested.sum()} tests {least:.3f}: {verdict}")
    lines.append("")
    for case, answers in found.items():
        width, median = np.median([one[1:3] for one in answers], axis=0)
        effective = [one.effective for one in answers]
        reliable = np.mean([one.reliable for one in answers])
        lines.append(
            f"{case:24}mass/truth {median:.2f}, factor {width:.2f} between its ends "
            f"(medians); weights reliable in {reliable:.3f}"
            f" of the logs; effective draws {np.median(effective):.0f} "
            f"(fewest {min(effective):.0f})"
        )
    return "\n".join(lines)


def scenes(logs: int = 500) -> None:
    """Rank truths drawn by the priors of scenes; print, keep and draw the ranks."""
    names = (
        *("arrivals", "flash_and_air", "four_microphones", "impulse_and_duration"),
        *("pressure", "burial", "camera_and_bang"),
    )
    found = rank_all([(by_priors, name) for name in names], logs)
    print(table(found))
    rows = (
        (case, log, name, rank, int(one.reliable))
        for case, answers in found.items()
        for log, one in enumerate(answers)
        for name, rank in one.rank.items()
    )
    columns = ("case", "log", "unknown", "rank", "reliable")
    if logs == 500:
        write_text(RESULTS / "sbc.csv", table_text([columns, *rows]))
        figure(found).savefig(RESULTS / "sbc.png", dpi=150)


def away(ranks: Int[np.ndarray, "*set log"]) -> Float[np.ndarray, "*set rank"]:
    """Return the share of ranks below each rank less what is expected."""
    below = np.stack(
        [np.mean(ranks < r, axis=-1) for r in range(1, DRAWS + 1)], axis=-1
    )
    return below - np.arange(1, DRAWS + 1) / (DRAWS + 1)


def band(logs: int) -> Float[np.ndarray, " rank"]:
    """Return how far 95 % of the curves of uniform ranks stay from none."""
    share = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    sd = np.sqrt(share * (1 - share) / logs)
    ranks = np.random.default_rng(0).integers(0, DRAWS + 1, (CURVES, logs))
    farthest = np.max(np.abs(away(ranks)) / sd, axis=1)
    return np.quantile(farthest, 0.95) * sd


def figure(found: Mapping[str, list[Ranked]]) -> Figure:
    """Return the figure, a panel for each case."""
    drawn = new_figure(11.0, 5.4)
    panels = drawn.subplots(2, 4, sharex=True, sharey=True)
    share = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    for axes, (case, answers) in zip(panels.flat, found.items(), strict=False):
        wide = band(len(answers))
        axes.fill_between(share, -wide, wide, color=INK, alpha=0.12, linewidth=0)
        for ranks in ranks_of(answers).values():
            axes.plot(share, away(ranks), color=BLUE, linewidth=1.0)
        quiet(axes)
        titled(axes, case.replace("_", " "))
    for axes in panels.flat[len(found) :]:
        axes.set_visible(False)
    for axes in panels[1]:
        axes.set_xlabel("rank of the truth")
    for axes in panels[:, 0]:
        axes.set_ylabel("share below, less expected")
    return drawn


def shares(cases: Iterable[Case], logs: int, *, drawn: bool = False) -> None:
    """Print the table of some cases."""
    print(table(rank_all(cases, logs), drawn=drawn))


def masses(seed: int, folder: Path, scene: Path) -> list[tuple[float, float, bool]]:
    """Return z and sd of ln(mass), and coverage, of every blast of a world."""
    run_world(scene, folder, seed=seed)
    document = json.loads((folder / "run.json").read_text())
    truth = {one["shot"]: one["mass_kg"] for one in document["blasts"]}
    found = fit_each(by_shot(read(folder / "observations.csv")), scene_to_fit(scene))
    rows = []
    for shot, mass in truth.items():
        fit = found[shot]
        assert isinstance(fit, Fit)
        one = fit.summary.estimates["charge_mass_kg"]
        # the sd of ln(mass) from the interval, which is 2 x 1.645 sd wide
        sd = np.log(one.q95 / one.q05) / 3.29
        rows.append((np.log(one.value / mass) / sd, sd, one.q05 <= mass <= one.q95))
    return rows


def runs(worlds: int = 50) -> None:
    """Record and fit worlds of several blasts, and print the tables."""
    start_jax()
    for scatter in (False, True):
        rows: list[tuple[float, float, bool]] = []
        with tempfile.TemporaryDirectory() as name:
            scene = Path(name) / "random_blasts.toml"
            law = "" if scatter else "[law]\nscatter = false\n"
            scene.write_text((SCENES / scene.name).read_text() + law)
            for seed in range(worlds):
                rows += masses(seed, Path(name) / f"{seed}", scene)
        z, sd, inside = (np.array(x, float) for x in zip(*rows, strict=True))
        low, high = wilson_interval(inside.mean(), len(inside))
        print(
            f"{len(rows)} blasts of {worlds} worlds, scatter {scatter}\n"
            f"90 % intervals of the mass that contain the truth: {inside.mean():.3f} "
            f"(90 % interval {low:.3f} to {high:.3f})\n"
            f"sd of ln(mass): {np.median(sd):.4f} (median), {sd.max():.4f} (largest)\n"
            f"error of ln(mass) over its sd: rms {np.sqrt(np.mean(z**2)):.3f}\n"
        )


if __name__ == "__main__":
    counts = [int(word) for word in sys.argv[1:] if word.isdigit()]

    def by(made: Any, names: Iterable[str], count: int, *, drawn: bool) -> Any:
        """Return a part."""
        cases = [(made, name) for name in names]
        return partial(shares, cases, *(counts or [count]), drawn=drawn)

    run_part(
        {
            "scenes": lambda: scenes(*counts),
            "seven": by(by_seven, ["weighted"], 400, drawn=False),
            "bounds": by(by_gauges, WAYS, 100, drawn=False),
            "worlds": by(by_world, SUBSETS, 200, drawn=True),
            "runs": lambda: runs(*counts),
        }
    )
