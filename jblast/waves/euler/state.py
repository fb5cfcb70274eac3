r"""State of the flow, and the constants of a run: gas, mesh and geometry.

The solver uses four methods of a gas only. Another equation of state (JWL for the
products of TNT) is therefore another class like `IdealGas`.

Meshes are defined by mass, not by position. A face is identified by the mass inside it.
It is at rest in the gas, or moves outward through it at a prescribed rate. Its position
in space follows from the volumes. Therefore contacts stay sharp in a mesh at rest, the
hot and thin core of a point source has a few large cells, and mass is conserved
exactly.

With a fitted shock the mesh is a function of the shock's radius $R$ alone. Air ahead of
it has its radius $a$ as label, and the faces behind it have the labels

$$a = R - D, \qquad D = \frac{\eta\,X L}{L + X(1-\eta)}, \qquad X = R - a_0$$

with $\eta$ equally spaced from 1 at the innermost label $a_0$ to 0 at the shock. While
$X \ll L$ the labels are equally spaced. Far out the cells at the shock keep the width
$L\,\Delta\eta$, and those deep inside grow: $L$ is about the length of the wave.

Areas and volumes are per steradian in a sphere ($r^2$ and $r^3/3$), and per square
metre in a plane (1 and $r$).
"""

from abc import abstractmethod
from typing import Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO
from jblast.types import as_float_array

Geometry = Literal["planar", "spherical"]


class FlowState(eqx.Module):
    """The flow at one instant; masses, volumes and energies per steradian (or m2).

    Attributes:
        radius: Radii of the faces [m].
        mass: Mass of each cell [kg].
        volume: Volume of each cell [m3]. The faces give it too, but with few digits in
            float32 if a cell is thin.
        momentum: Outward momentum of each cell [kg m/s].
        energy: Kinetic and internal energy of each cell [J].
        clock: Radius of the fitted shock [m], or time [s] if none is fitted.
        time: Time [s].
        alive: True if all densities and pressures are positive, checked at the begin of
            each step and at the end of a run. If False, the state no longer changes.
    """

    radius: Float[Array, "face ..."]
    mass: Float[Array, "cell ..."]
    volume: Float[Array, "cell ..."]
    momentum: Float[Array, "cell ..."]
    energy: Float[Array, "cell ..."]
    clock: Float[Array, "..."]
    time: Float[Array, "..."]
    alive: Bool[Array, "..."]


