"""How fast: each benchmark prints a table of rates, and of their ratios in that run.

python -m calibration.benchmarks laws
"""

import argparse

from calibration.benchmark_laws import laws_text

BENCHMARKS = {"laws": laws_text}


def main() -> None:
    """Run the benchmarks named."""
    parser = argparse.ArgumentParser(description="Measure how fast jblast is.")
    parser.add_argument("name", nargs="*", metavar="NAME", help=", ".join(BENCHMARKS))
    asked = parser.parse_args().name or list(BENCHMARKS)
    if unknown := [name for name in asked if name not in BENCHMARKS]:
        parser.error(f"no benchmark {unknown[0]!r}: expected {', '.join(BENCHMARKS)}")
    for name in asked:
        print(BENCHMARKS[name]())


if __name__ == "__main__":
    main()
