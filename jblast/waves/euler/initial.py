r"""Initial flows: Sedov's point source, a released sphere, a tube, a simple wave.

The point source starts while its shock is strong, with Sedov's solution in cells: the
closed form of `laws/sedov_taylor.py` in the parameter $x = x_2$. The label of the gas
at $\lambda = r/R$ follows without an integral, for the mass inside a similarity surface
grows with $R^3$ by what the surface overtakes,

$$\left(\frac aR\right)^3 = \lambda^2\,\frac{\gamma+1}{\gamma-1}\,
\frac{\rho}{\rho_s}\left(\lambda - \frac{2}{\gamma+1}\frac{u}{u_s}\right)$$

so the faces are found by Newton's method from their labels, and momentum and energy of
the cells by Gauss's quadrature in $x^k$, $k = 3(\gamma-1)/(2\gamma+1)$, in which the
centre is smooth.

Sedov's air is cold. Adding the ambient pressure everywhere gives the whole the energy
$E$ and that of the air swept up, exactly. The remaining effect of the ambient pressure
on the profile is of the order of $P_0/p_s$ at the start and decays.

A sphere of compressed gas is released with a shock that is fitted from the beginning.
When its wall vanishes, the surface of the sphere is a Riemann problem, with the contact
at $u^*$ and a shock ahead of it. The start is slightly later: a thin shell of air in
that state, with all the cells of the air, lies between contact and shock. The sphere
has separate cells of fixed mass. The outermost of them has given the shell its energy
and momentum.

A straight tube with rigid ends contains Sod's initial values or any profile given by
its cells. One such profile is an exact wave that steepens, a smooth flow that measures
the order of the scheme. A wave running to the right into gas at rest has constant
velocity on straight paths, with $c = c_0 + \frac{\gamma-1}{2}u$ (Riemann 1860; Whitham
1974, section 6.8),

$$u(x,t) = u_0\big(x - (u+c)\,t\big), \quad \rho = \rho_0 (c/c_0)^{2/(\gamma-1)}, \quad
p = p_0 (c/c_0)^{2\gamma/(\gamma-1)}$$

until paths meet. Here $u_0 = A\cos^4(\pi x/2)$ within $|x| < 1$, with three continuous
derivatives.

Riemann's problem in an ideal gas is solved exactly: it starts the sphere, and is the
reference of the tube. Toro (2009), *Riemann Solvers and Numerical Methods for Fluid
Dynamics*, chapter 4. At a pressure $p$ the velocity of each side changes by (eqs. 4.6,
4.7)

$$f(p) = (p-p_k)\sqrt{\frac{A_k}{p+B_k}} \;\; (p>p_k), \qquad
f(p) = \frac{2c_k}{\gamma-1}\left[\left(\frac{p}{p_k}\right)^{\frac{\gamma-1}{2\gamma}}
- 1\right] \;\; (p\le p_k)$$

with $A = 2/((\gamma+1)\rho)$ and $B = p_k(\gamma-1)/(\gamma+1)$; $p^*$ solves
$f_l + f_r + u_r - u_l = 0$ (eq. 4.5).
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.types import as_float_array
from jblast.waves.euler.state import (
    Ambient,
    Flow,
    FlowState,
    Gas,
    GradedMesh,
    IdealGas,
    Primitives,
    SlidingMesh,
)
from jblast.waves.euler.step import sound_speed
from jblast.waves.laws.sedov_taylor import sedov_alpha

# With fewer cells the shocked layer, a sixth of the radius in labels, is not resolved.
FEWEST_SEDOV_CELLS = 20
"""Smallest number of cells of a point source."""
# Sedov's solution neglects the ambient pressure: an error of the order of 1/300.
STRONG_START = 300.0
"""Smallest ratio of shock pressure to ambient pressure at the start."""
START_FRACTION = 0.02
"""Default radius of the start over $(E/P_0)^{1/3}$: 20,000 ambient pressures."""
# Near the root each step squares the error; the first ones approach from far starts.
NEWTON_STEPS = 30
# Gauss points of a cell: exact to degree 15, as profiles are smooth in the chosen
# parameter.
QUADRATURE = 8
# With fewer cells neither the fan nor the air behind the shock is resolved.
FEWEST_SPHERE_CELLS = 10
"""Smallest number of cells in the sphere, and in the air."""
# Small against a cell, so that curvature does not yet matter; the shell must not be
# empty, since all cells of the air lie in it.
SHELL = 0.25
"""Distance of the shock from the sphere at the start, in cells of the sphere."""
SOD_LEFT = (1.0, 0.0, 1.0)
SOD_RIGHT = (0.125, 0.0, 0.1)
"""Density, velocity, pressure; G. A. Sod (1978), J. Comput. Phys. 27:1."""
# The first paths meet at t = 4.1; a larger amplitude steepens earlier.
WAVE_AMPLITUDE = 0.1
"""Amplitude of the velocity of the simple wave, in speeds of sound."""
# The ratio of diatomic air; the closed form of the wave holds for any.
WAVE_GAMMA = 1.4
# The wave does not reach the ends before t = 3.
WAVE_REACH = (-2.0, 4.0)
"""Ends of the tube of the simple wave."""
# Each step reduces the error to t/4.1 of it: by half at t = 2, to 1e-18 in the end.
FIXED_POINT_STEPS = 60
"""Iterations for the velocity of the simple wave."""
# The function is concave and rising, so that Newton from below converges; in ln p it
# does so for any ratio of pressures.
RIEMANN_NEWTON_STEPS = 30
"""Newton steps for the pressure at the contact."""
# Gauss points of a cell of the smooth wave: exact to degree 11, far above its order.
MEAN_QUADRATURE = 6


def start_sedov(
    energy: Float[ArrayLike, ""],
    ambient: Ambient,
    radius: Float[ArrayLike, ""],
    *,
    cells: int,
    length: Float[ArrayLike, ""] | None = None,
    limited: bool = True,
) -> tuple[Flow, FlowState]:
    r"""Return the flow of a point source when its shock is at a radius.

    Args:
        energy: $E$ [J].
        ambient: Ambient air.
        radius: Radius of the shock [m]; the time is Sedov's.
        cells: Number of cells.
        length: Length over which the mesh is graded [m]; by default $(E/P_0)^{1/3}$.
        limited: True for limited slopes.

    Raises:
        InputError: There are too few cells to resolve the source, or the shock is no
            longer strong at that radius.
    """
    energy, radius = as_float_array(energy), as_float_array(radius)
    if cells < FEWEST_SEDOV_CELLS:
        raise InputError(
            f"cells: expected at least {FEWEST_SEDOV_CELLS} to resolve a point source, "
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
        # The spacing of the mesh is no property of the flow: it has no derivative.
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
    r"""Return faces, and volumes, momenta and energies of cells, in units of the shock.

    Args:
        labels: Labels of the faces over the radius of the shock, from 0 to 1.
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
    # quadrature in x^k, in which the profile is smooth at the centre
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
    # at x = 1e-20 the proportion is exact to rounding: it gives the constant
    deep = jnp.full_like(gamma, -20.0 * math.log(10.0))
    offset = _log_mass(deep, gamma) - slope * deep
    log_x = jnp.minimum((log_mass - offset) / slope, 0.0)
    along = jnp.ones_like(log_x)

    def closer(_, log_x):
        value, rise = jax.jvp(lambda y: _log_mass(y, gamma), (log_x,), (along,))
        # x = 1 is the shock: a step beyond it would leave the domain of the logarithms
        return jnp.minimum(log_x - (value - log_mass) / rise, 0.0)

    return jax.lax.fori_loop(0, NEWTON_STEPS, closer, log_x)


