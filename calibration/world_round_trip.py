"""Do fits of random worlds give the truth back, and which sense buys how much?

    python -m calibration.world_round_trip [WORLDS] > \
        calibration/results/world_round_trip.txt

Worlds of one blast are drawn by `jblast.world`, one a seed, and read with all errors:
Student-t of the instruments, and what the laws scatter. Three stations about the place
see the flash, feel the ground, hear the bang and its peak; a vehicle that hovers
beside it, in worlds of the same blasts, sees the flash and is jolted (when, how much
and whereto, by what its IMU leaves of it). Each subset of their readings is fitted
with the priors that the world was drawn by; the truth is ranked among draws of the
posterior (the normal approximation's, weighted). If intervals are right, ranks are
uniform (Kolmogorov and Smirnov, Holm's correction over all).
Sharpness is the posterior sd of ln(mass), its median over the worlds, beside the least
sd that data and priors allow (Cramer and Rao, of the same worlds at their truths, in
coordinates in which priors are normal: of what is known by its prior alone it is no
strict bound), and beside the prior's. Where k-hat says that the weights cannot be
believed a fit by `auto` walks instead; the last column of the first table leaves these
worlds out. Writes calibration/results/world_round_trip.png.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure
from scipy.stats import kstest

from calibration.sbc import WRONG, holm
from calibration.world_fits import Told, fits, worlds
from jblast.cli.jax_start import start_jax
from jblast.report.figure_style import BLUE, INK, VERMILLION, new_figure, quiet, titled
from jblast.scene import UncertainScene
from jblast.scene.priors import Belief
from jblast.scene.reader.scene import world_from_document
from jblast.world import scene_of_one_blast

WORLDS = 200
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
HOVERS = [25.0, 5.0, 4.0]
BY_AIR: dict[str, Any] = {
    "world": DOCUMENT["world"],
    "vehicle": {"model": "hummingbird", "position_m": HOVERS},
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
ON_LAND = DOCUMENT, tuple(SUBSETS)[:4]
IN_THE_AIR = BY_AIR, tuple(SUBSETS)[4:]
GOOD_K = 0.7
"""Below this k-hat weights may be believed (Vehtari et al. 2024)."""
RESULTS = Path(__file__).parent / "results"


class RoundTrip(NamedTuple):
    """What became of the worlds by one subset of readings.

    Attributes:
        names: What was unknown.
        rank: Share of the posterior below the truth.
        sd: Posterior sd of ln(mass).
        least: What data and priors allow at best at the truth.
        k_hat: Of the weights.
    """

    names: tuple[str, ...]
    rank: Float[np.ndarray, "world free"]
    sd: Float[np.ndarray, " world"]
    least: Float[np.ndarray, " world"]
    k_hat: Float[np.ndarray, " world"]


def round_trip(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> RoundTrip:
    """Fit some quantities of every world."""
    names, columns = (), []
    for parameters, drawn, at, covariance in fits(told, one, quantities):
        names, mass = parameters.names, parameters.names.index("charge_mass_kg")
        ln, slope = jax.vmap(log_slope, (None, 0))(
            parameters.beliefs[mass], jnp.asarray([*drawn.z[:, mass], at[mass]])
        )
        ln, slope = np.asarray(ln)[:-1], float(slope[-1])
        mean = drawn.weights @ ln
        columns.append(
            (
                drawn.weights @ (drawn.z < at),
                np.sqrt(drawn.weights @ np.square(ln - mean)),
                slope * np.sqrt(covariance[mass, mass]),
                drawn.k_hat,
            )
        )
    return RoundTrip(names, *map(np.array, zip(*columns, strict=True)))


def log_slope(belief: Belief, z: Float[Array, ""]) -> tuple[Array, Array]:
    """Return the logarithm of a positive number, and how it goes with z."""
    return jax.value_and_grad(lambda z: jnp.log(belief.constrain(z)))(z)


def inside(rank: Float[np.ndarray, " world"]) -> float:
    """Return the share of truths inside the 90 % interval."""
    return float(np.mean((rank > 0.05) & (rank < 0.95)))


def table(found: dict[str, RoundTrip]) -> str:
    """Return ranks and sharpness."""
    count = len(next(iter(found.values())).sd)
    lines = [f"{count} worlds of one blast, all errors", ""]
    lines += [f"{'':24}{'':18}{'inside':>8}{'p':>8}{'Holm':>8}{'k-hat < 0.7':>14}"]
    rows = [
        (f"{subset:24}{name:18}", one.rank[:, i], one.k_hat < GOOD_K)
        for subset, one in found.items()
        for i, name in enumerate(one.names)
    ]
    p = np.array([kstest(rank, "uniform").pvalue for _, rank, _ in rows])
    for (name, rank, good), one, corrected in zip(rows, p, holm(p), strict=True):
        told = (
            f"{inside(rank):8.3f}{one:8.3f}{corrected:8.3f}{inside(rank[good]):14.3f}"
        )
        lines.append(name + told)
    least = holm(p).min()
    verdict = "not uniform" if least < WRONG else "nothing against uniform"
    lines += [f"smallest of {len(p)} tests {least:.3f}: {verdict}", ""]
    lines += [f"sd of ln(mass){'':10}{'fits':>8}{'bound':>8}{'k-hat < 0.7':>14}"]
    lines += [
        f"{subset:24}{np.median(one.sd):8.3f}{np.median(one.least):8.3f}"
        f"{np.mean(one.k_hat < GOOD_K):14.2f}"
        for subset, one in found.items()
    ]
    prior = np.log(np.random.default_rng(0).uniform(5, 15, 100_000)).std()
    return "\n".join([*lines, f"{'prior':24}{prior:8.3f}"])


def figure(found: dict[str, RoundTrip]) -> Figure:
    """Draw each subset's ranks, and its sharpness beside the bound."""
    drawn = new_figure(9.0, 3.8)
    left, right = drawn.subplots(1, 2, width_ratios=(1, 1.2))
    count = len(next(iter(found.values())).sd)
    share = (np.arange(count) + 0.5) / count
    for one in found.values():
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
    right.legend(frameon=False, fontsize=9)
    titled(right, "Sharpness")
    for axes in (left, right):
        quiet(axes)
    return drawn


def main(count: int = WORLDS) -> None:
    """Draw, fit, print the table, write the figure."""
    start_jax(quick=True)
    found = {}
    for document, subsets in (ON_LAND, IN_THE_AIR):
        uncertain, spec = world_from_document(document, "world_round_trip")
        one = scene_of_one_blast(uncertain, spec)
        told = worlds(uncertain, spec, tuple(one.beliefs), count)
        for subset in subsets:
            found[subset] = round_trip(told, one, SUBSETS[subset])
            print(subset, file=sys.stderr, flush=True)
    print(table(found))
    figure(found).savefig(RESULTS / "world_round_trip.png", dpi=150)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
