"""How far is every method off, how far may the reference be, and what does each cost?

    python -m calibration.fidelity [errors] [references] [costs]

Writes the tables of `jblast/fidelity/data`, all or those named. Costs are measured by
the chart's own functions, on one machine: they are for choosing between methods, not
for quoting. No random numbers but the places that costs are measured at.
"""

import argparse
import datetime
import itertools
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

import jblast.fidelity
from calibration.fidelity_references import spans
from jblast.cli.jax_start import start_jax
from jblast.fidelity.errors import (
    ALTITUDES,
    BURSTS,
    FAR_NODES,
    MASSES,
    NODES,
    REFERENCES,
    exponents,
    log_losses,
    log_ratios,
    methods_for,
    standard_path,
)
from jblast.fidelity.timing import machine
from jblast.files import write_text
from jblast.report.words import comma_separated
from jblast.verification.benchmark.laws import method_seconds

DATA = Path(jblast.fidelity.__file__).parent / "data"


def write(name: str, what: str, header: Sequence[str], rows: Iterable) -> None:
    """Write a table beneath a head that says of what, when and on what machine."""
    today = datetime.date.today().isoformat()
    head = f"# {what}\n# Written by calibration/fidelity.py on {today}: {machine()}.\n"
    write_text(DATA / f"{name}.csv", head + comma_separated([header, *rows]))
    print(f"{name}.csv")


def write_errors() -> None:
    """Write how far every method is off its reference."""
    for quantity in REFERENCES:
        methods = methods_for(quantity)
        rows = []
        for burst in BURSTS:
            found = log_ratios(quantity, burst)
            for i, z in enumerate(NODES):
                ratios = (found[method][i] for method in methods)
                rows.append([burst, f"{z:.12g}", *map(_shown, ratios)])
        write(
            f"error_{quantity}",
            f"ln of every method over the lossless reference of {quantity}, 1 kg of "
            "TNT in standard air; empty where the reference does not hold.",
            ("burst", "z", *methods),
            rows,
        )
    write(
        "exponents",
        "Powers of mass [kg] and of ambient over standard pressure in these ratios.",
        ("quantity", "burst", "method", "per_ln_mass", "per_ln_pressure"),
        [
            (q, b, m, *(f"{power:.6g}" for power in exponents(q, m, b)))
            for q, b in itertools.product(REFERENCES, BURSTS)
            for m in methods_for(q)
        ],
    )
    grids = {burst: log_losses(burst) for burst in BURSTS}
    pressures = [
        float(np.asarray(standard_path(np.ones(1), "surface", 1.0, a).ambient_pressure))
        for a in map(float, ALTITUDES)
    ]
    write(
        "absorption",
        "ln of what ISO 9613-1 leaves of the peak past Z = 40, in the standard "
        "atmosphere, relative humidity 0.5.",
        ("burst", "z", "mass_kg", "ambient_pressure_pa", "log_loss"),
        [
            (b, f"{z:.12g}", f"{mass:g}", f"{pressure:.8g}", f"{grid[i, j, k]:.5f}")
            for b, grid in grids.items()
            for i, z in enumerate(FAR_NODES)
            for j, mass in enumerate(MASSES)
            for k, pressure in enumerate(pressures)
        ],
    )


def _shown(ratio: float) -> str:
    return "" if math.isnan(ratio) else f"{ratio:.5f}"


def write_references() -> None:
    """Write how far every reference may be off."""
    write(
        "references",
        "How far the reference of a quantity may itself be off, relative, and what "
        "says so.",
        ("quantity", "burst", "z_from", "z_to", "e_ref", "evidence"),
        [
            (
                s.quantity,
                s.burst,
                f"{s.start:.6g}",
                f"{s.end:g}",
                f"{s.error:.2g}",
                s.evidence,
            )
            for s in spans()
        ],
    )


def write_costs() -> None:
    """Write what a reading by every method costs."""
    write(
        "costs",
        "Seconds a reading, many at once, float64; of the solver, one run.",
        ("quantity", "method", "cost_s"),
        [
            (q, m, f"{method_seconds(q, m):.3g}")
            for q in REFERENCES
            for m in methods_for(q)
        ],
    )


TABLES = {
    "references": write_references,
    "errors": write_errors,
    "costs": write_costs,
}


def main() -> None:
    """Write the tables that are asked for."""
    parser = argparse.ArgumentParser(description="Measure errors and costs of methods.")
    parser.add_argument("table", nargs="*", metavar="TABLE", help=", ".join(TABLES))
    asked = parser.parse_args().table or list(TABLES)
    if unknown := [name for name in asked if name not in TABLES]:
        parser.error(f"no table {unknown[0]!r}: expected {', '.join(TABLES)}")
    start_jax()
    for name in asked:
        TABLES[name]()


if __name__ == "__main__":
    main()