def start_sphere(
    radius: Float[ArrayLike, ""],
    pressure: Float[ArrayLike, ""],
    density: Float[ArrayLike, ""],
    ambient: Ambient,
    *,
    core_cells: int,
    air_cells: int,
    length: Float[ArrayLike, ""] | None = None,
) -> tuple[Flow, FlowState]:
    r"""Return a sphere of compressed ambient gas shortly after its release from rest.

    Args:
        radius: Radius of the sphere [m].
        pressure: Pressure in the sphere [Pa], above the ambient one.
        density: Density in the sphere [kg/m3].
        ambient: Ambient air.
        core_cells: Cells in the sphere.
        air_cells: Cells in the air behind the shock.
        length: Length over which the mesh of the air is graded [m]; by default
            $\sqrt[3]{E/P_0}$ with the energy of the sphere.

    Raises:
        InputError: There are too few cells to resolve the source, or the pressure is
            not above the ambient one.
    """
    for name, cells in (("core_cells", core_cells), ("air_cells", air_cells)):
        if cells < FEWEST_SPHERE_CELLS:
            raise InputError(
                f"{name}: expected at least {FEWEST_SPHERE_CELLS} to resolve the "
                f"source, got {cells}"
            )
    radius, pressure, density = map(as_float_array, (radius, pressure, density))
    _refuse_low(pressure, ambient.pressure)
    gas: IdealGas = ambient.gas
    still = jnp.zeros_like(radius)
    inside = Primitives(density, still, pressure)
    outside = Primitives(ambient.density, still, ambient.pressure)
    star, contact_speed = star_state(inside, outside, gas)
    gamma = gas.gamma
    mach_square = 1.0 + (gamma + 1.0) / (2.0 * gamma) * (star / ambient.pressure - 1.0)
    speed = sound_speed(ambient) * jnp.sqrt(mach_square)

    reach = SHELL * radius / core_cells
    time = reach / speed
    contact = radius + contact_speed * time
    if length is None:
        work = (4.0 * jnp.pi / 3.0) * radius**3 * (pressure - ambient.pressure)
        length = jnp.cbrt(work / ((gamma - 1.0) * ambient.pressure))
    mesh = GradedMesh(
        label=radius,
        # the spacing of the mesh is no property of the flow: it has no derivative
        length=jax.lax.stop_gradient(as_float_array(length)),
        density=ambient.density,
        cells=air_cells,
        core=core_cells,
    )
    clock = radius + reach
    # The shell: labels from the sphere's surface to the shock, squeezed by the jump.
    air_mass = mesh.masses(clock)
    swept = jnp.cumsum(air_mass) / jnp.sum(air_mass)
    shell = (clock**3 - contact**3) / 3.0
    outer = jnp.cbrt(contact**3 + 3.0 * shell * swept[:-1])
    faces = radius * jnp.arange(core_cells, dtype=radius.dtype) / core_cells
    place = jnp.concatenate([faces, contact[None], outer, clock[None]])
    volume = jnp.diff(place**3) / 3.0
    original = jnp.concatenate([faces, radius[None]])
    core_volume = jnp.diff(original**3) / 3.0
    core_energy = gas.energy(density, pressure) * core_volume

    air_volume = volume[core_cells:]
    air_energy = (
        gas.energy(ambient.density, star) * air_volume
        + 0.5 * contact_speed**2 * air_mass
    )
    cold = gas.energy(ambient.density, ambient.pressure) * (clock**3 - radius**3) / 3.0
    # the shell takes its energy and momentum from the outermost cell of the sphere,
    # so that the total is conserved to rounding
    given = jnp.sum(air_energy) - cold
    pushed = (pressure - star) * radius**2 * time
    state = FlowState(
        radius=place,
        mass=jnp.concatenate([density * core_volume, air_mass]),
        volume=volume,
        momentum=jnp.concatenate(
            [
                jnp.zeros(core_cells - 1, radius.dtype),
                pushed[None],
                air_mass * contact_speed,
            ]
        ),
        energy=jnp.concatenate(
            [core_energy[:-1], (core_energy[-1] - given)[None], air_energy]
        ),
        clock=clock,
        time=time,
        alive=jnp.isfinite(radius),
    )
    return Flow(mesh, gas, ambient), state


