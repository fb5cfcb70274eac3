r"""Fireball of a bare charge: growth, rise, drift, cooling and smoke.

Growth. The final diameter of a high explosive's fireball is $3.76\,W^{0.325}$ m
(Rakaczky 1975; High 1968 has $3.86\,W^{0.32}$; both from memory). From 1 kg to 100 t
the first lies within 6 %, the second within 10 % of the cube root used here:

$$R(t) = 1.81\,W^{1/3} \left(1 - e^{-t/\tau}\right), \qquad \tau = 1.0\,W^{1/3}
\text{ ms}$$

The exponential is the drag model of fireballs. Its time constant is declared, not
measured: below $0.7\,W^{1/3}$ ms the products would overtake the free-air shock of
Kingery and Bulmash, and twice the value used is equally possible.

Rise. A light sphere starts with the acceleration of its buoyancy over its own and its
added mass, and reaches the speed of a large bubble (Davies and Taylor 1950, eq. 12):

$$a = g\,\frac{1 - \rho/\rho_a}{\rho/\rho_a + 1/2}, \quad w = \tfrac23\sqrt{g R_\infty},
\quad z(t) = \frac{w^2}{a} \ln\cosh\frac{a t}{w}$$

It entrains air, and its radius grows by a quarter of its rise (a thermal, Morton,
Taylor and Turner 1956; the number is Scorer's, 1957). Beyond some five diameters a
thermal slows down, which is not modelled.

Drift. The entrained air has the speed $U$ of the wind. The momentum of the sphere and
its added mass relative to the wind is conserved, as that of a thermal (Turner 1973,
chapter 6, from memory). The centre therefore moves with the wind except for a fraction
$f$ that decreases as the volume grows, with $V/V_0 = (1 + z/(4 R_\infty))^3$,

$$u = U\,(1 - f), \qquad f = \frac{\rho/\rho_a + 1/2}{\rho/\rho_a - 1 + \tfrac32
V/V_0}$$

Neglected are the drag of the wind on the sphere, which would accelerate it sooner, and
shear: the wind is the same at all heights.

Cooling. $T - T_a$ falls exponentially. $T$ starts at 2200 K (pyrometers on TNT read
1800 to 2500; from memory) and reaches Draper's point, 798 K, where visible glow ends,
at the end of the fireball: $t_d = 0.258\,W^{0.349}$ s (Rakaczky 1975, from memory).

Smoke. Without afterburning TNT leaves 3.5 of its 7 carbon atoms as soot, 0.185 of its
mass (7 C, 5 H, 3 N, 6 O to CO, H2O and C). The extinction of soot is 8700 m2/kg
(Mulholland and Choi 1998). With a density $\propto 1 - r^2/R^2$ the optical depth along
a diameter is $\tau_0 = 5 K M / (2 \pi R^2)$, an upper limit since afterburning consumes
soot.
"""

import math

import numpy as np

from jblast.constants import STANDARD_GRAVITY, STANDARD_TEMPERATURE
from jblast.types import Module, namespace
from jblast.waves.arguments import Number
from jblast.waves.tables import Numbers

# Within 6 % of Rakaczky (1975), W^0.325, from 1 kg to 100 t.
LARGEST_RADIUS = 1.81
"""Radius at the end of the expansion, for 1 kg [m/kg^(1/3)]."""

# Assumed, good to a factor of two: below 0.7 ms the products would overtake the shock.
GROWTH_TIME = 1.0e-3
"""Time constant of the expansion, for 1 kg [s/kg^(1/3)]."""

# Pyrometers on TNT read 1800 to 2500 K; from memory.
HOTTEST = 2200.0
"""Temperature at the start [K]."""

DRAPER_POINT = 798.0
"""Temperature at which visible glow begins [K]. Draper 1847."""

# Scorer (1957), for a thermal.
ENTRAINMENT = 0.25
"""Growth of the radius of a thermal with its rise [-]."""

SOOT_YIELD = 0.185
"""Mass of soot from a mass of TNT [-]: 3.5 x 12.011 / 227.13."""

SOOT_EXTINCTION = 8700.0
"""Mass extinction coefficient of soot at 633 nm [m2/kg], uncertainty 1100."""


# Error 1e-6 of the time while the fireball glows, and at most 5e-4.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Gauss-Legendre nodes and weights of the integral over the drift."""


class Fireball(Module):
    """Visible state of a fireball at a time.

    Attributes:
        radius: Radius of the cloud, with expansion and entrainment [m].
        rise: Rise of the centre above the burst [m].
        drift_time: Drift of the centre in a wind, over the wind speed [s].
        temperature: Temperature of the light [K].
        optical_depth: Optical depth along a diameter [-]; the density falls from the
            centre as 1 - (r/radius)^2.
    """

    radius: Numbers
    rise: Numbers
    drift_time: Numbers
    temperature: Numbers
    optical_depth: Numbers


