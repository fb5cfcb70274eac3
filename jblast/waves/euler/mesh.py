r"""Which mass each cell holds: meshes laid out by mass, not by place.

A face is known by the mass inside it. It stands in the gas, or moves outward through it
at a rate given beforehand; where it is in space follows from the volumes. So contacts
stay sharp in a mesh that stands, the hot and empty core of a point source takes a few
large cells by itself, and mass is conserved exactly.

With a fitted shock the mesh is a function of the shock's radius $R$ alone. Air ahead of
it has its radius $a$ as label, and the faces behind it have the labels

$$a = R - D, \qquad D = \frac{\eta\,X L}{L + X(1-\eta)}, \qquad X = R - a_0$$

with $\eta$ equally spaced from 1 at the innermost label $a_0$ to 0 at the shock. While
$X \ll L$ the labels are equally spaced. Far out the cells at the shock keep the width
$L\,\Delta\eta$, and those deep inside grow: $L$ is about the length of the wave.
"""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.geometry import Geometry, area, volume_between


class Mesh(eqx.Module):
    """Which mass each face overtakes, as a function of the clock that drives the run.

    The clock is the radius of the fitted shock [m], or time [s] where none is fitted.
    Cells and faces are the first axis; a batch may follow.
    """

    @abstractmethod
    def swept(
        self, clock: Float[Array, "..."], advance: Float[Array, "..."]
    ) -> Float[Array, "face ..."]:
        """Return the mass that each face overtakes as the clock advances [kg]."""

    @abstractmethod
    def sweeping(self, clock: Float[Array, "..."]) -> Float[Array, "face ..."]:
        """Return the mass that each face overtakes per unit of the clock."""


class SlidingMesh(Mesh):
    """Faces that stand in the gas, or overtake it at constant rates; no shock fitted.

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
    """Cells graded towards a fitted shock, around a core of cells that stand.

    Attributes:
        label: Outermost label of the core $a_0$ [m]; zero if there is none.
        length: $L$ [m].
        density: Of the air ahead [kg/m3].
        cells: How many lie between the core and the shock.
        core: How many lie in the core.
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
        # The depths' difference in closed form: thin cells are none of large numbers.
        stretch = reach * (1.0 + reach / self.length[None]) / self.cells
        widths = stretch * crowding[1:] * crowding[:-1]
        shells = volume_between(self.labels(clock)[:-1], widths, self.geometry)
        return self.density[None] * shells

    def swept(self, clock, advance):
        """Return the mass that each face overtakes [kg]."""
        crowding = self._crowding(clock) * self._crowding(clock + advance)
        way = advance[None] * (1.0 - self._eta(clock) * crowding)
        return self._with_core(volume_between(self.labels(clock), way, self.geometry))

    def sweeping(self, clock):
        """Return the mass that each face overtakes per metre of the shock [kg/m]."""
        speed = 1.0 - self._eta(clock) * self._crowding(clock) ** 2
        return self._with_core(area(self.labels(clock), self.geometry) * speed)

    def _with_core(self, volume):
        """Return masses at all faces: those of the core stand, and the innermost."""
        mass = self.density[None] * volume
        none = jnp.zeros_like(mass[:1])
        return jnp.concatenate([none] * (self.core + 1) + [mass[1:]])
