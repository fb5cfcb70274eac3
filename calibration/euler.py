r"""Shock solver for a point source: spherical flow behind a fitted shock, one gas.

It computed the table of the law `point_source`. All amounts are per steradian: areas
$r^2$, volumes $r^3/3$.

A face is identified by its label, the radius $a$ of its air before the blast. With the
radius $R$ of the shock as clock, $dt = dR/U$, the labels are

$$a = R - D, \qquad D = \frac{\eta\,R L}{L + R(1-\eta)}$$

with $\eta$ equally spaced from 1 at the centre to 0 at the shock. Near the source the
labels are equally spaced. Far out the cells at the shock keep the width $L\,\Delta\eta$
and the hot, thin core has a few large cells. The mass that a face overtakes is thereby
known before the step, and mass is conserved exactly. A run ends at a given radius.

In a cell of mass $M$, between faces of area $A$ that overtake the mass $\dot M$,

$$\frac{dV}{dt} = [A\dot V], \qquad \frac{d(Mu)}{dt} = [A\dot P] + p\,[A], \qquad
\frac{dE}{dt} = [A\dot E]$$

with the brackets outer face minus inner face. $p[A]$ is the pressure on the sides of a
cone. The ambient mass, its energy and $-P_0 A$ enter through the shock (Rankine and
Hugoniot), so that energy is conserved to rounding. Steps are Heun's (SSP-RK2; Shu and
Osher 1988).

Values at the faces follow from means by MUSCL with $\kappa = 1/3$ and the limiter of
van Albada (Anderson, Thomas and van Leer 1986, AIAA J. 24:1453). It has switches at
extrema only.

Fluxes are those of HLLC in mass coordinates (Toro 2009, section 10.4): two waves of
mass flux $Q_l$ and $Q_r$ leave the contact, where

$$u^* = \frac{Q_l u_l + Q_r u_r + p_l - p_r}{Q_l + Q_r}, \qquad
p^* = p_l + Q_l(u_l - u^*)$$

A wave is as fast as the shock that would take the whole difference in velocity,
$Q = \rho b + \sqrt{\gamma p\rho + (\rho b)^2}$ with $b = \frac{\gamma+1}{4}
\max(u_l - u_r, 0)$: never too slow, so positivity is kept. A face that overtakes the
mass flux $m \ge 0$ has, with $\theta = \min(m/Q_r, 1)$,

$$\dot V = m/\rho_r + u^* - \theta(u^*-u_r), \quad
\dot P = m u_r - [p^* - \theta(p^*-p_r)], \quad
\dot E = m E_r - [p^*u^* - \theta(p^*u^* - p_ru_r)]$$

The flow behind reaches the shock along a characteristic with constant
$p + \rho c\,u$. The Mach number $M$ at which the jump of an ideal gas at rest has this
value is found by Newton's method.

The start is Sedov's solution, in the parameter $x = x_2$ of `laws/sedov_taylor.py`. The
label of the gas at $\lambda = r/R$ is $(a/R)^3 = \lambda^2\,\frac{\gamma+1}{\gamma-1}\,
\frac{\rho}{\rho_s}\left(\lambda - \frac{2}{\gamma+1}\frac{u}{u_s}\right)$, for the mass
inside a similarity surface grows with $R^3$ by what the surface overtakes. The ambient
pressure is added everywhere: the whole then has the energy $E$ and that of the air
swept up, exactly.
"""

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.errors import InputError
from jblast.types import as_numbers
from jblast.waves.laws.sedov_taylor import sedov_alpha
from jblast.waves.tables import cubics

