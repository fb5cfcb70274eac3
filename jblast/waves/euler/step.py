r"""One step of the flow for all faces, all cells and the clock.

In a cell of mass $M$, between faces of area $A$ that overtake the mass $\dot M$,

$$\frac{dV}{dt} = [A\dot V], \qquad \frac{d(Mu)}{dt} = [A\dot P] + p\,[A], \qquad
\frac{dE}{dt} = [A\dot E]$$

with the brackets outer face minus inner face and the fluxes below. $p[A]$ is the
pressure on the sides of a cone; it balances the faces exactly if the pressure is
uniform. The ambient mass, its energy and $-P_0 A$ enter through a fitted shock (Rankine
and Hugoniot), so that energy is conserved to rounding for any speed of the shock.

The clock is the radius of the fitted shock, $dt = dR/U$. Therefore the mesh is known
before the step, a run ends at a given radius, and derivatives are at fixed radius. The
method is Heun's in $R$ and in $t$ (SSP-RK2; Shu and Osher 1988).

Values at the faces follow from means in the cells by MUSCL with a smooth limiter. With
$a$ and $b$ the differences to the neighbours and van Albada's limiter

$$s = \frac{2\,ab}{a^2 + b^2} \text{ if } ab > 0, \text{ else } 0$$

a cell's value at its outer face is $q + \tfrac{s}{4}[(1-\kappa s)a + (1+\kappa s)b]$,
at its inner face $q - \tfrac{s}{4}[(1+\kappa s)a + (1-\kappa s)b]$, with
$\kappa = \tfrac13$: van Leer's schemes with the limiter of Anderson, Thomas and van
Leer (1986), AIAA J. 24:1453. It has switches at extrema only, so it is differentiable.

Fluxes through a face that overtakes mass are those of HLLC in mass coordinates. Two
waves of mass flux $Q_l$ and $Q_r$ leave the contact (Toro 2009, *Riemann Solvers
and Numerical Methods for Fluid Dynamics*, section 10.4, with $Q = \rho|S - u|$), where

$$u^* = \frac{Q_l u_l + Q_r u_r + p_l - p_r}{Q_l + Q_r}, \qquad
p^* = p_l + Q_l(u_l - u^*)$$

A wave is as fast as the shock that would take the whole difference in velocity,
$Q = \rho b + \sqrt{\rho\cdot\rho c^2 + (\rho b)^2}$ with $b = s \max(u_l - u_r, 0)$
($s$: `Gas`): never too slow, so positivity is kept.

A face at rest in the gas is the contact: $u^*$, $p^*$, $p^*u^*$. A face that overtakes
the mass flux $m \ge 0$ has the star state outside the contact, or the undisturbed
one for $m \ge Q_r$. Both are, with $\theta = \min(m/Q_r, 1)$,

$$\dot V = m/\rho_r + u^* - \theta(u^*-u_r), \quad
\dot P = m u_r - [p^* - \theta(p^*-p_r)], \quad
\dot E = m E_r - [p^*u^* - \theta(p^*u^* - p_ru_r)]$$

All fluxes are integrals over an area and a time, whose product is called impulse here.

The speed of the fitted shock follows from the flow behind it, which reaches the front
along a characteristic with constant $J = p + Z u$, $Z = \rho c$. Across the front, in
an ideal gas at rest,

$$\frac{p}{P_0} = 1 + \frac{2\gamma}{\gamma+1}(M^2-1), \qquad
u = \frac{2c_0}{\gamma+1}\left(M - \frac1M\right)$$

and Newton's method solves $p(M) + Z u(M) = J$ for the Mach number $M$. This is the
Riemann problem between the flow and the air with an acoustic inner wave (Toro 2009,
section 9.3). The state behind the front is extrapolated from the last three cells, in
third order.

Intermediates are materialised, so that XLA does not recompute them. XLA fuses what it
can, and recomputes a value for each neighbour that uses it shifted by a cell. On a CPU
this is several times slower where fluxes become differences over cells. A barrier is
not enough: it is removed before fusion begins, and only concatenated arrays remain in
memory. A GPU gains by recomputing forward, but loses, as a CPU does, in the reverse
pass, where cells gather from faces.
"""

