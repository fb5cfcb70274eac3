r"""Jump conditions across a shock, its reflection, and its decay far away.

Mass, momentum and energy are conserved across the front, in an ideal gas of $\gamma$ =
1.4. With $x = p/P_0$ the relations of Rankine and Hugoniot are

$$M^2 = 1 + \tfrac67 x, \quad \frac{u}{c_0} = \frac{5x}{7M}, \quad
\frac{\rho}{\rho_0} = \frac{7+6x}{7+x}$$

$$q = \tfrac12\rho u^2 = \frac{5}{2}\frac{p^2}{7P_0+p}, \qquad
p_r = 2p\,\frac{7P_0+4p}{7P_0+p} = 2p + \tfrac{12}{5} q$$

Each is written so that nothing cancels however weak the shock. Real air above some ten
bar is not ideal: the reflected pressure of Kingery and Bulmash exceeds $p_r$ by 3.4 %
at Z = 0.7, 11 % at 0.5 and 53 % at 0.1 (free air); past Z = 1 the two agree to 1.6 %
(1.1 % on the surface).

Far away a spherical shock with a sharp front decays, in still air without absorption,
along the weak-shock tail

$$p = \frac{A}{Z \sqrt{\ln(Z/b)}}, \qquad
  \frac{d \ln p}{d \ln Z} = -1 - \frac{1}{2 \ln(Z/b)}$$

(Landau 1945; Whitham 1974, *Linear and Nonlinear Waves*, section 9.3), faster than the
acoustic 1/Z because the front keeps absorbing the wave behind it.

Past a scaled distance of 200 to 300 m/kg^(1/3) recorded peaks, impulses and durations
leave the laws for a weak shock: the median peak is half of theirs, and readings of one
shot scatter by a factor of 1.6. Wind and temperature bend the rays, turbulence and
terrain scatter them. Absorption does not explain it: by ISO 9613-1 it takes at most
0.5 % of the peaks recorded there (175 to 744 kg; `calibration/far_pressure.py`). Two
parts are added to the scatter in ln that a law has near the charge:

$$\sigma_{far} = F\,g(Z), \qquad \sigma_{record} = R\,g(Z), \qquad
  g(Z) = \frac{1}{1 + (Z_k/Z)^4}$$

The far rows of one shot share the first, which stands for its weather. It includes the
median loss, since the sign depends on the weather: downwind, peaks rise. It is
independent of the level of the shot near the charge. The second is that of each record,
the scale of a Student-t with 4 degrees of freedom in a fit, and the standard deviation
of a normal where blasts are simulated. Both are bounded; an unbounded scatter would
allow any distant reading to agree with any mass. The numbers, in
`data/far_scatter.json`, are estimated by `calibration/far_pressure.py` from 189 records
of 18 chemical shots, Z = 22 to 838 m/kg^(1/3).

The scatter keeps far rows from outweighing near ones. It does not make a mass from far
rows alone reliable, so the range of these laws ends at Z = 300: masses of held-out
shots from peaks past 300 alone are too small, and 3 of 8 intervals of 90 % contain the
true one (none with the scatter near the charge). A heavier charge would put the rows
nearer, where the laws hold and the recorded peaks would contradict them. Whether the
knee is at one Z for all masses and weathers cannot be decided by four campaigns.
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.errors import require
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.scaling import scaled_distance
from jblast.waves.tables import Curve, Numbers, slope_of

# Median of recorded peaks over the law, each shot relative to its own level: 0.97 to
# 1.04 in all bins up to here, 0.50 from 300 to 450
# (`calibration/results/far_pressure.txt`).
FAR_END = 300.0
"""Largest scaled distance of the laws for still, uniform air, for peak, impulse and
duration [m/kg^(1/3)]."""
# The calibration prints the likelihoods of 2, 4 and 8. An exponent of 8 fits the peaks
# somewhat better, but makes the scatter a step at the weather of one site.
FAR_SCATTER_EXPONENT = 4.0
"""Exponent of $Z_k/Z$ in the far scatter [-]."""
LOG_STANDARD_PRESSURE = math.log(STANDARD_PRESSURE)


@checked
def blast_wind(
    peak_overpressure: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
    sound_speed: Number = STANDARD_SOUND_SPEED,
) -> Numbers:
    r"""Return the speed of the air behind the front, $u = 5 c_0 x/(7M)$ [m/s].

    Args:
        peak_overpressure: $p$ [Pa], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    return plane_wave_wind(peak_overpressure / ambient_pressure, sound_speed)


def plane_wave_wind(overpressure: Numbers, sound_speed: Number) -> Numbers:
    r"""Return $5 c_0 x/(7\sqrt{1 + 6x/7})$ [m/s]; negative for a suction.

    Args:
        overpressure: $x = p/P_0$ [-], above -7/6.
        sound_speed: $c_0$, or its share along an axis [m/s].
    """
    steep = namespace(overpressure).sqrt(1.0 + 6.0 / 7.0 * overpressure)
    return 5.0 / 7.0 * sound_speed * overpressure / steep


def log_shock_speed(log_pressure: Numbers) -> Numbers:
    """Return ln U [m/s] in standard air, of ln p (p in Pa)."""
    xp = namespace(log_pressure)
    strength = 6.0 / 7.0 * xp.exp(log_pressure - LOG_STANDARD_PRESSURE)
    return 0.5 * xp.log1p(strength) + math.log(STANDARD_SOUND_SPEED)