FEWEST_CELLS = 20
"""With fewer the shocked layer, a sixth of the radius in labels, is not resolved."""
STRONG_START = 300.0
"""Least shock pressure at the start, over $P_0$: Sedov neglects $P_0$, 1/300 of it."""
START = 0.02
"""Radius of the start over $(E/P_0)^{1/3}$: 20,000 ambient pressures."""
COURANT = 0.7
"""Share of the largest stable step. Up to here the error is that of the grid; a smooth
wave in 100 cells has twice the error at 0.85 and 3.7 times at 1."""
RECORDS = 500
"""Records of one compiled call of `march`: some hundred hide the cost of the call."""
STRIDE = 10
"""Steps between records: 2 % of the radius with 100 cells, less later and with more."""
KAPPA = 1.0 / 3.0
"""Interpolation by a parabola through means of cells (van Leer 1985)."""
DIVISION_GUARD = 1e-30
"""Against 0/0 where neighbours are equal; far below the square of any difference."""
NEWTON_STEPS = 3
"""For the Mach number: the guess has third order, and each step squares its error."""
WEAKEST = 1e-9
"""Least $p/P_0 - 1$ of the guess: its root has an infinite slope at 0."""
SEDOV_STEPS = 30
"""Newton steps for the parameter $x$ of a face; the first ones come from far."""
QUADRATURE = 8
"""Gauss points of a cell of the start: exact to degree 15."""


class Air(eqx.Module):
    """Air at rest ahead of the shock, an ideal gas like that behind it.

    Attributes:
        pressure: Ambient pressure $P_0$ [Pa].
        density: Ambient density [kg/m3].
        gamma: Ratio of specific heats [-].
    """

    pressure: Float[Array, ""] = eqx.field(converter=as_numbers, default=1.0)
    density: Float[Array, ""] = eqx.field(converter=as_numbers, default=1.0)
    gamma: Float[Array, ""] = eqx.field(
        converter=as_numbers, default=AIR_HEAT_CAPACITY_RATIO
    )


class Flow(eqx.Module):
    """The flow at one radius of the shock.

    Attributes:
        air: Air ahead.
        length: Length $L$ over which the cells are graded [m].
        radius: Radii of the faces [m].
        mass: Mass of each cell [kg].
        volume: Volume of each cell [m3].
        momentum: Outward momentum of each cell [kg m/s].
        energy: Kinetic and internal energy of each cell [J].
        shock: Radius of the shock [m], the clock of a run.
        time: Time [s].
        alive: True while all densities and pressures are positive; then the flow stops.
    """

    air: Air
    length: Float[Array, ""]
    radius: Float[Array, " face"]
    mass: Float[Array, " cell"]
    volume: Float[Array, " cell"]
    momentum: Float[Array, " cell"]
    energy: Float[Array, " cell"]
    shock: Float[Array, ""]
    time: Float[Array, ""]
    alive: Bool[Array, ""]


class Gas(NamedTuple):
    """Density [kg/m3], outward velocity [m/s], pressure [Pa]: means, or at faces."""

    density: Float[Array, "..."]
    velocity: Float[Array, "..."]
    pressure: Float[Array, "..."]


class Front(NamedTuple):
    """Speed of the shock [m/s]; pressure [Pa] and velocity [m/s] behind it."""

    speed: Float[Array, "..."]
    pressure: Float[Array, "..."]
    velocity: Float[Array, "..."]


class History(NamedTuple):
    """Records of a run: radius of the shock, time, front, readings at the gauges."""

    shock: Float[Array, " record"]
    time: Float[Array, " record"]
    front: Front
    pressure: Float[Array, "record gauge"]
    velocity: Float[Array, "record gauge"]


class Decay(NamedTuple):
    r"""Decay of the shock of a point source.

    Attributes:
        scaled: $\lambda = R\,(P_0/E)^{1/3}$ [-], ascending.
        overpressure_ratio: $p/P_0$ [-].
        slope: $d\ln p/d\ln\lambda$ [-].
        arrival: $c_0 t\,(P_0/E)^{1/3}$ [-].
    """

    scaled: Float[np.ndarray, " node"]
    overpressure_ratio: Float[np.ndarray, " node"]
    slope: Float[np.ndarray, " node"]
    arrival: Float[np.ndarray, " node"]


