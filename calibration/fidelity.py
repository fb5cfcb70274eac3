"""How far is every method off, how far may the reference be, and what does each cost?

    python -m calibration.fidelity [errors] [references] [costs]
    python -m calibration.fidelity promises > calibration/results/promises.txt

Writes the tables of `jblast/fidelity/data`, all or those named. Costs are measured by
the chart's own functions, on one machine: they are for choosing between methods, not
for quoting. No random numbers but the places that costs are measured at.

References. Pressure, impulse and duration: the gauge of `gauge_200g.py` beside Kingery
and Bulmash at the factors of C4, the worse of its two readings. One gauge is not many:
that is all there is. Past Z = 20 recordings: for impulse and duration the scatter that
`ford_2021.py` measured on 189 of them; for the peak the root mean square of recorded
over reference, of the shots whose charge stood on the ground (`far_pressure.py`, where
the peak of a recording is defined), and the scatter of all shots that grows with Z.

Past Z = 20 the last stretch of Kingery's and Bulmash's pressure bends away from a weak
shock (`python -m calibration.laws tail`), so the reference there is also as uncertain
as the choice of where the tail joins: at 20 or at 40.

Arrival and speed: the two statements of one report. A front of their pressure moves by
Rankine and Hugoniot; summed up, that is an arrival, and it differs from theirs.

Promises: do methods keep what the stored tables promise of them, off every table's
nodes? 10,000 random places: charges of 0.1 g to 1 kt and Z from 0.1 to 1e4, both
uniform in ln, up to 5 km above the sea, the same for every quantity and burst. A
promise is one method at one place at one tolerance, where the reference covers the
place and may not itself be off by more; it is kept if the method really is within the
tolerance there. A method that is itself the reference does not count. The last columns
are of what is chosen, whichever of the methods that cost alike: promises met, and the
largest cost over that of the cheapest method that really would have done, by the stored
costs.
"""

import argparse
import dataclasses
import datetime
import itertools
import math
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

import jblast.fidelity
from calibration import run_part
from calibration.charts import method_seconds
from calibration.far_pressure import SHALLOW, bend, every_record
from calibration.gauge_200g import as_read, at_front, distance, table
from calibration.timing import machine
from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_PRESSURE
from jblast.fidelity import errors
from jblast.fidelity.choose import ALIKE, ON_THE_GROUND
from jblast.fidelity.errors import (
    ALTITUDES,
    BURSTS,
    END,
    FAR_NODES,
    FORD_START,
    KINGERY_BULMASH_END,
    MASSES,
    NODES,
    REFERENCES,
    Conditions,
    exponents,
    is_covered,
    jitted_conditions,
    log_losses,
    log_ratios,
    methods_for,
    reference_uncertainty,
    reference_value,
    relative_errors,
    standard_path,
    value_of,
)
from jblast.files import table_text, write_text
from jblast.registry import call, law_for, total_scatter
from jblast.scene.charge import Burst, tnt_factor
from jblast.study.statistics import wilson_interval
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curves
from jblast.waves.paths import Path as WavePath
from jblast.waves.propagation import (
    air_density,
    sound_speed_in_air,
    standard_atmosphere,
)
from jblast.waves.shock import FAR_END, weak_shock_tail

EDGES = (0.0, 0.3, 1.0, 3.0, 10.0, 20.0, 40.0, 100.0, 200.0, FAR_END, 1000.0)
"""Of the spans [m/kg^(1/3)]; the first begins where the reference does."""

MEASURED_FROM = 100.0
"""Where the scatter of peaks that grows with Z begins to count: at 100 it is 1 % of its
size, and what is declared nearer is no measurement [m/kg^(1/3)]."""

PER_SPAN = 200
"""Places looked at in each."""

EARLY, LATE = 20.0, KINGERY_BULMASH_END
"""Where the tail of a weak shock may join their pressure [m/kg^(1/3)]."""

JOINS = f"a tail joined at Z = {LATE:g} over one at {EARLY:g}"

GAUGE = {
    "peak_overpressure_pa": "peak",
    "positive_impulse_pa_s": "impulse",
    "positive_duration_s": "duration",
}
INCIDENT = {
    "reflected_pressure_pa": "peak_overpressure_pa",
    "reflected_impulse_pa_s": "positive_impulse_pa_s",
}


