"""What is believed of an uncertain number before the data: free, or a distribution.

Each belief is fitted in a coordinate $z$ of its own. Every distribution here is a
standard normal in its $z$: the log-determinant of the transform is in that already.
A free number is flat in its $z$, which is its logarithm where it is positive.
"""

from abc import abstractmethod
from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.scipy.special import ndtr, ndtri
from jaxtyping import Array, ArrayLike, Float, PRNGKeyArray

from jblast.types import as_float_array


@runtime_checkable
class Belief(Protocol):
    """What `Free`, `Normal`, `LogNormal`, `Uniform` and `LogUniform` have in common."""

    @abstractmethod
    def constrain(self, z: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Return the number at a fitted coordinate."""
        ...

    @abstractmethod
    def unconstrain(self, value: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Return the fitted coordinate of a number."""
        ...

    @abstractmethod
    def log_density(self, z: Float[ArrayLike, "..."]) -> Float[Array, "..."]:
        """Return ln of the prior density per unit of $z$, log-determinant included."""
        ...


class Free(eqx.Module):
    """Nothing is believed: flat in ln of a positive number, flat otherwise.

    Attributes:
        positive: Whether the number is positive.
    """

    positive: bool = eqx.field(static=True)

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        return jnp.exp(z) if self.positive else jnp.asarray(z)

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        return jnp.log(value) if self.positive else jnp.asarray(value)

    def log_density(self, z):
        """Return zero: the density is improper."""
        return jnp.zeros_like(z)


class Normal(eqx.Module):
    """Normal about `mean` with standard deviation `sd`."""

    mean: Float[Array, ""] = eqx.field(converter=as_float_array)
    sd: Float[Array, ""] = eqx.field(converter=as_float_array)

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        return self.mean + self.sd * z

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        return (value - self.mean) / self.sd

    def log_density(self, z):
        """Return ln of the prior density per unit of $z$."""
        return _standard_normal(z)


class LogNormal(eqx.Module):
    """Normal in ln about `median`, with standard deviation ln `factor`."""

    median: Float[Array, ""] = eqx.field(converter=as_float_array)
    factor: Float[Array, ""] = eqx.field(converter=as_float_array)

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        # not a power: XLA has none in vector instructions
        return self.median * jnp.exp(z * jnp.log(self.factor))

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        return jnp.log(value / self.median) / jnp.log(self.factor)

    def log_density(self, z):
        """Return ln of the prior density per unit of $z$."""
        return _standard_normal(z)


class Uniform(eqx.Module):
    """Uniform from `lo` to `hi`, fitted as the normal score of its quantile."""

    lo: Float[Array, ""] = eqx.field(converter=as_float_array)
    hi: Float[Array, ""] = eqx.field(converter=as_float_array)

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        return self.lo + (self.hi - self.lo) * ndtr(jnp.asarray(z))

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        return ndtri((value - self.lo) / (self.hi - self.lo))

    def log_density(self, z):
        """Return ln of the prior density per unit of $z$."""
        return _standard_normal(z)


class LogUniform(eqx.Module):
    """Uniform in ln from `lo` to `hi`, fitted as the normal score of its quantile."""

    lo: Float[Array, ""] = eqx.field(converter=as_float_array)
    hi: Float[Array, ""] = eqx.field(converter=as_float_array)

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        return self.lo * (self.hi / self.lo) ** ndtr(jnp.asarray(z))

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        return ndtri(jnp.log(value / self.lo) / jnp.log(self.hi / self.lo))

    def log_density(self, z):
        """Return ln of the prior density per unit of $z$."""
        return _standard_normal(z)


Prior = Normal | LogNormal | Uniform | LogUniform


def _standard_normal(z):
    return -0.5 * jnp.square(z) - 0.5 * jnp.log(2 * jnp.pi)


def draw(key: PRNGKeyArray, prior: Prior) -> Float[Array, ""]:
    """Draw one number from a prior."""
    return prior.constrain(jax.random.normal(key))
