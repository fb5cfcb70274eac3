r"""Kinney and Graham (1985): chemical and nuclear explosions in free air.

*Explosive Shocks in Air*, 2nd ed., read second-hand in two public programs (InfraPy,
Supracenter) that agree. For a TNT charge, with $Z = R/W^{1/3}$, 1 kg and standard air:

$$\frac{p}{P_0} = \frac{808\,[1 + (Z/4.5)^2]}{\sqrt{1 + (Z/0.048)^2}
  \sqrt{1 + (Z/0.32)^2} \sqrt{1 + (Z/1.35)^2}}$$
$$t_d = \frac{980\,[1 + (Z/0.54)^{10}]}{[1 + (Z/0.02)^3] [1 + (Z/0.74)^6]
  \sqrt{1 + (Z/6.9)^2}} \; \mathrm{ms}$$
$$i = \frac{0.067 \sqrt{1 + (Z/0.23)^4}}{Z^2 \sqrt[3]{1 + (Z/1.55)^3}} \;
  \mathrm{bar\,ms}$$

The impulse is in one of the programs only, without its unit: bar ms is from memory, and
puts it at 0.62 to 0.98 of that of Kingery and Bulmash, Z = 0.06 to 40. The shock speed
follows from the pressure by Rankine and Hugoniot, the arrival from the speed:

$$t = \frac{1}{c_0} \int_{r_c}^{R} \frac{dr}{\sqrt{1 + \tfrac67\, p/P_0}}$$

from the charge's radius $r_c$ = 0.053 m/kg^(1/3), where the time is zero. It is
tabulated as in `waves/tables.py`, in float64 to 1e-11.

Range: none was found in print, so the ranges are ours. Pressure and impulse: from the
charge's surface, Z = 0.053, to 40, as far as there is a Kingery-Bulmash curve to
compare with. Farther out the pressure falls as 1/Z, slower than a weak shock: 1.4
times `shock_kinematics` at Z = 100, 1.7 at 500. That hardly moves the shock any more:
its arrival stays within 0.2 % of `shock_kinematics` from Z = 7 on. So speed and arrival
hold to 1e4, past which absorption counts, and from 0.06: at the surface the arrival is
zero. Duration: Z = 4.2 to 33, where it is less than 30 % short of Kingery's and
Bulmash's.

Outside, the duration continues as printed to Z = 0.5, where the formula turns up
towards the charge (to 5 times Kingery's and Bulmash's at 0.2, and 0.98 s for 1 kg at
none), and to 300; past these as a power law, as the arrival inside 0.06. All others are
powers of Z at both ends and continue as printed.

Against Kingery and Bulmash in free air at Z = 0.5, 1, 2, 5, 10, 40: pressure 1.03,
1.08, 1.07, 0.93, 0.90, 1.23; duration 0.26, 0.29, 0.63, 0.74, 0.83, 0.67, far shorter
near the charge though both programs have the same digits.

Other air: by Sachs (`scaling.py`), as for every law here. Kinney and Graham multiply R
by $(P/P_0)^{1/3} (T_0/T)^{1/3}$, so by the density; but in an ideal gas a blast of
given energy has the one length $(W/P_0)^{1/3}$, and temperature enters only where a
time is given. The two differ by 1.2 % in distance for 10 K. Programs that write
$(T/T_0)^{1/3}$ (InfraPy, older infraGA) have it upside down.

For a nuclear burst, with $z = R/Y^{1/3}$ in m/kt^(1/3) and the duration for 1 kt:

$$\frac{p}{P_0} = 3.2 \cdot 10^6\, z^{-3} \sqrt{1 + (z/87)^2}\,(1 + z/800)$$
$$t_d = \frac{180 \sqrt{1 + (z/100)^3}}{\sqrt{1 + z/40}\,
  [1 + (z/285)^5]^{1/6}\, [1 + z/50000]^{1/6}} \; \mathrm{ms}$$

The charge's mass is chemical, $Y = 2W$, so z = 79.37 Z (`scaling.py`). The printed
range is not known either. Ours is that of the DNA's 1 kt standard (`dna_1kt.py`), 16 to
4000 m/kt^(1/3), over which this pressure is 1.00 to 1.22 times that. Both formulas are
powers of z at their ends and continue as printed. Compared with Kingery's and Bulmash's
TNT in free air the duration is 0.89 to 1.22 from Z = 1 to 40, and ten times as long at
0.2, where a bomb, without the size of a charge, has a higher pressure for longer.
"""

from functools import partial

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.scaling import (
    LOG_NUCLEAR_SCALED_METRES,
    NUCLEAR_SCALED_METRES,
    scaled_law,
)
from jblast.waves.shock import LOG_STANDARD_PRESSURE, log_shock_speed
from jblast.waves.tables import Curve, Form, arrival, broken_power

