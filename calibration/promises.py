"""Do methods keep what the stored tables promise of them, off every table's nodes?

Run `python -m calibration.promises`. 10,000 random places: charges of 0.1 g to 1 kt and
Z from 0.1 to 1e4, both uniform in ln, up to 5 km above the sea, the same for every
quantity and burst. A promise is one method at one place at one tolerance, where the
reference covers the place and may not itself be off by more; it is kept if the method
really is within the tolerance there. A method that is itself the reference does not
count. The last columns are of what is chosen, whichever of the methods that cost alike:
promises met, and the largest cost over that of the cheapest method that really would
have done, by the stored costs.
"""

import dataclasses
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_PRESSURE
from jblast.fidelity import errors
from jblast.fidelity.choose import ALIKE
from jblast.fidelity.errors import (
    BURSTS,
    REFERENCES,
    SOLVER as SOLVER,
    Conditions,
    is_covered,
    jitted_conditions,
    methods_for,
    reference_uncertainty,
    reference_value,
    relative_errors,
    standard_path,
    value_of,
)
from jblast.scene.charge import Burst
from jblast.study.statistics import wilson_interval
from jblast.waves.paths import Path
from jblast.waves.propagation import (
    air_density,
    sound_speed_in_air,
    standard_atmosphere,
)

SCENES = 10_000
TOLERANCES = (0.01, 0.03, 0.1, 0.3)
SELF = 1e-12
"""A method as near to the reference as this is it, or one of its parts."""


class Promises(NamedTuple):
    """How many promises were made and kept, at one tolerance.

    Attributes:
        made: By methods other than the reference.
        kept: Of these.
        supported: Places where the tolerance is supportable.
        met: Of these, where a method was chosen that promises it.
        good: Of these, where all that could be chosen really are within it.
        dearest: Their largest cost over the cheapest that really would have done.
    """

    made: int
    kept: int
    supported: int
    met: int
    good: int
    dearest: float


def random_path(burst: Burst, count: int = SCENES, seed: int = 1) -> Path:
    """Return paths to random places."""
    rng = np.random.default_rng(seed)
    mass, z = (
        np.exp(rng.uniform(math.log(low), math.log(high), count))
        for low, high in ((1e-4, 1e6), (0.1, 1e4))
    )
    altitude = jnp.asarray(rng.uniform(0.0, 5000.0, count))
    temperature, pressure = standard_atmosphere(altitude)
    distance = jnp.asarray(z) * jnp.cbrt(mass * STANDARD_PRESSURE / pressure)
    return dataclasses.replace(
        standard_path(np.ones(count), burst),
        slant_range=distance,
        ground_range=distance,
        charge_mass=jnp.asarray(mass),
        ambient_pressure=pressure,
        temperature=temperature,
        sound_speed=sound_speed_in_air(temperature, pressure, 0.5),
        air_density=air_density(temperature, pressure, 0.5),
    )


def real_errors(
    quantity: str, path: Path, conditions: Conditions
) -> dict[str, Float[np.ndarray, " place"]]:
    """Return every law's real error; infinite where it or the reference fails."""
    covered = is_covered(quantity, conditions)
    reference = np.asarray(reference_value(quantity, path))
    found = {}
    for method, holds in conditions.holds.items():
        if method in methods_for(quantity) and method != SOLVER:
            off = np.abs(value_of(quantity, method, path) / reference - 1.0)
            found[method] = np.where(np.asarray(holds) & covered, off, np.inf)
    return found


def promises(quantity: str, path: Path) -> dict[float, Promises]:
    """Return what was promised and kept over some places, by tolerance."""
    conditions = jax.tree.map(np.asarray, jitted_conditions(quantity, path))
    real = real_errors(quantity, path, conditions)
    promised = relative_errors(quantity, conditions)
    costs = np.array([errors.cost_table()[quantity, method] for method in real])[
        :, None
    ]
    said = np.stack([promised[method] for method in real])
    true = np.stack(list(real.values()))
    uncertainty, covered = (
        reference_uncertainty(quantity, conditions),
        is_covered(quantity, conditions),
    )
    return {
        tolerance: _promises(
            said, true, costs, covered & (uncertainty <= tolerance), tolerance
        )
        for tolerance in TOLERANCES
    }


def _promises(
    said: Float[np.ndarray, "method place"],
    true: Float[np.ndarray, "method place"],
    costs: Float[np.ndarray, "method 1"],
    supported: Bool[np.ndarray, " place"],
    tolerance: float,
) -> Promises:
    enough = (said <= tolerance) & supported
    counts = enough & (true > SELF)
    cheapest = np.where(enough, costs, np.inf).min(axis=0)
    alike = enough & (costs <= ALIKE * cheapest)
    met = enough.any(axis=0)
    worst = np.where(alike, true, 0.0).max(axis=0)
    dearest = np.where(alike, costs, 0.0).max(axis=0)
    would_do = np.where(true <= tolerance, costs, np.inf).min(axis=0)
    ratio = dearest[met] / would_do[met]
    return Promises(
        made=int(counts.sum()),
        kept=int((counts & (true <= tolerance)).sum()),
        supported=int(supported.sum()),
        met=int(met.sum()),
        good=int((worst[met] <= tolerance).sum()),
        dearest=float(ratio.max(initial=0.0)),
    )


def wilson_lower(kept: int, of: int) -> float:
    """Return the lower end of Wilson's 95 % interval of a share; NaN of none."""
    if not of:
        return math.nan
    return float(wilson_interval(kept / of, of, 0.95)[0])


def main() -> None:
    """Print the table."""
    start_jax()
    print(
        f"Promises at {SCENES:,} random places\n\n"
        f"{'quantity':24}{'burst':10}{'within':>7}{'made':>8}{'kept':>8}{'Wilson':>9}"
        f"{'supported':>11}{'met':>7}{'good':>7}{'cost':>6}"
    )
    for burst in BURSTS:
        path = random_path(burst)
        for quantity in REFERENCES:
            for tolerance, p in promises(quantity, path).items():
                wilson = f"{wilson_lower(p.kept, p.made):.4f}" if p.made else "-"
                print(
                    f"{quantity:24}{burst:10}{100 * tolerance:5.0f} %{p.made:8}"
                    f"{p.kept:8}{wilson:>9}{p.supported:11}{p.met:7}{p.good:7}"
                    f"{p.dearest:6.2f}"
                )


if __name__ == "__main__":
    main()
