"""How far may the reference of each quantity be off, and what does a reading cost?

    python -m calibration.fidelity [references] [costs]

Writes the tables that `jblast choose` reads, both or those named. Costs are measured on
one machine and are printed for information. No random numbers but the places at which
costs are measured.

References. Pressure, impulse and duration: the gauge of `gauge_200g.py` beside Kingery
and Bulmash at the factors of C4, the worse of its two readings. One gauge is not many:
that is all there is. Past Z = 20 recordings: for impulse and duration the scatter that
`ford_2021.py` measured on 189 of them; for the peak the root mean square of recorded
over reference, of the shots whose charge stood on the ground (`far_pressure.py`, where
the peak of a recording is defined), and the scatter of all shots that grows with Z.

Past Z = 20 the last stretch of Kingery's and Bulmash's pressure bends away from a weak
shock (slope -1.25 at Z = 20, -1.40 at 30), so the reference there is also as uncertain
as the choice of where the tail joins: at 20 or at 40.

Arrival and speed: the two statements of one report. A front of their pressure moves by
Rankine and Hugoniot; summed up, that is an arrival, and it differs from theirs.
"""

import argparse
import datetime
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import jblast.waves
from calibration.cases import standard_path
from calibration.charts import method_seconds
from calibration.far_pressure import SHALLOW, bend, every_record
from calibration.gauge_200g import as_read, at_front, distance, table
from calibration.timing import machine
from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_SOUND_SPEED
from jblast.files import table_text, write_text
from jblast.registry import LAWS, call, law_for, total_scatter
from jblast.scene.charge import BURSTS, Burst, tnt_factor
from jblast.waves.choice import ON_THE_GROUND, TABLES_END, is_candidate
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curves
from jblast.waves.paths import Path as WavePath
from jblast.waves.shock import (
    FAR_END,
    LOG_STANDARD_PRESSURE,
    log_shock_speed,
    weak_shock_tail,
)
from jblast.waves.tables import arrival

DATA = Path(jblast.waves.__path__[0]) / "data"
EDGES = (0.0, 0.3, 1.0, 3.0, 10.0, 20.0, 40.0, 100.0, 200.0, FAR_END, 1000.0)
"""Of the spans [m/kg^(1/3)]; the first begins where the reference does."""
RUNS = 4
"""Runs for the time of a law; the least counts."""
MEASURED_FROM = 100.0
"""Where the scatter of peaks that grows with Z begins to count: at 100 it is 1 % of its
size, and what is declared nearer is no measurement [m/kg^(1/3)]."""
PER_SPAN = 200
"""Places looked at in each."""
EARLY, LATE = 20.0, TABLES_END
"""Where the tail of a weak shock may join their pressure [m/kg^(1/3)]."""
JOINS = f"a tail joined at Z = {LATE:g} over one at {EARLY:g}"
INCIDENT = {
    "reflected_pressure_pa": "peak_overpressure_pa",
    "reflected_impulse_pa_s": "positive_impulse_pa_s",
}
GAUGE = {
    "peak_overpressure_pa": "peak",
    "positive_impulse_pa_s": "impulse",
    "positive_duration_s": "duration",
}


class Branch(NamedTuple):
    """A law that is the reference of a quantity, up to a scaled distance.

    Attributes:
        end: Largest Z [m/kg^(1/3)].
        law: Its name.
        lossless: That of the law without absorption; the same if it has none.
    """

    end: float
    law: str
    lossless: str


TABLES = Branch(TABLES_END, "kingery_bulmash", "kingery_bulmash")
SOUND = Branch(1000.0, "shock_kinematics", "shock_kinematics")
ABSORBED = Branch(FAR_END, "weak_shock_iso", "shock_kinematics")
# from the nearest of the recordings to which it was fitted, to the farthest
RECORDED = (TABLES._replace(end=20.0), Branch(1000.0, "ford_2021", "ford_2021"))
REFERENCES: dict[str, tuple[Branch, ...]] = {
    "air_arrival_s": (TABLES, SOUND),
    "peak_overpressure_pa": (TABLES, ABSORBED),
    "shock_speed_m_s": (TABLES, SOUND),
    "positive_impulse_pa_s": RECORDED,
    "positive_duration_s": RECORDED,
    "reflected_pressure_pa": (TABLES,),
    "reflected_impulse_pa_s": (TABLES,),
}
"""The reference of each quantity, nearest first."""


