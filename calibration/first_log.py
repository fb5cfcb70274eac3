"""The answer of the first tutorial, next to the truth.

    python -m calibration.first_log > calibration/results/first_log.txt

Fits the simulated log of five microphones as `jblast fit` does.
"""

import tomllib
from pathlib import Path

from jblast.cli.jax_start import start_jax

DATA = Path(__file__).parent / "data"
NAMES = {
    "charge_mass_kg": ("kg", 1.0),
    "charge_east_m": ("m", 1.0),
    "charge_north_m": ("m", 1.0),
    "origin_time_s": ("ms", 1e3),
}
"""Estimate -> printed unit and its value in SI units, inverted."""


def main() -> None:
    """Fit the log and print the estimates."""
    from jblast.inference import fit
    from jblast.observations import read
    from jblast.scene import read_scene

    start_jax(quick=True)
    log = DATA / "five_microphones.csv"
    found = fit(read(log), read_scene(log.with_suffix(".toml")))
    truth = true_values()
    print("estimate            value     5 %    95 %   truth")
    for name, (unit, scale) in NAMES.items():
        one = found.summary.estimates[name]
        assert one.value is not None
        numbers = (one.value, one.q05, one.q95, truth[name])
        row = " ".join(f"{scale * number:7.1f}" for number in numbers)
        print(f"{name:16s} {row} {unit}")


def true_values() -> dict[str, float]:
    """Return the parameters from which the log was simulated."""
    text = (DATA / "five_microphones_truth.toml").read_text("utf-8")
    charge = tomllib.loads(text)["charge"]
    east, north, _ = charge["position_m"]
    values = (charge["mass_kg"], east, north, charge["time_s"])
    return dict(zip(NAMES, values, strict=True))


if __name__ == "__main__":
    main()
