"""What is fitted: the uncertain numbers of a scene as one vector of coordinates.

Each number has its own coordinate $z$ (`scene.uncertain`): its logarithm where it is
free and positive, itself where it is free, a normal score where it has a prior.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.kept_programs import kept
from jblast.scene import Free, Scene, UncertainScene, parameter_named, with_values
from jblast.scene.uncertain import Belief


class Parameters(eqx.Module):
    """The uncertain numbers of a scene, in a fixed order.

    Attributes:
        names: As in `scene.PARAMETERS`.
        beliefs: One for each name.
        scene: Holds every number that is fixed.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    beliefs: tuple[Belief, ...]
    scene: Scene

    def values(self, z: Float[Array, " free"]) -> dict[str, Float[Array, ""]]:
        """Return the numbers by name."""
        # by NumPy where it is at hand: no program for each place
        at = z if isinstance(z, Tracer) else np.asarray(z)
        return {
            name: belief.constrain(at[i])
            for i, (name, belief) in enumerate(
                zip(self.names, self.beliefs, strict=True)
            )
        }

    @kept
    def values_of_each(
        self, z: Float[Array, "draw free"]
    ) -> dict[str, Float[Array, " draw"]]:
        """Return the numbers by name, for many places at once."""
        return jax.vmap(self.values)(z)

    def scene_at(self, z: Float[Array, " free"]) -> Scene:
        """Return the scene with the numbers put in their places."""
        return with_values(self.scene, self.values(z))

    def log_prior(self, z: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the prior density per unit of $z$."""
        terms = [belief.log_density(z[i]) for i, belief in enumerate(self.beliefs)]
        return sum(terms, start=jnp.zeros((), z.dtype))

    def has_prior(self) -> Float[Array, " free"]:
        """Return 1 where a number has a distribution, 0 where it is free."""
        return jnp.array([0.0 if isinstance(b, Free) else 1.0 for b in self.beliefs])

    def space(self) -> tuple[str, ...]:
        """Return "ln" or "linear" for each number: the space it is told in."""
        return tuple(
            "ln" if parameter_named(n).positive else "linear" for n in self.names
        )


def parameters_of(uncertain: UncertainScene) -> Parameters:
    """Collect the uncertain numbers of a scene."""
    return Parameters(
        names=tuple(uncertain.beliefs),
        beliefs=tuple(uncertain.beliefs.values()),
        scene=uncertain.scene,
    )
