"""Cost of a stream of sound, and its delay."""

import time

import numpy as np

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.signals import SoundWatch, bank_of_pulses

SECONDS = 4
TEMPLATES_S = (0.02, 0.05)
"""Lengths of single templates [s]."""
REPEATS = 20


def watch_for(templates: list[np.ndarray]) -> SoundWatch:
    """Return a search in known noise; of a bank with the test of form."""
    forms = len(templates) > 1
    return SoundWatch(templates, RATE, noise=rumble(), forms=forms)


def cost(templates: list[np.ndarray]) -> float:
    """Return the processor time for a second of sound, the least of all repeats [s]."""
    sound = coloured(np.random.default_rng(0), rumble(), SECONDS * round(RATE))[0]
    watch, best = watch_for(templates), np.inf
    for _ in range(REPEATS):
        start = time.process_time()  # of this process: others may be busy
        for packet in np.split(sound, 10 * SECONDS):
            watch.push(packet)
        best = min(best, time.process_time() - start)
    return best / SECONDS


def reported_after(templates: list[np.ndarray]) -> tuple[float, float]:
    """Return the delay of a report from the first sample of a blast, and its bound [s].

    The blast is that of the last template.
    """
    shape, at, step = templates[-1], 60_000, 24
    sound = coloured(np.random.default_rng(1), rumble(), 2**17)[0]
    watch = watch_for(templates)
    sound[at:][: shape.size] += 50 * shape / watch.kernels[-1].response
    reported = next(
        start + step - at
        for start in range(0, sound.size, step)
        if watch.push(sound[start : start + step])
    )
    return reported / RATE, watch.latency_s


def costs() -> tuple[list[str], dict[str, float]]:
    """Return lines of a table, and milliseconds a second by search."""
    searches = {f"{1e3 * t:.0f} ms": [pulse(t)] for t in TEMPLATES_S}
    searches["bank"] = bank_of_pulses(RATE)
    price = {name: 1e3 * cost(shapes) for name, shapes in searches.items()}
    lines = [
        "Stream at 48 kHz: delay of a report from the first sample of a blast, and at",
        "most [ms]; compute for a second of sound, one core [ms]",
        "  template      delay    at most    compute",
    ]
    for name, shapes in searches.items():
        delay, most = reported_after(shapes)
        lines.append(
            f"  {name:9s}{1e3 * delay:10.1f}{1e3 * most:11.1f}{price[name]:11.2f}"
        )
    return lines, price
