r"""Sedov and Taylor: the strong shock of a point source in cold, uniform air.

$$E = \alpha(\gamma)\,\rho_0 R^5/t^2$$

Taylor (1950), Proc. R. Soc. A 201:159; Sedov (1946). It neglects the ambient pressure,
so it holds while the shock is strong, and the charge, so it holds for a small and light
source: a nuclear burst. A chemical charge has hardly swept up its own mass of air
(0.58 m/kg^(1/3)) when the shock stops being strong (0.64 m/kg^(1/3)).

The constant $\alpha(\gamma)$ is exact. Behind the shock the flow is self-similar, and
Sedov (1946) found it in closed form. With $V = u t/r$ as parameter, in the notation of
Kamm (2000), LA-UR-00-6055, for a sphere and uniform density:

$$x_1 = \tfrac{5(\gamma+1)}{4} V,\quad
x_2 = \tfrac{\gamma+1}{\gamma-1}(\tfrac{5\gamma}{2} V - 1),\quad
x_3 = \tfrac{5(\gamma+1)}{7-\gamma}(1 - \tfrac{3\gamma-1}{2} V),\quad
x_4 = \tfrac{\gamma+1}{\gamma-1}(1 - \tfrac{5}{2} V)$$

$$\lambda = r/R = x_1^{-2/5}\,x_2^{-a_2}\,x_3^{-a_1},\quad u/u_s = x_1\lambda,\quad
\rho/\rho_s = x_2^{a_3} x_3^{a_4} x_4^{a_5},\quad
p/p_s = x_1^{6/5} x_3^{a_4-2a_1} x_4^{1+a_5}$$

with $x_2$ running from 0 at the centre to 1 at the shock.
"""

import math
from typing import Any

import numpy as np

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.registry import Law, declared_scatter, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.tables import Curve, Numbers

# The pressure is 10 % off at 21 to 26 atm (exact point-source solution).
STRONG_SHOCK = 25.0
"""Smallest valid ratio of overpressure to ambient pressure."""
# The shock is then at 0.033 m/kg^(1/3), inside a charge of TNT (0.053), and the time is
# a third of that of the first Trinity photograph.
EARLIEST_TIME = 1e-7
"""Time before which the radius is a continuation only [s/kg^(1/3)]."""
# The error falls as 6^-n; 24 nodes reach rounding for gamma from 1.05.
NODES = 24
"""Quadrature nodes."""
# The closed form has infinite exponents at gamma = 2 and is singular at 1.
GAMMAS = (1.02, 1.9)
"""Range of gamma of the constant; outside it is a power of gamma - 1."""


@checked
def sedov_taylor_energy(
    shock_radius: Number,
    time_since_detonation: Number,
    air_density: Number,
    sedov_gamma: Number,
) -> Numbers:
    r"""Return the energy of a point source from one radius and time [J].

    $$E = \alpha(\gamma)\,\rho_0 R^5/t^2$$

    Args:
        shock_radius: Radius $R$ [m].
        time_since_detonation: Time $t$ [s], positive.
        air_density: Density ahead of the shock $\rho_0$ [kg/m3].
        sedov_gamma: Ratio of specific heats behind the shock $\gamma$ [-].
    """
    scale = air_density * shock_radius**5 / time_since_detonation**2
    return sedov_alpha(sedov_gamma) * scale


