"""How fast: each benchmark prints a table of rates, and of their ratios in that run.

python -m calibration.benchmarks NAME ...
"""

import argparse
import importlib
import os

import jax

BENCHMARKS = (
    "laws",
    "fit_many",
    "picks",
    "flights",
    "events",
    "views",
    "flight_kernel",
    "world",
    "environments",
    "study",
)
"""Each has a function `NAME_text`, in the module of its name or of its subject."""
SUBJECTS = {"flight_kernel": "flights"}
SPLIT = {"fit_many", "flights", "world", "environments", "study"}
"""Those that use every core as a device of its own."""


def main() -> None:
    """Run the benchmarks named; each is imported only then, with what it needs."""
    parser = argparse.ArgumentParser(description="Measure how fast jblast is.")
    parser.add_argument("name", nargs="*", metavar="NAME", help=", ".join(BENCHMARKS))
    asked = parser.parse_args().name or list(BENCHMARKS)
    if unknown := [name for name in asked if name not in BENCHMARKS]:
        parser.error(f"no benchmark {unknown[0]!r}: expected {', '.join(BENCHMARKS)}")
    split = SPLIT & {*asked}
    if split and "device_count" not in os.environ.get("XLA_FLAGS", ""):
        jax.config.update("jax_num_cpu_devices", os.cpu_count())
    for name in asked:
        module = importlib.import_module(
            f"calibration.benchmark_{SUBJECTS.get(name, name)}"
        )
        print(getattr(module, f"{name}_text")())


if __name__ == "__main__":
    main()
