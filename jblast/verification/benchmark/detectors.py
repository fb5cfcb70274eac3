"""Detectors: what a shorter template costs, and what each method misses at what cost.

Noise is wind, traffic and three tones of a rotor, 90 dB from end to end; the blast
lasts 200 ms. A method is set to pass in 1 % of the windows without a blast.
"""

import functools
from collections.abc import Callable

import numpy as np

from jblast.detect import (
    filtered_by,
    matched_kernel,
    sta_lta,
    threshold_for,
    white_noise,
)
from jblast.fidelity.timing import best_of
from jblast.progress import in_words
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.cases.detectors import (
    RATE,
    coloured,
    plain_normalised,
    pulse,
    rumble,
)

LENGTHS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Of templates [s]; all begin as the blast does."""
WHOLE_S = 0.2
BLOCK_S = 0.01
SIZE, WINDOWS = 2**16, 100
LEAST = 1e-3
"""Of 2E/N0: less is not told."""
SNR_DB = 17.0
"""2E/N0 of the blasts whose misses are counted."""

Loudest = Callable[[np.ndarray], float]


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
                    max(lost, LEAST),
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
