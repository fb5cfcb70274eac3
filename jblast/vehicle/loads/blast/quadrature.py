"""Gauss's rule over the phases of a blast wave, as far as they fall within a step."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.vehicle.dynamics.components import Number
from jblast.vehicle.loads.blast.passage import Passage
from jblast.vehicle.loads.blast.wave import density_ratio, overpressure, wind_speed

NODES = 8
"""Of each phase: they leave below 1e-3 of the drag's impulse where a step holds all."""


class NodePlace(NamedTuple):
    """Where a node stands: a number each, or an array over all nodes.

    Attributes:
        share: How far in its phase.
        weight: Of the rule.
        later: Whether it is in the second phase.
    """

    share: Float[Array, "..."]
    weight: Float[Array, "..."]
    later: Bool[Array, "..."]


class Node(NamedTuple):
    """What there is at a node.

    Attributes:
        since: Time since arrival [s].
        width: Of its phase, as time of the flight [s].
        wind: Speed [m/s].
        density: [kg/m3].
    """

    since: Number
    width: Number
    wind: Number
    density: Number


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


def places(dtype: np.dtype) -> NodePlace:
    """Return all nodes, those of the first phase first."""
    return NodePlace(
        jnp.asarray(np.tile(PLACES, 2), dtype),
        jnp.asarray(np.tile(WEIGHTS, 2), dtype),
        jnp.asarray(np.repeat([False, True], NODES)),
    )


def until(value: Float[Array, " node"]) -> Float[Array, " node"]:
    """Integrate from the step's beginning to each node.

    Args:
        value: At all nodes, times the width of their phase.
    """
    whole = np.tile(WEIGHTS, (NODES, 1))
    matrix = np.block([[SO_FAR, 0 * SO_FAR], [whole, SO_FAR]])
    return jnp.asarray(matrix, value.dtype) @ value


def node_at(passage: Passage, end_s: Number, place: NodePlace) -> Node:
    """Return a node of the part of a passage before a time since arrival [s]."""
    wave = passage.wave
    zero, past = jnp.zeros_like(end_s), wave.duration_s + wave.suction_s
    first, middle, last = (
        jnp.clip(edge, passage.start_s, end_s) for edge in (zero, wave.duration_s, past)
    )
    begin = jnp.where(place.later, middle, first)
    width = jnp.where(place.later, last - middle, middle - first)
    since = begin + width * place.share
    density = passage.air_density * density_ratio(overpressure(wave, since))
    return Node(since, width / passage.rate, wind_speed(wave, since), density)
