"""Which controller flies on through which blast, and how far each lets it be thrown.

    python -m calibration.controllers --out calibration/results/controllers.png
        > calibration/results/controllers.txt

Each vehicle, 3 m up, is flown by every controller through the same blasts of 1 to 10 kg
of TNT on the ground, 3 to 30 m off, in a wind of up to 3 m/s either way. The figure is
of the Iris.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.report.flight_figures import controllers_figure
from jblast.report.words import aligned
from jblast.scene import read_scene
from jblast.study.flight_results import (
    Flights,
    Options,
    flies_on,
    hold_words,
    metric,
    quantiles,
)
from jblast.study.flights import fly
from jblast.vehicle import CONTROLLERS

VEHICLES, COUNT, STEP_S = ("crazyflie", "hummingbird", "iris"), 500, 2e-3
SCENE = """[charge]
mass_kg = {{ loguniform = [1.0, 10.0] }}
position_m = [{{ loguniform = [3.0, 30.0] }}, 0.0, 0.0]
time_s = 2.0

[air]
wind_m_s = [{{ uniform = [-3.0, 3.0] }}, {{ uniform = [-3.0, 3.0] }}]

[vehicle]
model = "{vehicle}"
position_m = [0.0, 0.0, 3.0]
"""


def flown(vehicle: str, count: int) -> Flights:
    """Fly a vehicle by every controller."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(SCENE.format(vehicle=vehicle), encoding="utf-8")
        scene = read_scene(str(file))
    options = Options(seconds=8.0, step_s=STEP_S, backend="jax")
    return fly(scene, options, vehicles=count, controllers=tuple(CONTROLLERS))


def rows(flights: Flights) -> list[tuple[str, ...]]:
    """Return a row a controller; the peak deviation is of those that fly on."""
    found = []
    for name, held in flights.holds.items():
        on = flies_on(held)
        peak = metric(held, "peak_deviation_m")[on]
        back = metric(held, "recovery_time_s")[on]
        low, middle, high = quantiles(peak)
        found.append(
            (
                flights.vehicle.model,
                hold_words(name),
                f"{100 * on.mean():.1f} %",
                f"{middle:.3f} ({low:.3f} to {high:.3f})",
                f"{np.median(back):.2f}",
                f"{100 * np.isfinite(back).mean():.1f} %",
            )
        )
    return found


def main() -> None:
    """Fly, print, draw."""
    parser = argparse.ArgumentParser(description="Controllers side by side.")
    parser.add_argument("--out", type=Path, help="the figure")
    parser.add_argument("--count", type=int, default=COUNT)
    asked = parser.parse_args()
    start_jax(all_cores=True)
    head = (
        "vehicle",
        "held",
        "flies on",
        "peak deviation [m] (5 to 95 %)",
        "recovery [s], median",
        "recovered",
    )
    table = [head]
    every = [flown(vehicle, asked.count) for vehicle in VEHICLES]
    for flights in every:
        table += rows(flights)
    print(f"{asked.count} blasts a vehicle, 8 s, steps of {STEP_S:g} s")
    print("\n".join(aligned(table)))
    if asked.out is not None:
        controllers_figure(every[-1]).savefig(asked.out)


if __name__ == "__main__":
    main()