def point_source(
    energy: Float[ArrayLike, ""] = 1.0,
    air: Air | None = None,
    *,
    cells: int,
    radius: Float[ArrayLike, ""] = START,
    length: Float[ArrayLike, ""] | None = None,
) -> Flow:
    """Return the flow of a point source when its shock is at a radius.

    Args:
        energy: $E$ [J].
        air: Air ahead; by default of unit pressure and density, gamma 1.4.
        cells: Number of cells.
        radius: Radius of the shock [m]; the time is Sedov's.
        length: Length over which the cells are graded [m]; by default $(E/P_0)^{1/3}$.

    Raises:
        InputError: There are too few cells, or the shock is not strong at that radius.
    """
    air = Air() if air is None else air
    energy, radius = as_numbers(energy), as_numbers(radius)
    if cells < FEWEST_CELLS:
        raise InputError(
            f"cells: expected at least {FEWEST_CELLS} to resolve a point source, got "
            f"{cells}"
        )
    gamma = air.gamma
    # t and U of R = (E t^2/(alpha rho))^(1/5)
    time = jnp.sqrt(sedov_alpha(gamma) * air.density * radius**5 / energy)
    speed = 0.4 * radius / time
    strength = 2.0 * air.density * speed**2 / (gamma + 1.0) / air.pressure
    if strength < STRONG_START:
        raise InputError(
            f"radius: expected a shock of at least {STRONG_START:g} ambient pressures "
            f"at the start, got {strength:.3g} at {radius:g} m; start nearer to the "
            "source"
        )
    length = jnp.cbrt(energy / air.pressure) if length is None else as_numbers(length)
    labels, crowding, _ = _labels(radius, length, cells)
    # a difference of depths in closed form: thin cells would lose their digits
    stretch = radius * (1.0 + radius / length) / cells
    mass = air.density * shell_volume(
        labels[:-1], stretch * crowding[1:] * crowding[:-1]
    )
    place, momentum, energies = _sedov_cells(labels / radius, gamma)
    volume = jnp.diff(place**3) / 3.0 * radius**3
    velocity = 2.0 * speed / (gamma + 1.0)
    density = air.density * (gamma + 1.0) / (gamma - 1.0)
    hot = energies * (0.5 * density * velocity**2 * radius**3)
    return Flow(
        air=air,
        length=length,
        radius=place * radius,
        mass=mass,
        volume=volume,
        momentum=momentum * (density * velocity * radius**3),
        energy=hot + air.pressure / (gamma - 1.0) * volume,
        shock=radius,
        time=time,
        alive=jnp.isfinite(radius),
    )


@functools.partial(jax.jit, static_argnames="stride")
def _run(flow: Flow, end, radii, stride: int) -> tuple[Flow, History]:
    """Advance by `RECORDS` times `stride` steps, or until the shock is at a radius."""

    def segment(flow: Flow, _) -> tuple[Flow, History]:
        first, front = _step(flow, end)
        record = History(flow.shock, flow.time, front, *_readings(flow, front, radii))
        last = jax.lax.fori_loop(1, stride, lambda _, f: _step(f, end)[0], first)
        return last, record

    last, history = jax.lax.scan(segment, flow, length=RECORDS)
    # Each step checks the flow before it, so the last one is still unchecked.
    least = jnp.minimum(*gas_of(last)[::2])
    alive = last.alive & jnp.all(least > 0.0)
    return dataclasses.replace(last, alive=alive), history


def march(
    cells: int,
    end: float,
    *,
    flow: Flow | None = None,
    stride: int = STRIDE,
    gauges: Sequence[float] = (),
) -> tuple[Flow, History]:
    r"""Run a point source until its shock is at a radius.

    Args:
        cells: Number of cells.
        end: Radius at the end [m]; $\lambda$, unless a flow is given.
        flow: Flow at the begin; by default $P_0 = \rho_0 = E = 1$ and gamma 1.4.
        stride: Steps between records.
        gauges: Radii at which pressure and velocity are recorded [m].

    Returns:
        The flow at the end, and the records as NumPy arrays.
    """
    last = point_source(cells=cells) if flow is None else flow
    radii, parts = jnp.asarray(gauges, last.radius.dtype), []
    while not parts or parts[-1].shock[-1] < end:
        last, history = _run(last, end, radii, stride)
        parts.append(jax.tree.map(np.asarray, history))
        if not last.alive or not parts[-1].shock[-1] > parts[-1].shock[0]:
            at = f"at a shock radius of {float(last.shock):g} m"
            raise RuntimeError(f"expected positive densities and pressures, lost {at}")
    whole = jax.tree.map(lambda *part: np.concatenate(part), *parts)
    moved = np.concatenate([[True], np.diff(whole.shock) > 0.0])
    return last, jax.tree.map(lambda values: values[moved], whole)


