"""How fast: each benchmark prints a table of rates, and of their ratios in that run.

python -m calibration.benchmarks laws fit_many
"""

import argparse
import os

import jax

from calibration.benchmark_fit_many import fit_many_text
from calibration.benchmark_laws import laws_text
from calibration.benchmark_samplers import samplers_text

BENCHMARKS = {
    "laws": laws_text,
    "fit_many": fit_many_text,
    "samplers": samplers_text,
}


def main() -> None:
    """Run the benchmarks named."""
    parser = argparse.ArgumentParser(description="Measure how fast jblast is.")
    parser.add_argument("name", nargs="*", metavar="NAME", help=", ".join(BENCHMARKS))
    asked = parser.parse_args().name or list(BENCHMARKS)
    if unknown := [name for name in asked if name not in BENCHMARKS]:
        parser.error(f"no benchmark {unknown[0]!r}: expected {', '.join(BENCHMARKS)}")
    if "fit_many" in asked and "device_count" not in os.environ.get("XLA_FLAGS", ""):
        jax.config.update("jax_num_cpu_devices", os.cpu_count())
    for name in asked:
        print(BENCHMARKS[name]())


if __name__ == "__main__":
    main()
