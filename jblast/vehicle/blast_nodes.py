"""Gauss's rule over the phases of a blast wave, as far as they fall within a step."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.vehicle.blast_passage import Passage
from jblast.vehicle.blast_wave import density_ratio, overpressure, wind_speed
from jblast.vehicle.motion import Number

NODES = 8
"""Of each phase: they leave below 1e-3 of the drag's impulse where a step holds all."""


def _gauss() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes of Gauss's rule on 0 to 1, weights, and weights of the integrals so far."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    nodes, weights = (nodes + 1) / 2, weights / 2
    # l_j of Lagrange, in Legendre's polynomials, whose integrals stay well conditioned
    legendre = np.polynomial.legendre
    basis = np.linalg.inv(legendre.legvander(2 * nodes - 1, NODES - 1))
    so_far = np.stack(
        [
            legendre.legval(2 * nodes - 1, legendre.legint(column, lbnd=-1)) / 2
            for column in basis.T
        ],
        axis=1,
    )
    return nodes, weights, so_far


PLACES, WEIGHTS, SO_FAR = _gauss()


class Nodes(NamedTuple):
    """Places of Gauss's rule: a row for each phase of the wave."""

    since: Float[Array, "phase node"]
    width: Float[Array, " phase"]
    wind: Float[Array, "phase node"]
    density: Float[Array, "phase node"]

    def total(self, value: Float[Array, "phase node"]) -> Number:
        """Integral over the step."""
        return jnp.sum(self._parts(value))

    def until(self, value: Float[Array, "phase node"]) -> Float[Array, "phase node"]:
        """Integral from the step's beginning to each node."""
        parts = self._parts(value)
        earlier = jnp.stack([jnp.zeros_like(parts[0]), parts[0]])
        so_far = jnp.asarray(SO_FAR, value.dtype)
        inner = jnp.sum(value[:, None, :] * so_far[None], axis=2)
        return earlier[:, None] + self.width[:, None] * inner

    def _parts(self, value: Float[Array, "phase node"]) -> Float[Array, " phase"]:
        weights = jnp.asarray(WEIGHTS, value.dtype)
        return self.width * jnp.sum(value * weights[None], axis=1)


def nodes_within(passage: Passage, end_s: Number) -> Nodes:
    """Return the nodes of the part of a passage before a time since arrival [s]."""
    wave = passage.wave
    past = wave.duration_s + wave.suction_s
    edges = jnp.stack([jnp.zeros_like(past), wave.duration_s, past])
    edges = jnp.clip(edges, passage.start_s, end_s)
    width = jnp.diff(edges)
    places = jnp.asarray(PLACES, width.dtype)
    since = edges[:-1, None] + width[:, None] * places[None]
    density = passage.air_density * density_ratio(overpressure(wave, since))
    return Nodes(since, width / passage.rate, wind_speed(wave, since), density)
