"""Pressure records and detectors: cost against error.

Pressure records: methods to estimate a mass from the records of six gauges about 15 kg,
with exact laws and with their scatter. Readings by eye are threshold, largest sample,
first zero and trapezoids, with assumed errors (`EYE_ERROR`). The error is that of ln
mass. The error of an interval is the difference of its coverage from 90 %.

Detectors: effect of a shorter template, and missed blasts of each method against its
cost. Noise is wind, traffic and three tones of a rotor, with a range of 90 dB; the
blast lasts 200 ms. The threshold of a method is exceeded in 1 % of the windows without
a blast.
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

from calibration.eye_pick import eye_pick
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
    threshold_for,
    white_noise,
)
from jblast.signals.picks import pick_records
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
"""Lengths of the templates [s], each the beginning of the blast."""
WHOLE_S = 0.2
"""Length of the blast and of the longest template [s]."""
# Sound arrives in blocks of this length, which adds to the delay of every template.
BLOCK_S = 0.01
"""Length of a block of sound [s]."""
# 1.4 s a window; one false alarm in 100 windows fixes the threshold.
SIZE, WINDOWS = 2**16, 100
"""Samples of a window, and windows with and without a blast."""
MIN_LOSS = 1e-3
"""Smallest reported loss, as a share of 2E/N0."""
# Near the threshold: louder blasts are found by every whitened method.
SNR_DB = 17.0
"""2E/N0 of the blasts whose misses are counted [dB]."""
Loudest = Callable[[np.ndarray], float]
"""Function from a window to its largest detector output."""
# The standard error of a coverage of 90 % is then 4 %.
LOGS = 60
"""Logs for each case."""
# Any number: it only fixes the records.
SEED = 20
SNR = 20.0
"""Ratio of peak to noise in the records."""
# About a line width of a printed record, a few per cent of the phase.
EYE_ERROR = 0.05
"""Assumed relative error of a duration or an impulse by eye. The error of an arrival is
that of a sample, the error of a peak is the noise."""
# Samples need fewer: their grid is centred on the result of the readings.
WIDE, NARROW = 41, 17
"""Nodes of the density of readings and of samples."""
# The normal tail beyond 4.5 sd is 7e-6, far below the 5 % of a bound.
REACH_SD = 4.5
"""Largest distance of the nodes [sd]."""
# Ratios of length about the true one, none of them equal to it.
BANK_FACTORS = (0.25, 0.5, 0.8, 1.25, 2.0)
"""Lengths of the templates of the bank, relative to the blast."""


def beginning(length_s: float) -> np.ndarray:
    """Return the beginning of the blast with a faded end.

    Args:
        length_s: Length of the beginning [s].
    """
    whole = pulse(WHOLE_S)
    count = round(length_s * RATE)
    fade = np.clip(np.arange(count, 0, -1) / (0.3 * count), 0, 1)
    return whole[:count] * np.sin(0.5 * np.pi * fade) ** 2


def latency_points() -> list[BenchmarkPoint]:
    """Return the delay of each template, and its loss of 2E/N0."""
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
            response = filtered_by(alone, kernel).statistic[2**14]
            lost = 1 - (response / possible) ** 2
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
    """Return the largest output of each detector in a window, by method."""
    noise, shape = rumble(lines=True), pulse(WHOLE_S)

    def matched(kernel) -> Loudest:
        def loudest(window: np.ndarray) -> float:
            filtered = filtered_by(window, kernel)
            return float(filtered.statistic[filtered.start : filtered.stop].max())

        return loudest

    bank = [
        matched(matched_kernel(pulse(WHOLE_S * factor), RATE, noise))
        for factor in BANK_FACTORS
    ]
    white = white_noise(1.0, RATE)
    return {
        "matched, whitened": matched(matched_kernel(shape, RATE, noise)),
        "matched, whitened, first 20 ms": matched(
            matched_kernel(beginning(0.02), RATE, noise)
        ),
        "matched, as if white": matched(matched_kernel(shape, RATE, white)),
        "plain normalised": lambda window: float(plain_normalised(window, shape).max()),
        "bank of five other lengths": lambda window: max(
            loudest(window) for loudest in bank
        ),
    }


def miss_points(repeats: int = 40) -> list[BenchmarkPoint]:
    """Return the cost of each method per second of sound, and its missed share.

    Args:
        repeats: Number of timed repetitions.
    """
    progress, noise, shape = in_words(), rumble(lines=True), pulse(WHOLE_S)
    rng = np.random.default_rng(0)
    windows = [coloured(rng, noise, SIZE)[0] for _ in range(2 * WINDOWS)]
    blast = 10 ** (SNR_DB / 20) / matched_kernel(shape, RATE, noise).response * shape
    loud = [window.copy() for window in windows[WINDOWS:]]
    # the blast lies well within the window, so that the ends do not matter
    for window, at in zip(loud, rng.integers(26_000, 50_000, WINDOWS), strict=True):
        window[at:][: blast.size] += blast
    points = []
    for name, loudest in methods().items():
        progress(name)
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
        title="Detectors: delay or computing time, against loss or misses",
        cost="waiting: from the first sample of a blast; misses: a second of sound",
        error=f"waiting: lost share of 2E/N0, to 0.001; misses: share at {SNR_DB:g} dB",
        measure=lambda: [*latency_points(), *miss_points()],
        relative=False,
    )
)


class Answer(NamedTuple):
    """Estimate of ln mass by a method.

    Attributes:
        middle: Median.
        low: Lower bound of the 90 % interval.
        high: Upper bound of the 90 % interval.
        sd: Standard deviation.
    """

    middle: float
    low: float
    high: float
    sd: float


class Trial(NamedTuple):
    """Estimates of a method for simulated logs.

    Attributes:
        answers: Estimates for the logs without a poor pick.
        seconds: Time of one estimate.
        drawn: Number of simulated logs, with those that have a poor pick.
    """

    answers: list[Answer]
    seconds: float
    drawn: int


# One node after another: a batch of all would need the memory of all at once.
_DENSITIES = jax.jit(lambda p, z: jax.lax.map(p.log_density, z[:, None]))


def _on_grid(posterior: Posterior, centre: float, sd: float, count: int) -> Answer:
    """Return the estimate by quadrature on nodes about a centre."""
    z = centre + sd * np.linspace(-REACH_SD, REACH_SD, count)
    density = np.asarray(_DENSITIES(posterior, jnp.asarray(z)))
    fine = np.linspace(z[0], z[-1], 2001)
    # relative to the largest, since the exponential of a log density underflows
    weight = np.exp(np.interp(fine, z, density) - np.nanmax(density))
    weight /= weight.sum()
    low, middle, high = np.interp([0.05, 0.5, 0.95], np.cumsum(weight), fine)
    mean = weight @ fine
    return Answer(middle, low, high, float(np.sqrt(weight @ (fine - mean) ** 2)))


def answer_of(posterior: Posterior) -> Answer:
    """Return the estimate from readings alone, on narrower and narrower grids."""
    answer = Answer(math.log(MASS), 0.0, 0.0, 0.3)
    # each grid is at most 4.4 times finer: six cover any sd down to 0.3 / 4.4^6
    for _ in range(6):
        before = answer.sd
        answer = _on_grid(posterior, answer.middle, answer.sd, WIDE)
        spacing = 2 * REACH_SD * before / (WIDE - 1)
        answer = answer._replace(sd=max(answer.sd, spacing))
        if answer.sd > 2 * spacing:
            break
    return answer


def by_eye(records: list[PressureRecord]) -> Observations:
    """Return the rows of readings by eye, with assumed errors (`EYE_ERROR`)."""
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
            EYE_ERROR * eye.positive_duration_s,
            EYE_ERROR * eye.positive_impulse_pa_s,
        ]
    return replace(log, value=value, sigma=sigma, covariances=())


def trials(recorder: Recorder, logs: int, *, scatter: bool) -> dict[str, Trial]:
    """Apply every method to simulated logs.

    A log with a poor pick has fewer rows, and another layout needs another compilation.
    All methods leave such a log out. The number of simulated logs is reported.

    Args:
        recorder: Properties of the recorder.
        logs: Number of logs without a poor pick.
        scatter: True if laws scatter, in the simulated records and in the fit.
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
        method(drawn[0])  # compiles, so that the timed calls do not
        start = perf_counter()
        answers = [method(records) for records in drawn]
        found[name] = Trial(answers, (perf_counter() - start) / logs, count)
    return found


