"""What a stream costs, and after how long it tells of a blast."""

import time

import numpy as np

from calibration.cases import RATE, coloured, pulse, rumble
from jblast.signals import stream

BLOCKS = (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
SECONDS = 1


def cost(template_s: float, block_s: float, repeats: int = 100) -> float:
    """Return what a second of sound costs a core [s].

    Args:
        template_s: Length of the template [s].
        block_s: Of a block [s].
        repeats: How often it is timed; the least counts.
    """
    sound = coloured(np.random.default_rng(0), rumble(), SECONDS * round(RATE))[0]
    block = round(block_s * RATE)
    blocks = [sound[start : start + block] for start in range(0, sound.size, block)]
    listening = stream(
        pulse(template_s), RATE, noise_spectrum=rumble(), block_s=block_s
    )

    best = np.inf
    for _ in range(repeats):
        start = time.process_time()  # of this core: others may be busy
        for samples in blocks:
            listening.push(samples)
        best = min(best, time.process_time() - start)
    return best / SECONDS


def told_after(template_s: float, block_s: float) -> tuple[float, float]:
    """Return how long after its first sample a blast is told, and at most [s].

    Args:
        template_s: Length of the template [s].
        block_s: Of a block [s].
    """
    shape, at, step = pulse(template_s), 30_000, 24
    sound = coloured(np.random.default_rng(1), rumble(), 2**16)[0]
    sound[at:][: shape.size] += 20 * shape
    listening = stream(shape, RATE, noise_spectrum=rumble(), block_s=block_s)
    told = next(
        start + step - at
        for start in range(0, sound.size, step)
        if listening.push(sound[start : start + step])
    )
    assert listening.latency_s is not None
    return told / RATE, listening.latency_s


def costs() -> tuple[list[str], dict[float, float]]:
    """Return lines of a table, and milliseconds a second by block."""
    lines = [
        "Told after, from the first sample of a blast: measured, and at most [ms]",
        "  template   block 100 ms     block 20 ms      block 5 ms",
    ]
    for template_s in (0.02, 0.05):
        row = [told_after(template_s, block) for block in (0.1, 0.02, 0.005)]
        lines.append(
            f"  {1e3 * template_s:3.0f} ms  "
            + "".join(f"{1e3 * a:9.1f} {1e3 * b:6.1f}" for a, b in row)
        )
    price = {block: 1e3 * cost(0.02, block) for block in BLOCKS}
    lines += [
        "",
        "Compute for a second of sound at 48 kHz, template of 20 ms, one core [ms]",
        "  block  " + "".join(f"{1e3 * block:7.0f} ms" for block in BLOCKS),
        "         " + "".join(f"{price[block]:10.2f}" for block in BLOCKS),
    ]
    return lines, price
