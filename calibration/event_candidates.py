"""A way to make events of frames on a GPU, compiled and run by CuPy.

Part of `calibration.event_kernel_candidates`; the kernels are those of
`event_kernel_candidates.cu`.
"""

import importlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

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
