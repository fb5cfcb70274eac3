"""Densities with known moments, for the tests of samplers."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np


class Gaussian(eqx.Module):
    """A normal with unit normals' correlations (see `COVARIANCE`)."""

    precision: jnp.ndarray

    def log_density(self, w):
        return -0.5 * w @ self.precision @ w


COVARIANCE = np.array([[1.0, 0.6, 0.0], [0.6, 4.0, -0.5], [0.0, -0.5, 0.25]])


def gaussian():
    return Gaussian(jnp.asarray(np.linalg.inv(COVARIANCE)))


class Banana(eqx.Module):
    """x normal; y normal about x^2 times a bend, with sd 1."""

    bend: jnp.ndarray
    long: jnp.ndarray

    def log_density(self, w):
        bent = w[1] - self.bend * w[0] ** 2
        return -0.5 * (w[0] / self.long) ** 2 - 0.5 * bent**2


def banana():
    """y has mean 0.5 and variance 1.5."""
    return Banana(jnp.array(0.5), jnp.array(1.0))


class Two(eqx.Module):
    """Two unit normals, apart along the first axis; a third is about the second."""

    apart: jnp.ndarray

    def log_density(self, w):
        right = -0.5 * (w[0] - self.apart) ** 2
        left = -0.5 * (w[0] + self.apart) ** 2 + jnp.log(0.5)
        return jnp.logaddexp(right, left) - 0.5 * w[1] ** 2


class Nowhere(eqx.Module):
    """No number but at the origin's neighbours."""

    reach: jnp.ndarray

    def log_density(self, w):
        return jnp.where(jnp.sum(w**2) < self.reach, -0.5 * jnp.sum(w**2), jnp.nan)
