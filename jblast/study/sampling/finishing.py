"""What only runs from Python on whole batches: the fits of blocks, device by device.

On a CPU a block is finished at a time, so that an answer does not depend on how many
there are; as many at once as there are devices. A GPU finishes all it has together,
where they were calculated: only columns of the study leave it.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np
from jaxtyping import Array

from jblast.study.outcome.family import Answers, Finish


def by_block(
    finish: Finish, answers: Mapping[str, np.ndarray], devices: Sequence[Any]
) -> dict[str, np.ndarray]:
    """Finish blocks, as many at a time as there are devices.

    Args:
        finish: What finishes a batch.
        answers: By name a value of every sample of every block.
        devices: Of one process.
    """
    blocks = len(next(iter(answers.values())))

    def some(nth: int) -> list[tuple[int, dict[str, np.ndarray]]]:
        with jax.default_device(devices[nth]):
            return [
                (n, _on_host(finish({k: x[n] for k, x in answers.items()})))
                for n in range(nth, blocks, len(devices))
            ]

    with ThreadPoolExecutor(len(devices)) as pool:
        parts = [done for part in pool.map(some, range(len(devices))) for done in part]
    rows = [columns for _, columns in sorted(parts, key=lambda one: one[0])]
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def where_they_are(
    finishes: Sequence[Finish],
    pieces: Sequence[Mapping[str, Array]],
    wanted: Sequence[str],
) -> dict[str, np.ndarray]:
    """Finish what devices have, each its own, and return the columns that are wanted.

    Args:
        finishes: What finishes batches.
        pieces: Blocks in their order, those of a piece on one device.
        wanted: Names of columns.
    """

    def one(piece: Mapping[str, Array]) -> dict[str, np.ndarray]:
        shape = next(iter(piece.values())).shape[:2]
        rows = shape[0] * shape[1]  # not -1: a column may have no width
        found: dict[str, Any] = {
            name: x.reshape(rows, *x.shape[2:]) for name, x in piece.items()
        }
        (device,) = next(iter(piece.values())).devices()
        with jax.default_device(device):
            for finish in finishes:
                found |= finish(found)
        kept = {name: found[name] for name in wanted if name in found}
        for x in kept.values():
            x.copy_to_host_async()
        return {n: x.reshape(*shape, *x.shape[1:]) for n, x in _on_host(kept).items()}

    with ThreadPoolExecutor(len(pieces)) as pool:
        parts = list(pool.map(one, pieces))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _on_host(answers: Answers) -> dict[str, np.ndarray]:
    return {name: np.asarray(x) for name, x in answers.items()}