def fireball_growth_time(charge_mass: Number) -> Numbers:
    r"""Return the time constant $\tau$ of the expansion [s], good to a factor of two.

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
    """
    return GROWTH_TIME * namespace(charge_mass).cbrt(charge_mass)


def fireball_duration(charge_mass: Number) -> Numbers:
    """Return the duration of the visible glow [s]: Rakaczky (1975), from memory.

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
    """
    return 0.258 * charge_mass**0.349


def fireball_radius(
    charge_mass: Number,
    time: Number,
    growth_time: Number,
) -> Numbers:
    r"""Return the radius of the luminous fireball, without entrained air [m].

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        time: Time since detonation [s]; the radius is zero before it.
        growth_time: Time constant $\tau$ of the expansion [s], positive.
    """
    xp = namespace(charge_mass, time, growth_time)
    largest = LARGEST_RADIUS * xp.cbrt(charge_mass)
    # expm1 keeps all digits shortly after detonation
    return -largest * xp.expm1(-xp.maximum(time, 0.0) / growth_time)


def fireball_rise(
    charge_mass: Number,
    time: Number,
    air_temperature: Number = STANDARD_TEMPERATURE,
) -> Numbers:
    """Return the rise of the centre of the fireball above the burst [m].

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        time: Time since detonation [s]; no rise before it.
        air_temperature: Temperature of the ambient air [K], below 2200.
    """
    xp = namespace(charge_mass, time, air_temperature)
    lightness = air_temperature / HOTTEST  # densities at one pressure
    start = STANDARD_GRAVITY * (1.0 - lightness) / (lightness + 0.5)
    final = (
        2.0 / 3.0 * xp.sqrt(STANDARD_GRAVITY * LARGEST_RADIUS * xp.cbrt(charge_mass))
    )
    x = xp.maximum(time, 0.0) * start / final
    # ln cosh x: exact near zero, without overflow far from it
    near = xp.log1p(2.0 * xp.square(xp.sinh(0.5 * xp.minimum(x, 1.0))))
    far = x + xp.log1p(xp.exp(-2.0 * x)) - math.log(2.0)
    return final**2 / start * xp.where(x < 1.0, near, far)


def smoke_drift_time(
    charge_mass: Number,
    time: Number,
    air_temperature: Number = STANDARD_TEMPERATURE,
) -> Numbers:
    r"""Return the drift of the centre of the fireball over the wind speed [s].

    It is $\int_0^t (1 - f)\,dt'$, by Gauss-Legendre quadrature in $\sqrt{t'/t}$. Value
    and slope start at zero; the final lag behind the time is about $R_\infty/w$.

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        time: Time since detonation [s]; no drift before it.
        air_temperature: Temperature of the ambient air [K], below 2200.
    """
    xp = namespace(charge_mass, time, air_temperature)
    mass, air = charge_mass, air_temperature
    since = xp.maximum(time, 0.0)
    lightness = air / HOTTEST
    total = xp.zeros_like(since * mass * air)
    for node, weight in zip(0.5 * (1.0 + _NODES), 0.5 * _WEIGHTS, strict=True):
        widened = ENTRAINMENT * fireball_rise(mass, since * float(node) ** 2, air)
        part = widened / (LARGEST_RADIUS * xp.cbrt(mass))
        gained = 1.5 * part * (3.0 + part * (3.0 + part))  # 3/2 (V - V0) / V0
        followed = gained / (lightness + 0.5 + gained)
        total = total + 2.0 * float(node * weight) * followed
    return since * total


def fireball(
    charge_mass: Number,
    time: Number,
    air_temperature: Number = STANDARD_TEMPERATURE,
    growth_time: Number | None = None,
) -> Fireball:
    r"""Return the fireball of a charge at a time, with zero size before detonation.

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        time: Time since detonation [s].
        air_temperature: Temperature of the ambient air [K], below 798.
        growth_time: Time constant $\tau$ of the expansion [s], positive; None for
            that of `fireball_growth_time`.
    """
    if growth_time is None:
        growth_time = fireball_growth_time(charge_mass)
    xp = namespace(charge_mass, time, air_temperature)
    mass, air = charge_mass, air_temperature
    begun = time > 0.0
    rise = fireball_rise(mass, time, air)
    expansion = fireball_radius(mass, time, growth_time)
    radius = expansion + ENTRAINMENT * rise
    cooled = xp.log((HOTTEST - air) / (DRAPER_POINT - air))
    part = xp.maximum(time, 0.0) / fireball_duration(mass)
    soot = SOOT_EXTINCTION * SOOT_YIELD * mass
    # 1 before detonation: a guard of the division, its result is not used
    depth = 2.5 / math.pi * soot / xp.square(xp.where(begun, radius, 1.0))
    return Fireball(
        radius=radius,
        rise=rise,
        drift_time=smoke_drift_time(mass, time, air),
        temperature=air + (HOTTEST - air) * xp.exp(-part * cooled),
        optical_depth=xp.where(begun, depth, 0.0),
    )
