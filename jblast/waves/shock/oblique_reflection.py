r"""Peak pressure on a face that the front meets at an angle.

Between the reflected pressure $p_r$ of a face turned to the charge ($\alpha$ = 0) and
the incident $p_{so}$ of a face that the front sweeps along (90 degrees), two forms are
in use. ARL-TR-1310 prints, and LS-DYNA documents,

$$p = p_r \cos^2\alpha + p_{so}\,(1 + \cos^2\alpha - 2\cos\alpha)$$

while a port of ConWep and OpenRadioss compute

$$p = p_r \cos^2\alpha + p_{so}\,(1 + \cos\alpha - 2\cos^2\alpha)$$

and call the print a misprint (OpenRadioss, pull request 1134). They agree at 0 and 90
degrees and differ by $3 p_{so}\cos\alpha\,(1 - \cos\alpha)$: 0.75 $p_{so}$ at 60.

We take the second. The printed form falls below the incident pressure: for
$\cos\alpha < 2/(1 + p_r/p_{so})$, down to $p_{so}\,p_r/(p_r + p_{so})$ at
$\cos\alpha = p_{so}/(p_r + p_{so})$. For a weak shock ($p_r = 2 p_{so}$) that is 0.667
$p_{so}$ at 70.5 degrees, and less than $p_{so}$ from 48.2 on; for the strongest
($p_r = 8 p_{so}$) 0.889 at 83.6, from 77.2 on. No wall does that. The second rises from
grazing to normal for every $p_r \ge 2 p_{so}$, in the weak limit as
$p_{so}(1 + \cos\alpha)$.

Neither knows the Mach stem, which past some 40 degrees can exceed both.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_arrays
from jblast.waves.arguments import checked


@checked
def oblique_reflected_pressure(
    peak_overpressure: Float[ArrayLike, "..."],
    reflected_pressure: Float[ArrayLike, "..."],
    incidence_angle: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the peak overpressure on a face at an angle [Pa].

    $$p = p_r \cos^2\alpha + p_{so}\,(1 + \cos\alpha - 2\cos^2\alpha)$$

    Args:
        peak_overpressure: Incident $p_{so}$ [Pa], positive.
        reflected_pressure: On a face turned to the charge $p_r$ [Pa], positive.
        incidence_angle: Between the face's normal and the way to the charge $\alpha$
            [rad], 0 to pi/2.
    """
    incident, reflected, angle = as_float_arrays(
        peak_overpressure, reflected_pressure, incidence_angle
    )
    cos = jnp.cos(angle)
    # 1 + cos - 2 cos^2, without the cancellation near normal incidence
    return reflected * cos**2 + incident * (1.0 - cos) * (1.0 + 2.0 * cos)


@checked
def oblique_reflected_pressure_arl(
    peak_overpressure: Float[ArrayLike, "..."],
    reflected_pressure: Float[ArrayLike, "..."],
    incidence_angle: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the same by the form ARL-TR-1310 prints, for comparison [Pa].

    $$p = p_r \cos^2\alpha + p_{so}\,(1 + \cos^2\alpha - 2\cos\alpha)$$

    Args:
        peak_overpressure: Incident $p_{so}$ [Pa], positive.
        reflected_pressure: On a face turned to the charge $p_r$ [Pa], positive.
        incidence_angle: Between the face's normal and the way to the charge $\alpha$
            [rad], 0 to pi/2.
    """
    incident, reflected, angle = as_float_arrays(
        peak_overpressure, reflected_pressure, incidence_angle
    )
    cos = jnp.cos(angle)
    return reflected * cos**2 + incident * (1.0 - cos) ** 2
