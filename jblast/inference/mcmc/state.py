"""A stretch of a walk: what the samplers hand back, and what they go on from."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class State(NamedTuple):
    """Where the walkers stand.

    Attributes:
        walkers: Their places.
        log_density: ln of the density there.
        random: What the next random numbers follow from.
    """

    walkers: Float[np.ndarray, "walker free"]
    log_density: Float[np.ndarray, " walker"]
    random: Mapping[str, np.ndarray]


class Stretch(NamedTuple):
    """Steps in a row.

    Attributes:
        chain: Places after each step.
        log_density: ln of the density there.
        random: As of `State`, after the last step.
        interrupted: Whether Ctrl-C ended it early.
    """

    chain: Float[np.ndarray, "step walker free"]
    log_density: Float[np.ndarray, "step walker"]
    random: Mapping[str, np.ndarray]
    interrupted: bool = False

    @property
    def end(self) -> State:
        """Where the walkers stand after the last step."""
        return State(self.chain[-1], self.log_density[-1], self.random)


SHARES = {"near": 0.7, "jump": 0.1, "stretch": 0.1, "anew": 0.1}
r"""How often a step is of each kind.

near: along the difference of two other walkers, $2.38/\sqrt{2 d}$ of it long (ter Braak
2006, Stat. Comput. 16:239). jump: the whole of it, which leads from mode to mode.
stretch: towards or away from another walker (Goodman & Weare 2010), for long tails.
anew: to a place drawn from the normals about the known optima (see `mixture`).
Five microphones, four unknowns, 64 walkers: autocorrelation time 11 steps, without anew
17, with the stretch move alone 59; for a normal of 12 unknowns 13, 45 and 184. A charge
beside a line of microphones and its mirror image: 36, without anew some 460.
"""