class Span(NamedTuple):
    """One row of `references.csv`."""

    quantity: str
    burst: Burst
    z_from: float
    z_to: float
    law: str
    lossless: str
    e_ref: float
    evidence: str


def spans() -> list[Span]:
    """Return how far every reference may be off, by span."""
    found: list[Span] = []
    for quantity, branches in REFERENCES.items():
        for burst in BURSTS:
            first, last = _first(quantity, burst), branches[-1].end
            ends = [edge for edge in EDGES if first < edge <= last]
            for start, end in pairwise([first, *ends]):
                branch = next(one for one in branches if end <= one.end)
                error, why = max(_evidence(quantity, burst, start, end))
                laws = branch.law, branch.lossless
                found.append(Span(quantity, burst, start, end, *laws, error, why))
    return _joined(found)


def _joined(found: list[Span]) -> list[Span]:
    """Return spans with those of one value and one evidence put together."""
    kept = found[:1]
    for span in found[1:]:
        last = kept[-1]
        same = span[:2] == last[:2] and span.evidence == last.evidence
        if same and math.isclose(span.e_ref, last.e_ref, rel_tol=0.05):
            error = max(span.e_ref, last.e_ref)
            kept[-1] = last._replace(z_to=span.z_to, e_ref=error)
        else:
            kept.append(span)
    return kept


def _first(quantity: str, burst: Burst) -> float:
    """Return where the nearest reference begins [m/kg^(1/3)]."""
    law = law_for(quantity, REFERENCES[quantity][0].law)
    z = np.geomspace(0.01, 1.0, 20_000)
    return float(z[call(law.valid, standard_path(z, burst)).argmax()])


def _evidence(
    quantity: str, burst: Burst, start: float, end: float
) -> Iterator[tuple[float, str]]:
    """Yield relative errors and what they were measured by."""
    z = np.geomspace(start, end, PER_SPAN)
    path, in_tables = standard_path(z, burst), end <= TABLES_END

    def value(name: str, of: str = quantity) -> np.ndarray:
        return call(law_for(of, name).function, path)

    if quantity == "air_arrival_s":
        why = "their arrival over their pressure's" if in_tables else JOINS
        theirs = value("kingery_bulmash") if in_tables else _late_arrival(path, burst)
        yield _worst(theirs / value("shock_kinematics")), why
        return
    if quantity == "shock_speed_m_s":
        if in_tables:
            peak = np.log(value("kingery_bulmash", "peak_overpressure_pa"))
            ratio = value("kingery_bulmash") / path.sound_speed / _mach(peak)
            yield _worst(ratio), "their speed over their pressure's"
        else:
            late, early = (_mach(_tail(z, burst, join)) for join in (LATE, EARLY))
            yield _worst(late / early), JOINS
        return
    incident = INCIDENT.get(quantity, quantity)
    which = "" if incident == quantity else ", of the incident wave"
    if incident != "peak_overpressure_pa" and start >= EARLY:
        law = law_for(incident, "ford_2021")
        yield _scatter(call(law.scatter, path)), f"scatter of 189 records{which}"
        return
    yield gauge_error(incident), f"a gauge 2 m from 200 g{which}"
    if incident != "peak_overpressure_pa" or start < EARLY:
        return
    late, why = _tail(z, burst, LATE), JOINS
    if in_tables:
        late = np.log(value("kingery_bulmash", incident))
        why = f"their curve over a weak shock's from Z = {EARLY:g}"
    yield _worst(np.exp(late - _tail(z, burst, EARLY))), why + which
    off, records = _recorded_peaks(start, end)
    yield off, records + which
    if start >= MEASURED_FROM:
        law = law_for(quantity, "shock_kinematics")
        yield _scatter([total_scatter(law, path)]), "scatter of 189 records"