from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.state import (
    Ambient,
    Flow,
    FlowState,
    Gas,
    Primitives,
    area,
    primitives,
    swept_radius,
)

# The upwind-biased scheme of third order (van Leer 1985): of the kappa family, the only
# member whose interpolation is a parabola through cell means.
KAPPA = 1.0 / 3.0
# Far below the square of any difference that matters, above the least float32 (1e-38).
DIVISION_GUARD = 1e-30
"""Guard against 0/0 in the limiter where neighbouring cells are equal."""
# The first guess has third order already, and each step squares its error.
NEWTON_STEPS = 3
"""Newton steps for the Mach number of the fitted shock."""
# The guess needs M above 0 only; without a limit the root has an infinite slope at 1.
WEAKEST = 1e-9
"""Smallest $p/P_0 - 1$ of the first guess."""
T = TypeVar("T")


class Front(NamedTuple):
    """The fitted shock, or the state at a wall.

    Attributes:
        speed: Speed of the shock [m/s]; 1 at a wall, so that the clock is time.
        pressure: Pressure behind it [Pa].
        velocity: Velocity behind it [m/s].
    """

    speed: Float[Array, "..."]
    pressure: Float[Array, "..."]
    velocity: Float[Array, "..."]


class Rates(NamedTuple):
    """Changes in one step of the clock, with the front used.

    Attributes:
        swept: Volume that each face sweeps [m3].
        mass: Gain of each cell [kg].
        volume: Gain of each cell [m3].
        momentum: Gain of each cell [kg m/s].
        energy: Gain of each cell [J].
        time: Duration of the step [s].
        front: The shock or the wall.
    """

    swept: Float[Array, "face ..."]
    mass: Float[Array, "cell ..."]
    volume: Float[Array, "cell ..."]
    momentum: Float[Array, "cell ..."]
    energy: Float[Array, "cell ..."]
    time: Float[Array, "..."]
    front: Front


def step(
    state: FlowState,
    flow: Flow,
    courant: float | Float[Array, ""],
    end: Float[Array, "..."],
) -> tuple[FlowState, Front]:
    """Advance by one step; return the new state and the front at its begin.

    Args:
        state: State of the flow.
        flow: Constants of the run.
        courant: Fraction of the largest stable step, above 0 and at most 1.
        end: Final clock; once it is reached, steps have zero length.
    """
    cells = primitives(state, flow.gas)
    front = _front(cells, flow)
    # No wave crosses a cell in one step. The limit is zero where a cell has no volume,
    # and NaN, by the root, where a pressure is below zero.
    sound = wave_mass_flux(cells, jnp.zeros_like(cells.density), flow.gas)
    outer = area(state.radius[1:], flow.geometry)
    crossing = outer * sound / front.speed[None] + flow.mesh.sweeping(state.clock)[1:]
    crossed = jnp.where(state.volume > 0.0, state.mass / crossing, 0.0)
    limit = courant * jnp.min(crossed, axis=0)
    alive = state.alive & (limit > 0.0)
    length = jnp.minimum(jnp.where(alive, limit, 0.0), end - state.clock)
    # Steps are constant while parameters vary: derivatives are those of the same steps.
    # The rounding of the clock is part of the step.
    clock = state.clock + jnp.maximum(length, 0.0)
    advance = jax.lax.stop_gradient(clock - state.clock)
    clock = state.clock + advance
    overtaken = flow.mesh.swept(state.clock, advance)
    first = _rates(state, flow, cells, front, overtaken, advance)
    middle = materialized(_advanced(state, first, clock, flow))
    cells = primitives(middle, flow.gas)
    second = _rates(middle, flow, cells, _front(cells, flow), overtaken, advance)
    both = materialized(jax.tree.map(lambda a, b: 0.5 * (a + b), first, second))
    advanced = _advanced(state, both, clock, flow)
    new = jax.tree.map(lambda a, b: jnp.where(alive, a, b), advanced, state)
    return eqx.tree_at(lambda s: s.alive, new, alive), front


