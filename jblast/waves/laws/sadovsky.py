r"""Peak pressure and duration by Sadovsky's cubic, the handbook law of the USSR.

Sadovsky (1952), read second-hand. With $Z$ of `scaling.py` and pressures in kgf/cm2
(98066.5 Pa),

$$p = \frac{0.95}{Z} + \frac{3.9}{Z^2} + \frac{13.0}{Z^3} \text{ (ground)}$$

which is 93.2, 383, 1275 kPa. Handbooks also round it to MPa: 0.1, 0.43, 1.4 lies 8 (Z =
15) to 10 % (Z = 1) higher.

The duration is

$$\tau_+ = 1.7\times10^{-3}\,W^{1/6} R^{1/2} = 1.7\times10^{-3}\,W^{1/3} Z^{1/2}$$

Range: Z = 1 to 15 m/kg^(1/3), where the pressure is 1.29 (Z = 1), 1.06 (2), 1.02 (5)
and 0.97 (10) of Kingery and Bulmash, the duration 0.98, 1.17, 1.00 and 1.12. Closer in,
the cubic leaves them fast (2.4 at 0.5), so there, as past 15, the pressure is a power
law with the end slope and not valid.
"""

import math
from functools import partial

from jblast.waves.scaling import scaled_law
from jblast.waves.tables import Curve, polynomial, power_sum

KGF_PER_CM2 = 98_066.5
"""One kilogram-force per square centimetre [Pa], exact."""
RANGE = (1.0, 15.0)
"""Valid scaled distances [m/kg^(1/3)]; some sources state 10 as the upper limit."""

# No constant term: far away the pressure vanishes.
PRESSURE = power_sum(
    (0.95 * KGF_PER_CM2, -1.0), (3.9 * KGF_PER_CM2, -2.0), (13.0 * KGF_PER_CM2, -3.0)
)
DURATION = polynomial([math.log(1.7e-3), 0.5])
_law = partial(
    scaled_law,
    spans={"surface": RANGE},
    name="sadovsky",
    title="Sadovsky",
    source="Sadovsky 1952, second-hand",
)
sadovsky_pressure = _law("peak_overpressure_pa", Curve(PRESSURE, *RANGE))
sadovsky_duration = _law("positive_duration_s", Curve(DURATION, *RANGE, cheap=True))