def decay_at(scaled: Float[np.ndarray, " node"], history: History) -> Decay:
    r"""Return the decay at scaled distances, from the records of a `march`.

    The time between records is integrated from the speed of the shock at each. The
    slope of the pressure is that of parabolas through three records.

    Args:
        scaled: $\lambda$ [-], within the run.
        history: Records of a run with $P_0 = \rho_0 = E = 1$ and gamma 1.4.
    """
    # in logarithms both curves are nearly straight between two records
    x, time = np.log(history.shock), np.asarray(history.time)
    y = np.log(np.asarray(history.front.pressure) - 1.0)
    width, chord = np.diff(x), np.diff(y) / np.diff(x)
    inner = (width[1:] * chord[:-1] + width[:-1] * chord[1:]) / (width[1:] + width[:-1])
    slopes = np.concatenate(
        [[2.0 * chord[0] - inner[0]], inner, [2 * chord[-1] - inner[-1]]]
    )
    pressure = cubics(x, y, slopes)
    log_time = np.log(np.sqrt(AIR_HEAT_CAPACITY_RATIO) * time)
    pace = np.asarray(history.shock / (time * history.front.speed))
    arrival = cubics(x, log_time, pace)
    at = np.log(scaled)
    interval = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    share = (at - x[interval]) / (x[interval + 1] - x[interval])
    return Decay(
        scaled,
        np.exp(pressure(at)),
        # interpolated: the derivative of the cubic is one order less
        slopes[interval] + share * (slopes[interval + 1] - slopes[interval]),
        np.exp(arrival(at)),
    )


def gas_of(flow: Flow) -> Gas:
    """Return the means of each cell."""
    density, velocity = flow.mass / flow.volume, flow.momentum / flow.mass
    internal = (flow.energy - 0.5 * velocity * flow.momentum) / flow.volume
    return Gas(density, velocity, (flow.air.gamma - 1.0) * internal)


def cell_centres(radius: Float[Array, " face"]) -> Float[Array, " cell"]:
    r"""Return the radii at which a linear profile has the means of the cells [m].

    $$\frac34 \frac{r_2^4 - r_1^4}{r_2^3 - r_1^3}$$, without differences.
    """
    a, b = radius[:-1], radius[1:]
    return 0.75 * (a + b) * (a * a + b * b) / (a * a + a * b + b * b)


def shell_volume(inner, thickness):
    r"""Return the volume of a shell [m3], $h\,(r^2 + rh + h^2/3)$."""
    return thickness * (inner * (inner + thickness) + thickness * thickness / 3.0)


def swept_radius(radius, volume):
    r"""Return the radius of a face after it has swept a volume, $\sqrt[3]{r^3+3V}$ [m].

    Args:
        radius: Radius before [m].
        volume: Swept volume [m3], small compared with $r^3$.
    """
    # y = r'/r - 1 solves y^3 + 3y^2 + 3y = x: its series, then Newton once. A cube root
    # has no vector instruction.
    at_centre = radius == 0.0
    r = jnp.where(at_centre, 1.0, radius)
    x = jnp.where(at_centre, 0.0, volume / (r * r * r))
    y = x * (1.0 - x * (1.0 - 5.0 / 3.0 * x))
    rest = y * (3.0 + y * (3.0 + y)) - 3.0 * x
    return radius * (1.0 + y - rest / (3.0 * (1.0 + y) * (1.0 + y)))


