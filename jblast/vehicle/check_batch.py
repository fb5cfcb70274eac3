"""Whether winds, loads and controllers are told for the vehicles that fly.

The kernel takes the last column for every vehicle that has none of its own: without
this it would fly an `Each` of too few, and say nothing.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax

from jblast.errors import InputError
from jblast.vehicle.control.position_hold import PositionHold
from jblast.vehicle.loads.blast.load import BlastLoad
from jblast.vehicle.loads.gusts import FriedlanderGust, NWaveGust, StepGust
from jblast.vehicle.rollout.batching import Each

VECTORS = {
    StepGust: "velocity_m_s",
    NWaveGust: "velocity_m_s",
    FriedlanderGust: "velocity_m_s",
    PositionHold: "target_m",
    BlastLoad: "wind_m_s",
}
"""What has three numbers where there is no batch."""


def check_shared(given: Mapping[str, Sequence[Any]], batch: tuple[int, ...]) -> None:
    """Refuse what is told for other vehicles than those of the batch.

    Args:
        given: Winds, loads, controllers by their name.
        batch: Axes of the state.

    Raises:
        InputError: An `Each` whose arrays do not begin with the batch's axes, or one
            beside a single vehicle; or arrays for many without `Each`.
    """
    for name, values in given.items():
        for value in values:
            if not isinstance(value, Each):
                _check_alone(name, value)
                continue
            if not batch:
                raise InputError(f"{name}: expected Each beside a batch, got one state")
            for array in filter(eqx.is_array, jax.tree.leaves(value)):
                if array.shape[: len(batch)] != batch:
                    raise InputError(
                        f"{name}: expected Each of arrays that begin with {batch}, as "
                        f"the state does, got {array.shape}"
                    )


def _check_alone(name: str, value: Any) -> None:
    """Refuse what is built in and has axes of a batch.

    Raises:
        InputError: It has.
    """
    own = next((n for kind, n in VECTORS.items() if isinstance(value, kind)), None)
    if own is not None and getattr(value, own).ndim != 1:
        raise InputError(
            f"{name}: expected {own} of the shape (3,), or a batch wrapped in Each, "
            f"got {getattr(value, own).shape}"
        )
