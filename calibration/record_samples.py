"""Ways to count the samples of records in a fit: densities, seconds, error of the ends.

    python -m calibration.record_samples

writes `calibration/results/record_samples.txt`. Six gauges about 15 kg, the mass alone
unknown, laws exact, peaks 10 times the noise of a sample: where samples say more than
their picks do. Right is the density of samples at 41 masses, between them by a cubic
spline. Seconds are those of the processor, of a log, once all is compiled.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from calibration.cases import (
    Recorder,
    log_of_picks,
    readings,
    recorded,
    uncertain_scene,
)
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.inference.fitting.fit import solve
from jblast.inference.fitting.solution import Solution, densities_of_samples
from jblast.inference.importance import weighted_quantiles
from jblast.inference.posterior.record_likelihood import SampledRecords
from jblast.inference.sampled_records import sampled_records
from jblast.report.words import aligned
from jblast.signals.picks import pick_records

OUT = Path(__file__).parent / "results" / "record_samples.txt"
LOGS, SEED, SNR = 4, 20, 10.0
PLACES, REACH = 41, 5.0
FINE = 4001
SHARES = (0.05, 0.5, 0.95)


class Log(NamedTuple):
    """A log, and what is right of it.

    Attributes:
        solution: By the samples, as a fit has it.
        samples: Of its records.
        right: 5, 50 and 95 % of ln mass by samples.
        sd: Its standard deviation.
    """

    solution: Solution
    samples: SampledRecords
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
    return np.interp(SHARES, sums, fine), sd


def places(log: Log | Solution) -> Float[np.ndarray, " place"]:
    """Return masses about an answer."""
    normal = (log.solution if isinstance(log, Log) else log).laplace
    sd = float(np.sqrt(normal.covariance[0, 0]))
    return normal.z[0] + sd * np.linspace(-REACH, REACH, PLACES)


def both(log: Log | Solution, samples: SampledRecords, z) -> np.ndarray:
    """Return the densities of samples and of picks."""
    solution = log.solution if isinstance(log, Log) else log
    read = replace(solution.posterior, correction=None)
    return densities_of_samples(read, samples, jnp.asarray(z)[:, None])


def made(rng: np.random.Generator) -> Log:
    """Simulate a log and answer it."""
    records = recorded(rng, readings(rng, scatter=False), Recorder(snr=SNR))
    picks = pick_records(records)
    log = log_of_picks(picks)
    samples = sampled_records(log, [(one.record.name, one) for one in picks])
    found = solve(log, uncertain_scene(scatter=False), records=samples)
    z = places(found)
    right, sd = quantiles_of(z, both(found, samples, z)[0])
    return Log(found, samples, right, sd)


def by_picks(log: Log) -> tuple[np.ndarray, int]:
    """Return what picks with their covariance say."""
    z = places(log)
    read = replace(log.solution.posterior, correction=None)
    density = jax.vmap(read.log_density)(jnp.asarray(z)[:, None])
    return quantiles_of(z, np.asarray(density))[0], 0


def by_spline(log: Log) -> tuple[np.ndarray, int]:
    """Return what the corrected density says: as a fit does it."""
    z = places(log)
    density = jax.vmap(log.solution.posterior.log_density)(jnp.asarray(z)[:, None])
    correction = log.solution.posterior.correction
    assert correction is not None
    return quantiles_of(z, np.asarray(density))[0], int(np.sum(correction.weights != 0))


def by_draws(count: int) -> Callable[[Log], tuple[np.ndarray, int]]:
    """Return what weights draws of the normal approximation by the samples."""

    def answer(log: Log) -> tuple[np.ndarray, int]:
        normal = log.solution.laplace
        z = normal.draws(count, np.random.default_rng(SEED))[:, 0]
        sd = float(np.sqrt(normal.covariance[0, 0]))
        value = both(log, log.samples, z)[0] + 0.5 * np.square((z - normal.z[0]) / sd)
        weight = np.exp(value - value.max())
        ends = weighted_quantiles(z, weight / weight.sum(), SHARES)
        return np.array(ends), count

    return answer


WAYS: dict[str, Callable[[Log], tuple[np.ndarray, int]]] = {
    "picks with their covariance": by_picks,
    "a spline between nodes (kept)": by_spline,
    "64 weighted draws": by_draws(64),
    "256 weighted draws": by_draws(256),
}


def main() -> None:
    """Measure and write."""
    start_jax(quick=True)
    rng = np.random.default_rng(SEED)
    logs = [made(rng) for _ in range(LOGS)]
    z = places(logs[0])[:16]
    both(logs[0], logs[0].samples, z)
    begin = process_time()
    both(logs[0], logs[0].samples, z)
    of_one = (process_time() - begin) / len(z)
    rows = [["way", "densities", "seconds", "ends off [sd]", "worst", "median off"]]
    for name, way in WAYS.items():
        found = [way(log) for log in logs]
        off = np.array(
            [
                (answer - log.right) / log.sd
                for (answer, _), log in zip(found, logs, strict=True)
            ]
        )
        ends = np.abs(off[:, [0, 2]])
        densities = float(np.mean([count for _, count in found]))
        rows.append(
            [
                name,
                f"{densities:.0f}",
                f"{densities * of_one:.1f}",
                f"{np.sqrt(np.mean(ends**2)):.3f}",
                f"{ends.max():.3f}",
                f"{np.sqrt(np.mean(off[:, 1] ** 2)):.3f}",
            ]
        )
    known = [log.solution.samples_known or 0.0 for log in logs]
    text = [
        f"# {LOGS} logs of six records, laws exact, peak {SNR:g} times the noise; "
        "ends of 90 % intervals of ln mass",
        f"# a density of samples: {of_one:.3f} s; the spline says of itself that it "
        f"is known to {max(known):.2g} in ln or better",
        *aligned(rows),
    ]
    write_text(OUT, "\n".join(text) + "\n")
    print("\n".join(text))


if __name__ == "__main__":
    main()
