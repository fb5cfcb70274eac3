r"""Does `jblast.study.discovery` find laws that are known, and at which noise not?

    python -m calibration.discovery --out calibration/results/discovery.png \
        > calibration/results/discovery.txt

Simulated: the drag of a Hummingbird in a swinging wind, the motor lag of a Crazyflie
under stepped commands, 50 and 200 rows a second (`discovery_cases.py`), and a strong
shock of a point source, 60 radii. To each, normal noise, 20 seeds a level (0 to 19).
Shocks: Trinity's radii (calibration/data/trinity.csv; and with the zero of time moved),
and the radius of 1 kg on the ground by Kingery and Bulmash and by `shock_kinematics`,
in three ranges, with 1 % of noise (seed 0).

How to read the table: "exact" is the share of seeds in which exactly the true terms
came out; "missing" and "false" are mean numbers of terms; "error" is the largest
relative error of a coefficient, the median over the exact ones; "in 90 %" the share of
true coefficients inside their 5 to 95 %; "holds" the share whose equations, integrated
from the start, stay within 10 % of the spread of the clean record.
"""

import argparse
import sys
from pathlib import Path

import jax
import numpy as np

from jblast.observations import read
from jblast.report.discovery_figure import noise_figure
from jblast.report.discovery_text import outcomes_text, slowing_text
from jblast.study.discovery_cases import CASES
from jblast.study.discovery_noise import noise_sweep
from jblast.study.discovery_shock import shock_slowing
from jblast.waves import kingery_bulmash_arrival_time, shock_kinematics_arrival_time

TRINITY = Path(__file__).parent / "data" / "trinity.csv"
SHIFTS_S = (0.0, -2e-5, 2e-5)
"""Of the zero of time: a fifth of the first interval between two photographs."""
RANGES = ((0.1, 2.0), (0.5, 5.0), (2.0, 40.0))
"""Of scaled distance [m/kg^(1/3)]: near, middle, far."""
NOISE = 0.01
ROWS = 60
LAWS = {
    "Kingery and Bulmash": kingery_bulmash_arrival_time,
    "shock_kinematics": shock_kinematics_arrival_time,
}


def main() -> None:
    """Print the table and the shocks; draw the figure."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", metavar="FIGURE.png")
    asked = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    outcomes = []
    for name, build in CASES.items():
        outcomes += noise_sweep(build())
        sys.stderr.write(f"{name} done\n")
    print(outcomes_text(outcomes))
    if asked.out:
        noise_figure(outcomes).savefig(asked.out)
    photographs = read(TRINITY)
    for shift in SHIFTS_S:
        moved = f", time {1e6 * shift:+.0f} µs" if shift else ""
        print(f"Trinity, {len(photographs)} radii{moved}")
        print(slowing_text(shock_slowing(photographs.time + shift, photographs.value)))
    for near, far in RANGES:
        radius = np.geomspace(near, far, ROWS)
        drawn = np.exp(NOISE * np.random.default_rng(0).standard_normal(ROWS))
        for law, arrival in LAWS.items():
            print(f"{law}, 1 kg, {near:g} to {far:g} m, {100 * NOISE:g} % of noise")
            time = np.asarray(arrival(radius, 1.0))
            print(slowing_text(shock_slowing(time, radius * drawn)))


if __name__ == "__main__":
    main()