def _labels(shock, length, cells: int):
    r"""Return the label of each face, $L/(L + R(1-\eta))$, and $\eta$."""
    eta = 1.0 - jnp.arange(cells + 1, dtype=shock.dtype) / cells
    crowding = length / (length + shock * (1.0 - eta))
    return shock * (1.0 - eta * crowding), crowding, eta


def _overtaken(flow: Flow, advance):
    """Return the mass that each face overtakes [kg], and its rate at begin [kg/m]."""
    cells = flow.mass.shape[0]
    labels, crowding, eta = _labels(flow.shock, flow.length, cells)
    # Exact for any advance: R C(R) grows by the advance times both values of C.
    both = crowding * _labels(flow.shock + advance, flow.length, cells)[1]
    mass = flow.air.density * shell_volume(labels, advance * (1.0 - eta * both))
    rate = flow.air.density * (labels * labels * (1.0 - eta * crowding**2))
    return mass.at[0].set(0.0), rate


def _step(flow: Flow, end) -> tuple[Flow, Front]:
    """Advance by one step; return the new flow and the front at its begin."""
    cells = gas_of(flow)
    front = fitted_front(cells, flow.air)
    # No wave crosses a cell in one step. The limit is zero where a cell has no volume,
    # and NaN, by the root, where a pressure is below zero.
    sound = _wave_mass_flux(cells, jnp.zeros_like(cells.density), flow.air.gamma)
    rate = _overtaken(flow, jnp.zeros_like(flow.shock))[1]
    crossing = flow.radius[1:] * flow.radius[1:] * sound / front.speed + rate[1:]
    crossed = jnp.where(flow.volume > 0.0, flow.mass / crossing, 0.0)
    limit = COURANT * jnp.min(crossed)
    alive = flow.alive & (limit > 0.0)
    length = jnp.minimum(jnp.where(alive, limit, 0.0), end - flow.shock)
    # The rounding of the clock is part of the step.
    advance = (flow.shock + jnp.maximum(length, 0.0)) - flow.shock
    mass = _overtaken(flow, advance)[0]
    first = _rates(flow, cells, front, mass, advance)
    middle = jax.lax.optimization_barrier(_advanced(flow, first, mass, advance))
    cells = gas_of(middle)
    second = _rates(middle, cells, fitted_front(cells, flow.air), mass, advance)
    both = jax.tree.map(lambda a, b: 0.5 * (a + b), first, second)
    both = jax.lax.optimization_barrier(both)
    advanced = _advanced(flow, both, mass, advance)
    new = jax.tree.map(lambda a, b: jnp.where(alive, a, b), advanced, flow)
    return dataclasses.replace(new, alive=alive), front


def _advanced(flow: Flow, rates, mass, advance) -> Flow:
    """Return the flow after a step of given changes."""
    swept, momentum, energy, time = rates
    return dataclasses.replace(
        flow,
        radius=swept_radius(flow.radius, swept),
        mass=flow.mass + jnp.diff(mass),
        volume=flow.volume + jnp.diff(swept),
        momentum=flow.momentum + momentum,
        energy=flow.energy + energy,
        shock=flow.shock + advance,
        time=flow.time + time,
    )


def _rates(flow: Flow, cells: Gas, front: Front, overtaken, advance):
    """Return swept volumes, gains of momentum and energy, and the time of a step."""
    cells = jax.lax.optimization_barrier(cells)
    air, time = flow.air, advance / front.speed
    impulse = flow.radius * flow.radius * time
    flux = face_flux(*reconstruct(cells), overtaken, impulse, air.gamma)
    # Nothing passes the centre. At the shock the ambient air enters.
    internal = air.pressure / (air.gamma - 1.0) / air.density
    inflow = overtaken[-1]
    last = inflow / air.density, -air.pressure * impulse[-1], inflow * internal
    swept, momentum, energy = jax.lax.optimization_barrier(
        tuple(
            jnp.concatenate([jnp.zeros_like(faces[:1]), faces[1:-1], end[None]])
            for faces, end in zip(flux, last, strict=True)
        )
    )
    sides = cells.pressure * jnp.diff(impulse)
    return swept, jnp.diff(momentum) + sides, jnp.diff(energy), time


