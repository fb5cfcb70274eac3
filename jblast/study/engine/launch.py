"""Blocks of samples through one compiled program, on all devices of a mesh.

A device goes through its blocks one by one; how many there are is a number of the
program, not part of it. So the instructions that a block meets are the same in a tile
of any size, on any number of devices: the same numbers come out, bit for bit, on one
kind of processor.
"""

import warnings
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array, Int, PyTree

from jblast.errors import InputError

LANES = "lanes"
"""Axis of the mesh along which samples are shared."""

Block = Callable[[PyTree[Array], PyTree[Array]], PyTree[Array]]
"""From what all blocks share and what is of one block to an answer for each sample."""


def mesh_of(devices: int | None = None) -> Mesh:
    """Return a mesh of the local devices, or of the first few.

    Raises:
        InputError: There are not as many.
    """
    there = jax.local_devices()
    if devices is not None and not 1 <= devices <= len(there):
        raise InputError(
            f"devices: expected a whole number from 1 to {len(there)}, which this "
            f"machine has, got {devices}"
        )
    return Mesh(np.array(there[:devices]), (LANES,), axis_types=(AxisType.Auto,))


class Launcher:
    """Runs blocks of one kind on a mesh.

    Attributes:
        capacity: Blocks of a device in one launch; halved where memory runs out.
    """

    def __init__(self, block: Block, mesh: Mesh, capacity: int) -> None:
        if len(mesh.axis_names) != 1:
            raise InputError(
                f"mesh: expected one axis, along which samples are shared, got "
                f"{len(mesh.axis_names)}: {', '.join(map(str, mesh.axis_names))}"
            )
        self._block, self._mesh = block, mesh
        self.capacity = max(1, capacity)
        self._programs: dict[int, Any] = {}

    def __call__(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> PyTree[np.ndarray]:
        """Return the answers of blocks, in their order.

        Args:
            shared: What all blocks take.
            each: What is of each block: its first axis counts blocks.

        Raises:
            MemoryError: Not even one block fits into a device.
        """
        count = jax.tree.leaves(each)[0].shape[0]
        parts, done = [], 0
        while done < count:
            begun = self.capacity * self._mesh.size
            some = jax.tree.map(lambda x, a=done, n=begun: x[a : a + n], each)
            try:
                parts.append(self._launch(shared, some))
            except (MemoryError, jax.errors.JaxRuntimeError) as error:
                self._cut(error)
                continue
            done += jax.tree.leaves(some)[0].shape[0]
        return jax.tree.map(lambda *x: np.concatenate(x), *parts)

    def _cut(self, error: Exception) -> None:
        """Halve what a device is given, where it ran out of memory."""
        if not out_of_memory(error):
            raise error
        if self.capacity == 1:
            raise MemoryError(
                "a device has too little memory for one block of samples"
            ) from error
        self.capacity //= 2
        warnings.warn(
            f"a device ran out of memory: it is given {self.capacity} blocks of "
            "samples at a time from now on; the answers are the same",
            stacklevel=3,
        )

    def _launch(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> PyTree[np.ndarray]:
        """Run at most as many blocks as the devices take at once."""
        devices, capacity = self._mesh.size, self.capacity
        count = jax.tree.leaves(each)[0].shape[0]
        share = -(-count // devices)
        counts = np.clip(count - share * np.arange(devices), 0, share)

        def spread(x: np.ndarray) -> np.ndarray:
            """Give each device a row, filled up to what it takes."""
            x = np.pad(x, [(0, share * devices - count)] + [(0, 0)] * (x.ndim - 1))
            x = x.reshape(devices, share, *x.shape[1:])
            return np.pad(x, [(0, 0), (0, capacity - share)] + [(0, 0)] * (x.ndim - 2))

        along = NamedSharding(self._mesh, PartitionSpec(self._mesh.axis_names[0]))
        inputs = jax.device_put(
            (counts.astype(np.int32), jax.tree.map(spread, each)), along
        )
        shared = jax.device_put(shared, NamedSharding(self._mesh, PartitionSpec()))
        answers = self._program(capacity)(shared, *inputs)

        def gathered(x: Array) -> np.ndarray:
            rows = np.asarray(x)
            return np.concatenate([rows[d, : counts[d]] for d in range(devices)])

        return jax.tree.map(gathered, answers)

    def _program(self, capacity: int) -> Callable[..., PyTree[Array]]:
        """Return the compiled program for so many blocks a device."""
        if capacity not in self._programs:
            axis = PartitionSpec(self._mesh.axis_names[0])
            spread = jax.shard_map(
                self._here,
                mesh=self._mesh,
                in_specs=(PartitionSpec(), axis, axis),
                out_specs=axis,
                check_vma=False,
            )
            self._programs[capacity] = jax.jit(spread)
        return self._programs[capacity]

    def _here(
        self, shared: PyTree[Array], count: Int[Array, "1"], each: PyTree[Array]
    ) -> PyTree[Array]:
        """Go through the blocks of one device."""
        each = jax.tree.map(lambda x: x[0], each)
        capacity = jax.tree.leaves(each)[0].shape[0]

        def one(n: Array) -> PyTree[Array]:
            return self._block(shared, jax.tree.map(lambda x: x[n], each))

        empty = jax.tree.map(
            lambda like: jnp.zeros((capacity, *like.shape), like.dtype),
            jax.eval_shape(one, jax.ShapeDtypeStruct((), jnp.int32)),
        )

        def body(n: Array, filled: PyTree[Array]) -> PyTree[Array]:
            # a barrier, so that nothing of how answers are stored is fused into them
            answers = jax.lax.optimization_barrier(one(n))
            return jax.tree.map(
                lambda whole, part: jax.lax.dynamic_update_index_in_dim(
                    whole, part, n, 0
                ),
                filled,
                answers,
            )

        filled = jax.lax.fori_loop(0, count[0], body, empty)
        return jax.tree.map(lambda x: x[None], filled)


def out_of_memory(error: Exception) -> bool:
    """Whether an error says that memory ran out."""
    words = str(error)
    return (
        isinstance(error, MemoryError)
        or "RESOURCE_EXHAUSTED" in words
        or "out of memory" in words.lower()
    )