class Gas(eqx.Module):
    """Equation of state of a gas; densities in kg/m3, pressures in Pa."""

    def of_cells(self, cells: slice | tuple[int, ...]) -> "Gas":
        """Return the gas of some cells; `self` if it is the same in all."""
        del cells
        return self

    @abstractmethod
    def pressure(
        self, density: Float[Array, "..."], energy: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Return the pressure [Pa] for an internal energy per volume [J/m3]."""

    @abstractmethod
    def energy(
        self, density: Float[Array, "..."], pressure: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Return the internal energy per volume [J/m3] for a pressure [Pa]."""

    @abstractmethod
    def stiffness(
        self, density: Float[Array, "..."], pressure: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        r"""Return the isentropic bulk modulus $\rho c^2$ [Pa]."""

    @abstractmethod
    def shock_slope(self) -> Float[Array, "..."]:
        r"""Return $s$ of a shock: $D \approx c + 2s\,\Delta u$ if it is strong [-]."""


class IdealGas(Gas):
    r"""An ideal gas: $p = (\gamma-1)\,\rho e$, $\rho c^2 = \gamma p$.

    Attributes:
        gamma: Ratio of specific heats $\gamma$ [-].
    """

    gamma: Float[Array, "..."] = eqx.field(
        converter=as_float_array, default=AIR_HEAT_CAPACITY_RATIO
    )

    def pressure(self, density, energy):
        """Return the pressure [Pa]."""
        del density
        return (self.gamma - 1.0) * energy

    def energy(self, density, pressure):
        """Return the internal energy per volume [J/m3]."""
        del density
        return pressure / (self.gamma - 1.0)

    def stiffness(self, density, pressure):
        r"""Return $\rho c^2$ [Pa]."""
        del density
        return self.gamma * pressure

    def shock_slope(self):
        r"""Return $(\gamma+1)/4$.

        A shock that changes the velocity by $\Delta u$ runs into gas at rest with
        $D = s\Delta u + \sqrt{c^2 + (s\Delta u)^2}$ exactly.
        """
        return (self.gamma + 1.0) / 4.0


class Ambient(eqx.Module):
    """Air at rest ahead of a fitted shock.

    Attributes:
        pressure: Ambient pressure [Pa].
        density: Ambient density [kg/m3].
        gas: Ideal gas, whose jump conditions have a closed form.
    """

    pressure: Float[Array, "..."]
    density: Float[Array, "..."]
    gas: IdealGas


class Mesh(eqx.Module):
    """Mass that each face overtakes, as a function of the clock of a run.

    The clock is the radius of the fitted shock [m], or time [s] if none is fitted.
    Cells and faces are the first axis; batch axes may follow.
    """

    @abstractmethod
    def swept(
        self, clock: Float[Array, "..."], advance: Float[Array, "..."]
    ) -> Float[Array, "face ..."]:
        """Return the mass that each face overtakes as the clock advances [kg]."""

    @abstractmethod
    def sweeping(self, clock: Float[Array, "..."]) -> Float[Array, "face ..."]:
        """Return the mass that each face overtakes per unit of the clock."""


class Flow(eqx.Module):
    """Constants of a run.

    Attributes:
        mesh: Masses of the cells.
        gas: Gas of the cells.
        ambient: Air ahead of a fitted shock; None for a rigid wall at the outer end.
            The inner end is a rigid wall, or the centre.
        geometry: "planar" or "spherical".
        limited: True for limited slopes; False for smooth flow only.
    """

    mesh: Mesh
    gas: Gas
    ambient: Ambient | None
    geometry: Geometry = eqx.field(static=True, default="spherical")
    limited: bool = eqx.field(static=True, default=True)


class Primitives(NamedTuple):
    """Means over cells, or values at faces.

    Attributes:
        density: Density [kg/m3].
        velocity: Outward velocity [m/s].
        pressure: Pressure [Pa].
    """

    density: Float[Array, "..."]
    velocity: Float[Array, "..."]
    pressure: Float[Array, "..."]


def primitives(state: FlowState, gas: Gas) -> Primitives:
    """Return density, velocity and pressure of each cell."""
    density = state.mass / state.volume
    velocity = state.momentum / state.mass
    internal = (state.energy - 0.5 * velocity * state.momentum) / state.volume
    return Primitives(density, velocity, gas.pressure(density, internal))


def is_positive(state: FlowState, gas: Gas) -> Bool[Array, "..."]:
    """Return True if all densities and pressures are positive."""
    cells = primitives(state, gas)
    # a NaN compares as False, so that it counts as lost too
    least = jnp.minimum(cells.density, cells.pressure)
    return jnp.all(least > 0.0, axis=0)


class SlidingMesh(Mesh):
    """Faces at rest in the gas, or with constant rates; without a fitted shock.

    Attributes:
        rate: Mass that each face overtakes [kg/s], not negative; zero at both ends.
    """

    rate: Float[Array, "face ..."]

    def swept(self, clock, advance):
        """Return the mass that each face overtakes [kg]."""
        del clock
        return self.rate * advance[None]

    def sweeping(self, clock):
        """Return the mass that each face overtakes [kg/s]."""
        del clock
        return self.rate


class GradedMesh(Mesh):
    """Cells graded towards a fitted shock, around a core of cells of fixed mass.

    Attributes:
        label: Outermost label of the core $a_0$ [m]; zero if there is none.
        length: $L$ [m].
        density: Density of the air ahead [kg/m3].
        cells: Number of cells between the core and the shock.
        core: Number of cells in the core.
        geometry: "planar" or "spherical".
    """

    label: Float[Array, "..."]
    length: Float[Array, "..."]
    density: Float[Array, "..."]
    cells: int = eqx.field(static=True)
    core: int = eqx.field(static=True, default=0)
    geometry: Geometry = eqx.field(static=True, default="spherical")

    def _eta(self, like: Float[Array, "..."]) -> Float[Array, "face ..."]:
        eta = 1.0 - jnp.arange(self.cells + 1, dtype=like.dtype) / self.cells
        return eta.reshape(-1, *(1,) * like.ndim)

    def _crowding(self, clock):
        r"""Return $L/(L + X(1-\eta))$ at each face; its square is $dD/d(\eta X)$."""
        reach, length = (clock - self.label)[None], self.length[None]
        return length / (length + reach * (1.0 - self._eta(clock)))

    def labels(self, clock: Float[Array, "..."]) -> Float[Array, "face ..."]:
        """Return the label of each face outside the core [m]."""
        reach = (clock - self.label)[None]
        return self.label[None] + reach * (
            1.0 - self._eta(clock) * self._crowding(clock)
        )

    def masses(self, clock: Float[Array, "..."]) -> Float[Array, "cell ..."]:
        """Return the mass in each cell outside the core [kg]."""
        reach, crowding = (clock - self.label)[None], self._crowding(clock)
        # The difference of depths in closed form: for thin cells a subtraction of the
        # labels would lose all digits.
        stretch = reach * (1.0 + reach / self.length[None]) / self.cells
        widths = stretch * crowding[1:] * crowding[:-1]
        shells = volume_between(self.labels(clock)[:-1], widths, self.geometry)
        return self.density[None] * shells

    def swept(self, clock, advance):
        """Return the mass that each face overtakes [kg]."""
        crowding = self._crowding(clock) * self._crowding(clock + advance)
        # Exact for any advance: X C(X) grows by the advance times both values of C.
        path = advance[None] * (1.0 - self._eta(clock) * crowding)
        return self._with_core(volume_between(self.labels(clock), path, self.geometry))

    def sweeping(self, clock):
        """Return the mass that each face overtakes per metre of the shock [kg/m]."""
        speed = 1.0 - self._eta(clock) * self._crowding(clock) ** 2
        return self._with_core(area(self.labels(clock), self.geometry) * speed)

    def _with_core(self, volume):
        """Return masses at all faces, with zero for the core and the innermost face."""
        mass = self.density[None] * volume
        none = jnp.zeros_like(mass[:1])
        return jnp.concatenate([none] * (self.core + 1) + [mass[1:]])


def area(radius: Float[Array, "..."], geometry: Geometry) -> Float[Array, "..."]:
    """Return the area of a face [m2]."""
    return radius * radius if geometry == "spherical" else jnp.ones_like(radius)


def volume_between(
    inner: Float[Array, "..."],
    thickness: Float[Array, "..."],
    geometry: Geometry,
) -> Float[Array, "..."]:
    r"""Return the volume of a shell [m3], $h\,(r^2 + rh + h^2/3)$.

    Args:
        inner: Inner radius $r$ [m].
        thickness: $h$ [m]; not as a difference of radii, which loses digits.
        geometry: "planar" or "spherical".
    """
    if geometry == "planar":
        return thickness
    return thickness * (inner * (inner + thickness) + thickness * thickness / 3.0)


def swept_radius(
    radius: Float[Array, "..."], volume: Float[Array, "..."], geometry: Geometry
) -> Float[Array, "..."]:
    r"""Return the radius of a face after it has swept a volume, $\sqrt[3]{r^3+3V}$ [m].

    Args:
        radius: Radius before $r$ [m].
        volume: Swept volume $V$ [m3], small compared with $r^3$.
        geometry: "planar" or "spherical".
    """
    if geometry == "planar":
        return radius + volume
    # y = r'/r - 1 solves y^3 + 3y^2 + 3y = x: its series, then Newton once. A cube root
    # has no vector instruction, and in float32 no digits for a small step.
    at_centre = radius == 0.0
    r = jnp.where(at_centre, 1.0, radius)
    x = jnp.where(at_centre, 0.0, volume / (r * r * r))
    y = x * (1.0 - x * (1.0 - 5.0 / 3.0 * x))
    rest = y * (3.0 + y * (3.0 + y)) - 3.0 * x
    return radius * (1.0 + y - rest / (3.0 * (1.0 + y) * (1.0 + y)))
