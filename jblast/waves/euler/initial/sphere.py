r"""A sphere of compressed gas let go: the shock is fitted from its first moment.

When its wall vanishes the sphere's surface is Riemann's problem, with the contact at
$u^*$ and a shock ahead of it. The start is a moment later: between contact and shock
lies a thin shell of air in that state, in it all the cells of the air. The sphere keeps
its own cells, of fixed mass; the outermost has given the shell its energy and momentum.
"""

import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError
from jblast.types import as_float_array
from jblast.waves.euler.exact_riemann import star_state
from jblast.waves.euler.gas import IdealGas
from jblast.waves.euler.mesh import GradedMesh
from jblast.waves.euler.shock_fitting import sound_speed
from jblast.waves.euler.state import Ambient, Flow, FlowState, Primitives

FEWEST_CELLS = 10
"""In the sphere, and in the air."""
SHELL = 0.25
"""Way of the shock before the start, in cells of the sphere."""


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
    r"""Return a sphere of the ambient gas at rest, compressed, a moment after release.

    Args:
        radius: Of the sphere [m].
        pressure: In it [Pa], above the ambient.
        density: In it [kg/m3].
        ambient: The air around.
        core_cells: Cells in the sphere.
        air_cells: Cells in the air that the shock has overtaken.
        length: Over which the mesh of the air is graded far out [m];
            $\sqrt[3]{E/P_0}$ of the sphere's energy if not given.

    Raises:
        InputError: There are too few cells to hold the source, or the pressure is not
            above the ambient.
    """
    for name, cells in (("core_cells", core_cells), ("air_cells", air_cells)):
        if cells < FEWEST_CELLS:
            raise InputError(
                f"{name}: expected at least {FEWEST_CELLS} to hold the source, "
                f"got {cells}"
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
