"""Pressure records and detectors: cost against error.

Pressure records: methods to estimate a mass from the records of six gauges about 15 kg,
with exact laws and with their scatter. Readings by eye are threshold, largest sample,
first zero and trapezoids, with assumed errors (`EYE`). The error is that of ln of the
mass; the error of an interval is the difference of its coverage from 90 %.

Detectors: effect of a shorter template, and missed blasts of each method against its
cost. Noise is wind, traffic and three tones of a rotor, 90 dB in all; the blast lasts
200 ms. The threshold of a method is passed in 1 % of the windows without a blast.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.fidelity.timing import best_of
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import Posterior, posterior_of
from jblast.inference.sampled_records import sampled_records
from jblast.observations import Observations
from jblast.observations.records.recording import PressureRecord
from jblast.observations.table import RECORD_QUANTITIES
from jblast.progress import in_words
from jblast.signals import (
    filtered_by,
    matched_kernel,
    sta_lta,
    threshold_for,
    white_noise,
)
from jblast.signals.picks import eye_pick, pick_records
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.simulated_recordings import (
    LAWS,
    MASS,
    RATE,
    Recorder,
    coloured,
    layout,
    log_of_picks,
    plain_normalised,
    pulse,
    readings,
    recorded,
    rumble,
    uncertain_scene,
)

LENGTHS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Of templates [s]; all begin as the blast does."""
WHOLE_S = 0.2
BLOCK_S = 0.01
SIZE, WINDOWS = 2**16, 100
MIN_LOSS = 1e-3
"""Smallest reported loss, as a share of 2E/N0."""
SNR_DB = 17.0
"""2E/N0 of the blasts whose misses are counted."""
Loudest = Callable[[np.ndarray], float]
LOGS = 60
SEED = 20
SNR = 20.0
EYE = 0.05
"""Relative error beside a duration or an impulse by eye; beside an arrival stands the
part of a sample, beside a peak the noise."""
WIDE, NARROW = 41, 17
"""Masses at which a density is looked at, of readings and of samples."""
REACH_SD = 4.5
"""Largest distance of the nodes [sd]."""


def beginning(length_s: float) -> np.ndarray:
    """Return the beginning of the blast, its end faded.

    Args:
        length_s: How much of it [s].
    """
    whole = pulse(WHOLE_S)
    count = round(length_s * RATE)
    fade = np.clip(np.arange(count, 0, -1) / (0.3 * count), 0, 1)
    return whole[:count] * np.sin(0.5 * np.pi * fade) ** 2


def latency_points() -> list[BenchmarkPoint]:
    """Return how long each template waits, and how much of 2E/N0 it lacks."""
    alone = np.zeros(2**15)
    alone[2**14 :][: round(WHOLE_S * RATE)] = pulse(WHOLE_S)
    whole, points = pulse(WHOLE_S), []
    for panel, noise in (
        ("waiting, wind and a rotor", rumble(lines=True)),
        ("waiting, white noise", white_noise(1.0, RATE)),
    ):
        possible = matched_kernel(whole, RATE, noise).response
        for length in LENGTHS:
            kernel = matched_kernel(beginning(length), RATE, noise)
            heard = filtered_by(alone, kernel).statistic[2**14]
            lost = 1 - (heard / possible) ** 2
            needed = 20 * np.log10(threshold_for(kernel))
            points.append(
                BenchmarkPoint(
                    f"template {1e3 * length:g} ms",
                    2 * kernel.reach / RATE + BLOCK_S,
                    max(lost, MIN_LOSS),
                    f"threshold {needed:.1f} dB for one false alarm an hour",
                    panel,
                )
            )
    return points


def methods() -> dict[str, Loudest]:
    """Return what gives the loudest moment of a window, by method."""
    noise, shape = rumble(lines=True), pulse(WHOLE_S)

    def matched(kernel) -> Loudest:
        def loudest(window: np.ndarray) -> float:
            heard = filtered_by(window, kernel)
            return float(heard.statistic[heard.start : heard.stop].max())

        return loudest

    def banked(window: np.ndarray) -> float:
        return max(loudest(window) for loudest in bank)

    bank = [
        matched(matched_kernel(pulse(WHOLE_S * factor), RATE, noise))
        for factor in (0.25, 0.5, 0.8, 1.25, 2.0)
    ]
    white = white_noise(1.0, RATE)
    return {
        "matched, whitened": matched(matched_kernel(shape, RATE, noise)),
        "matched, whitened, first 20 ms": matched(
            matched_kernel(beginning(0.02), RATE, noise)
        ),
        "matched, as if white": matched(matched_kernel(shape, RATE, white)),
        "plain normalised": lambda window: float(plain_normalised(window, shape).max()),
        "bank of five other lengths": banked,
        "short over long average": lambda window: float(sta_lta(window, RATE).max()),
    }


