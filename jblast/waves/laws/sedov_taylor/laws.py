r"""The strong shock of a point source in cold air of uniform density.

$$E = \alpha(\gamma)\,\rho_0 R^5/t^2$$

Taylor (1950), Proc. R. Soc. A 201:159; Sedov (1946). It forgets the ambient pressure,
so it holds while the shock is strong, and the charge, so it holds for what is small
and light: a nuclear burst. A chemical charge has hardly swept up its own mass of air
(0.58 m/kg^(1/3)) when the shock stops being strong (0.64 m/kg^(1/3)).
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.laws.sedov_taylor.alpha import GAMMAS, sedov_alpha

STRONG_SHOCK = 25.0
"""Least overpressure over ambient pressure.

The pressure is 10 % off at 21 to 26 atm already (exact point-source solution).
"""

EARLIEST_TIME = 1e-7
"""Time before which the radius is a continuation only [s/kg^(1/3)].

The shock has gone 0.033 m/kg^(1/3) by then: less than the radius of a TNT charge,
0.053, and a third of the time of the first Trinity photograph.
"""


@checked
def sedov_taylor_energy(
    shock_radius: Float[ArrayLike, "..."],
    time_since_detonation: Float[ArrayLike, "..."],
    air_density: Float[ArrayLike, "..."],
    sedov_gamma: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the energy of a point source from one radius and time [J].

    $$E = \alpha(\gamma)\,\rho_0 R^5/t^2$$

    Args:
        shock_radius: Radius $R$ [m].
        time_since_detonation: Time $t$ [s], positive.
        air_density: Density ahead of the shock $\rho_0$ [kg/m3].
        sedov_gamma: Ratio of specific heats behind the shock $\gamma$ [-].
    """
    radius, time, density = as_float_arrays(
        shock_radius, time_since_detonation, air_density
    )
    return sedov_alpha(sedov_gamma) * density * radius**5 / time**2


@checked
def sedov_taylor_shock_radius(
    time_since_detonation: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    air_density: Float[ArrayLike, "..."],
    sedov_gamma: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the radius of the shock of a point source [m].

    $$R = \left(\frac{E\,t^2}{\alpha(\gamma)\,\rho_0}\right)^{1/5}$$

    A fit may move its origin time past the time of a photograph, where $t^{2/5}$ has
    no value, and no slope at zero. Before $t_e = 10^{-7}\,W^{1/3}$ s the law is
    therefore continued with $t_e^2/(2t_e - t)$ for $t$: equal to $t$ in value and slope
    at $t_e$, positive and rising for all $t$, so ln R stays finite and its slope says
    which way to go. Such rows are marked invalid. A missing time (NaN) gives NaN, and
    no gradient, so a row that is masked out spoils no other.

    Args:
        time_since_detonation: Time $t$ [s].
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg, $W$ [kg].
        air_density: Density ahead of the shock $\rho_0$ [kg/m3].
        sedov_gamma: Ratio of specific heats behind the shock $\gamma$ [-].
    """
    time, mass, density = as_float_arrays(
        time_since_detonation, charge_mass, air_density
    )
    missing = jnp.isnan(time)
    time = _continued_time(jnp.where(missing, 1.0, time), mass)
    energy = TNT_SPECIFIC_ENERGY * mass
    radius = (energy / (sedov_alpha(sedov_gamma) * density)) ** 0.2 * time**0.4
    return jnp.where(missing, jnp.nan, radius)


@checked
def sedov_taylor_shock_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    sedov_gamma: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the pressure behind the shock of a point source [Pa].

    $$p_s = \frac{2\rho_0 U^2}{\gamma+1} = \frac{8E}{25\,(\gamma+1)\,\alpha R^3},
    \qquad U = \frac{2R}{5t}$$

    Args:
        slant_range: Radius of the shock $R$ [m].
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg].
        sedov_gamma: Ratio of specific heats behind the shock $\gamma$ [-].
    """
    radius, mass, gamma = as_float_arrays(slant_range, charge_mass, sedov_gamma)
    energy = TNT_SPECIFIC_ENERGY * mass
    return 8.0 * energy / (25.0 * (gamma + 1.0) * sedov_alpha(gamma) * radius**3)


def sedov_taylor_valid(
    time_since_detonation: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    air_density: Float[ArrayLike, "..."],
    sedov_gamma: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."],
) -> Bool[Array, "..."]:
    r"""Return where the shock is strong, $p_s \ge 25 P_0$, and the time after $t_e$."""
    time, mass, ambient = as_float_arrays(
        time_since_detonation, charge_mass, ambient_pressure
    )
    radius = sedov_taylor_shock_radius(time, mass, air_density, sedov_gamma)
    pressure = sedov_taylor_shock_pressure(radius, mass, sedov_gamma)
    begun = time >= EARLIEST_TIME * jnp.cbrt(mass)
    gamma = as_float_array(sedov_gamma)
    computed = (gamma >= GAMMAS[0]) & (gamma <= GAMMAS[1])
    return begun & computed & (pressure >= STRONG_SHOCK * ambient)


def _continued_time(time, mass):
    """Time itself after `EARLIEST_TIME`, its positive continuation before."""
    earliest = EARLIEST_TIME * jnp.cbrt(mass)
    early = time < earliest
    # Twice guarded: where the branch is not taken its divisor must not be zero either.
    before = earliest**2 / jnp.where(early, 2.0 * earliest - time, 1.0)
    return jnp.where(early, before, time)


register(
    Law(
        quantity="shock_radius_m",
        name="sedov_taylor",
        function=sedov_taylor_shock_radius,
        range="overpressure >= 25 ambient pressures; source small and light against "
        "the air swept up (nuclear)",
        source="Taylor 1950; Sedov 1946",
        valid=sedov_taylor_valid,
        # What photographs show is the luminous front, near the shock but not it, and
        # no shock is a perfect sphere: 1 % shared by the shot, 1 % each photograph.
        scatter=declared_scatter(shot=0.01, record=0.01),
        scatter_source="declared (luminous front for shock front)",
        joins=(EARLIEST_TIME,),
    )
)