def _advanced(state: FlowState, rates: Rates, clock: Float[Array, "..."], flow: Flow):
    return FlowState(
        radius=swept_radius(state.radius, rates.swept, flow.geometry),
        mass=state.mass + rates.mass,
        volume=state.volume + rates.volume,
        momentum=state.momentum + rates.momentum,
        energy=state.energy + rates.energy,
        clock=clock,
        time=state.time + rates.time,
        alive=state.alive,
    )


def _front(cells: Primitives, flow: Flow) -> Front:
    """Return the fitted shock, or the pressure on the wall."""
    if flow.ambient is not None:
        return fitted_front(cells, flow.gas.of_cells(slice(-1, None)), flow.ambient)
    # speed 1 makes dt = d(clock): without a shock the clock is time
    still = jnp.zeros_like(cells.velocity[-1])
    return Front(jnp.ones_like(still), cells.pressure[-1], still)


def _rates(
    state: FlowState,
    flow: Flow,
    cells: Primitives,
    front: Front,
    overtaken: Float[Array, "face ..."],
    advance: Float[Array, "..."],
) -> Rates:
    """Return the changes in one explicit step."""
    cells = materialized(cells)
    left, right = materialized(
        reconstruct(cells, fitted=flow.ambient is not None, limited=flow.limited)
    )
    time = advance / front.speed
    areas = area(state.radius, flow.geometry)
    impulse = areas * time[None]
    number = cells.density.shape[0]
    # On a CPU fluxes are computed at the two ends too, and discarded: removing the ends
    # first would prevent XLA from fusing the loops.
    at = slice(None) if jax.default_backend() == "cpu" else slice(1, -1)
    flux = face_flux(
        Primitives(*(q[at] for q in left)),
        Primitives(*(q[at] for q in right)),
        overtaken[at],
        impulse[at],
        flow.gas.of_cells((0, *range(number))[at]),
        flow.gas.of_cells((*range(number), number - 1)[at]),
    )
    within = slice(None) if at.start else slice(1, -1)
    ends = _ends(left, right, flow, overtaken, impulse)
    swept, momentum, energy = materialized(
        tuple(
            jnp.concatenate([first[None], faces[within], last[None]])
            for (first, last), faces in zip(ends, flux, strict=True)
        )
    )
    # the pressure on the sides of a cone; zero in a plane, whose areas are equal
    sides = cells.pressure * (impulse[1:] - impulse[:-1])
    return Rates(
        swept=swept,
        mass=overtaken[1:] - overtaken[:-1],
        volume=swept[1:] - swept[:-1],
        momentum=momentum[1:] - momentum[:-1] + sides,
        energy=energy[1:] - energy[:-1],
        time=time,
        front=front,
    )


def _ends(left, right, flow: Flow, overtaken, impulse):
    """Return volume, momentum and energy through the innermost and outermost face.

    Fluxes through a wall are exactly zero, except for the pressure.
    """
    none = jnp.zeros_like(impulse[0])
    centre = -_wall_pressure(right, 0, -1.0, flow.gas) * impulse[0]
    if flow.ambient is None:
        wall = -_wall_pressure(left, -1, 1.0, flow.gas) * impulse[-1]
        return (none, none), (centre, wall), (none, none)
    ambient = flow.ambient
    internal = ambient.gas.energy(ambient.density, ambient.pressure) / ambient.density
    momentum = -ambient.pressure * impulse[-1]
    return (
        (none, overtaken[-1] / ambient.density),
        (centre, momentum),
        (none, overtaken[-1] * internal),
    )


def _wall_pressure(faces: Primitives, face: int, outward: float, gas: Gas):
    """Return the pressure on a rigid wall, with the mirrored flow on its other side."""
    at = Primitives(*(q[face] for q in faces))
    towards = outward * at.velocity
    approach = jnp.maximum(2.0 * towards, 0.0)
    q = wave_mass_flux(at, approach, gas.of_cells(slice(face, (face + 1) or None)))
    return at.pressure + q * towards


