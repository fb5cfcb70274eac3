"""Do fits of runs contain the true masses, and how much do they learn of them?

python -m calibration.run_fits exact
python -m calibration.run_fits scatter

50 worlds of four random blasts (`scenes/random_blasts.toml`, seeds 0 to 49) are
recorded by `jblast world`; readings are picked from the records, and each blast is
fitted as by `--fit`, with [world] as the prior. The answers are compared with the
truth.

Records follow the laws exactly. `exact` fits them with exact laws: the intervals
contain errors of instruments and picks only. `scatter` fits them with the scatter of
real blasts about the laws, which the records do not have: intervals are then too wide.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.inference import Fit, fit_each
from jblast.observations import read
from jblast.observations.grouping import by_shot
from jblast.report.world import run_world
from jblast.study.statistics import wilson_interval
from jblast.world import scene_to_fit

SCENE = Path(__file__).parent / "scenes" / "random_blasts.toml"
RESULTS = Path(__file__).parent / "results"
OUT = {"exact": "run_fits.txt", "scatter": "run_fits_scatter.txt"}
WORLDS = 50
PRIOR_SD = float(np.log(2.0))
"""Standard deviation of ln(mass) in the scene."""


def fits_of(seed: int, folder: Path, scene: Path) -> list[tuple[float, float, bool]]:
    """Return z and sd of ln(mass), and coverage, of every blast of a world.

    Args:
        seed: Seed of the world.
        folder: Folder of its run.
        scene: File of the scene.
    """
    run_world(scene, folder, seed=seed)
    document = json.loads((folder / "run.json").read_text())
    truth = {one["shot"]: one["mass_kg"] for one in document["blasts"]}
    found = fit_each(by_shot(read(folder / "observations.csv")), scene_to_fit(scene))
    rows = []
    for shot, mass in truth.items():
        fit = found[shot]
        assert isinstance(fit, Fit)
        one = fit.summary.estimates["charge_mass_kg"]
        # the sd of ln(mass) from the interval, which is 2 x 1.645 sd wide
        sd = np.log(one.q95 / one.q05) / 3.29
        rows.append((np.log(one.value / mass) / sd, sd, one.q05 <= mass <= one.q95))
    return rows


def main(part: str, worlds: int = WORLDS) -> str:
    """Record and fit all worlds; return the table."""
    rows: list[tuple[float, float, bool]] = []
    with tempfile.TemporaryDirectory() as name:
        scene = Path(name) / SCENE.name
        law = "" if part == "scatter" else "[law]\nscatter = false\n"
        scene.write_text(SCENE.read_text() + law)
        for seed in range(worlds):
            rows += fits_of(seed, Path(name) / f"{seed}", scene)
    z, sd, inside = (np.array(column, float) for column in zip(*rows, strict=True))
    low, high = wilson_interval(inside.mean(), len(inside))
    return "\n".join(
        [
            f"{len(rows)} blasts of {worlds} worlds, scene scenes/random_blasts.toml",
            "",
            f"90 % intervals of the mass that contain the truth: {inside.mean():.3f} "
            f"(90 % interval {low:.3f} to {high:.3f})",
            f"sd of ln(mass): prior {PRIOR_SD:.3f}, posterior {np.median(sd):.4f} "
            f"(median), {sd.max():.4f} (largest)",
            f"error of ln(mass) over its sd: rms {np.sqrt(np.mean(z**2)):.3f}",
            "",
        ]
    )


if __name__ == "__main__":
    start_jax()
    which = sys.argv[1]
    text = main(which, *map(int, sys.argv[2:]))
    print(text)
    if len(sys.argv) == 2:
        write_text(RESULTS / OUT[which], text)