def reconstruct(cells: Gas) -> tuple[Gas, Gas]:
    """Return values on the inner and on the outer side of each face.

    The ghost cell inside the centre is the mirrored flow. Towards the shock the flow is
    extrapolated linearly, with densities and pressures not below zero. Values between
    positive means are positive.
    """
    left, right = [], []
    for sign, q in zip((1.0, -1.0, 1.0), cells, strict=True):
        beyond = 2.0 * q[-1] - q[-2]
        beyond = beyond if sign < 0.0 else jnp.maximum(beyond, 0.0)
        around = jnp.concatenate([sign * q[:1], q, beyond[None]])
        around = jax.lax.optimization_barrier(around)
        a, b = q - around[:-2], around[2:] - q
        s = 2.0 * jnp.maximum(a * b, 0.0) / (a * a + b * b + DIVISION_GUARD)
        mean, twist = 0.25 * s * (a + b), (0.25 * KAPPA) * s * s * (b - a)
        inner, outer = q - mean + twist, q + mean + twist
        left.append(jnp.concatenate([sign * inner[:1], outer]))
        right.append(jnp.concatenate([inner, sign * outer[-1:]]))
    return jax.lax.optimization_barrier((Gas(*left), Gas(*right)))


def _wave_mass_flux(side: Gas, approach, gamma):
    """Return Q of the wave that enters a side [kg/(m2 s)]."""
    steep = side.density * ((gamma + 1.0) / 4.0 * approach)
    return steep + jnp.sqrt(side.density * (gamma * side.pressure) + steep * steep)


def face_flux(left: Gas, right: Gas, overtaken, impulse, gamma):
    """Return volume, momentum and energy through faces.

    Args:
        left: Gas just inside.
        right: Gas just outside.
        overtaken: Mass through the moving face [kg], not negative.
        impulse: Area of the face times time [m2 s].
        gamma: Ratio of specific heats [-].
    """
    approach = jnp.maximum(left.velocity - right.velocity, 0.0)
    q_l = _wave_mass_flux(left, approach, gamma)
    q_r = _wave_mass_flux(right, approach, gamma)
    force = left.pressure - right.pressure
    u = (q_l * left.velocity + q_r * right.velocity + force) / (q_l + q_r)
    p = left.pressure + q_l * (left.velocity - u)
    # A step of zero length sweeps nothing. The guard is on the input, so that neither
    # the value nor the derivative is 0/0.
    capacity = jnp.where(impulse > 0.0, impulse, 1.0) * q_r
    theta = jnp.minimum(overtaken / capacity, 1.0)
    carried = overtaken / right.density
    energy = right.pressure / (gamma - 1.0) * carried
    energy = energy + 0.5 * overtaken * right.velocity * right.velocity
    return (
        carried + impulse * (u - theta * (u - right.velocity)),
        overtaken * right.velocity - impulse * (p - theta * (p - right.pressure)),
        energy - impulse * (p * u - theta * (p * u - right.pressure * right.velocity)),
    )