def face_values(
    means: Float[Array, "cell ..."],
    inner: Float[Array, "..."],
    outer: Float[Array, "..."],
    limited: bool,
) -> tuple[Float[Array, "cell ..."], Float[Array, "cell ..."]]:
    """Return each cell's values at its inner and at its outer face.

    Args:
        means: Means of the cells.
        inner: Value of the ghost cell inside the first.
        outer: Value of the ghost cell beyond the last.
        limited: True for limited slopes.
    """
    around = materialized(jnp.concatenate([inner[None], means, outer[None]]))
    a, b = means - around[:-2], around[2:] - means
    if limited:
        s = 2.0 * jnp.maximum(a * b, 0.0) / (a * a + b * b + DIVISION_GUARD)
    else:
        s = jnp.ones_like(a)
    mean, twist = 0.25 * s * (a + b), (0.25 * KAPPA) * s * s * (b - a)
    return means - mean + twist, means + mean + twist


def reconstruct(
    cells: Primitives, *, fitted: bool, limited: bool
) -> tuple[Primitives, Primitives]:
    """Return values on the inner and on the outer side of each face.

    The ghost cell beyond the centre or a wall is the mirrored flow. Towards a fitted
    shock the flow is extrapolated linearly, with densities and pressures not below
    zero. Limited values between positive means are positive: none differs from its mean
    by more than 0.55 of the difference to the lesser neighbour. Without the limiter,
    both faces of a cell have its mean if a density or pressure would not be positive.

    Args:
        cells: Means of the cells.
        fitted: True if the outer end is a fitted shock, False for a wall.
        limited: True for limited slopes.
    """
    mirror = (1.0, -1.0, 1.0)
    faces = []
    for name, sign, q in zip(Primitives._fields, mirror, cells, strict=True):
        beyond = sign * q[-1]
        if fitted:
            straight = 2.0 * q[-1] - q[-2]
            beyond = straight if name == "velocity" else jnp.maximum(straight, 0.0)
        faces.append(face_values(q, sign * q[0], beyond, limited))
    if not limited:
        (low, high), _, (least, most) = faces
        good = jnp.minimum(jnp.minimum(low, high), jnp.minimum(least, most)) > 0.0
        faces = [
            tuple(jnp.where(good, f, q) for f in pair)
            for pair, q in zip(faces, cells, strict=True)
        ]
    # Concatenated arrays stay in memory on a CPU (see the docstring of the module).
    signed = list(zip(mirror, faces, strict=True))
    left = [jnp.concatenate([sign * i[:1], o]) for sign, (i, o) in signed]
    right = [jnp.concatenate([i, sign * o[-1:]]) for sign, (i, o) in signed]
    return Primitives(*left), Primitives(*right)


class Flux(NamedTuple):
    """Gain of the cell inside a face through the face.

    Attributes:
        volume: Volume that the face sweeps [m3].
        momentum: Momentum [kg m/s].
        energy: Energy [J].
    """

    volume: Float[Array, "..."]
    momentum: Float[Array, "..."]
    energy: Float[Array, "..."]


def wave_mass_flux(
    side: Primitives, approach: Float[Array, "..."], gas: Gas
) -> Float[Array, "..."]:
    r"""Return $Q$ of the wave that enters a side [kg/(m2 s)].

    Args:
        side: State of that side.
        approach: $\max(u_l - u_r, 0)$ [m/s].
        gas: Gas of that side.
    """
    steep = side.density * (gas.shock_slope() * approach)
    sound = side.density * gas.stiffness(side.density, side.pressure)
    return steep + jnp.sqrt(sound + steep * steep)


