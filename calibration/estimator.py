"""How good a vehicle's estimate of its state is, and what blasts do to it.

An Iris holds its place by the error-state Kalman filter, 8 m from a charge and 10 m up,
with masses that make fronts of 10 to 100 kPa; beside it flies the same hold by the
truth. Each row is a mass: medians, and greatest of the vehicles.

    python -m calibration.estimator [VEHICLES] > calibration/results/estimator.txt
"""

import sys

import numpy as np

from jblast.cli.jax_start import start_jax

MASSES_KG = (1.0, 5.0, 20.0, 50.0)
VEHICLES = 16
BLAST_S, SECONDS = 6.0, 14.0


def main(vehicles: int) -> str:
    """Fly them, and return what is kept."""
    start_jax(all_cores=True)
    from jblast.scene import Charge, Scene, UncertainScene, VehicleSpec
    from jblast.scene.uncertain import Normal
    from jblast.study.flight_results import Options
    from jblast.study.flights import fly

    lines = [
        f"{vehicles} Iris a row, hold with integral action, blast at {BLAST_S:g} s; "
        "errors of the estimate",
        "in the second before it and greatest in 8 s after: median (greatest)",
        "mass [kg]  front [kPa]  place before [m]  after [m]     velocity before "
        "[m/s]  after [m/s]    attitude before [mrad]  after [mrad]  "
        "hold off by [m]  by the truth [m]",
    ]
    for mass in MASSES_KG:
        spec = VehicleSpec("iris", position=np.array([8.0, 0.0, 10.0]), integral=True)
        scene = Scene(Charge(mass, time_s=BLAST_S), vehicle=spec)
        uncertain = UncertainScene(scene, {"charge_mass_kg": Normal(mass, mass / 1e3)})
        found = [
            fly(
                uncertain,
                Options(seconds=SECONDS, step_s=0.004, estimator=estimator),
                vehicles=vehicles,
            ).holds["with_integral"]
            for estimator in ("ekf", "")
        ]
        thrown = found[0].thrown
        assert thrown is not None
        cells = [
            _both(values[:, 0] * (1e3 if name.endswith("rad") else 1.0))
            for name, values in thrown._asdict().items()
        ]
        off = [_both(each.metrics.peak_deviation_m) for each in found]
        front = float(np.median(found[0].encounter.overpressure_pa)) / 1e3
        lines.append("  ".join([f"{mass:<9g}", f"{front:<11.3g}", *cells, *off]))
    return "\n".join(lines) + "\n"


def _both(values: object) -> str:
    known = np.asarray(values)
    return f"{np.median(known):.3g} ({known.max():.3g})"


if __name__ == "__main__":
    sys.stdout.write(main(int(sys.argv[1]) if len(sys.argv) > 1 else VEHICLES))
