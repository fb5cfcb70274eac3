r"""A shock front from the charge to the acoustic limit, in one consistent picture.

Peak overpressure: Kingery and Bulmash up to $Z = 20$ m/kg^(1/3), from there the
weak-shock tail that meets it in value and slope. Not from 40, where their table ends:
its last stretch bends away (on the surface its slope is -1.25 at 20, -1.40 at 30).
Surface: $A$ = 170256 Pa m/kg^(1/3), $b$ = 2.7953 m/kg^(1/3); free air: 105693, 4.8852.

Shock speed, by Rankine and Hugoniot for air of $\gamma$ = 1.4:
$$U = c_0 \sqrt{1 + \tfrac{6}{7}\, p/P_0}$$

Arrival, starting from the Kingery-Bulmash time at their first $Z$:
$$t = t_{KB}(R_1) + \int_{R_1}^{R} dr/U$$
so that $dt/dR = 1/U$ to rounding, which tends to $1/c_0$. The integral is tabulated at
first use (under 5 ms, `waves/tables.py`); in float64 its relative error is below
1e-10.

Listed points: at $Z = 20$ value and slope are continuous, curvature is not. At the
first $Z$ the slope of the arrival jumps (1 % surface, 7 % free air): below it, not
valid, the arrival goes on as Kingery's and Bulmash's power law.

Within the table the arrival is that of Kingery and Bulmash to 3.4 % (worst near
Z = 0.2, where the start decides), to 0.9 % past Z = 2. Below Z = 0.5 real air is slower
than the ideal gas: U is up to 5 % above their shock speed.

Range of arrival and speed: from the first $Z$ (0.0674 surface, 0.0531 free air) to 1e4;
past that the formulas continue, finite. Neither wind nor absorption is modelled.
Z = 1e4 is 10 km for 1 kg, where ISO 9613-1 (20 C, 70 % humidity) takes 3.4 dB at
125 Hz, above the 20 Hz or so where such a pulse is strongest; larger charges are lower
in pitch and lose less. That limit is a choice, not a measurement.

Range of the pressure: to Z = 300. Past it the median of recorded peaks is half of the
law, with a scatter of a factor of 1.6; from 200 on the scatter grows as measured
(`waves/shock.py`). A peak that is off by a factor of two changes the speed by 0.05 % at
Z = 300.

Duration and impulse of the positive phase are those of Kingery and Bulmash to the end
of their table, Z = 40 m/kg^(1/3), and from there those of a weak shock (Landau 1945;
Whitham 1974, section 9.3), whose front absorbs the wave behind it:

$$t_d = t_{40} \sqrt{\frac{\ln(Z/b)}{\ln(40/b)}}, \qquad i = i_{40}\,\frac{40}{Z}$$

with the length $b$ of the tail of the pressure. Peak times duration then falls as
$1/Z$, so the impulse keeps its share of it: 0.42 on the surface and 0.47 in free air,
near the 1/2 of the triangle that every such pulse becomes. A record then has the front,
the duration and the impulse of one pulse at all distances.

Past 40 the curves are blended over 5 % in Z, where the slope of the duration falls from
0.31 to 0.18 (free air: 0.28 to 0.23), that of the impulse from -1.02 to -1 (-1.10).

Absorption, turbulence and weather are not modelled. `ford_2021`, fitted to recordings
on the surface, has durations 13 % shorter at Z = 100 and 13 % longer at 1000, impulses
21 % and 44 % smaller. For a log `ford_2021` is chosen there, not this law
(`waves.choice`).

Range of duration and impulse: from the start of Kingery's and Bulmash's tables to
Z = 300. Past it the median of recorded impulses is 0.7 of this, of durations 1.2 to 1.3
times; from 200 on the scatter grows as measured (`waves/shock.py`).
"""

import math
from functools import partial

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.types import namespace
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curves
from jblast.waves.scaling import scaled_law
from jblast.waves.shock import (
    FAR_END,
    LOG_STANDARD_PRESSURE,
    WeakShockTail,
    log_shock_speed,
    measured_far_scatter,
    weak_shock_tail,
    with_tail,
)
from jblast.waves.tables import (
    BLEND_WIDTH,
    Curve,
    Numbers,
    arrival,
    joined,
)

