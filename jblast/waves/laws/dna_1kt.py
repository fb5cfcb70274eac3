r"""Pressure and arrival of a nuclear burst in free air: the DNA's 1 kt standard.

$$p = \frac{3.04 \cdot 10^{11}}{r^3} + \frac{1.13 \cdot 10^9}{r^2}
  + \frac{7.9 \cdot 10^6}{r \sqrt{\ln\left(x + 3\, e^{-\sqrt{x}/3}\right)}}
  \; \mathrm{Pa}, \qquad x = r/445.42$$
$$t = \frac{r^2 (6.7 + r)}{7.12 \cdot 10^6 + 7.32 \cdot 10^4\, r + 340.5\, r^2}
  \; \mathrm{s}$$

with r in m for 1 kt. As in the program BLAST of the Defense Nuclear Agency (1984), read
second-hand in two public programs (GOFAI/glasstone, HeWu) that agree. The mass of the
charge is chemical: $Y = 2W$ (`scaling.py`), so r = 79.37 Z.

The formulas need no guard and no continuation: the argument of the logarithm is least,
2.784, at r = 83.4 m, so the root is never of less than 1.02. Close in p goes as
$r^{-3}$, a strong shock; far out as $1/(r \sqrt{\ln r})$, a weak one.

Other air: by Sachs (`scaling.py`). The arrival's own sound speed is 340.5 m/s, not the
340.29 of our curves. What is carried over is the fraction $340.5\,t/r$ of the sound's
travel time, so that far away $t = R/c_0$ for the sound speed given; BLAST does the same
with the sound speed at altitude. In our standard air times are 0.06 % above the print.

Range: 16 to 4000 m/kt^(1/3), as BLAST has it. (It also asks for 0.1 to 25000 kt; cube-
root scaling knows no such bound.) Against `shock_kinematics`, free air, the pressure is
0.87 to 1.01 from Z = 1 to 50 and still 0.95 at 1e4. Closer to a TNT charge than Z = 1
it is too high, 1.5 times at 0.5 and 5 times at 0.2: a bomb has no size there, TNT has.
"""

from functools import partial

from jblast.types import namespace
from jblast.waves.scaling import NUCLEAR_SCALED_METRES, scaled_law
from jblast.waves.tables import Curve, Numbers

EVERYWHERE = (1e-4, 1e6)
"""Scaled distances of the curves, powers at both ends [m/kg^(1/3)]."""


def _log_pressure(log_z: Numbers) -> Numbers:
    """Return ln p (p in Pa)."""
    xp = namespace(log_z)
    r = NUCLEAR_SCALED_METRES * xp.exp(log_z)
    x = r / 445.42
    weak = xp.sqrt(xp.log(x + 3.0 * xp.exp(-xp.sqrt(x) / 3.0)))
    return xp.log((3.04e11 / r**2 + 1.13e9 / r + 7.9e6 / weak) / r)


def _log_sound_fraction(log_z: Numbers) -> Numbers:
    """Return ln(340.5 t/r)."""
    xp = namespace(log_z)
    r = NUCLEAR_SCALED_METRES * xp.exp(log_z)
    # Divided by 340.5 r^2: no power that overflows single precision.
    slowness = 1.0 + (7.32e4 / 340.5 + 7.12e6 / 340.5 / r) / r
    return xp.log((1.0 + 6.7 / r) / slowness)


_law = partial(
    scaled_law,
    spans={"free-air": (16.0 / NUCLEAR_SCALED_METRES, 4000.0 / NUCLEAR_SCALED_METRES)},
    name="dna_1kt",
    title="DNA 1 kt standard",
    source="DNA 1 kt free-air standard (program BLAST, 1984), over two transcriptions",
    words="free air, r = 16 to 4000 m/kt^(1/3) (Z = 0.2 to 50 m/kg^(1/3)), Y = 2 W",
)
dna_1kt_arrival_time = _law(
    "air_arrival_s", Curve(_log_sound_fraction, *EVERYWHERE), factor="travel"
)
dna_1kt_pressure = _law("peak_overpressure_pa", Curve(_log_pressure, *EVERYWHERE))
