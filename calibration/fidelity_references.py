"""How far may a reference be off? What the evidence at hand says, span by span.

Pressure, impulse and duration: the gauge of `gauge_200g.py` beside Kingery and Bulmash
at the factors of C4, the worse of its two readings. One gauge is not many: that is all
there is. Past Z = 20 recordings: for impulse and duration the scatter that
`ford_2021.py` measured on 189 of them; for the peak the root mean square of recorded
over reference, of the shots whose charge stood on the ground (`far_pressure.py`, where
the peak of a recording is defined), and the scatter of all shots that grows with Z.

Past Z = 20 the last stretch of Kingery's and Bulmash's pressure bends away from a weak
shock (`python -m calibration.laws tail`), so the reference there is also as uncertain as the choice
of where the tail joins: at 20 or at 40.

Arrival and speed: the two statements of one report. A front of their pressure moves by
Rankine and Hugoniot; summed up, that is an arrival, and it differs from theirs.
"""

import math
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from calibration.far_pressure import SHALLOW, bend, every_record
from calibration.gauge_200g import as_read, at_front, distance, table
from jblast.fidelity.choose import ON_THE_GROUND
from jblast.fidelity.errors import (
    BURSTS,
    END,
    FORD_START,
    KINGERY_BULMASH_END,
    REFERENCES,
    standard_path,
)
from jblast.registry import call, law_for, total_scatter
from jblast.scene.charge import Burst, tnt_factor
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from jblast.waves.shock import FAR_END, shock_mach_number, weak_shock_tail

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
            ratio = theirs / (sound * np.asarray(shock_mach_number(peak)))
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
    curve = kingery_bulmash_curve("incident_pressure", burst)
    tail = weak_shock_tail(curve.segments[-1], join)
    return np.exp(np.asarray(tail.log_pressure(jnp.log(z))))


def _mach(z: np.ndarray, burst: Burst, join: float) -> np.ndarray:
    return np.asarray(shock_mach_number(_pressure(z, burst, join)))


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