class Span(NamedTuple):
    """One row of `references.csv`."""

    quantity: str
    burst: Burst
    start: float
    end: float
    error: float
    evidence: str


DATA = Path(jblast.fidelity.__file__).parent / "data"


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


def write(name: str, what: str, header: Sequence[str], rows: Iterable) -> None:
    """Write a table beneath a head that says of what, when and on what machine."""
    today = datetime.date.today().isoformat()
    head = f"# {what}\n# Written by calibration/fidelity.py on {today}: {machine()}.\n"
    write_text(DATA / f"{name}.csv", head + table_text([header, *rows]))
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
        "Seconds a reading, many at once, float64.",
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


def spans() -> list[Span]:
    """Return how far every reference may be off, by span."""
    found = []
    for quantity, branches in REFERENCES.items():
        for burst in BURSTS:
            first = _first(quantity, burst)
            for low, high in pairwise(EDGES):
                if high <= first or high > branches[-1].end:
                    continue
                start = max(low, first)
                worst, why = max(_evidence(quantity, burst, start, high))
                found.append(Span(quantity, burst, start, high, worst, why))
    return _joined(found)


def _joined(found: list[Span]) -> list[Span]:
    """Return spans with those of one value and one evidence put together."""
    kept = found[:1]
    for span in found[1:]:
        last = kept[-1]
        same = span[:2] == last[:2] and span.evidence == last.evidence
        if same and math.isclose(span.error, last.error, rel_tol=0.05):
            error = max(span.error, last.error)
            kept[-1] = last._replace(end=span.end, error=error)
        else:
            kept.append(span)
    return kept


def _first(quantity: str, burst: Burst) -> float:
    """Return where the nearest reference begins [m/kg^(1/3)]."""
    law = law_for(quantity, REFERENCES[quantity][0].law)
    z = np.exp(np.linspace(math.log(0.01), 0.0, 20_000))
    valid = np.asarray(call(law.valid, standard_path(z, burst)))
    return float(z[valid.argmax()])


def _evidence(
    quantity: str, burst: Burst, start: float, end: float
) -> list[tuple[float, str]]:
    """Return relative errors and what they were measured by."""
    z = np.exp(np.linspace(math.log(start), math.log(end), PER_SPAN))
    within = end <= KINGERY_BULMASH_END
    if quantity == "air_arrival_s":
        theirs = _value(quantity, "kingery_bulmash", z, burst)
        joined = _value(quantity, "shock_kinematics", z, burst)
        if within:
            return [(_worst(theirs / joined), "their arrival over their pressure's")]
        return [(_worst(_arrival_joined_at_the_end(z, burst) / joined), JOINS)]
    if quantity == "shock_speed_m_s":
        if within:
            peak = _value("peak_overpressure_pa", "kingery_bulmash", z, burst)
            sound = np.asarray(standard_path(z, burst).sound_speed)
            theirs = _value(quantity, "kingery_bulmash", z, burst)
            ratio = theirs / (sound * _mach_number(peak))
            return [(_worst(ratio), "their speed over their pressure's")]
        return [(_worst(_mach(z, burst, LATE) / _mach(z, burst, EARLY)), JOINS)]
    incident = INCIDENT.get(quantity, quantity)
    which = ", of the incident wave" if incident != quantity else ""
    if incident != "peak_overpressure_pa" and start >= FORD_START:
        return [(_ford_scatter(incident, z, burst), f"scatter of 189 records{which}")]
    found = [(gauge_error(incident), f"a gauge 2 m from 200 g{which}")]
    if incident == "peak_overpressure_pa" and start >= EARLY:
        tail = _pressure(z, burst, EARLY)
        theirs = _value(incident, "kingery_bulmash", z, burst)
        late, why = (
            (theirs, f"their curve over a weak shock's from Z = {EARLY:g}")
            if within
            else (_pressure(z, burst, LATE), JOINS)
        )
        found.append((_worst(late / tail), why + which))
        off, which_records = _recorded_peaks(start, end)
        found.append((off, which_records + which))
        if start >= MEASURED_FROM:
            found.append((_law_scatter(z, burst), "scatter of 189 records"))
    return found


