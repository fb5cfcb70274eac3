"""Ways to make events of frames on a GPU, side by side, and what limits them.

    JAX_PLATFORMS=cpu python -m calibration.event_kernel_candidates [--out TABLE.txt]

Needs CuPy and a GPU, not Warp; one or two minutes, most of them for the compiler. The
kernels are those of `event_kernel_candidates.cu`, in CUDA C++; each is held to the
events of the first, time for time. Two films of 640 x 480 pixels of RGBA: the disc that
grows of `benchmark_events`, and noise in every pixel of every frame, below the
threshold. Beside the rates stand those of nothing but reading or copying the frames.
Then the ways to the host in order of time and pixel: as `EventKernel.in_order` had it,
sorted on the device, through pinned memory, and that while the next frames are
followed.
"""

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from calibration.event_candidates import FPS, HEIGHT, PIXELS, WIDTH, Candidate, Events
from calibration.event_order_candidates import ordered

cupy: Any = importlib.import_module("cupy")

FRAMES, NOISY = 4096, 1024
BACKGROUND, BRIGHT = 0.16, 200
REPEATS = 7

NOW = Candidate("two", ahead=1)
COLOUR = (
    NOW,
    Candidate("two"),
    Candidate("two", together=512),
    Candidate("fused"),
    Candidate("fused", together=512),
    Candidate("fused", together=FRAMES),
    Candidate("fused", run=32),
    Candidate("fused", threads=256),
    Candidate("fused", pixels=2),
    Candidate("fused", run=8, pixels=4),
    Candidate("fused", pixels=4),
    Candidate("fused", pixels=4, threads=64),
    Candidate("fused", pixels=4, together=512),
    Candidate("fused", pixels=4, together=FRAMES),
    Candidate("fused", mode=1),
    Candidate("fused", pixels=4, mode=1),
    Candidate("fused", pixels=4, mode=2),
    Candidate("fused", pixels=4, mode=3),
    Candidate("staged", run=8, pixels=4),
    Candidate("staged", run=16, pixels=4),
    Candidate("staged", run=8, pixels=4, mode=1, together=512),
)
GREY = (
    NOW._replace(grey=True),
    Candidate("two", grey=True),
    Candidate("fused", pixels=4, grey=True),
    Candidate("fused", pixels=16, grey=True),
    Candidate("fused", pixels=16, together=512, grey=True),
)


def films() -> tuple[Any, Any, Any]:
    """Return the disc that grows and the noise, words; and the first as grey bytes."""
    y, x = cupy.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    radius = cupy.hypot(x - WIDTH / 2, y - HEIGHT / 2)
    disc = cupy.empty((FRAMES, PIXELS), np.uint32)
    grey = cupy.empty((FRAMES, PIXELS), np.uint8)
    for k in range(FRAMES):
        edge = 3.0 + 260.0 * 0.4 * (1.0 - np.exp(-k / FPS / 0.4))
        alpha = cupy.rint(255.0 / (1.0 + cupy.exp(radius - np.float32(edge)))).ravel()
        disc[k] = alpha.astype(np.uint32) << np.uint32(24) | np.uint32(
            BRIGHT * 0x010101
        )
        light = BACKGROUND + alpha / 255.0 * (BRIGHT / 255.0 - BACKGROUND)
        grey[k] = cupy.rint(255.0 * light).astype(np.uint8)
    chance = cupy.random.default_rng(1)
    noise = cupy.empty((NOISY, PIXELS), np.uint32)
    for k in range(NOISY):
        bits = chance.integers(0, 1 << 24, PIXELS, dtype=np.uint32)
        noise[k] = np.uint32(0xB0B0B0B0) + (bits & np.uint32(0x03030303))
    return disc, noise, grey


def seconds(run: Callable[[], Any]) -> float:
    """Return the median time of a run on the device [s], by its own clock."""
    begin, end = cupy.cuda.Event(), cupy.cuda.Event()
    took = []
    for _ in range(REPEATS + 1):
        begin.record()
        run()
        end.record()
        end.synchronize()
        took.append(1e-3 * cupy.cuda.get_elapsed_time(begin, end))
    return float(np.median(took[1:]))


def measured(films: list[tuple[Any, float]], candidates, behind, copied, say) -> Events:
    """Measure candidates and say their rows; return the quickest on the first film."""
    known: list[tuple[np.ndarray, ...] | None] = [None] * len(films)
    best: tuple[float, Events | None] = (np.inf, None)
    for how in candidates:
        row, events = [], Events(how, behind)
        for number, (film, least) in enumerate(films):
            times = cupy.arange(len(film)) / FPS
            took = seconds(lambda f=film, t=times, e=events: e.run(f, t))
            rate = len(film) / took
            found = events.sorted()
            first = known[number] = known[number] or found
            same = len(first[0]) == len(found[0]) and all(
                np.allclose(a, b, rtol=0, atol=1e-6)
                for a, b in zip(first, found, strict=True)
            )
            words = f"{len(found[0]):,}" if same else "OTHER EVENTS"
            row.append(
                f"{rate:10.3g}{rate / copied:8.0%}{least / took:8.0%}{words:>14}"
            )
            if number == 0 and same and took < best[0]:
                best = took, events
        name = (
            f"{how.kind:7}{how.run:4}{how.pixels:4}{how.mode:4}{how.together:6}"
            f"{how.ahead if how.kind == 'two' else '-':>4}{how.threads:5}"
        )
        say(f"{name}{events.registers():>10}" + "".join(row))
    assert best[1] is not None
    return best[1]


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", metavar="TABLE.txt")
    out, lines = parser.parse_args().out, []

    def say(line: str) -> None:
        lines.append(line)
        print(line, flush=True)

    name = cupy.cuda.runtime.getDeviceProperties(0)["name"].decode()
    disc, noise, grey = films()
    behind = cupy.full(PIXELS, BACKGROUND, np.float32)
    copied = FRAMES / seconds(disc.copy)
    sums = [
        (film, seconds(lambda f=film: f.view(np.uint64).max()))
        for film in (disc, noise, grey)
    ]
    say(f"Frames to events: {name}, {FRAMES} and {NOISY} frames of {WIDTH} x {HEIGHT}")
    say(f"copied {copied:.3g} frames/s of RGBA; read alone (a maximum of words)")
    say(
        f"{FRAMES / sums[0][1]:.3g} frames/s of RGBA, {FRAMES / sums[2][1]:.3g} of grey"
    )
    say("")
    titles = f"{'frames/s':>10}{'copied':>8}{'read':>8}{'events':>14}"
    head = f"{'kind':7}{'run':>4}{'px':>4}{'mod':>4}{'fr.':>6}{'ah.':>4}{'thr.':>5}"
    say(f"{head}{'registers':>10}{titles}   then of noise: the same")
    best = measured(sums[:2], COLOUR, behind, copied, say)
    say("grey of 8 bits")
    measured(sums[2:], GREY, behind, copied, say)
    say(f"\nIn order on the host: {best.how}")
    for label, took in ordered(best, disc, seconds):
        say(f"{label:56}{len(disc) / took:10.3g} frames/s")
    if out:
        Path(out).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    sys.exit(main())