# Up to here absorption is negligible in an arrival (docstring of the module).
LAST_VALID = 1e4
"""Largest valid scaled distance of arrival and speed [m/kg^(1/3)]."""
# A shock is sound there: 4e-6 of an arrival is its head start.
END = 1e6
"""Last scaled distance of the curves [m/kg^(1/3)]."""
END_OF_TABLE = 40.0
"""Largest scaled distance of the Kingery-Bulmash curves [m/kg^(1/3)]."""
# Not at 40, where the table ends: its last segment departs from a weak shock.
JOIN = 20.0
"""Scaled distance at the start of the tail [m/kg^(1/3)]."""

TAILS: dict[str, WeakShockTail] = {
    burst: weak_shock_tail(curve, JOIN)
    for burst, curve in kingery_bulmash_curves("incident_pressure").items()
}
"""Tail that continues the pressure curve of each burst."""
FRONTS: dict[str, Curve] = {
    burst: with_tail(curve, TAILS[burst], END)
    for burst, curve in kingery_bulmash_curves("incident_pressure").items()
}
"""Pressure of the front of each burst, ln Pa against ln Z."""


def _arrival(burst: str) -> Curve:
    front, timed = FRONTS[burst], kingery_bulmash_curves("arrival_time")[burst]
    start = math.exp(timed.form(math.log(front.z_min)))
    form = arrival(
        lambda x: front.form(x) - LOG_STANDARD_PRESSURE,
        front.z_min,
        STANDARD_SOUND_SPEED * start,
        END,
    )
    return Curve(form, front.z_min, END)


def _continued(quantity: str, burst: str) -> Curve:
    """Return a curve of the table with that of a weak shock beyond the table."""
    curve = kingery_bulmash_curves(quantity)[burst]
    log_end = math.log(END_OF_TABLE)
    # numbers of Python take the precision of the argument
    at_end = float(curve.form(log_end))

    def near(log_z: Numbers) -> Numbers:
        inside = namespace(log_z).minimum(log_z, log_end)
        return curve.form(inside) + curve.end_slopes[1] * (log_z - inside)

    def far(log_z: Numbers) -> Numbers:
        if quantity == "positive_phase_duration":
            return at_end + TAILS[burst].log_growth(log_z, log_end)
        return at_end + log_end - log_z  # peak times duration falls as 1/Z

    # the blend begins at the end of the table
    blend = END_OF_TABLE * math.sqrt(1.0 + BLEND_WIDTH)
    return Curve(joined([near, far], [blend]), curve.z_min, END, cheap=True)


def _law(
    quantity: str,
    curves: dict[str, Curve],
    last: float = FAR_END,
    source: str = "Kingery & Bulmash 1984 to Z = 20, weak-shock tail, 1/U integrated",
    factor: str = "",
):
    return scaled_law(
        quantity,
        curves,
        {burst: (curve.z_min, last) for burst, curve in curves.items()},
        name="shock_kinematics",
        source=source,
        factor=factor,
        note="; no absorption",
        far_scatter=measured_far_scatter(quantity) if last == FAR_END else None,
    )


shock_kinematics_arrival_time = _law(
    "air_arrival_s",
    {burst: _arrival(burst) for burst in FRONTS},
    LAST_VALID,
    factor="travel",
)
shock_kinematics_pressure = _law("peak_overpressure_pa", FRONTS)
shock_kinematics_shock_speed = _law(
    "shock_speed_m_s",
    {burst: front.then(log_shock_speed) for burst, front in FRONTS.items()},
    LAST_VALID,
)
_phase_law = partial(
    _law, source="Kingery & Bulmash 1984 to Z = 40, weak shock from there"
)
shock_kinematics_duration = _phase_law(
    "positive_duration_s",
    {burst: _continued("positive_phase_duration", burst) for burst in FRONTS},
)
shock_kinematics_impulse = _phase_law(
    "positive_impulse_pa_s",
    {burst: _continued("incident_impulse", burst) for burst in FRONTS},
)
