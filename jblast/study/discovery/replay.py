"""Equations found, integrated and held against the record they were found in."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.study.discovery.discover import Discovery
from jblast.study.discovery.flow import CLOSE, flow, misfit


@dataclass(frozen=True)
class Replay:
    """A trajectory by the equations alone, from the first row on.

    Attributes:
        states: At the rows; NaN from where the integration was given up.
        misfit: Root mean square of what lies between it and the data, the noise taken
            off in quadrature, as a share of the state's standard deviation.
        reproduced: Whether the misfit is at most 10 %, state by state.
    """

    states: Float[np.ndarray, "row state"]
    misfit: Float[np.ndarray, " state"]
    reproduced: tuple[bool, ...]


def replay(
    discovery: Discovery,
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"] | None = None,
    *,
    held: bool = False,
    noise: bool = True,
) -> Replay:
    """Integrate the equations and hold them against the data.

    Args:
        discovery: The equations.
        time_s: Of the rows, rising [s].
        states: At the rows.
        inputs: At the rows.
        held: Inputs keep their value until the next row; else linear between rows.
        noise: Whether the states have the noise found; it is taken off then.
    """
    inputs = np.empty((len(time_s), 0)) if inputs is None else inputs
    own = flow(
        discovery.candidates.evaluate,
        discovery.coefficients,
        discovery.start,
        time_s,
        inputs,
        np.std(states, axis=0),
        held=held,
    )
    off = misfit(own, states, noise * discovery.noise_sd)
    return Replay(own, off, tuple((off <= CLOSE).tolist()))