def _refuse_low(pressure, ambient_pressure) -> None:
    values = (pressure, ambient_pressure)
    if any(isinstance(value, Tracer) for value in values):
        return
    if not bool(jnp.all(pressure > ambient_pressure)):
        raise InputError(
            f"pressure: expected more than the ambient {float(ambient_pressure):g} Pa, "
            f"got {float(pressure):g} Pa"
        )


def start_tube(
    faces: Float[Array, " face"],
    cells: Primitives,
    gas: Gas,
    *,
    rate: Float[Array, " face"] | None = None,
    limited: bool = True,
) -> tuple[Flow, FlowState]:
    """Return a tube with given means of its cells.

    Args:
        faces: Positions of the faces, ascending [m].
        cells: Means of the cells: density, momentum over mass, and the pressure of the
            mean internal energy.
        gas: Gas of all cells.
        rate: Mass that each face overtakes [kg/s]; by default zero.
        limited: True for limited slopes.

    Raises:
        InputError: There are fewer than three cells.
    """
    if faces.shape[0] < 4:
        raise InputError(f"faces: expected at least 4, got {faces.shape[0]}")
    volume = jnp.diff(faces)
    internal = gas.energy(cells.density, cells.pressure)
    mass = cells.density * volume
    state = FlowState(
        radius=faces,
        mass=mass,
        volume=volume,
        momentum=mass * cells.velocity,
        energy=internal * volume + 0.5 * mass * cells.velocity**2,
        clock=jnp.zeros_like(faces[0]),
        time=jnp.zeros_like(faces[0]),
        alive=jnp.isfinite(faces[0]),
    )
    mesh = SlidingMesh(jnp.zeros_like(faces) if rate is None else rate)
    return Flow(mesh, gas, None, "planar", limited), state


