"""Ways to make events of frames on a GPU, side by side, and what limits them.

    JAX_PLATFORMS=cpu python -m calibration.event_kernel_candidates [--out TABLE.txt]

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
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jblast.sensors.camera.events.stream import Found, gathered

cupy: Any = importlib.import_module("cupy")

HEIGHT, WIDTH, FPS, THRESHOLD = 480, 640, 1000.0, 0.2
PIXELS = HEIGHT * WIDTH
ROOM = 1 << 20
SOURCE = Path(__file__).with_name("event_kernel_candidates.cu")


class Candidate(NamedTuple):
    """A kernel as it is compiled and launched.

    Attributes:
        kind: `two` (screen, then follow), `fused` or `staged` (shared memory).
        run: Frames asked for together.
        pixels: Of a thread.
        mode: Light by which pixels are screened: 0 conversions, 1 `dp4a`, 2 permuted
            bytes, 3 only where a word changed at all.
        together: Frames of a launch.
        ahead: Frames that `follow` asks for together.
        threads: Of a block.
        grey: Whether frames are grey and not RGBA.
    """

    kind: str
    run: int = 16
    pixels: int = 1
    mode: int = 0
    together: int = 128
    ahead: int = 16
    threads: int = 128
    grey: bool = False


class Events:
    """A candidate, compiled, with the state of its pixels and room for events."""

    def __init__(self, how: Candidate, behind: Any):
        """Compile it.

        Args:
            how: The candidate.
            behind: Grey light behind RGBA frames.
        """
        self.how = how
        named = {
            "RUN": how.run,
            "PX": how.pixels,
            "MODE": how.mode,
            "AHEAD": how.ahead,
            "THREADS": how.threads,
        }
        defined = "".join(f"#define {k} {v}\n" for k, v in named.items())
        defined += "#define GREY 1\n" if how.grey else ""
        module = cupy.RawModule(
            code=defined + SOURCE.read_text(), options=("-std=c++17",)
        )
        kinds = ("screen", "follow") if how.kind == "two" else (how.kind,)
        names = "begin", "finish", *kinds
        self.kernels = {name: module.get_function(name) for name in names}
        if how.kind == "staged":
            self.shared = 2 * how.run * how.threads * 16
            self.kernels["staged"].max_dynamic_shared_size_bytes = self.shared
        self.first = cupy.zeros(PIXELS, np.float64)
        self.counts = cupy.zeros((2, PIXELS), np.int32)
        self.quiet = cupy.zeros((PIXELS, 2), np.float32)
        self.value = cupy.zeros(PIXELS, np.uint32)
        self.behind = behind
        self.listed = cupy.zeros(PIXELS, np.int32)
        self.fresh()

    def fresh(self) -> None:
        """Make new room for events."""
        self.found = cupy.zeros(1, np.int32)
        self.pixel, self.sign = (cupy.zeros(ROOM, np.int32) for _ in range(2))
        self.time = cupy.zeros(ROOM, np.float64)

    def _launch(self, name: str, pixels: int, *given: Any) -> None:
        threads = self.how.threads
        blocks = -(-PIXELS // (pixels * threads))
        state = (
            self.behind,
            np.float64(THRESHOLD),
            np.float64(THRESHOLD),
            np.int32(PIXELS),
            self.first,
            self.counts[0],
            self.counts[1],
            self.quiet,
            self.value,
            self.found,
            self.pixel,
            self.time,
            self.sign,
            np.int32(ROOM),
        )
        shared = {"shared_mem": self.shared} if name == "staged" else {}
        self.kernels[name]((blocks,), (threads,), (*given, *state), **shared)

    def run(self, frames: Any, times: Any, first: int = 0) -> None:
        """Take frames; the events lie on the device.

        Args:
            frames: Words or bytes (frame, pixel).
            times: Of them [s], on the device.
            first: Number of the first of them in the film; of 0 all begins anew.
        """
        how, count = self.how, len(frames)
        if first == 0:
            self._launch("begin", 1, frames)
        self.found.fill(0)
        listed = cupy.zeros(-(-count // how.together), np.int32)
        for part, start in enumerate(range(0, count, how.together)):
            some = np.int32(start), np.int32(min(start + how.together, count))
            last = np.float64(max(first + start - 1, 0) / FPS)
            if how.kind == "two":
                which = listed[part : part + 1], self.listed
                self._launch("screen", 1, frames, *some, *which)
                self._launch("follow", 1, frames, times, *some, last, *which)
            else:
                self._launch(how.kind, how.pixels, frames, times, *some, last)
        self._launch("finish", 1, frames, np.int32(count))

    def sorted(self) -> tuple[np.ndarray, ...]:
        """Return time, pixel and sign in order of pixel and time, on the host."""
        count = int(self.found[0])
        time, pixel, sign = (
            a[:count].get() for a in (self.time, self.pixel, self.sign)
        )
        order = np.lexsort((time, pixel))
        return time[order], pixel[order], sign[order]

    def registers(self) -> str:
        """Return registers of a thread, and bytes in local memory if any."""
        kernel = self.kernels["screen" if self.how.kind == "two" else self.how.kind]
        local = kernel.local_size_bytes
        return f"{kernel.num_regs}" + (f"+{local} B" if local else "")


BLOCK = 512
"""Frames that are followed while the events of those before are fetched."""
ORDER_REPEATS = 5

Fields = tuple[np.ndarray, ...]


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


def ordered(
    events: Any, film: Any, seconds: Callable[[Callable[[], Any]], float]
) -> Iterator[tuple[str, float]]:
    """Measure each way.

    Args:
        events: A candidate that keeps its events on the device.
        film: Frames, on the device.
        seconds: Measures a run on the device [s].

    Yields:
        What was measured, and how long it took [s].
    """
    times = cupy.arange(len(film)) / FPS

    def followed() -> None:
        events.run(film, times)

    yield "followed alone", seconds(followed)
    known = _by_host(events)
    ways: dict[str, Callable[[], Fields]] = {
        "three copies, sorted by NumPy (as EventKernel)": lambda: _by_host(events),
        "sorted on the device, three copies": lambda: _by_device(events, pinned=False),
        "sorted on the device, pinned memory": lambda: _by_device(events, pinned=True),
    }
    for label, way in ways.items():
        yield (
            label + _checked(way(), known),
            _clocked(lambda w=way: (followed(), w())),
        )
    label = f"the same, while the next {BLOCK} frames are followed"
    blocks = Blocks(events, film, times)
    yield label + _checked(blocks.run(), known), _clocked(blocks.run)
    yield (
        "   of which the sort alone",
        _clocked(lambda: _order(events, count_of(events))),
    )


def count_of(events: Any) -> int:
    """Return how many events lie on the device."""
    return int(events.found[0])


def _checked(found: Fields, known: Fields) -> str:
    """Return a word where the events are others."""
    alike = all(
        len(a) == len(b) and np.allclose(a, b, rtol=0, atol=1e-9)
        for a, b in zip(found, known, strict=True)
    )
    return "" if alike else " (OTHER EVENTS)"


def _clocked(run: Callable[[], Any]) -> float:
    """Return the median time of a run by the host's clock [s]."""
    took = []
    for _ in range(ORDER_REPEATS + 1):
        cupy.cuda.Device().synchronize()
        begin = time.perf_counter()
        run()
        cupy.cuda.Device().synchronize()
        took.append(time.perf_counter() - begin)
    return float(np.median(took[1:]))


