"""What one drone knows of a blast, and which of its senses buys which certainty.

    python -m calibration.one_drone [SECONDS [WORLDS]] > \
        calibration/results/one_drone.txt

A Hummingbird hovers at 15 m. Its event camera sees the flash, when and in which
direction; its microphone hears the ground's tremor, the bang, and how loud it is; the
blast jolts it. Worlds of one blast on even ground before it are drawn, one a seed, and
read with all errors: Student-t of the instruments, and what the laws scatter. Each
subset of the senses is fitted with the priors that the world was drawn by.

Beside the posterior's sd (its median over the worlds) stand the least that data and
priors allow (Cramer and Rao, at the truths), and how many 90 % intervals hold the
truth. Place is that on the ground, east and north together; range that from the drone.
The eye's direction meets even ground at a place: without that knowledge it is but a
line, and range is what flash and bang tell. Declared: 5 mrad of the eye, 5 % of the
microphone's peak; of the jolt what an IMU of 1 kHz leaves of one at some 30 m
(`calibration.jolts`). The bound is that of a prior made normal about the truth: of what
is known by its prior alone, as the mass by the eye, it is no strict one.

Rows go into calibration/results/one_drone.csv as they are found; what it holds is not
done again, and after so many seconds nothing is begun. The table is of the worlds that
every subset has. Writes calibration/results/one_drone.png.
"""

import csv
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure

from calibration import run_part
from calibration.world_round_trip import Fitted, fits, worlds
from jblast.cli.jax_start import start_jax
from jblast.report.colours import BLUE, VERMILLION
from jblast.report.figures import new_figure, quiet, titled
from jblast.report.view import aligned
from jblast.scene.reader import world_from_document
from jblast.world import scene_of_one_blast

WORLDS, AT_ONCE = 60, 10
HOVERS = (0.0, 0.0, 15.0)
EYE = {"flash_time_s": 1e-3, "bearing_rad": 5e-3, "elevation_rad": 5e-3}
EAR = {"ground_arrival_s": 2e-3, "air_arrival_s": 1e-4, "peak_overpressure_pa": "5%"}
SKIN = {
    "jolt_velocity_m_s": "4%",
    "jolt_bearing_rad": 0.02,
    "jolt_elevation_rad": 0.03,
}
DOCUMENT: dict[str, Any] = {
    "world": {
        "count": 1,
        "region_m": {"box": [[20, -25, 0], [50, 25, 0]]},
        "mass_kg": {"uniform": [2, 15]},
        "time_s": [1.0, 3.0],
    },
    "vehicle": {"model": "hummingbird", "position_m": list(HOVERS)},
    "sensor": [
        {"name": "eye", "mount": "vehicle", "records": EYE},
        {"name": "ear", "mount": "vehicle", "records": EAR},
        {"name": "imu", "kind": "imu", "mount": "vehicle", "records": SKIN},
    ],
}
BANG = ("air_arrival_s",)
SENSES: dict[str, tuple[str, ...]] = {
    "eye": tuple(EYE),
    "eye, tremor": (*EYE, "ground_arrival_s"),
    "eye, bang": (*EYE, *BANG),
    "eye, tremor, bang": (*EYE, "ground_arrival_s", *BANG),
    "eye, bang, loudness": (*EYE, *BANG, "peak_overpressure_pa"),
    "flash, bang, jolt": ("flash_time_s", *BANG, *SKIN),
    "all of them": (*EYE, *EAR, *SKIN),
}
ASKED = {
    "mass [%]": 100.0,
    "range [m]": 1.0,
    "place [m]": 1.0,
    "origin time [ms]": 1e3,
}
"""What is asked, and what it is multiplied by to be printed."""
RESULTS = Path(__file__).parent / "results"
KEPT = RESULTS / "one_drone.csv"
OF = "ln_mass", "range_m", "place_m", "origin_time_s"
HEAD = ("senses", "world", *(f"{k}_{of}" for k in ("sd", "least", "held") for of in OF))


class Known(NamedTuple):
    """How surely the worlds' blasts are known by some senses; a column for each asked.

    Attributes:
        sd: Of the posterior.
        least: What data and priors allow at best.
        inside: Whether the 90 % interval holds the truth; of a place both of its.
    """

    sd: Float[np.ndarray, "world asked"]
    least: Float[np.ndarray, "world asked"]
    inside: Float[np.ndarray, "world asked"]


def numbers_of(fitted: Fitted) -> Callable[[Array], Array]:
    """Return what makes ln(mass), range, east, north and time of coordinates."""
    names, beliefs = fitted.parameters.names, fitted.parameters.beliefs

    def numbers(z: Float[Array, " free"]) -> Float[Array, "5"]:
        value = {
            name: belief.constrain(one)
            for name, belief, one in zip(names, beliefs, z, strict=True)
        }
        place = jnp.stack([value["charge_east_m"], value["charge_north_m"]])
        away = jnp.sqrt(jnp.sum(jnp.square(place)) + HOVERS[2] ** 2)
        mass, time = jnp.log(value["charge_mass_kg"]), value["origin_time_s"]
        return jnp.stack([mass, away, *place, time])

    return numbers