def start_sod(
    cells: int, length: Float[ArrayLike, ""] = 1.0, *, limited: bool = True
) -> tuple[Flow, FlowState]:
    """Return Sod's shock tube with the diaphragm in the middle.

    Args:
        cells: Number of cells, even.
        length: Length of the tube [m].
        limited: True for limited slopes.

    Raises:
        InputError: The number of cells is odd: the diaphragm would be inside a cell.
    """
    if cells % 2:
        raise InputError(f"cells: expected an even number, got {cells}")
    length = as_float_array(length)
    faces = length * jnp.linspace(-0.5, 0.5, cells + 1, dtype=length.dtype)
    at_left = jnp.arange(cells) < cells // 2
    filled = Primitives(
        *(
            jnp.where(at_left, a, b).astype(length.dtype)
            for a, b in zip(SOD_LEFT, SOD_RIGHT, strict=True)
        )
    )
    gas = IdealGas(jnp.asarray(1.4, length.dtype))
    return start_tube(faces, filled, gas, limited=limited)


def simple_wave(
    place: Float[Array, "..."], time: Float[Array, ""] | float
) -> Primitives:
    """Return the simple wave at positions and a time (density and speed 1 ahead)."""

    # u = u0(x - (u + c) t), by fixed-point iteration: a contraction before paths meet
    def closer(_, velocity):
        start = place - (1.0 + (WAVE_GAMMA + 1.0) / 2.0 * velocity) * time
        shape = jnp.cos(0.5 * jnp.pi * jnp.clip(start, -1.0, 1.0)) ** 4
        return WAVE_AMPLITUDE * shape

    velocity = jax.lax.fori_loop(0, FIXED_POINT_STEPS, closer, jnp.zeros_like(place))
    sound = 1.0 + (WAVE_GAMMA - 1.0) / 2.0 * velocity
    density = sound ** (2.0 / (WAVE_GAMMA - 1.0))
    return Primitives(density, velocity, density**WAVE_GAMMA / WAVE_GAMMA)


def simple_wave_means(
    faces: Float[Array, " face"], time: Float[Array, ""] | float
) -> Primitives:
    """Return mean density, momentum over mass, and pressure of the mean energy."""
    nodes, weights = (
        jnp.asarray(array, faces.dtype)
        for array in np.polynomial.legendre.leggauss(MEAN_QUADRATURE)
    )
    width = jnp.diff(faces)[:, None]
    flow = simple_wave(faces[:-1, None] + width * (nodes[None] + 1.0) / 2.0, time)
    density, momentum, kinetic, pressure = (
        jnp.sum(q * weights[None] / 2.0, axis=1)
        for q in (
            flow.density,
            flow.density * flow.velocity,
            0.5 * flow.density * flow.velocity**2,
            flow.pressure,
        )
    )
    velocity = momentum / density
    # kinetic energy of the variation within a cell counts as internal, as in a cell
    rest = kinetic - 0.5 * momentum * velocity
    return Primitives(density, velocity, pressure + (WAVE_GAMMA - 1.0) * rest)


def start_simple_wave(
    cells: int, *, overtaking: float = 0.0, limited: bool = True
) -> tuple[Flow, FlowState]:
    """Return the simple wave in a tube.

    Args:
        cells: Number of cells.
        overtaking: Mass flux through the faces at the middle, over density times sound
            speed; it falls to zero at the ends.
        limited: True for limited slopes.
    """
    faces = as_float_array(jnp.linspace(*WAVE_REACH, cells + 1))
    along = (faces - WAVE_REACH[0]) / (WAVE_REACH[1] - WAVE_REACH[0])
    rate = overtaking * 4.0 * along * (1.0 - along)
    gas = IdealGas(jnp.asarray(WAVE_GAMMA, faces.dtype))
    filled = simple_wave_means(faces, 0.0)
    return start_tube(faces, filled, gas, rate=rate, limited=limited)