def record_points(logs: int = LOGS) -> list[BenchmarkPoint]:
    """Return cost and errors of each method, with exact laws and with scatter.

    Args:
        logs: Number of logs of each case.
    """
    progress = in_words()
    points = []
    truth = math.log(MASS)
    for words, scatter in (("laws exact", False), ("laws scatter", True)):
        progress(words)
        for name, trial in trials(Recorder(snr=SNR), logs, scatter=scatter).items():
            errors = np.array([one.middle - truth for one in trial.answers])
            covered = sum(one.low <= truth <= one.high for one in trial.answers)
            sd = np.median([one.sd for one in trial.answers])
            error = float(np.sqrt(np.mean(errors**2)))
            span = (
                f"bias {errors.mean():+.2%}, reported sd {sd:.2%}, 90 % intervals "
                f"contain {covered} of {logs}"
            )
            if trial.drawn > logs:
                span += f", the logs without a poor pick of {trial.drawn} drawn"
            missed = max(abs(covered / logs - 0.9), 0.5 / logs)
            points += [
                BenchmarkPoint(name, trial.seconds, error, span, f"mass, {words}"),
                BenchmarkPoint(name, trial.seconds, missed, span, f"interval, {words}"),
            ]
    return points


register_benchmark(
    Benchmark(
        name="records",
        title=f"A mass from six pressure records, peak {SNR:g} times the noise",
        cost=f"time of a log: picks, and densities on grids of {WIDE} masses",
        error="rms of ln mass; coverage of 90 % intervals minus 90 %",
        measure=record_points,
    )
)