def log_wind(log_pressure: Numbers) -> Numbers:
    """Return ln u [m/s] in standard air, of ln p (p in Pa)."""
    speed = log_pressure + math.log(5.0 / 7.0 / STANDARD_PRESSURE)
    return speed - log_shock_speed(log_pressure) + 2.0 * math.log(STANDARD_SOUND_SPEED)


def log_dynamic_pressure(log_pressure: Numbers) -> Numbers:
    """Return ln q (q in Pa) in standard air, of ln p (p in Pa)."""
    xp = namespace(log_pressure)
    total = 7.0 * STANDARD_PRESSURE + xp.exp(log_pressure)
    return math.log(2.5) + 2.0 * log_pressure - xp.log(total)


@dataclass(frozen=True)
class WeakShockTail:
    """Weak-shock tail of a pressure curve.

    Attributes:
        join: Scaled distance at the start of the tail [m/kg^(1/3)].
        amplitude: $A$ [Pa m/kg^(1/3)].
        length: $b$ [m/kg^(1/3)].
    """

    join: float
    amplitude: float
    length: float

    def log_pressure(self, log_z: Numbers) -> Numbers:
        """Return ln p (p in Pa); log_z must exceed ln b."""
        reach = namespace(log_z).log(log_z - math.log(self.length))
        return math.log(self.amplitude) - log_z - 0.5 * reach

    def log_growth(self, log_z: Numbers, log_start: float) -> Numbers:
        r"""Return ln of the duration over that at a start: $\tfrac12$ ln of ln(Z/b)."""
        log_length = math.log(self.length)
        reach = (log_z - log_length) / (log_start - log_length)
        return 0.5 * namespace(log_z).log(reach)


def tail_from(join: float, pressure: float, slope: float) -> WeakShockTail:
    r"""Return the tail from a point: $b$ follows from the slope, then $A$ from $p$.

    Args:
        join: Distance of the point, in any unit; $b$ has the same unit.
        pressure: $p$ at the point, in any unit; the unit of $A$ is the product.
        slope: $d\ln p/d\ln Z$ at the point [-].

    Raises:
        InputError: The slope is flatter than that of 1/Z; no tail has this slope.
    """
    require(slope < -1.0, "slope at join", "below -1", f"{slope:g}")
    # ln(Z/b), from the slope -1 - 1/(2 ln(Z/b)).
    log_reach = -0.5 / (slope + 1.0)
    return WeakShockTail(
        join=join,
        amplitude=pressure * join * math.sqrt(log_reach),
        length=join * math.exp(-log_reach),
    )


def weak_shock_tail(pressure: Curve, join: float) -> WeakShockTail:
    """Return the tail that joins a pressure curve in value and slope.

    Args:
        pressure: The curve, ln Pa against ln Z.
        join: Scaled distance of the junction [m/kg^(1/3)].

    Raises:
        InputError: The curve is flatter than 1/Z at the join.
    """
    log_z = math.log(join)
    slope = float(slope_of(pressure.form, log_z))
    return tail_from(join, math.exp(pressure.form(log_z)), slope)


def with_tail(pressure: Curve, tail: WeakShockTail, last: float) -> Curve:
    """Return a pressure curve that continues as a weak shock past the join."""
    log_join = math.log(tail.join)

    def form(log_z: Numbers) -> Numbers:
        xp = namespace(log_z)
        # each branch has an argument in its own range, so that none is NaN
        near = pressure.form(xp.minimum(log_z, log_join))
        far = tail.log_pressure(xp.maximum(log_z, log_join))
        return xp.where(log_z < log_join, near, far)

    return Curve(form, pressure.z_min, last)


class FarScatter(NamedTuple):
    """Scatter of one quantity at large distances.

    Attributes:
        shared: $F$, sd of the effect common to the far rows of a shot [ln].
        record: $R$, scale of each record [ln].
        knee: $Z_k$, at which both have half their final value [m/kg^(1/3)].
    """

    shared: float
    record: float
    knee: float

    def at(self, z: Numbers) -> tuple[Numbers, Numbers]:
        """Return both standard deviations in ln at a scaled distance."""
        # In Z/Z_k, not in its inverse: power and slope are finite at Z = 0.
        power = (z / self.knee) ** FAR_SCATTER_EXPONENT
        share = power / (1.0 + power)
        return self.shared * share, self.record * share


@cache
def _packaged() -> dict[str, FarScatter]:
    data = files("jblast.waves") / "data" / "far_scatter.json"
    numbers = json.loads(data.read_text(encoding="utf-8"))["quantities"]
    return {quantity: FarScatter(**each) for quantity, each in numbers.items()}


def measured_far_scatter(quantity: str) -> Callable[..., tuple[Numbers, Numbers]]:
    """Return the far scatter of a quantity, for `registry.Law.far_scatter`.

    Args:
        quantity: "peak_overpressure_pa", "positive_impulse_pa_s" or
            "positive_duration_s".
    """

    def far_scatter(
        slant_range: Number,
        charge_mass: Number,
        ambient_pressure: Number = STANDARD_PRESSURE,
    ) -> tuple[Numbers, Numbers]:
        z = scaled_distance(slant_range, charge_mass, ambient_pressure)
        return _packaged()[quantity].at(z)

    return far_scatter