def _worst(ratio: np.ndarray) -> float:
    return float(np.abs(ratio - 1.0).max())


def _scatter(parts: Iterable[np.ndarray]) -> float:
    """Return the largest scatter, all its parts together, as a relative error."""
    return math.expm1(math.sqrt(np.max(sum(part**2 for part in parts))))


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


def gauge_error(quantity: str) -> float:
    """Return how far the gauge's readings were from Kingery and Bulmash, the worse."""
    mass = table()["charge_mass"] * tnt_factor("C4", quantity)
    law = law_for(quantity, "kingery_bulmash")
    expected = float(law.function(distance(), mass, burst="free-air"))
    read = (getattr(pulse, GAUGE[quantity]) for pulse in (as_read(), at_front()))
    return max(abs(one / expected - 1.0) for one in read)


def _tail(z: Any, burst: Burst, join: float) -> Any:
    """Return ln of the pressure of a weak shock that leaves their curve [Pa]."""
    curve = kingery_bulmash_curves("incident_pressure")[burst]
    return weak_shock_tail(curve, join).log_pressure(np.log(z))


def _mach(log_pressure: Any) -> Any:
    """Return the speed of a front over that of sound."""
    return np.exp(log_shock_speed(log_pressure)) / STANDARD_SOUND_SPEED


def _late_arrival(path: WavePath, burst: Burst) -> Any:
    """Return the arrival of a front that is theirs to Z = 40, then a weak shock [s]."""
    timed = kingery_bulmash_curves("arrival_time")[burst]
    form = arrival(
        lambda log_z: _tail(np.exp(log_z), burst, LATE) - LOG_STANDARD_PRESSURE,
        LATE,
        STANDARD_SOUND_SPEED * math.exp(timed.form(math.log(LATE))),
        EDGES[-1],
    )
    time = np.exp(form(np.log(path.slant_range)))
    return time * path.slant_range / path.sound_speed


def write(name: str, what: str, header: Sequence[str], rows: Iterable) -> None:
    """Write a table beneath a head that says of what, when and on what machine."""
    today = datetime.date.today().isoformat()
    head = f"# {what}\n# Written by calibration/fidelity.py on {today}: {machine()}.\n"
    write_text(DATA / f"{name}.csv", head + table_text([header, *rows]))
    print(f"{name}.csv")


def write_references() -> None:
    """Write how far every reference may be off."""
    what = "How far the reference of a quantity may itself be off, relative, and "
    digits = {"z_from": ".6g", "z_to": "g", "e_ref": ".2g"}
    rows = (
        [format(one, digits.get(name, "")) for name, one in span._asdict().items()]
        for span in spans()
    )
    write("references", f"{what}what says so.", Span._fields, rows)


def write_costs() -> None:
    """Write the time of a reading by every law that may be chosen."""
    laws = [law for law in LAWS.values() if law.quantity in REFERENCES]
    rows = (
        (*of, f"{min(method_seconds(*of) for _ in range(RUNS)):.3g}")
        for law in sorted(laws, key=lambda law: [*REFERENCES].index(law.quantity))
        if is_candidate(law)
        for of in [(law.quantity, law.name)]
    )
    header = "quantity", "method", "cost_s"
    what = f"Seconds a reading, many at once, float64: the least of {RUNS} runs."
    write("costs", what, header, rows)


def main() -> None:
    """Write the tables that are asked for."""
    tables = {"references": write_references, "costs": write_costs}
    parser = argparse.ArgumentParser(description="Measure references and costs.")
    parser.add_argument("table", nargs="*", choices=[[], *tables], metavar="TABLE")
    start_jax()
    for name in parser.parse_args().table or tables:
        tables[name]()


if __name__ == "__main__":
    main()
