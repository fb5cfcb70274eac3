"""How many records are picked a second?

    nice python -m calibration.picks_speed > calibration/results/picks_speed.txt

Records of 4,096 samples as `picks_records.py` makes them (drift, coloured noise,
rings), picked by all cores together. Beside the time on the wall stands that of the
processors, which other work on the machine lengthens less; J is how long `import jax`
takes there.
"""

import os
import subprocess
import sys
import time

import jax
import numpy as np

from calibration.picks_records import SAMPLES, drawn, noise_of, signal_of
from jblast.cli.jax_start import start_jax
from jblast.inference.picks import pick
from jblast.report.tables import aligned

MANY, MADE, SEED = 6_000, 320, 21


def main(many: int = MANY) -> None:
    """Print the table."""
    start_jax(all_cores=True)
    rng = np.random.default_rng(SEED)
    made = drawn(MADE, rng)
    plain = [o for o in made if not o.resonance]
    clock = np.arange(SAMPLES, dtype=float)
    rows = [["records", "", "1/s", "1/s of CPU", "in J", "load"]]
    j = _import_time()
    for name, some in (("as they come", made), ("no sensor rings", plain)):
        few = np.array([signal_of(o) + noise_of(o, rng) for o in some])
        samples = np.resize(few, (many, SAMPLES))
        jax.block_until_ready(pick(clock, samples[:64]))
        begun, busy = time.perf_counter(), time.process_time()
        jax.block_until_ready(pick(clock, samples))
        wall, cpu = time.perf_counter() - begun, time.process_time() - busy
        cores = os.cpu_count() or 1
        rate, alone = f"{many / wall:.0f}", f"{many * cores / cpu:.0f}"
        rows.append(
            [
                str(many),
                name,
                rate,
                alone,
                f"{wall / j:.0f}",
                f"{os.getloadavg()[0]:.0f}",
            ]
        )
    print(f"{SAMPLES} samples, {os.cpu_count()} cores, J = {j:.2f} s\n")
    print("\n".join(aligned(rows)))


def _import_time() -> float:
    """Return how long `import jax` takes [s]."""
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import jax"], check=True)
    return time.perf_counter() - begun


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:2]))
