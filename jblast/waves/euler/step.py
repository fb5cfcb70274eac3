r"""One step: all faces, all cells, and the clock.

In a cell of mass $M$, between faces of area $A$ that overtake the mass $\dot M$,

$$\frac{dV}{dt} = [A\dot V], \qquad \frac{d(Mu)}{dt} = [A\dot P] + p\,[A], \qquad
\frac{dE}{dt} = [A\dot E]$$

with the brackets outer face minus inner face and the fluxes of `riemann.py`. $p[A]$ is
the pressure of the sides of a cone; it balances the faces exactly where the pressure is
uniform. Through a fitted shock come the ambient mass, its energy and $-P_0 A$: Rankine
and Hugoniot, so energy is conserved to rounding whatever the shock does.

The clock is the radius of the fitted shock, $dt = dR/U$, so that the mesh is known
before the step, a run ends where it is told to, and a derivative is taken at fixed
radius. Both in $R$ and in $t$: Heun's method (SSP-RK2; Shu and Osher 1988).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.gas import Gas
from jblast.waves.euler.geometry import area, swept_radius
from jblast.waves.euler.reconstruction import reconstruct
from jblast.waves.euler.riemann import face_flux, wave_mass_flux
from jblast.waves.euler.shock_fitting import Front, fitted_front
from jblast.waves.euler.state import Flow, FlowState, Primitives, primitives
from jblast.waves.euler.xla_layout import materialized, worked_out_faces


class Rates(NamedTuple):
    """What a step of the clock adds, and the front it was reckoned with.

    Attributes:
        swept: Volume that each face sweeps [m3].
        mass: Gain of each cell [kg].
        volume: Gain of each cell [m3].
        momentum: Gain of each cell [kg m/s].
        energy: Gain of each cell [J].
        time: [s].
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
    """Advance by one step, and return what the front was at its beginning.

    Args:
        state: Where the flow is.
        flow: What does not change.
        courant: Fraction of the largest stable step, above 0 and at most 1.
        end: The clock does not pass it; once there, steps have no length.
    """
    cells = primitives(state, flow.gas)
    front = _front(cells, flow)
    limit = courant * _largest_step(state, flow, cells, front)
    alive = state.alive & (limit > 0.0)
    wanted = jnp.minimum(jnp.where(alive, limit, 0.0), end - state.clock)
    # The steps are held while parameters vary: a derivative is that of the steps taken.
    # The rounding of the clock is part of the step.
    clock = state.clock + jnp.maximum(wanted, 0.0)
    advance = jax.lax.stop_gradient(clock - state.clock)
    clock = state.clock + advance
    overtaken = flow.mesh.swept(state.clock, advance)
    first = _rates(state, flow, cells, front, overtaken, advance)
    middle = materialized(_moved(state, first, clock, flow))
    cells = primitives(middle, flow.gas)
    second = _rates(middle, flow, cells, _front(cells, flow), overtaken, advance)
    both = materialized(jax.tree.map(lambda a, b: 0.5 * (a + b), first, second))
    moved = _moved(state, both, clock, flow)
    new = jax.tree.map(lambda a, b: jnp.where(alive, a, b), moved, state)
    return eqx.tree_at(lambda s: s.alive, new, alive), front


def _moved(state: FlowState, rates: Rates, clock: Float[Array, "..."], flow: Flow):
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
    """Return the shock, or the pressure on the wall."""
    if flow.ambient is not None:
        return fitted_front(cells, flow.gas.of_cells(slice(-1, None)), flow.ambient)
    still = jnp.zeros_like(cells.velocity[-1])
    return Front(jnp.ones_like(still), cells.pressure[-1], still)


def _largest_step(
    state: FlowState,
    flow: Flow,
    cells: Primitives,
    front: Front,
) -> Float[Array, "..."]:
    """Return the advance of the clock in which no wave crosses a cell.

    Zero where a cell has no volume; NaN, by a root, where a pressure is below zero.
    """
    sound = wave_mass_flux(cells, jnp.zeros_like(cells.density), flow.gas)
    outer = area(state.radius[1:], flow.geometry)
    crossing = outer * sound / front.speed[None] + flow.mesh.sweeping(state.clock)[1:]
    crossed = jnp.where(state.volume > 0.0, state.mass / crossing, 0.0)
    return jnp.min(crossed, axis=0)


def _rates(
    state: FlowState,
    flow: Flow,
    cells: Primitives,
    front: Front,
    overtaken: Float[Array, "face ..."],
    advance: Float[Array, "..."],
) -> Rates:
    """Return what a step adds if the flow stays what it is."""
    cells = materialized(cells)
    left, right = materialized(
        reconstruct(cells, fitted=flow.ambient is not None, limited=flow.limited)
    )
    time = advance / front.speed
    areas = area(state.radius, flow.geometry)
    impulse = areas * time[None]
    number, at = cells.density.shape[0], worked_out_faces()
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

    What goes through a wall is nothing to the last digit, but for the pressure.
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
    """Return the pressure on a rigid wall: the mirrored flow is its other side."""
    at = Primitives(*(q[face] for q in faces))
    towards = outward * at.velocity
    approach = jnp.maximum(2.0 * towards, 0.0)
    q = wave_mass_flux(at, approach, gas.of_cells(slice(face, (face + 1) or None)))
    return at.pressure + q * towards