def fitted_front(cells: Gas, air: Air) -> Front:
    """Return the shock driven by the outermost cells into air at rest."""
    # a parabola with the last three means
    behind = Gas(*((11.0 * q[-1] - 7.0 * q[-2] + 2.0 * q[-3]) / 6.0 for q in cells))
    # Right after a start the parabola may overshoot; the last mean is always positive.
    good = jnp.minimum(behind.density, behind.pressure) > 0.0
    behind = Gas(
        *(jnp.where(good, q, m[-1]) for q, m in zip(behind, cells, strict=True))
    )
    gamma, sound = air.gamma, jnp.sqrt(air.gamma * air.pressure / air.density)
    impedance = jnp.sqrt(behind.density * (gamma * behind.pressure))
    drive = behind.pressure + impedance * behind.velocity

    def jump(mach):
        # (M - 1)(M + 1), not M^2 - 1, which has no digits for a weak shock
        rise = 2.0 * gamma / (gamma + 1.0) * (mach - 1.0) * (mach + 1.0)
        velocity = 2.0 * sound / (gamma + 1.0) * (mach - 1.0) * (mach + 1.0) / mach
        return air.pressure * (1.0 + rise), velocity

    rise = jnp.maximum(behind.pressure / air.pressure - 1.0, WEAKEST)
    mach = jnp.sqrt(1.0 + (gamma + 1.0) / (2.0 * gamma) * rise)
    for _ in range(NEWTON_STEPS):
        pressure, velocity = jump(mach)
        slope = air.pressure * 4.0 * gamma * mach + impedance * 2.0 * sound * (
            1.0 + 1.0 / (mach * mach)
        )
        residual = pressure + impedance * velocity - drive
        mach = mach - (gamma + 1.0) * residual / slope
    return Front(mach * sound, *jump(mach))


def _readings(flow: Flow, front: Front, gauges):
    """Return pressure and velocity at radii, linear between the centres of cells."""
    cells = gas_of(flow)
    radii = jnp.concatenate([cell_centres(flow.radius), flow.radius[-1:]])
    ahead = gauges > flow.radius[-1]
    pressure = jnp.concatenate([cells.pressure, front.pressure[None]])
    velocity = jnp.concatenate([cells.velocity, front.velocity[None]])
    return (
        jnp.where(ahead, flow.air.pressure, jnp.interp(gauges, radii, pressure)),
        jnp.where(ahead, 0.0, jnp.interp(gauges, radii, velocity)),
    )


def _sedov_cells(labels, gamma):
    r"""Return faces, and momenta and energies of cells, in units of the shock.

    Args:
        labels: Labels of the faces over the radius of the shock, from 0 to 1.
        gamma: Ratio of specific heats [-].

    Returns:
        $r/R$; momentum over $\rho_s u_s R^3$; energy over $\tfrac12\rho_s u_s^2 R^3$
        (behind the shock kinetic and internal energy are equal).
    """
    k = 3.0 * (gamma - 1.0) / (2.0 * gamma + 1.0)
    log_x = _parameter_at(3.0 * jnp.log(labels[1:-1]), gamma)
    place = jnp.concatenate([labels[:1], _profile(log_x, gamma)[0], labels[-1:]])
    ends = jnp.concatenate([labels[:1], jnp.exp(k * log_x), labels[-1:]])
    nodes, weights = map(jnp.asarray, np.polynomial.legendre.leggauss(QUADRATURE))
    # quadrature in x^k, in which the profile is smooth at the centre
    width = jnp.diff(ends)[:, None] / 2.0
    power = ends[:-1, None] + width * (nodes[None, :] + 1.0)
    place_at, velocity, density, pressure, stretch = _profile(jnp.log(power) / k, gamma)
    shell = place_at**3 * stretch / (k * power) * width * weights[None, :]
    momentum = jnp.sum(density * velocity * shell, axis=1)
    return place, momentum, jnp.sum((density * velocity**2 + pressure) * shell, axis=1)


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
    r"""Return $\ln x$ where $3\ln(a/R)$ has given values, by Newton's method."""
    # Near the centre both are in proportion; at x = 1e-20 exactly, to rounding.
    slope = 3.0 * gamma / (2.0 * gamma + 1.0)
    deep = jnp.full_like(gamma, -20.0 * math.log(10.0))
    log_x = jnp.minimum((log_mass - _log_mass(deep, gamma)) / slope + deep, 0.0)

    def closer(_, log_x):
        along = jnp.ones_like(log_x)
        value, rise = jax.jvp(lambda y: _log_mass(y, gamma), (log_x,), (along,))
        # x = 1 is the shock: a step beyond it would leave the domain of the logarithms
        return jnp.minimum(log_x - (value - log_mass) / rise, 0.0)

    return jax.lax.fori_loop(0, SEDOV_STEPS, closer, log_x)