def _velocity_change(pressure, side: Primitives, gamma):
    """Return $f$ [m/s]."""
    sound = jnp.sqrt(gamma * side.pressure / side.density)
    a = 2.0 / ((gamma + 1.0) * side.density)
    b = side.pressure * (gamma - 1.0) / (gamma + 1.0)
    shock = (pressure - side.pressure) * jnp.sqrt(a / (pressure + b))
    power = (gamma - 1.0) / (2.0 * gamma)
    fan = 2.0 * sound / (gamma - 1.0) * ((pressure / side.pressure) ** power - 1.0)
    return jnp.where(pressure > side.pressure, shock, fan)


def star_state(
    left: Primitives, right: Primitives, gas: IdealGas
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return pressure [Pa] and velocity [m/s] at the contact.

    Args:
        left: State on the left.
        right: State on the right; the two do not separate so fast that vacuum appears.
        gas: Gas on both sides.
    """

    def velocity_gap(log_pressure):
        pressure = jnp.exp(log_pressure)
        waves = [_velocity_change(pressure, side, gas.gamma) for side in (left, right)]
        return waves[0] + waves[1] + right.velocity - left.velocity

    def closer(_, log_pressure):
        value, slope = jax.jvp(
            velocity_gap, (log_pressure,), (jnp.ones_like(log_pressure),)
        )
        return log_pressure - value / slope

    start = jnp.log(jnp.minimum(left.pressure, right.pressure))
    pressure = jnp.exp(jax.lax.fori_loop(0, RIEMANN_NEWTON_STEPS, closer, start))
    pull = _velocity_change(pressure, right, gas.gamma)
    push = _velocity_change(pressure, left, gas.gamma)
    velocity = 0.5 * (left.velocity + right.velocity + pull - push)
    return pressure, velocity


def riemann_profile(
    left: Primitives,
    right: Primitives,
    gas: IdealGas,
    speed: Float[Array, "..."],
) -> Primitives:
    """Return the solution along rays.

    Args:
        left: State on the left.
        right: State on the right.
        gas: Gas on both sides.
        speed: Speed of each ray: distance from the interface over time [m/s].
    """
    pressure, velocity = star_state(left, right, gas)
    inside = [
        _riemann_side(state, sign, pressure, velocity, gas.gamma, speed)
        for state, sign in ((left, 1.0), (right, -1.0))
    ]
    at_left = speed < velocity
    return Primitives(*(jnp.where(at_left, a, b) for a, b in zip(*inside, strict=True)))


def _riemann_side(side: Primitives, sign, pressure, velocity, gamma, speed):
    """Return the state on rays on one side of the contact, the right side mirrored."""
    xi, u, star = sign * speed, sign * side.velocity, sign * velocity
    sound = jnp.sqrt(gamma * side.pressure / side.density)
    ratio = pressure / side.pressure
    weak = (gamma - 1.0) / (gamma + 1.0)
    # a shock, eqs. 4.50 and 4.52
    front = u - sound * jnp.sqrt(
        (gamma + 1.0) / (2.0 * gamma) * ratio + (gamma - 1.0) / (2.0 * gamma)
    )
    dense = side.density * (ratio + weak) / (weak * ratio + 1.0)
    # or a fan, eqs. 4.53 to 4.56
    thin = side.density * ratio ** (1.0 / gamma)
    tail = star - sound * ratio ** ((gamma - 1.0) / (2.0 * gamma))
    # rays outside the fan would give a negative base; their value is not used
    within = jnp.maximum(2.0 / (gamma + 1.0) + weak / sound * (u - xi), 1e-12)
    fan = Primitives(
        side.density * within ** (2.0 / (gamma - 1.0)),
        2.0 / (gamma + 1.0) * (sound + (gamma - 1.0) / 2.0 * u + xi),
        side.pressure * within ** (2.0 * gamma / (gamma - 1.0)),
    )
    is_shock = pressure > side.pressure
    undisturbed = xi < jnp.where(is_shock, front, u - sound)
    behind = Primitives(jnp.where(is_shock, dense, thin), star, pressure)
    at_star = is_shock | (xi > tail)
    density, velocity, pressure = (
        jnp.where(undisturbed, q, jnp.where(at_star, s, f))
        for q, s, f in zip((side.density, u, side.pressure), behind, fan, strict=True)
    )
    return Primitives(density, sign * velocity, pressure)
