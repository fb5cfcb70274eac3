"""How much memory does a gigabyte of sound take to be picked?

    python -m calibration.long_recording > calibration/results/long_recording.txt

A WAV file of one channel, 16 bits, 48,000 samples a second: zeros (a sparse file),
white noise of 20 steps about three bangs, of which the first is in the first second and
the last in the last ten. `jblast pick` runs on it in a process of its own, and on its
first two seconds; peak resident memory is the kernel's (`ru_maxrss`), what the short
one takes is the start. Silence takes as long to go through as noise.
"""

import json
import os
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RATE_HZ, BYTES = 48_000, 10**9
BANGS_S = (0.8, 5000.0, 10_400.0)
NOISE, PEAK, DURATION_S = 20.0, 20_000.0, 0.01
CHILD = """
import resource, sys
from jblast.cli.main import main
code = main(sys.argv[1:], progress=False)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)
sys.exit(code)
"""


def header(data_bytes: int) -> bytes:
    """Return the head of a WAV file of one channel and 16 bits."""
    head = struct.pack("<4sI4s", b"RIFF", 36 + data_bytes, b"WAVE")
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, 1, RATE_HZ, 2 * RATE_HZ, 2, 16)
    return head + form + struct.pack("<4sI", b"data", data_bytes)


def bang(rng: np.random.Generator) -> np.ndarray:
    """Return four seconds of noise, a pulse one second after their start."""
    since = np.arange(4 * RATE_HZ) / RATE_HZ - 1.0
    x = np.maximum(since, 0.0) / DURATION_S
    pulse = np.where(since >= 0, PEAK * (1 - x) * np.exp(-x), 0.0)
    noise = NOISE * rng.standard_normal(since.size)
    return np.rint(pulse + noise).astype("<i2")


def write_recording(path: Path, data_bytes: int) -> None:
    """Write the recording, or its beginning; what is silent takes no room."""
    rng = np.random.default_rng(30)
    with path.open("wb") as file:
        file.write(header(data_bytes))
        file.truncate(44 + data_bytes)
        for at in BANGS_S:
            samples = bang(rng)
            first = round((at - 1.0) * RATE_HZ)
            samples, first = samples[max(-first, 0) :], max(first, 0)
            room = max(data_bytes // 2 - first, 0)
            if room:
                file.seek(44 + 2 * first)
                file.write(samples[:room].tobytes())


def picked(path: Path) -> tuple[dict, float, float]:
    """Return what was picked, the peak of memory [MB], and how long it took [s]."""
    words = [sys.executable, "-c", CHILD, "pick", str(path), "--full-scale", "200"]
    began = time.perf_counter()
    done = subprocess.run(
        [*words, "--json"], capture_output=True, text=True, check=True, env=os.environ
    )
    seconds = time.perf_counter() - began
    return json.loads(done.stdout), float(done.stderr.split()[-1]) / 1024, seconds


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.wav"
        print("recording        picks at [s]                       peak [MB]  time [s]")
        peaks = []
        for name, size in (("2 s", 2 * 2 * RATE_HZ), ("1 GB", BYTES)):
            write_recording(path, size)
            document, peak, seconds = picked(path)
            peaks.append(peak)
            times = ", ".join(
                f"{pick['air_arrival_s']['value']:.5f}" for pick in document["picks"]
            )
            print(f"{name:<15}  {times:<33}  {peak:9.0f}  {seconds:8.1f}")
    print(f"\n1 GB above the start: {peaks[1] - peaks[0]:.0f} MB")


if __name__ == "__main__":
    main()