def face_flux(
    left: Primitives,
    right: Primitives,
    overtaken: Float[Array, "..."],
    impulse: Float[Array, "..."],
    left_gas: Gas,
    right_gas: Gas,
) -> Flux:
    """Return volume, momentum and energy through faces.

    Args:
        left: State just inside.
        right: State just outside.
        overtaken: Mass through the moving face [kg], not negative.
        impulse: Area of the face times time [m2 s].
        left_gas: Gas inside.
        right_gas: Gas outside.
    """
    approach = jnp.maximum(left.velocity - right.velocity, 0.0)
    q_l = wave_mass_flux(left, approach, left_gas)
    q_r = wave_mass_flux(right, approach, right_gas)
    u = (
        q_l * left.velocity + q_r * right.velocity + (left.pressure - right.pressure)
    ) / (q_l + q_r)
    p = left.pressure + q_l * (left.velocity - u)
    # A step of zero length sweeps nothing. The guard is on the input, so that neither
    # the value nor the derivative is 0/0.
    capacity = jnp.where(impulse > 0.0, impulse, 1.0) * q_r
    theta = jnp.minimum(overtaken / capacity, 1.0)
    internal = right_gas.energy(right.density, right.pressure)
    carried = overtaken / right.density
    energy = internal * carried + 0.5 * overtaken * right.velocity * right.velocity
    return Flux(
        carried + impulse * (u - theta * (u - right.velocity)),
        overtaken * right.velocity - impulse * (p - theta * (p - right.pressure)),
        energy - impulse * (p * u - theta * (p * u - right.pressure * right.velocity)),
    )


def extrapolated(means: Float[Array, "cell ..."]) -> Float[Array, "..."]:
    """Return the value of a parabola with the last three means at the outer face."""
    return (11.0 * means[-1] - 7.0 * means[-2] + 2.0 * means[-3]) / 6.0


def jump(
    mach: Float[Array, "..."], ambient: Ambient
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return pressure [Pa] and velocity [m/s] behind a shock of a Mach number."""
    gamma, sound = ambient.gas.gamma, sound_speed(ambient)
    # (M - 1)(M + 1), not M^2 - 1, which has no digits for a weak shock
    rise = 2.0 * gamma / (gamma + 1.0) * (mach - 1.0) * (mach + 1.0)
    velocity = 2.0 * sound / (gamma + 1.0) * (mach - 1.0) * (mach + 1.0) / mach
    return ambient.pressure * (1.0 + rise), velocity


def sound_speed(ambient: Ambient) -> Float[Array, "..."]:
    """Return the speed of sound ahead [m/s]."""
    return jnp.sqrt(ambient.gas.gamma * ambient.pressure / ambient.density)


def fitted_front(cells: Primitives, gas: Gas, ambient: Ambient) -> Front:
    """Return the shock driven by the outermost cells.

    Args:
        cells: Means of the cells.
        gas: Gas of the last cells.
        ambient: Air at rest ahead.
    """
    behind = Primitives(*(extrapolated(q) for q in cells))
    # Right after a start the parabola may overshoot; the last mean is always positive.
    good = jnp.minimum(behind.density, behind.pressure) > 0.0
    behind = Primitives(
        *(jnp.where(good, q, means[-1]) for q, means in zip(behind, cells, strict=True))
    )
    stiffness = gas.stiffness(behind.density, behind.pressure)
    impedance = jnp.sqrt(behind.density * stiffness)
    drive = behind.pressure + impedance * behind.velocity
    gamma, sound = ambient.gas.gamma, sound_speed(ambient)
    rise = jnp.maximum(behind.pressure / ambient.pressure - 1.0, WEAKEST)
    mach = jnp.sqrt(1.0 + (gamma + 1.0) / (2.0 * gamma) * rise)
    for _ in range(NEWTON_STEPS):
        pressure, velocity = jump(mach, ambient)
        slope = ambient.pressure * 4.0 * gamma * mach + impedance * 2.0 * sound * (
            1.0 + 1.0 / (mach * mach)
        )
        residual = pressure + impedance * velocity - drive
        mach = mach - (gamma + 1.0) * residual / slope
    pressure, velocity = jump(mach, ambient)
    return Front(mach * sound, pressure, velocity)


def materialized(values: T) -> T:
    """Return the values, stored in memory; except on a CPU, in reverse mode only.

    Args:
        values: Arrays.
    """
    if jax.default_backend() == "cpu":
        return jax.lax.optimization_barrier(values)
    return jax.tree.map(
        lambda x: _backward(x) if jnp.issubdtype(x.dtype, jnp.floating) else x, values
    )


@jax.custom_jvp
def _backward(values: Array) -> Array:
    return values


@_backward.defjvp
def _backward_jvp(primals, tangents):
    # The transpose of a barrier is a barrier, so reverse mode has it too.
    return primals[0], jax.lax.optimization_barrier(tangents[0])