@checked
def sedov_taylor_shock_radius(
    time_since_detonation: Number,
    charge_mass: Number,
    air_density: Number,
    sedov_gamma: Number,
) -> Numbers:
    r"""Return the radius of the shock of a point source [m].

    $$R = \left(\frac{E\,t^2}{\alpha(\gamma)\,\rho_0}\right)^{1/5}$$

    A fit may move its origin time past the time of a photograph, where $t^{2/5}$ has
    no value, and no slope at zero. Before $t_e = 10^{-7}\,W^{1/3}$ s the law is
    therefore continued with $t_e^2/(2t_e - t)$ for $t$: equal to $t$ in value and slope
    at $t_e$, positive and rising for all $t$. Therefore ln R stays finite, and its
    slope leads a fit back. Such rows are marked invalid. A missing time (NaN) gives NaN
    and a gradient of zero, so that a masked row does not affect others.

    Args:
        time_since_detonation: Time $t$ [s].
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg, $W$ [kg].
        air_density: Density ahead of the shock $\rho_0$ [kg/m3].
        sedov_gamma: Ratio of specific heats behind the shock $\gamma$ [-].
    """
    xp = namespace(time_since_detonation, charge_mass, air_density, sedov_gamma)
    missing = xp.isnan(time_since_detonation)
    time = xp.where(missing, 1.0, time_since_detonation)
    earliest = EARLIEST_TIME * xp.cbrt(charge_mass)
    early = time < earliest
    # Two guards: the divisor must not be zero in the branch that is not used either,
    # because its gradient would be NaN.
    before = earliest**2 / xp.where(early, 2.0 * earliest - time, 1.0)
    time = xp.where(early, before, time)
    energy = TNT_SPECIFIC_ENERGY * charge_mass
    radius = (energy / (sedov_alpha(sedov_gamma) * air_density)) ** 0.2 * time**0.4
    return xp.where(missing, np.nan, radius)


@checked
def sedov_taylor_shock_pressure(
    slant_range: Number,
    charge_mass: Number,
    sedov_gamma: Number,
) -> Numbers:
    r"""Return the pressure behind the shock of a point source [Pa].

    $$p_s = \frac{2\rho_0 U^2}{\gamma+1} = \frac{8E}{25\,(\gamma+1)\,\alpha R^3},
    \qquad U = \frac{2R}{5t}$$

    Args:
        slant_range: Radius of the shock $R$ [m].
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg].
        sedov_gamma: Ratio of specific heats behind the shock $\gamma$ [-].
    """
    density = 8.0 * TNT_SPECIFIC_ENERGY / 25.0 * charge_mass / slant_range**3
    return density / ((sedov_gamma + 1.0) * sedov_alpha(sedov_gamma))


def sedov_taylor_valid(
    time_since_detonation: Number,
    charge_mass: Number,
    air_density: Number,
    sedov_gamma: Number,
    ambient_pressure: Number,
) -> Any:
    r"""Return True for a strong shock, $p_s \ge 25 P_0$, and a time after $t_e$."""
    xp = namespace(time_since_detonation, charge_mass)
    time = xp.where(xp.isnan(time_since_detonation), -1.0, time_since_detonation)
    radius = sedov_taylor_shock_radius(time, charge_mass, air_density, sedov_gamma)
    pressure = sedov_taylor_shock_pressure(radius, charge_mass, sedov_gamma)
    begun = time >= EARLIEST_TIME * xp.cbrt(charge_mass)
    computed = (sedov_gamma >= GAMMAS[0]) & (sedov_gamma <= GAMMAS[1])
    return begun & computed & (pressure >= STRONG_SHOCK * ambient_pressure)


@checked
def sedov_alpha(sedov_gamma: Number) -> Numbers:
    r"""Return $\alpha$ of a spherical point explosion, $E = \alpha\rho_0 R^5/t^2$ [-].

    Kinetic and internal energy behind the shock add up to

    $$\alpha = \frac{32\pi}{25(\gamma^2-1)} \int_0^1 \left[
    \frac{\rho}{\rho_s}\frac{u^2}{u_s^2} + \frac{p}{p_s}\right]\lambda^2 d\lambda$$

    In $x = x_2$ the bracket is analytic, and $\lambda^2 d\lambda$ is $x^{k-1} dx$ times
    an analytic function, $k = 3(\gamma-1)/(2\gamma+1)$. The analytic part is expanded
    in Legendre polynomials of $2x-1$, and $x^{k-1}$ times each is integrated exactly.

    Args:
        sedov_gamma: Ratio of specific heats $\gamma$ [-], above 1 and below 2 (where
            two exponents of the closed form are infinite).
    """
    xp = namespace(sedov_gamma)
    return xp.exp(ALPHA(xp.log(sedov_gamma - 1.0)))


