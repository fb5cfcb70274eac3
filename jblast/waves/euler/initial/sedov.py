r"""The point source, taken up while its shock is strong: Sedov's solution in cells.

The closed form of `laws/sedov_taylor/alpha.py` in the parameter $x = x_2$. The label of
what is at $\lambda = r/R$ follows without an integral, for the mass inside a similarity
surface grows with $R^3$ by what the surface overtakes,

$$\left(\frac aR\right)^3 = \lambda^2\,\frac{\gamma+1}{\gamma-1}\,
\frac{\rho}{\rho_s}\left(\lambda - \frac{2}{\gamma+1}\frac{u}{u_s}\right)$$

so the faces are found by Newton's method from their labels, and momentum and energy of
the cells by Gauss's quadrature in $x^k$, $k = 3(\gamma-1)/(2\gamma+1)$, in which the
centre is smooth.

Sedov's air is cold. Adding the ambient pressure everywhere gives the whole the energy
$E$ and that of the air swept up, exactly; what is left of the ambient pressure's effect
on the profile is of the order of $P_0/p_s$ at the start and fades.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.types import as_float_array
from jblast.waves.euler.mesh import GradedMesh
from jblast.waves.euler.state import Ambient, Flow, FlowState
from jblast.waves.laws.sedov_taylor.alpha import sedov_alpha

FEWEST_CELLS = 20
"""With fewer the shocked layer, a sixth of the radius in labels, has no profile."""
STRONG_START = 300.0
"""Least pressure over ambient at the start, for an error of the order of 1/300."""
START_FRACTION = 0.02
"""Usual radius of the start over $(E/P_0)^{1/3}$: 20,000 ambient pressures."""
NEWTON_STEPS = 30
QUADRATURE = 8


def start_sedov(
    energy: Float[ArrayLike, ""],
    ambient: Ambient,
    radius: Float[ArrayLike, ""],
    *,
    cells: int,
    length: Float[ArrayLike, ""] | None = None,
    limited: bool = True,
) -> tuple[Flow, FlowState]:
    r"""Return a point source whose shock has come to a radius.

    Args:
        energy: $E$ [J].
        ambient: The air around.
        radius: Of the shock [m]; the time is Sedov's.
        cells: How many.
        length: Over which the mesh is graded far out [m]; $(E/P_0)^{1/3}$ if not given.
        limited: Whether slopes are limited.

    Raises:
        InputError: There are too few cells to hold the source, or the shock is not
            strong any more at that radius.
    """
    energy, radius = as_float_array(energy), as_float_array(radius)
    if cells < FEWEST_CELLS:
        raise InputError(
            f"cells: expected at least {FEWEST_CELLS} to hold a point source, "
            f"got {cells}"
        )
    gamma = ambient.gas.gamma
    alpha = sedov_alpha(gamma)
    # t and U of R = (E t^2/(alpha rho))^(1/5)
    time = jnp.sqrt(alpha * ambient.density * radius**5 / energy)
    speed = 0.4 * radius / time
    pressure = 2.0 * ambient.density * speed**2 / (gamma + 1.0)
    _refuse_weak(pressure, ambient.pressure, radius)
    if length is None:
        length = jax.lax.stop_gradient(jnp.cbrt(energy / ambient.pressure))
    mesh = GradedMesh(
        label=jnp.zeros_like(radius),
        length=as_float_array(length),
        density=ambient.density,
        cells=cells,
    )
    place, volume, momentum, energies = sedov_cells(mesh.labels(radius) / radius, gamma)
    velocity = 2.0 * speed / (gamma + 1.0)
    density = ambient.density * (gamma + 1.0) / (gamma - 1.0)
    volume = volume * radius**3
    hot = energies * (0.5 * density * velocity**2 * radius**3)
    cold = ambient.gas.energy(ambient.density, ambient.pressure) * volume
    state = FlowState(
        radius=place * radius,
        mass=mesh.masses(radius),
        volume=volume,
        momentum=momentum * (density * velocity * radius**3),
        energy=hot + cold,
        clock=radius,
        time=time,
        alive=jnp.isfinite(radius),
    )
    return Flow(mesh, ambient.gas, ambient, "spherical", limited), state


def _refuse_weak(pressure, ambient_pressure, radius) -> None:
    values = (pressure, ambient_pressure, radius)
    if any(isinstance(value, Tracer) for value in values):
        return
    strength = np.asarray(pressure / ambient_pressure)
    if not np.all(strength >= STRONG_START):
        raise InputError(
            f"radius: expected a shock of at least {STRONG_START:g} ambient pressures "
            f"at the start, got {strength.min():.3g} at {np.max(radius):g} m; start "
            "nearer to the source"
        )


def sedov_cells(
    labels: Float[Array, " face"], gamma: Float[Array, ""]
) -> tuple[
    Float[Array, " face"],
    Float[Array, " cell"],
    Float[Array, " cell"],
    Float[Array, " cell"],
]:
    r"""Return faces, and volumes, momenta and energies in cells, in units of the shock.

    Args:
        labels: Of the faces over the radius of the shock, from 0 to 1.
        gamma: Ratio of specific heats $\gamma$ [-].

    Returns:
        $r/R$; $V/R^3$; momentum over $\rho_s u_s R^3$; energy over
        $\tfrac12\rho_s u_s^2 R^3$ (behind the shock kinetic and internal energy are
        equal).
    """
    k = 3.0 * (gamma - 1.0) / (2.0 * gamma + 1.0)
    log_x = _parameter_at(3.0 * jnp.log(labels[1:-1]), gamma)
    inner = _profile(log_x, gamma)[0]
    place = jnp.concatenate([labels[:1], inner, labels[-1:]])
    ends = jnp.concatenate([labels[:1], jnp.exp(k * log_x), labels[-1:]])
    nodes, weights = (
        jnp.asarray(array, labels.dtype)
        for array in np.polynomial.legendre.leggauss(QUADRATURE)
    )
    width = jnp.diff(ends)[:, None] / 2.0
    power = ends[:-1, None] + width * (nodes[None, :] + 1.0)
    place_at, velocity, density, pressure, stretch = _profile(jnp.log(power) / k, gamma)
    shell = place_at**3 * stretch / (k * power) * width * weights[None, :]
    momentum = jnp.sum(density * velocity * shell, axis=1)
    energy = jnp.sum((density * velocity**2 + pressure) * shell, axis=1)
    volume = jnp.diff(place**3) / 3.0
    return place, volume, momentum, energy


def _profile(log_x, gamma):
    r"""Return $\lambda$, $u/u_s$, $\rho/\rho_s$, $p/p_s$, $d\ln\lambda/d\ln x$."""
    minus_a2 = (gamma - 1.0) / (2.0 * gamma + 1.0)
    e = (3.0 * gamma - 1.0) / 2.0
    a1 = (6.0 * (2.0 - gamma) / 5.0 + 5.0 * gamma * minus_a2) / (2.0 * e)
    a3, a4 = 3.0 / (2.0 * gamma + 1.0), 5.0 * a1 / (2.0 - gamma)
    a5 = -2.0 / (2.0 - gamma)
    b = (gamma + 1.0) / (gamma - 1.0)
    x = jnp.exp(log_x)
    v = 0.4 * (1.0 + x / b) / gamma
    x1 = 1.25 * (gamma + 1.0) * v
    log_x1 = jnp.log(x1)
    log_x3 = jnp.log(5.0 * (gamma + 1.0) / (7.0 - gamma) * (1.0 - e * v))
    log_x4 = jnp.log(b * (1.0 - 2.5 * v))
    place = jnp.exp(-0.4 * log_x1 + minus_a2 * log_x - a1 * log_x3)
    density = jnp.exp(a3 * log_x + a4 * log_x3 + a5 * log_x4)
    pressure = jnp.exp(1.2 * log_x1 + (a4 - 2.0 * a1) * log_x3 + (1.0 + a5) * log_x4)
    dv = 0.4 * x / (b * gamma)  # dV/d ln x
    stretch = minus_a2 + dv * (-0.4 / v + a1 * e / (1.0 - e * v))
    return place, x1 * place, density, pressure, stretch


def _log_mass(log_x, gamma):
    r"""Return $3\ln(a/R)$."""
    place, velocity, density, _, _ = _profile(log_x, gamma)
    behind = place - 2.0 / (gamma + 1.0) * velocity
    b = (gamma + 1.0) / (gamma - 1.0)
    return 2.0 * jnp.log(place) + jnp.log(b * density * behind)


def _parameter_at(log_mass, gamma):
    r"""Return $\ln x$ where $3\ln(a/R)$ has given values.

    Near the centre the two are in proportion, with $k + a_3$ as slope.
    """
    slope = 3.0 * gamma / (2.0 * gamma + 1.0)
    deep = jnp.full_like(gamma, -20.0 * math.log(10.0))
    offset = _log_mass(deep, gamma) - slope * deep
    log_x = jnp.minimum((log_mass - offset) / slope, 0.0)
    along = jnp.ones_like(log_x)

    def closer(_, log_x):
        value, rise = jax.jvp(lambda y: _log_mass(y, gamma), (log_x,), (along,))
        return jnp.minimum(log_x - (value - log_mass) / rise, 0.0)

    return jax.lax.fori_loop(0, NEWTON_STEPS, closer, log_x)
