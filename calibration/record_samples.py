"""Ways to count the samples of records in a fit: seconds, error of the ends.

    python -m calibration.record_samples

writes `calibration/results/record_samples.txt`. Six gauges about 15 kg, the mass alone
unknown, laws exact, peaks 10 times the noise of a sample: where samples say more than
their picks do. Right is the density of samples at 41 masses, between them by a cubic
spline. Seconds are those of the processor, of a log, once all is compiled, beyond those
of the draws by the picks.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import process_time
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from calibration import run_part
from calibration.cases import (
    Recorder,
    log_of_picks,
    readings,
    recorded,
    uncertain_scene,
)
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.inference import posterior_of
from jblast.inference.density import Density, density_of
from jblast.inference.fitting.solution import with_samples
from jblast.inference.posterior.record_likelihood import (
    SampledRecords,
    densities_of_samples,
)
from jblast.inference.regions import ENDS, quantiles
from jblast.inference.sample import Draws, sample
from jblast.inference.sampled_records import sampled_records
from jblast.report.words import aligned
from jblast.signals.picks import pick_records

OUT = Path(__file__).parent / "results" / "record_samples.txt"
LOGS, SEED, SNR = 4, 20, 10.0
PLACES, REACH = 41, 5.0
FINE = 4001


class Log(NamedTuple):
    """A log, and what is right of it.

    Attributes:
        density: The density by the picks.
        picked: Draws of it.
        samples: Of its records.
        known: Error of the density of samples between the nodes of the spline.
        right: 5, 50 and 95 % of ln mass by samples.
        sd: Its standard deviation.
    """

    density: Density
    picked: Draws
    samples: SampledRecords
    known: float
    right: Float[np.ndarray, "3"]
    sd: float


def quantiles_of(z, density) -> tuple[Float[np.ndarray, "3"], float]:
    """Return quantiles and standard deviation by quadrature."""
    fine = np.linspace(z[0], z[-1], FINE)
    weight = np.exp(CubicSpline(z, density)(fine) - np.max(density))
    weight /= weight.sum()
    sums = np.cumsum(weight) - 0.5 * weight
    mean = weight @ fine
    sd = float(np.sqrt(weight @ np.square(fine - mean)))
    return np.interp(ENDS, sums, fine), sd


def by_samples(density: Density, samples: SampledRecords, z) -> np.ndarray:
    """Return ln of the likelihood of samples at values of ln mass."""
    read = posterior_of(
        density.parameters,
        density.layout,
        density.observations,
        density.laws,
        density.noise,
    )
    return np.asarray(densities_of_samples(read, samples, jnp.asarray(z)[:, None]))


def made(rng: np.random.Generator) -> Log:
    """Simulate a log and answer it."""
    records = recorded(rng, readings(rng, scatter=False), Recorder(snr=SNR))
    picks = pick_records(records)
    log = log_of_picks(picks)
    samples = sampled_records(log, [(one.record.name, one) for one in picks])
    density = density_of(log, uncertain_scene(scatter=False))
    picked = sample(density)
    draws, known = with_samples(density, picked, samples)
    ln_mass = np.log(draws.values[:, 0])
    mean = draws.weights @ ln_mass
    sd = np.sqrt(draws.weights @ np.square(ln_mass - mean))
    z = mean + sd * np.linspace(-REACH, REACH, PLACES)
    right, sd = quantiles_of(z, by_samples(density, samples, z))
    return Log(density, picked, samples, known, right, sd)


def of_draws(draws: Draws) -> np.ndarray:
    """Return the quantiles of ln mass."""
    return quantiles(np.log(draws.values[:, 0]), draws.weights)


def by_picks(log: Log) -> np.ndarray:
    """Return what picks with their covariance say."""
    return of_draws(log.picked)


def by_spline(log: Log) -> np.ndarray:
    """Return what a fit does: a spline through the difference of both densities."""
    return of_draws(with_samples(log.density, log.picked, log.samples)[0])


def by_draws(count: int, log: Log) -> np.ndarray:
    """Return what draws by the picks say, weighted by the samples."""
    mass = log.picked.values[log.picked.resampled(count, SEED)]
    z = np.log(mass[:, 0])
    value = by_samples(log.density, log.samples, z) - log.density.of_readings(mass)
    weight = np.exp(value - value.max())
    return quantiles(z, weight / weight.sum())


WAYS: dict[str, Callable[[Log], np.ndarray]] = {
    "picks with their covariance": by_picks,
    "a spline between nodes (kept)": by_spline,
    "64 weighted draws": partial(by_draws, 64),
    "256 weighted draws": partial(by_draws, 256),
}


def main() -> None:
    """Measure and write."""
    start_jax(quick=True)
    rng = np.random.default_rng(SEED)
    logs = [made(rng) for _ in range(LOGS)]
    rows = [["way", "seconds", "ends off [sd]", "worst", "median off"]]
    for name, way in WAYS.items():
        way(logs[0])  # compiles
        begin = process_time()
        found = [way(log) for log in logs]
        took = (process_time() - begin) / LOGS
        off = np.array(
            [
                (answer - log.right) / log.sd
                for answer, log in zip(found, logs, strict=True)
            ]
        )
        ends = np.abs(off[:, [0, 2]])
        rows.append(
            [
                name,
                f"{took:.1f}",
                f"{np.sqrt(np.mean(ends**2)):.3f}",
                f"{ends.max():.3f}",
                f"{np.sqrt(np.mean(off[:, 1] ** 2)):.3f}",
            ]
        )
    known = max(log.known for log in logs)
    text = [
        f"# {LOGS} logs of six records, laws exact, peak {SNR:g} times the noise; "
        "ends of 90 % intervals of ln mass",
        f"# the density between the nodes of the spline is known to {known:.2g} in ln",
        *aligned(rows),
    ]
    write_text(OUT, "\n".join(text) + "\n")
    print("\n".join(text))


if __name__ == "__main__":
    run_part({"table": main})