# The arrival of Kinney and Graham starts at the surface of the charge; from memory.
CHARGE_RADIUS = 0.053
"""Radius of 1 kg of TNT (1600 kg/m3) [m/kg^(1/3)]."""
# At the surface the arrival is zero, and its logarithm has no slope.
FIRST_ARRIVAL = 0.06
"""Smallest scaled distance of the arrival [m/kg^(1/3)]; below, it is a power law."""
PRESSURE = broken_power(
    808.0 * STANDARD_PRESSURE,
    0.0,
    (4.5, 2.0, 1.0),
    (0.048, 2.0, -0.5),
    (0.32, 2.0, -0.5),
    (1.35, 2.0, -0.5),
)
"""Pa in standard air."""
DURATION = broken_power(
    0.980,
    0.0,
    (0.54, 10.0, 1.0),
    (0.02, 3.0, -1.0),
    (0.74, 6.0, -1.0),
    (6.9, 2.0, -0.5),
)
"""Seconds for 1 kg."""
IMPULSE = broken_power(6.7, -2.0, (0.23, 4.0, 0.5), (1.55, 3.0, -1.0 / 3.0))
"""Pa s for 1 kg: 1 bar ms = 100 Pa s."""
NUCLEAR_PRESSURE = broken_power(
    3.2e6 * STANDARD_PRESSURE, -3.0, (87.0, 2.0, 0.5), (800.0, 1.0, 1.0)
)
"""Pa in standard air, of m/kt^(1/3)."""
NUCLEAR_DURATION = broken_power(
    0.180,
    0.0,
    (100.0, 3.0, 0.5),
    (40.0, 1.0, -0.5),
    (285.0, 5.0, -1.0 / 6.0),
    (50000.0, 1.0, -1.0 / 6.0),
)
"""Seconds for 1 kt, of m/kt^(1/3)."""
EVERYWHERE = (1e-4, 1e6)
"""Scaled distances of curves that are powers of Z at both ends [m/kg^(1/3)]."""


def _of_yield(form: Form, per_length: float = 0.0) -> Curve:
    """Return a curve for a nuclear yield of 2 W; times grow with $Y^{1/3}$."""
    scale = LOG_NUCLEAR_SCALED_METRES
    return Curve(lambda x: form(x + scale) - per_length * scale, *EVERYWHERE)


_pressure = Curve(PRESSURE, *EVERYWHERE)
_arrival = arrival(
    lambda x: PRESSURE(x) - LOG_STANDARD_PRESSURE, CHARGE_RADIUS, 0.0, EVERYWHERE[1]
)


_law = partial(
    scaled_law,
    name="kinney_graham",
    title="Kinney-Graham",
    source="Kinney & Graham 1985 (Explosive Shocks in Air), over two transcriptions",
    note=" (ours)",
)

# Compared with Kingery and Bulmash: their pressure ends at 40, and the duration is
# within 30 % of theirs from 4.2 on (at 0.7 it is 23 % of theirs). Farther than 1e4
# absorption changes an arrival (see `shock_kinematics`).
kinney_graham_arrival_time = _law(
    "air_arrival_s",
    Curve(_arrival, FIRST_ARRIVAL, EVERYWHERE[1]),
    {"free-air": (FIRST_ARRIVAL, 1e4)},
    factor="travel",
)
"""Time from the shock's leaving the charge to its arrival [s].

Earlier than Kingery and Bulmash near the charge: by 53 % at Z = 0.1, 16 % at 0.3, 6 %
at 1, 0.2 % at 10.
"""
kinney_graham_pressure = _law(
    "peak_overpressure_pa", _pressure, {"free-air": (CHARGE_RADIUS, 40.0)}
)
kinney_graham_impulse = _law(
    "positive_impulse_pa_s",
    Curve(IMPULSE, *EVERYWHERE),
    {"free-air": (CHARGE_RADIUS, 40.0)},
)
# Cut where it turns up towards the charge, and where it is constant to 0.05 % a factor
# e: past that its tenth power would cost single precision its digits.
kinney_graham_duration = _law(
    "positive_duration_s", Curve(DURATION, 0.5, 300.0), {"free-air": (4.2, 33.0)}
)
kinney_graham_shock_speed = _law(
    "shock_speed_m_s",
    _pressure.then(log_shock_speed),
    {"free-air": (FIRST_ARRIVAL, 1e4)},
)
_nuclear_law = partial(
    scaled_law,
    spans={"free-air": (16.0 / NUCLEAR_SCALED_METRES, 4000.0 / NUCLEAR_SCALED_METRES)},
    name="kinney_graham_nuclear",
    source="Kinney & Graham 1985 (Explosive Shocks in Air), nuclear, "
    "two transcriptions",
    words="free air, z = 16 to 4000 m/kt^(1/3) (Z = 0.2 to 50 m/kg^(1/3)), Y = 2 W",
    note=" (ours)",
)
kinney_graham_nuclear_pressure = _nuclear_law(
    "peak_overpressure_pa", _of_yield(NUCLEAR_PRESSURE)
)
kinney_graham_nuclear_duration = _nuclear_law(
    "positive_duration_s", _of_yield(NUCLEAR_DURATION, 1.0)
)
