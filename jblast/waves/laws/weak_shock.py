r"""Peak pressure far away: the weak-shock tail, with and without absorption by the air.

`weak_shock` is the tail alone,

$$p_s = \frac{A}{Z \sqrt{\ln(Z/b)}}$$

with $A$ and $b$ where it leaves the curve of Kingery and Bulmash, at $Z = 20$
m/kg^(1/3) (`waves/shock.py` derives it). From there on it is `shock_kinematics`;
nearer, where it does not hold, it is a power law with the slope at 20. Its range is
Z = 20 to 300; past it recorded peaks are half of it, and the formula continues.

`weak_shock_iso` subtracts the absorption,

$$p = p_s(R)\,\exp[-\alpha(f)\,(R - R_{20})], \qquad f = \frac{1}{2 t_d}, \qquad
  t_d = t_{20} \sqrt{\frac{\ln(Z/b)}{\ln(20/b)}}$$

$R_{20}$ is the distance of $Z$ = 20 for this charge, $t_{20}$ Kingery's and Bulmash's
positive duration there, scaled by Sachs, from where it grows as that of a weak shock
(Landau, Whitham); $\alpha$ is that of ISO 9613-1 (`waves/propagation.py`).

The frequency is our choice and the loss an estimate: that of a tone whose half period
is the positive phase. A front is no tone: its higher frequencies are absorbed faster,
and steepening feeds them again. The frequency is that at $R$, the lowest on the way;
summed along the way the loss would be about a fifth larger. Charges of more than 1 kg
are below 50 Hz, where ISO 9613-1 does not state its 10 %.

Loss of pressure on the surface, at 15 C, 101325 Pa and 50 % (10 %) humidity:

    kg         f at Z = 100     Z = 100             Z = 300             Z = 1000
    0.001      625 Hz           0.25 % (0.75)       0.77 % (2.1)        2.4 % (5.8)
    1          62 Hz            0.13 % (0.32)       0.35 % (0.96)       0.97 % (2.9)
    15         25 Hz            0.06 % (0.22)       0.15 % (0.60)       0.41 % (1.7)
    1000       6.2 Hz           0.01 % (0.06)       0.04 % (0.17)       past 5 km

The drier the air, the larger the loss at such frequencies: at 2 % humidity 15 kg lose
4.9 % by Z = 1000, without any vapour 14 %, which no air outdoors does. So specify the
humidity: `jblast calc` assumes dry air by default.

The loss does not explain recorded peaks: past Z = 300 their median is half of this law,
for charges that lose at most 0.5 % by it. From 200 on the scatter grows as measured
(`waves/shock.py`).

Its range is Z = 20 to 300 and R to 5 km; farther, rays bend. Nearer than 20 it is
`shock_kinematics` itself. At 20, where the loss sets in, the log slope of the
pressure falls by 0.003 at most for the charges above.
"""

import math
from typing import Any

from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    STANDARD_TEMPERATURE,
)
from jblast.registry import Law, declared_scatter, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curves
from jblast.waves.laws.shock_kinematics import (
    END,
    JOIN,
    TAILS,
    shock_kinematics_pressure,
)
from jblast.waves.propagation import iso_9613_absorption
from jblast.waves.scaling import (
    SD,
    log_scaled_distance,
    sachs_distance_factor,
    sachs_time_factor,
    scaled_law,
    valid_within,
)
from jblast.waves.shock import FAR_END, measured_far_scatter
from jblast.waves.tables import Curve, Numbers

SPANS = dict.fromkeys(TAILS, (JOIN, FAR_END))
# Farther away the weather determines what is recorded.
LAST_RANGE = 5e3
"""Largest valid range, for large charges [m]."""
# The default of `scene.Air`.
HUMIDITY = 0.5
"""Relative humidity of air without a stated one [-]."""

weak_shock_pressure = scaled_law(
    "peak_overpressure_pa",
    {burst: Curve(tail.log_pressure, JOIN, END) for burst, tail in TAILS.items()},
    SPANS,
    name="weak_shock",
    source="Landau 1945; Whitham 1974; from Kingery & Bulmash at Z = 20",
    note="; no absorption",
    far_scatter=measured_far_scatter("peak_overpressure_pa"),
)


@checked
def weak_shock_iso_pressure(
    slant_range: Number,
    charge_mass: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
    sound_speed: Number = STANDARD_SOUND_SPEED,
    temperature: Number = STANDARD_TEMPERATURE,
    relative_humidity: Number = HUMIDITY,
    burst: str = "surface",
) -> Numbers:
    """Return the peak incident overpressure [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
        temperature: $T$ [K], positive.
        relative_humidity: Fraction, 0 to 1.
        burst: "surface" (hemispherical) or "free-air" (spherical).
    """
    log_z = log_scaled_distance(slant_range, charge_mass, ambient_pressure)
    xp, start = namespace(log_z), math.log(JOIN)
    growth = TAILS[burst].log_growth(xp.maximum(log_z, start), start)
    time_factor = sachs_time_factor(charge_mass, ambient_pressure, sound_speed)
    curve = kingery_bulmash_curves("positive_phase_duration")[burst]
    # t_20 by Kingery and Bulmash, from where a weak shock lengthens as its tail does
    duration = time_factor * xp.exp(growth + float(curve.form(start)))
    # one frequency stands for the pulse: half a period is the positive phase
    absorption = iso_9613_absorption(
        0.5 / duration, temperature, ambient_pressure, relative_humidity
    )
    first = JOIN * sachs_distance_factor(charge_mass, ambient_pressure)
    path = xp.maximum(slant_range - first, 0.0)
    peak = shock_kinematics_pressure(slant_range, charge_mass, ambient_pressure, burst)
    return peak * xp.exp(-absorption * path)


def weak_shock_iso_valid(
    slant_range: Number,
    charge_mass: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
) -> Any:
    """Return True for Z from 20 to 300 and ranges up to 5 km."""
    near = valid_within(SPANS)(slant_range, charge_mass, ambient_pressure)
    return near & (slant_range <= LAST_RANGE)


register(
    Law(
        quantity="peak_overpressure_pa",
        name="weak_shock_iso",
        title="weak shock with ISO 9613-1",
        function=weak_shock_iso_pressure,
        range="Z = 20 to 300 m/kg^(1/3), up to 5 km; loss estimated by humidity",
        source="weak shock from Kingery & Bulmash at Z = 20, ISO 9613-1:1993",
        valid=weak_shock_iso_valid,
        scatter=declared_scatter(*SD),
        scatter_source="declared",
        far_scatter=measured_far_scatter("peak_overpressure_pa"),
    )
)
