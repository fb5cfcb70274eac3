"""A stretch of a walk: what the samplers hand back, and what they go on from."""

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from jblast.inference.importance.whitening import Density
from jblast.inference.mcmc.independence_move import Mixture


class WalkState(NamedTuple):
    """Where the walkers stand.

    Attributes:
        walkers: Their places.
        log_density: ln of the density there.
        random: What the next random numbers follow from.
    """

    walkers: Float[np.ndarray, "walker free"]
    log_density: Float[np.ndarray, " walker"]
    random: Mapping[str, np.ndarray]


class Segment(NamedTuple):
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
    def end(self) -> WalkState:
        """Where the walkers stand after the last step."""
        return WalkState(self.chain[-1], self.log_density[-1], self.random)


@runtime_checkable
class Engine(Protocol):
    """What moves the walkers."""

    @property
    def tick_steps(self) -> int:
        """Steps from one call of `tick` to the next."""
        ...

    def first_random(self, seed: int) -> Mapping[str, np.ndarray]:
        """Return what the random numbers start from, as arrays."""
        ...

    def walk(
        self,
        density: Density,
        mixture: Mixture,
        state: WalkState,
        steps: int,
        tick: Callable[[], None],
    ) -> Segment:
        """Walk on; Ctrl-C ends the stretch early.

        Args:
            density: Where to walk.
            mixture: Of the normals about its known optima.
            state: Where the walkers stand.
            steps: How many steps.
            tick: Called after each, or each `tick_steps`.
        """
        ...


SHARES = {"near": 0.7, "jump": 0.1, "stretch": 0.1, "independence": 0.1}
r"""How often a step is of each kind.

near: along the difference of two other walkers, $2.38/\sqrt{2 d}$ of it long (ter Braak
2006, Stat. Comput. 16:239). jump: the whole of it, which leads from mode to mode.
stretch: towards or away from another walker (Goodman & Weare 2010), for long tails.
independence: to a place drawn from the normals about the known optima (see `mixture`).
Five microphones, four unknowns, 64 walkers: autocorrelation time 11 steps, without that
17, with the stretch move alone 59; for a normal of 12 unknowns 13, 45 and 184. A charge
beside a line of microphones and its mirror image: 36, without that some 460.
"""