def known_of(fitted: Fitted) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sd, bound, and what holds the truth, of each that is asked."""
    numbers, weights = numbers_of(fitted), fitted.weights
    drawn = np.asarray(jax.vmap(numbers)(jnp.asarray(fitted.z)))
    truth = np.asarray(numbers(jnp.asarray(fitted.truth)))
    slopes = np.asarray(jax.jacfwd(numbers)(jnp.asarray(fitted.truth)))
    least = np.diag(slopes @ fitted.covariance @ slopes.T)
    variance = weights @ np.square(drawn - weights @ drawn)
    rank = weights @ (drawn < truth)
    held = np.asarray((rank > 0.05) & (rank < 0.95), float)
    # of a place the two axes' variances together; its intervals are two, half a one
    return (
        np.sqrt(_asked(variance)),
        np.sqrt(_asked(least)),
        np.array([held[0], held[1], 0.5 * (held[2] + held[3]), held[4]]),
    )


def _asked(of: np.ndarray) -> np.ndarray:
    return np.array([of[0], of[1], of[2] + of[3], of[4]])


def table(found: dict[str, Known]) -> str:
    """Return the median sd of fits, the bound, and the share that holds the truth."""
    count = len(next(iter(found.values())).sd)
    rows = [["senses"]]
    for name in ASKED:
        rows[0] += [f"{name}", "bound", "held"]
    for senses, known in found.items():
        row = [senses]
        for i, size in enumerate(ASKED.values()):
            row += [
                f"{size * np.median(known.sd[:, i]):.3g}",
                f"{size * np.median(known.least[:, i]):.3g}",
                f"{known.inside[:, i].mean():.3f}",
            ]
        rows.append(row)
    lead = [
        f"{count} worlds of one blast, one drone at {HOVERS[2]:g} m; "
        "written by calibration/one_drone.py",
        "sd of fits (median), the least that data and priors allow, and the share of",
        "90 % intervals that hold the truth",
        "",
    ]
    return "\n".join([*lead, *aligned(rows, right=range(1, len(rows[0])))])


def figure(found: dict[str, Known]) -> Figure:
    """Draw, for each that is asked, fits beside the bound by subset of senses."""
    drawn = new_figure(10.5, 3.7)
    panels = drawn.subplots(1, len(ASKED), sharey=True)
    places = np.arange(len(found))[::-1]
    for i, (axes, (name, size)) in enumerate(zip(panels, ASKED.items(), strict=True)):
        for place, known in zip(places, found.values(), strict=True):
            low, middle, high = size * np.quantile(known.sd[:, i], (0.05, 0.5, 0.95))
            axes.plot([low, high], [place, place], color=BLUE, linewidth=2.0)
            first = i == 0 and place == places[0]
            label = "fits: median, 90 %" if first else None
            axes.plot(middle, place, "o", color=BLUE, label=label)
            least = size * np.median(known.least[:, i])
            label = "bound" if first else None
            axes.plot(
                *(least, place, "|"), color=VERMILLION, markersize=16, label=label
            )
        axes.set_xlim(left=0.0)
        axes.set_xlabel(f"sd of {name}")
        titled(axes, name.split(" [")[0].capitalize())
        quiet(axes)
    panels[0].set_yticks(places, list(found))
    panels[0].set_ylim(-0.6, len(found) - 0.4)
    drawn.legend(frameon=False, fontsize=9, loc="outside lower center", ncols=2)
    return drawn


def go_on(seconds: float, count: int) -> None:
    """Draw worlds, read them, and fit each subset of the senses, few at a time."""
    end = time.monotonic() + seconds
    uncertain, spec = world_from_document(DOCUMENT, "one_drone")
    one = scene_of_one_blast(uncertain, spec)
    done = kept()
    for first in range(0, count, AT_ONCE):
        seeds = range(first, min(first + AT_ONCE, count))
        if all((senses, seed) in done for senses in SENSES for seed in seeds):
            continue
        told = worlds(uncertain, spec, tuple(one.beliefs), seeds)
        for senses, quantities in SENSES.items():
            some = [world for world in told if (senses, world.seed) not in done]
            if not some:
                continue
            if time.monotonic() > end:
                return
            found = map(known_of, fits(some, one, quantities))
            fresh = not KEPT.exists()
            with KEPT.open("a", newline="") as file:
                if fresh:
                    csv.writer(file, lineterminator="\n").writerow(HEAD)
                for world, columns in zip(some, found, strict=True):
                    numbers = (f"{x:.6g}" for x in np.ravel(columns))
                    csv.writer(file, lineterminator="\n").writerow(
                        (senses, world.seed, *numbers)
                    )
        print(f"worlds to {seeds.stop}", file=sys.stderr, flush=True)


def kept() -> dict[tuple[str, int], np.ndarray]:
    """Return what is known by which senses of which world: sd, bound, what holds."""
    if not KEPT.exists():
        return {}
    with KEPT.open(newline="") as file:
        return {
            (senses, int(seed)): np.array(numbers, float).reshape(3, len(ASKED))
            for senses, seed, *numbers in list(csv.reader(file))[1:]
        }


def known_by_sense() -> dict[str, Known]:
    """Return what was found, of the worlds that every subset has."""
    done = kept()
    seeds = set.intersection(*({n for s, n in done if s == name} for name in SENSES))
    by_sense = {}
    for senses in SENSES:
        rows = [done[senses, seed] for seed in sorted(seeds)]
        by_sense[senses] = Known(*np.reshape(rows, (-1, 3, len(ASKED))).swapaxes(0, 1))
    return by_sense


def main(seconds: int = 540, count: int = WORLDS) -> None:
    """Draw, read, fit, print the table, write the figure."""
    start_jax(quick=True)
    go_on(seconds, count)
    found = known_by_sense()
    if not all(len(known.sd) for known in found.values()):
        raise SystemExit("no world is done by every subset yet: run it again")
    print(table(found))
    figure(found).savefig(RESULTS / "one_drone.png", dpi=150)


if __name__ == "__main__":
    run_part({"table": lambda: main(*map(int, sys.argv[1:]))})
