"""The unit of time of this machine: J, how long `import jax` takes, warm.

    python tests/tools/import_time.py

Machines differ threefold; what takes 10 J here takes about 10 J there.
"""

import subprocess
import sys
import time


def import_time(runs: int = 3) -> float:
    """Return the least of some runs of `python -c 'import jax'` [s], after one more."""
    seconds = []
    for _ in range(runs + 1):
        begun = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import jax"], check=True)
        seconds.append(time.perf_counter() - begun)
    return min(seconds[1:])


if __name__ == "__main__":
    sys.stdout.write(f"{import_time():.2f}\n")