def _recorded_peaks(start: float, end: float) -> tuple[float, str]:
    """Return how far recorded peaks are off `shock_kinematics`, root mean square.

    Of shots on the ground: at most `ON_THE_GROUND` below it, since burial lowers the
    peak, and at most `SHALLOW` above it. Peaks nearer than the end of the
    tables are those of Kingery's and Bulmash's shape, not of a triangle.
    """
    found = every_record()
    some = (found.height >= -ON_THE_GROUND) & (found.height <= SHALLOW)
    some &= (found.z > start) & (found.z <= end)
    off = found.log_ratio("peak_overpressure_pa") + np.log(bend(found.z))
    size = math.sqrt(float(np.mean(off[some] ** 2)))
    return math.expm1(size), f"{int(some.sum())} recorded peaks"


def _law_scatter(z: np.ndarray, burst: Burst) -> float:
    """Return the largest scatter about the far reference of the peak, all its parts."""
    law = law_for("peak_overpressure_pa", "shock_kinematics")
    return math.expm1(float(np.max(total_scatter(law, standard_path(z, burst)))))


def _ford_scatter(quantity: str, z: np.ndarray, burst: Burst) -> float:
    """Return the scatter of records about `ford_2021`, all its parts together."""
    scatter = call(law_for(quantity, "ford_2021").scatter, standard_path(z, burst))
    sd = np.sqrt(sum(np.square(np.asarray(part)) for part in scatter))
    return math.expm1(float(np.max(sd)))


def _worst(ratio) -> float:
    return float(np.max(np.abs(np.asarray(ratio) - 1.0)))


def _value(quantity: str, law: str, z: np.ndarray, burst: Burst) -> np.ndarray:
    return np.asarray(call(law_for(quantity, law).function, standard_path(z, burst)))


@cache
def gauge_error(quantity: str) -> float:
    """Return how far the gauge's readings were from Kingery and Bulmash, the worse."""
    mass = table()["charge_mass"] * tnt_factor("C4", quantity)
    law = law_for(quantity, "kingery_bulmash")
    expected = float(law.function(distance(), mass, burst="free-air"))
    name = GAUGE[quantity]
    return max(
        abs(getattr(pulse, name) / expected - 1.0) for pulse in (as_read(), at_front())
    )


def _pressure(z: np.ndarray, burst: Burst, join: float) -> np.ndarray:
    """Return the pressure of a weak shock that leaves the curve somewhere [Pa]."""
    curve = kingery_bulmash_curves("incident_pressure")[burst]
    tail = weak_shock_tail(curve, join)
    return np.exp(np.asarray(tail.log_pressure(np.log(z))))


def _mach(z: np.ndarray, burst: Burst, join: float) -> np.ndarray:
    return _mach_number(_pressure(z, burst, join))


def _mach_number(peak: np.ndarray) -> np.ndarray:
    """Return the speed of a front over that of sound in standard air."""
    return np.sqrt(1.0 + 6.0 / 7.0 * np.asarray(peak) / STANDARD_PRESSURE)


def _arrival_joined_at_the_end(z: np.ndarray, burst: Burst) -> np.ndarray:
    """Return the arrival of a front that is theirs to Z = 40, then a weak shock [s]."""
    join = KINGERY_BULMASH_END
    start = _value("air_arrival_s", "kingery_bulmash", np.array([join]), burst)
    r = np.concatenate(
        [[join], np.exp(np.linspace(math.log(join), math.log(END), 4000))[1:]]
    )
    sound = float(standard_path(r[:1], burst).sound_speed[0])
    slowness = 1.0 / (sound * _mach(r, burst, join))
    steps = 0.5 * (slowness[1:] + slowness[:-1]) * np.diff(r)
    times = start + np.concatenate([[0.0], np.cumsum(steps)])
    return np.interp(z, r, times)


def random_path(burst: Burst, count: int = SCENES, seed: int = 1) -> WavePath:
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
    quantity: str, path: WavePath, conditions: Conditions
) -> dict[str, Float[np.ndarray, " place"]]:
    """Return every law's real error; infinite where it or the reference fails."""
    covered = is_covered(quantity, conditions)
    reference = np.asarray(reference_value(quantity, path))
    found = {}
    for method, holds in conditions.holds.items():
        if method in methods_for(quantity):
            off = np.abs(value_of(quantity, method, path) / reference - 1.0)
            found[method] = np.where(np.asarray(holds) & covered, off, np.inf)
    return found


def promises(quantity: str, path: WavePath) -> dict[float, Promises]:
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


def kept_promises() -> None:
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
    run_part({"tables": main, "promises": kept_promises})
