"""Samples a second of studies, and what the engine adds to what it runs.

python -m calibration.benchmark_study [air|flights|fits|host ...] [--seconds N]

On a GPU by the wall clock; on a CPU by processor time over the number of cores, which
is the wall clock of an idle machine, and tells alike beside others. The best of a few.

The engine's share: the programs of a tile are called again as they were, on what they
were given, all of it on the devices already, nothing copied back, one wait at the end.
What the tile takes beyond that is the engine's: to count, to hand out, to fetch, to
merge, to write. Both in this run, by the same lanes.

Air: mass and range of a charge are drawn, Kingery and Bulmash's laws give arrival and
peak pressure at 16 sensors, or at one; draws and statistics (mean, standard deviation,
quantiles) included, nothing else kept: `keep = "summary"`. An evaluation is both at one
sensor. Of two devices of a GPU machine: the same samples for each as for one.

Flights: vehicle-seconds a second of the outcome `flies_on`, against the same flights by
`simulate` alone (a blast of its own for each, the hold asked at every step, as many
rows stored, over ground), and against those of `benchmark_flights`, whose hold is asked
every 4 ms and whose last row alone is stored; all at the same step and in the same
precision: float64 on a CPU, float32 on a GPU.

Fits: logs a second of the outcome `fit_error`, against `fit_many` of readings that lie
on the host, its answer copied back, and the draws of the readings alone.

Host: `fit_from_host`, which copies while it fits and brings back what was asked,
against `fit_many` and its whole answer; logs of `calibration.six_stations`. Pieces of
several sizes, numbers that come back in float64 and float32, arrays that are new or
were filled before.

The table of a CPU goes to calibration/results/benchmark_study.txt, that of a GPU to
benchmark_study_gpu.txt, as each part is done.
"""

import argparse
import contextlib
import os
import time
from pathlib import Path

import jax

from calibration.study_clock import platform
from calibration.study_speed_air import air_lines
from calibration.study_speed_fits import fit_lines, host_lines
from calibration.study_speed_flights import flight_lines
from jblast.files import write_text

RESULTS = Path(__file__).parent / "results"
PARTS = {
    "air": air_lines,
    "flights": flight_lines,
    "fits": fit_lines,
    "host": host_lines,
}


def study_text(
    asked: tuple[str, ...] = tuple(PARTS),
    seconds: float = float("inf"),
    kept: Path | None = None,
) -> str:
    """Measure and return the table.

    Args:
        asked: Its parts.
        seconds: No part is begun later than that.
        kept: Where to keep it, as parts are done.
    """
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    start = time.perf_counter()
    try:
        device = jax.devices()[0]
        name = device.device_kind if platform() == "gpu" else f"{os.cpu_count()} cores"
        lines = [
            f"Studies: {platform()}, {name}, {len(jax.devices())} devices of JAX "
            f"{jax.__version__}, float64, load average {os.getloadavg()[0]:.1f}"
        ]
        for part in asked:
            begun = time.perf_counter()
            if begun - start > seconds:
                lines += ["", f"{part}: not measured, {seconds:g} s are over"]
                continue
            lines += ["", *PARTS[part]()]
            lines.append(f"  ({time.perf_counter() - begun:.0f} s to measure)")
            if kept is not None:
                write_text(kept, "\n".join(lines) + "\n")
        return "\n".join(lines)
    finally:
        jax.config.update("jax_enable_x64", before)


def main() -> None:
    """Measure parts; print and keep."""
    parser = argparse.ArgumentParser(description="Measure how fast studies are.")
    parser.add_argument("part", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--seconds", type=float, default=float("inf"))
    asked = parser.parse_args()
    if unknown := [part for part in asked.part if part not in PARTS]:
        parser.error(f"no part {unknown[0]!r}: expected {', '.join(PARTS)}")
    with contextlib.suppress(RuntimeError):  # the devices stand already
        jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    suffix = "_gpu" if platform() == "gpu" else ""
    kept = RESULTS / f"benchmark_study{suffix}.txt"
    if asked.part:
        kept = None
    print(study_text(tuple(asked.part) or tuple(PARTS), asked.seconds, kept))


if __name__ == "__main__":
    main()