def _log_alpha(log_excess: Numbers) -> Numbers:
    r"""Return $\ln\alpha$ of $\ln(\gamma - 1)$."""
    xp = namespace(log_excess)
    # Nodes on (0, 1), and the matrix from values there to Legendre coefficients.
    points, weights = np.polynomial.legendre.leggauss(NODES)
    values = np.polynomial.legendre.legvander(points, NODES - 1).T
    projection = (np.arange(NODES)[:, None] + 0.5) * values * weights
    gamma = 1.0 + xp.exp(log_excess)[..., None]
    points, projection = points.astype(gamma.dtype), projection.astype(gamma.dtype)
    k = 3.0 * (gamma - 1.0) / (2.0 * gamma + 1.0)
    nodes = xp.broadcast_to((points + 1.0) / 2.0, (*gamma.shape[:-1], NODES))
    part = _analytic_part(nodes, gamma)
    coefficients = part @ xp.asarray(projection.T)
    # The integral of x^(k-1) P_n is (-1)^n/k times the product of (j-k)/(j+k), j to n.
    j = xp.broadcast_to(
        np.arange(1.0, NODES).astype(gamma.dtype), (*gamma.shape[:-1], NODES - 1)
    )
    products = (-1.0) ** j * xp.cumprod((j - k) / (j + k), axis=-1)
    moments = coefficients[..., :1] + (products * coefficients[..., 1:]).sum(
        -1, keepdims=True
    )
    factor = 32.0 * math.pi / (25.0 * (gamma**2 - 1.0)) / k
    return xp.log(factor * moments)[..., 0]


def _analytic_part(x2: Numbers, gamma: Numbers) -> Numbers:
    r"""Return the energy density times $\lambda^2 d\lambda/dx_2$, over $x_2^{k-1}$.

    The density has the factor $x_2^{a_3}$ and $u^2$ the factor $x_2^{-2a_2}$: together
    exactly $x_2$. The powers of $x_1$ cancel, which leaves

    $$(x_2 + x_4)\,x_4^{a_5}\,x_3^{a_4-5a_1}\,\frac{d\ln\lambda}{d\ln x_2}$$
    """
    xp = namespace(gamma)
    minus_a2 = (gamma - 1.0) / (2.0 * gamma + 1.0)
    a1 = (6.0 * (2.0 - gamma) / 5.0 + 5.0 * gamma * minus_a2) / (3.0 * gamma - 1.0)
    a4 = 5.0 * a1 / (2.0 - gamma)
    a5 = -2.0 / (2.0 - gamma)
    b = (gamma + 1.0) / (gamma - 1.0)
    e = (3.0 * gamma - 1.0) / 2.0

    v = 0.4 * (1.0 + x2 / b) / gamma
    x3 = 5.0 * (gamma + 1.0) / (7.0 - gamma) * (1.0 - e * v)
    x4 = b * (1.0 - 2.5 * v)
    dv = 0.4 / (b * gamma)  # dV/dx2
    slope = minus_a2 + x2 * dv * (-0.4 / v + a1 * e / (1.0 - e * v))
    powers = a5 * xp.log(x4) + (a4 - 5.0 * a1) * xp.log(x3)
    return (x2 + x4) * xp.exp(powers) * slope


ALPHA = Curve(_log_alpha, GAMMAS[0] - 1.0, GAMMAS[1] - 1.0, cheap=True)
r"""$\ln\alpha$ of $\ln(\gamma - 1)$."""


register(
    Law(
        quantity="shock_radius_m",
        name="sedov_taylor",
        title="Sedov-Taylor",
        function=sedov_taylor_shock_radius,
        range="overpressure >= 25 ambient pressures; source small and light against "
        "the air swept up (nuclear)",
        source="Taylor 1950; Sedov 1946",
        valid=sedov_taylor_valid,
        # What photographs show is the luminous front, near the shock but not it, and
        # no shock is a perfect sphere: 1 % shared by the shot, 1 % each photograph.
        scatter=declared_scatter(shot=0.01, record=0.01),
        scatter_source="declared (luminous front for shock front)",
    )
)
