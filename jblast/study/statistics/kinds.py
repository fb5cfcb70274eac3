"""The two kinds of outcome, and what a stream of each is reduced by."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Array, Float

from jblast.study.statistics.number import (
    empty_number,
    finish_number,
    merge_numbers,
    number_of,
    numbers_in_slabs,
)
from jblast.study.statistics.share import (
    empty_share,
    finish_share,
    merge_shares,
    share_of,
)
from jblast.study.statistics.stream import blocks, checked_weights

# A state is a NamedTuple of arrays, of one class for each kind.
State = Any


@dataclass(frozen=True)
class Accumulator:
    """How a stream of one kind is reduced to a state of fixed size.

    Attributes:
        empty: The state of no samples: shape of an outcome, origin of its bins, and
            whether samples have weights.
        of: The state of one block, from values, weights or None, and a state whose
            origin it shares; pure, and in JAX where the values are of it.
        merge: Two states that follow one another.
        finish: What a state amounts to, in NumPy.
        in_slabs: The same state from a state and values without weights, sooner.
    """

    empty: Callable[..., State]
    of: Callable[..., State]
    merge: Callable[[State, State], State]
    finish: Callable[..., dict[str, np.ndarray]]
    in_slabs: Callable[[State, np.ndarray], State] | None = None

    def add(
        self,
        state: State,
        values: Array | np.ndarray,
        weights: Float[np.ndarray, " sample"] | None = None,
    ) -> State:
        """Return the state with more samples, in NumPy, block after block.

        Args:
            state: What was so far.
            values: Samples along the first axis; NaN, or -1 of yes and no, where a
                lane failed.
            weights: Of each sample; one each where None.

        Raises:
            ValueError: A weight is negative or not finite, or there are not as many.
        """
        array = np.asarray(values)
        if weights is not None:
            weights = checked_weights(weights, array.shape[0])
        if self.in_slabs is not None and weights is None:
            return self.in_slabs(state, array)
        for part in blocks(array.shape[0]):
            own = None if weights is None else weights[part]
            state = self.merge(state, self.of(array[part], own, state))
        return state


NUMBER = Accumulator(
    empty_number, number_of, merge_numbers, finish_number, numbers_in_slabs
)
YES_NO = Accumulator(empty_share, share_of, merge_shares, finish_share)
ACCUMULATORS = {"number": NUMBER, "yes_no": YES_NO}
"""By `kind` of an outcome."""