def _by_host(events: Any) -> Fields:
    """Return pixel, time and sign as `EventKernel.in_order` gets them."""
    count = count_of(events)
    fields = (a[:count].get() for a in (events.pixel, events.time, events.sign))
    found = gathered([Found(*fields)], WIDTH)
    return (
        np.asarray(found.y) * WIDTH + np.asarray(found.x),
        np.asarray(found.time),
        np.asarray(found.polarity),
    )


def _order(events: Any, count: int) -> Any:
    """Return the order of events by time, then pixel: two stable sorts by radix."""
    by_pixel = cupy.argsort(events.pixel[:count], kind="stable")
    time_bits = events.time[:count][by_pixel].view(np.int64)
    return by_pixel[cupy.argsort(time_bits, kind="stable")]


def _by_device(events: Any, *, pinned: bool) -> Fields:
    count = count_of(events)
    order = _order(events, count)
    fields = [a[:count][order] for a in (events.pixel, events.time, events.sign)]
    if not pinned:
        return tuple(field.get() for field in fields)
    return _fetched(fields, _PINNED, 0)


def _fetched(fields: list[Any], kept: dict, half: int) -> Fields:
    """Return fields in pinned memory, which is kept for the next time."""
    out = []
    for number, field in enumerate(fields):
        key = number, half
        if key not in kept or kept[key][0].nbytes < field.nbytes:
            size = max(1 << 20, 1 << (field.nbytes - 1).bit_length())
            memory = cupy.cuda.alloc_pinned_memory(size)
            kept[key] = (np.frombuffer(memory, np.uint8, size), memory)
        host = kept[key][0][: field.nbytes].view(field.dtype)
        field.get(out=host, blocking=False)
        out.append(host)
    cupy.cuda.get_current_stream().synchronize()
    return tuple(out)


_PINNED: dict = {}


class Blocks:
    """Follows a block of frames while the events of the one before come to the host."""

    def __init__(self, events: Any, film: Any, times: Any):
        """Make room for the events of two blocks."""
        self.events, self.film, self.times = events, film, times
        self.follows, self.brings = (
            cupy.cuda.Stream(non_blocking=True) for _ in range(2)
        )
        self.kept: dict = {}
        self.rooms = []
        for _ in range(2):
            events.fresh()
            self.rooms.append((events.found, events.pixel, events.time, events.sign))

    def run(self) -> Fields:
        """Return pixel, time and sign of all blocks."""
        starts = list(range(0, len(self.film), BLOCK))
        parts: list[Fields] = []
        done = [self._follow(starts[0], 0)]
        for number, _ in enumerate(starts):
            if number + 1 < len(starts):
                done.append(self._follow(starts[number + 1], (number + 1) % 2))
            self.brings.wait_event(done[number])
            parts.append(self._bring(number % 2))
        return tuple(np.concatenate(f) for f in zip(*parts, strict=True))

    def _follow(self, start: int, half: int) -> Any:
        events = self.events
        events.found, events.pixel, events.time, events.sign = self.rooms[half]
        stop = min(start + BLOCK, len(self.film))
        with self.follows:
            events.run(self.film[start:stop], self.times[start:stop], start)
            return self.follows.record()

    def _bring(self, half: int) -> Fields:
        found, pixel, at, sign = self.rooms[half]
        with self.brings:
            count = int(found[0])
            by_pixel = cupy.argsort(pixel[:count], kind="stable")
            bits = at[:count][by_pixel].view(np.int64)
            order = by_pixel[cupy.argsort(bits, kind="stable")]
            fields = [a[:count][order] for a in (pixel, at, sign)]
            return tuple(f.copy() for f in _fetched(fields, self.kept, half))


if __name__ == "__main__":
    sys.exit(main())
