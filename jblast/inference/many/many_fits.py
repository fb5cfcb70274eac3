"""What many logs say, each of its own blast."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int


class ManyFits(eqx.Module):
    """What many logs say, each of its own blast.

    Attributes:
        names: The free numbers.
        z: Where the optimum is, in fitted coordinates: ln of a free positive number;
            what has a prior counts from its median, in its standard deviations (of ln,
            for a log-normal). NaN for a bad log.
        values: The numbers by name.
        cost: Minus ln of the joint density at the optimum, up to a constant.
        misfit: What of it the readings and priors add, 0 for a perfect log.
        covariance: Of the coordinates, by Fisher information; NaN where that is
            singular.
        converged: Whether $z$ is an optimum: the gradient, in standard deviations, is
            down to `tolerance`, and the cost curves upwards on every side. It does not
            say that it is the best one.
        doubtful: Whether $z$ may not be the best there is, all tries used up: it did
            not converge, or has a misfit that readings would hardly have.
        tolerance: How long a gradient counts as none; larger where rounding hides more.
        steps: Places tried.
        bad: Whether a log could not be read.
        faults: What is wrong with each of the first bad logs, by number.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    z: Float[Array, "log free"]
    values: dict[str, Float[Array, " log"]]
    cost: Float[Array, " log"]
    misfit: Float[Array, " log"]
    covariance: Float[Array, "log free free"]
    converged: Bool[Array, " log"]
    doubtful: Bool[Array, " log"]
    tolerance: Float[Array, " log"]
    steps: Int[Array, " log"]
    bad: Bool[Array, " log"]
    faults: tuple[tuple[int, str], ...] = eqx.field(static=True)

    def sd(self) -> Float[Array, "log free"]:
        """Return the standard deviation of each coordinate."""
        return jnp.sqrt(jnp.diagonal(self.covariance, axis1=1, axis2=2))
