"""Are errors of picks right? Two thousand simulated records, and rules of the eye.

    python -m calibration.picks_simulated --workers 2 \
        > calibration/results/picks_simulated.txt

Z from 2 to 300, 10 to 500 kHz, SNR (peak over the noise of a sample) from 5 to 1000,
all log-uniform; half of the records drift by 2 to 30 % of the peak, in half the noise
is coloured (an autoregression of 0.3 to 0.9), a quarter come from a sensor that rings.
`picks_records.py` makes them, and shares nothing with the fit.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np

from calibration.eye_pick import eye_pick
from calibration.picks_records import (
    SAMPLES,
    Made,
    Picked,
    arrival_bound,
    drawn,
    noise_of,
    picked,
    signal_of,
)
from jblast.cli.jax_start import start_jax
from jblast.report.view import aligned

MANY, SEEDS = 200, (20, 21, 30, 31, *range(40, 46))
"""Records of a seed."""


NORMAL_90 = 1.6449
NAMES = ("arrival", "peak", "duration", "impulse")


class Seed(NamedTuple):
    """Records of one seed, and what is picked of them.

    Attributes:
        made: What is in them.
        found: Their picks.
        bound: Cramer-Rao bounds of their arrivals [samples].
        eye: Picks by the rules of an eye.
    """

    made: list[Made]
    found: Picked
    bound: np.ndarray
    eye: np.ndarray


def of_seed(many: int, seed: int) -> Seed:
    """Make and pick the records of one seed."""
    start_jax()
    rng = np.random.default_rng(seed)
    made = drawn(many, rng)
    samples = np.array([signal_of(one) + noise_of(one, rng) for one in made])
    time = np.arange(SAMPLES, dtype=float)
    bound = np.array([arrival_bound(one) for one in made])
    eye = np.array([eye_pick(time, x) for x in samples])
    return Seed(made, picked(samples), bound, eye)


def main(many: int, workers: int) -> None:
    """Print the tables."""
    start_jax()
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        seeds = list(pool.map(partial(of_seed, many), SEEDS))
    made = [one for seed in seeds for one in seed.made]
    parts = zip(*(seed.found for seed in seeds), strict=True)
    found = Picked(*(np.concatenate(x, axis=-1) for x in parts))
    bound = np.concatenate([seed.bound for seed in seeds])
    eye = np.concatenate([seed.eye for seed in seeds]).T
    truth = np.array([[o.arrival, o.peak, o.duration, o.impulse] for o in made]).T
    expected = np.concatenate([truth[:1], np.log(truth[1:])])
    error, sd = found.value - expected, found.sd
    with np.errstate(invalid="ignore", divide="ignore"):
        eye_error = np.concatenate([eye[:1] - truth[:1], np.log(eye[1:] / truth[1:])])
    groups = _groups(made, found)
    names = ", ".join(str(seed) for seed in SEEDS)
    print(f"{len(made)} records of {SAMPLES} samples, seeds {names}\n")
    print("Bias in standard deviations, share of 90 % intervals that hold the truth")
    rows = [
        ["", "records", "found", *(f"{n} {w}" for n in NAMES for w in ("bias", "90 %"))]
    ]
    for name, inside in groups.items():
        rows.append([name, str(int(inside.sum())), *_honesty(inside, found, error, sd)])
    _print(rows)
    print(
        "Rms error of the arrival over what it is held against: all but the worst 1 %,"
    )
    print("all, and by the median; a bound knows whether the sensor rings")
    rows = [["", "records", "rms/bound", "of all", "median rms/bound"]]
    rows += _arrivals(made, found, error, bound)
    _print(rows)
    print("Errors (68 % are below): arrival in samples, ln of the rest")
    rows = [["", *(f"{n} {w}" for n in NAMES for w in ("pick", "eye"))]]
    for name, inside in groups.items():
        rows.append([name, *_against_eye(inside, error, eye_error)])
    _print(rows)


def _print(rows) -> None:
    """Print a table."""
    print("\n".join(aligned(rows)), end="\n\n")


def _groups(made, found):
    """Return which records are of each kind."""
    snr, z = (
        np.array([o.snr for o in made]),
        np.array([o.scaled_distance for o in made]),
    )
    length, rise = (
        np.array([o.duration for o in made]),
        np.array([o.rise for o in made]),
    )
    drift = np.array([o.drift > 0 for o in made])
    colour = np.array([o.colour > 0 for o in made])
    rings = np.array([o.resonance > 0 for o in made])
    return {
        "all": np.ones(len(made), bool),
        "white, steady, no ring": ~drift & ~colour & ~rings,
        "drift": drift,
        "coloured noise": colour,
        "sensor rings": rings,
        "SNR below 20": snr < 20,
        "SNR above 200": snr > 200,
        "Z below 10": z < 10,
        "Z above 60": z > 60,
        "rise of 2 samples or more": rise >= 2,
        "rise below 2 samples": rise < 2,
        "below 20 samples": length < 20,
        "ring was named": _noted(found, "resonating"),
        "further front was named": _noted(found, "later_arrival"),
        "high-pass was named": _noted(found, "high_passed"),
        "shift was named": _noted(found, "zero_shift"),
    }


def _noted(found: Picked, note: str) -> np.ndarray:
    """Return which picks have a note."""
    return np.array([note in notes.split(",") for notes in found.notes])


def _found(found: Picked) -> np.ndarray:
    """Return which records have a pulse."""
    return np.isfinite(found.value[1])


def _honesty(inside, found, error, sd):
    """Return cells of bias and coverage."""
    some = inside & _found(found)
    cells = [f"{100 * some.sum() / max(inside.sum(), 1):.1f} %"]
    for e, s in zip(error, sd, strict=True):
        z = (e / s)[some]
        held = np.mean(np.abs(z) < NORMAL_90) if z.size else np.nan
        # the median is the bias of most; a mean is that of the few that went astray
        cells += [f"{np.median(z):+.2f}" if z.size else "-", f"{100 * held:.1f}"]
    return cells


def _arrivals(made, found, error, bound):
    """Return rows of the arrival's errors over their bounds."""
    rise = np.array([o.rise for o in made])
    rings = np.array([o.resonance > 0 for o in made])
    seen = _noted(found, "resonating")
    sound = _found(found)
    wide, sharp = sound & (rise >= 2), sound & (rise < 2)
    rows = []
    for name, some, against in (
        ("rise of 2 samples or more, Cramer-Rao", wide, bound),
        ("no ring, none told", wide & ~rings & ~seen, bound),
        ("a ring that was found", wide & rings & seen, bound),
        ("a ring that was overlooked", wide & rings & ~seen, bound),
        ("a ring that is none", wide & ~rings & seen, bound),
        ("rise below 2 samples, dt/sqrt(12)", sharp, np.full_like(bound, 12**-0.5)),
    ):
        ratio = np.abs(error[0] / against)[some]
        if not ratio.size:
            continue
        low = ratio[ratio <= np.quantile(ratio, 0.99)]
        rows.append(
            [
                name,
                str(int(some.sum())),
                f"{np.sqrt(np.mean(low**2)):.2f}",
                f"{np.sqrt(np.mean(ratio**2)):.2f}",
                f"{np.median(ratio) / 0.6745:.2f}",
            ]
        )
    return rows


def _against_eye(inside, error, eye_error):
    """Return cells of errors by either."""
    cells = []
    for one, other in zip(error, eye_error, strict=True):
        for e in (one, other):
            size = np.abs(e[inside])
            size = size[np.isfinite(size)]
            cells.append(f"{np.quantile(size, 0.68):.3g}" if size.size else "-")
    return cells


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("many", nargs="?", type=int, default=MANY)
    parser.add_argument("--workers", type=int, default=2, help="processes")
    asked = parser.parse_args()
    main(asked.many, asked.workers)
