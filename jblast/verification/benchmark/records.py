"""Pressure records: ways to let them tell a mass, cost against error of the answer.

Six gauges about 15 kg, the mass alone unknown; laws exact, and with their scatter. By
eye: threshold, largest sample, first zero, trapezoids, with the errors that one would
write beside them (`EYE`). The answer's error is that of ln of the mass; its interval's
is how far the share of 90 % intervals that hold the truth is from 90 %.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.picks import eye_pick, pick_records
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import Posterior, posterior_of
from jblast.inference.records.covariance import TOLD
from jblast.inference.records.sampled import sampled_records
from jblast.observations import Observations
from jblast.observations.records.recording import PressureRecord
from jblast.progress import in_words
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.cases.pressure_records import (
    LAWS,
    MASS,
    Recorder,
    layout,
    log_of_picks,
    readings,
    recorded,
    uncertain_scene,
)

LOGS = 60
SEED = 20
SNR = 20.0
EYE = 0.05
"""Relative error beside a duration or an impulse by eye; beside an arrival stands the
part of a sample, beside a peak the noise."""
WIDE, NARROW = 41, 17
"""Masses at which a density is looked at, of readings and of samples."""
REACH = 4.5
"""Standard deviations that they go to."""


class Answer(NamedTuple):
    """What a method says of a log's ln mass."""

    middle: float
    low: float
    high: float
    sd: float


class Trial(NamedTuple):
    """Answers of a method, and how long each took."""

    answers: list[Answer]
    seconds: float


@jax.jit
def _densities(posterior: Posterior, z: Float[Array, " place"]) -> Array:
    return jax.lax.map(posterior.log_density, z[:, None])


def _on_grid(posterior: Posterior, centre: float, sd: float, count: int) -> Answer:
    """Return an answer by quadrature about a place."""
    z = centre + sd * np.linspace(-REACH, REACH, count)
    density = np.asarray(_densities(posterior, jnp.asarray(z)))
    fine = np.linspace(z[0], z[-1], 2001)
    weight = np.exp(np.interp(fine, z, density) - np.nanmax(density))
    weight /= weight.sum()
    low, middle, high = np.interp([0.05, 0.5, 0.95], np.cumsum(weight), fine)
    mean = weight @ fine
    return Answer(middle, low, high, float(np.sqrt(weight @ (fine - mean) ** 2)))


def answer_of(posterior: Posterior) -> Answer:
    """Return what readings say, from nothing: ever closer about the best."""
    answer = Answer(math.log(MASS), 0.0, 0.0, 0.3)
    for _ in range(6):
        before = answer.sd
        answer = _on_grid(posterior, answer.middle, answer.sd, WIDE)
        spacing = 2 * REACH * before / (WIDE - 1)
        answer = answer._replace(sd=max(answer.sd, spacing))
        if answer.sd > 2 * spacing:
            break
    return answer


def by_eye(records: list[PressureRecord]) -> Observations:
    """Return the rows that eye rules give, as good as one would say."""
    picks = pick_records(records)
    log = log_of_picks(picks)
    value, sigma = log.value.copy(), log.sigma.copy()
    for k, record in enumerate(records):
        eye = eye_pick(record.time_s, record.samples)
        quiet = record.samples[: record.samples.size // 10].std()
        rows = slice(len(TOLD) * k, len(TOLD) * (k + 1))
        value[rows] = eye
        sigma[rows] = [
            1 / record.rate_hz / math.sqrt(12),
            quiet,
            EYE * eye.positive_duration_s,
            EYE * eye.positive_impulse_pa_s,
        ]
    return replace(log, value=value, sigma=sigma, covariances=())


def trials(recorder: Recorder, logs: int, *, scatter: bool) -> dict[str, Trial]:
    """Let every method answer simulated logs.

    Args:
        recorder: How records are taken.
        logs: How many.
        scatter: Whether laws scatter, in nature and in what is known of them.
    """
    rng = np.random.default_rng(SEED)
    parameters = parameters_of(uncertain_scene(scatter=scatter))

    def posterior(log: Observations) -> Posterior:
        return posterior_of(parameters, layout(), log, LAWS, "student")

    def of_samples(records: list[PressureRecord]) -> Answer:
        picks = pick_records(records)
        log = log_of_picks(picks)
        of_picks = posterior(log)
        first = answer_of(of_picks)
        samples = sampled_records(log, [(one.record.name, one) for one in picks])
        sampled = replace(of_picks, records=samples)
        return _on_grid(sampled, first.middle, first.sd, NARROW)

    def picked(records: list[PressureRecord]) -> Observations:
        return log_of_picks(pick_records(records))

    methods: dict[str, Callable[[list[PressureRecord]], Answer]] = {
        "by eye": lambda records: answer_of(posterior(by_eye(records))),
        "picks": lambda records: answer_of(
            posterior(replace(picked(records), covariances=()))
        ),
        "picks, covariance": lambda records: answer_of(posterior(picked(records))),
        "samples": of_samples,
    }
    drawn: list[list[PressureRecord]] = []
    while len(drawn) < logs:
        records = recorded(rng, readings(rng, scatter=scatter), recorder)
        # a pick that is poor goes into no log
        if all(one.quality != "poor" for one in pick_records(records)):
            drawn.append(records)
    found = {}
    for name, method in methods.items():
        method(drawn[0])  # compiled
        start = perf_counter()
        answers = [method(records) for records in drawn]
        found[name] = Trial(answers, (perf_counter() - start) / logs)
    return found


def record_points(logs: int = LOGS) -> list[BenchmarkPoint]:
    """Return cost and errors of each method, on laws that are exact and that scatter.

    Args:
        logs: How many of each.
    """
    tell = in_words()
    points = []
    truth = math.log(MASS)
    for words, scatter in (("laws exact", False), ("laws scatter", True)):
        tell(words)
        for name, trial in trials(Recorder(snr=SNR), logs, scatter=scatter).items():
            off = np.array([one.middle - truth for one in trial.answers])
            held = sum(one.low <= truth <= one.high for one in trial.answers)
            sd = np.median([one.sd for one in trial.answers])
            error = float(np.sqrt(np.mean(off**2)))
            said = (
                f"bias {off.mean():+.2%}, told sd {sd:.2%}, 90 % intervals hold "
                f"{held} of {logs}"
            )
            missed = max(abs(held / logs - 0.9), 0.5 / logs)
            points += [
                BenchmarkPoint(name, trial.seconds, error, said, f"mass, {words}"),
                BenchmarkPoint(name, trial.seconds, missed, said, f"interval, {words}"),
            ]
    return points


register_benchmark(
    Benchmark(
        name="records",
        title=f"A mass from six pressure records, peak {SNR:g} times the noise",
        cost=f"time of a log: picks, and densities at {WIDE} masses a time",
        error="rms of ln mass; share of 90 % intervals less 90 %",
        measure=record_points,
    )
)