def miss_points(repeats: int = 40) -> list[BenchmarkPoint]:
    """Return what each method costs a second of sound, and the share it misses.

    Args:
        repeats: How often each is timed.
    """
    tell, noise, shape = in_words(), rumble(lines=True), pulse(WHOLE_S)
    rng = np.random.default_rng(0)
    windows = [coloured(rng, noise, SIZE)[0] for _ in range(2 * WINDOWS)]
    blast = 10 ** (SNR_DB / 20) / matched_kernel(shape, RATE, noise).response * shape
    loud = [window.copy() for window in windows[WINDOWS:]]
    for window, at in zip(loud, rng.integers(26_000, 50_000, WINDOWS), strict=True):
        window[at:][: blast.size] += blast
    points = []
    for name, loudest in methods().items():
        tell(name)
        height = np.quantile([loudest(window) for window in windows[:WINDOWS]], 0.99)
        missed = float(np.mean([loudest(window) <= height for window in loud]))
        took, _ = best_of(functools.partial(loudest, windows[0]), repeats)
        points.append(
            BenchmarkPoint(
                name,
                took / (SIZE / RATE),
                max(missed, 0.5 / WINDOWS),
                f"{round(missed * WINDOWS)} of {WINDOWS} missed",
                "misses",
            )
        )
    return points


register_benchmark(
    Benchmark(
        name="detector",
        title="Detectors: what is waited for or computed, and what is missed",
        cost="waiting: from the first sample of a blast; misses: a second of sound",
        error="waiting: share of 2E/N0 lacked, to 0.001; misses: share at "
        f"{SNR_DB:g} dB",
        measure=lambda: [*latency_points(), *miss_points()],
        relative=False,
    )
)


class Answer(NamedTuple):
    """Estimates of a log's ln mass by a method."""

    middle: float
    low: float
    high: float
    sd: float


class Trial(NamedTuple):
    """Answers of a method to simulated logs.

    Attributes:
        answers: To the logs without a poor pick.
        seconds: Time of one answer.
        drawn: Logs simulated, those with a poor pick included.
    """

    answers: list[Answer]
    seconds: float
    drawn: int


@jax.jit
def _densities(posterior: Posterior, z: Float[Array, " place"]) -> Array:
    return jax.lax.map(posterior.log_density, z[:, None])


def _on_grid(posterior: Posterior, centre: float, sd: float, count: int) -> Answer:
    """Return an answer by quadrature about a place."""
    z = centre + sd * np.linspace(-REACH_SD, REACH_SD, count)
    density = np.asarray(_densities(posterior, jnp.asarray(z)))
    fine = np.linspace(z[0], z[-1], 2001)
    weight = np.exp(np.interp(fine, z, density) - np.nanmax(density))
    weight /= weight.sum()
    low, middle, high = np.interp([0.05, 0.5, 0.95], np.cumsum(weight), fine)
    mean = weight @ fine
    return Answer(middle, low, high, float(np.sqrt(weight @ (fine - mean) ** 2)))


def answer_of(posterior: Posterior) -> Answer:
    """Return the answer from readings alone, on ever narrower grids about the best."""
    answer = Answer(math.log(MASS), 0.0, 0.0, 0.3)
    for _ in range(6):
        before = answer.sd
        answer = _on_grid(posterior, answer.middle, answer.sd, WIDE)
        spacing = 2 * REACH_SD * before / (WIDE - 1)
        answer = answer._replace(sd=max(answer.sd, spacing))
        if answer.sd > 2 * spacing:
            break
    return answer


def by_eye(records: list[PressureRecord]) -> Observations:
    """Return the rows by eye rules, with assumed errors (`EYE`)."""
    picks = pick_records(records)
    log = log_of_picks(picks)
    value, sigma = log.value.copy(), log.sigma.copy()
    for k, record in enumerate(records):
        eye = eye_pick(record.time_s, record.samples)
        quiet = record.samples[: record.samples.size // 10].std()
        rows = slice(len(RECORD_QUANTITIES) * k, len(RECORD_QUANTITIES) * (k + 1))
        value[rows] = eye
        sigma[rows] = [
            1 / record.rate_hz / math.sqrt(12),
            quiet,
            EYE * eye.positive_duration_s,
            EYE * eye.positive_impulse_pa_s,
        ]
    return replace(log, value=value, sigma=sigma, covariances=())


def trials(recorder: Recorder, logs: int, *, scatter: bool) -> dict[str, Trial]:
    """Apply every method to simulated logs.

    A log with a poor pick has fewer rows. All methods leave it out, as its layout would
    be compiled again, and the number of logs drawn for those that count is reported.

    Args:
        recorder: How records are taken.
        logs: How many without a poor pick.
        scatter: Whether laws scatter, in the simulated records and in the fit.
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
    count = 0
    while len(drawn) < logs:
        count += 1
        records = recorded(rng, readings(rng, scatter=scatter), recorder)
        if all(one.quality != "poor" for one in pick_records(records)):
            drawn.append(records)
    found = {}
    for name, method in methods.items():
        method(drawn[0])  # compiled
        start = perf_counter()
        answers = [method(records) for records in drawn]
        found[name] = Trial(answers, (perf_counter() - start) / logs, count)
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
            if trial.drawn > logs:
                said += f", the logs without a poor pick of {trial.drawn} drawn"
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
