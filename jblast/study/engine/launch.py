"""Blocks of samples through one compiled program, on all devices of a mesh.

A device goes through its blocks one by one; how many there are is a number of the
program, not part of it. So the instructions that a block meets are the same in a tile
of any size, on any number of devices: the same numbers come out, bit for bit, on one
kind of processor.
"""

import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array, Int, PyTree

from jblast.errors import InputError

LANES = "lanes"
"""Axis of the mesh along which samples are shared."""

Blocks = Callable[[PyTree[Array], PyTree[Array]], PyTree[Array]]
"""From what all blocks share and what is of some, by block first, to an answer for each
sample, by block and by sample."""


class Reduce(NamedTuple):
    """What is kept of blocks in place of their answers.

    Attributes:
        empty: Whole numbers that a device begins to count from, from what is shared.
        step: From what is shared, the counts so far, and the answers of some blocks,
            to the counts and to what is kept of each block.
    """

    empty: Callable[[PyTree[Array]], PyTree[Array]]
    step: Callable[..., tuple[PyTree[Array], PyTree[Array]]]


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
        group: Blocks that a device takes at once: one on a core, many on a GPU.
    """

    def __init__(
        self,
        blocks: Blocks,
        mesh: Mesh,
        capacity: int,
        *,
        group: int = 1,
        reduce: Reduce | None = None,
    ) -> None:
        if len(mesh.axis_names) != 1:
            raise InputError(
                f"mesh: expected one axis, along which samples are shared, got "
                f"{len(mesh.axis_names)}: {', '.join(map(str, mesh.axis_names))}"
            )
        self._blocks, self._mesh, self._reduce = blocks, mesh, reduce
        self.group = max(1, min(group, capacity))
        self.capacity = max(self.group, capacity // self.group * self.group)
        self._programs: dict[tuple[int, int], Any] = {}

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
        return self.reduced(shared, each)[0]

    def reduced(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> tuple[PyTree[np.ndarray], PyTree[np.ndarray]]:
        """Return what is kept of each block, and the counts of all; likewise."""
        parts, counts = [], None
        for answers, own, counted in self._launches(shared, each):
            parts.append(_gathered(answers, own))
            totals = jax.tree.map(lambda x: np.asarray(x).sum(axis=0), counted)
            if counts is not None:
                totals = jax.tree.map(np.add, counts, totals)
            counts = totals
        return jax.tree.map(lambda *x: np.concatenate(x), *parts), counts

    def pieces(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> list[PyTree[Array]]:
        """Return the answers of blocks, in their order, each piece on one device."""
        return [
            jax.tree.map(
                lambda x, d=d, n=n: x.addressable_shards[d].data[0, :n], answers
            )
            for answers, own, _ in self._launches(shared, each)
            for d, n in enumerate(own)
            if n
        ]

    def _launches(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> Iterator[tuple[PyTree[Array], np.ndarray, PyTree[Array]]]:
        """Run all blocks; give answers, how many each device has, and its counts."""
        count, done = jax.tree.leaves(each)[0].shape[0], 0
        while done < count:
            begun = self.capacity * self._mesh.size
            some = jax.tree.map(lambda x, a=done, n=begun: x[a : a + n], each)
            try:
                launched = self._launch(shared, some)
            except (MemoryError, jax.errors.JaxRuntimeError) as error:
                self._cut(error)
                continue
            yield launched
            done += jax.tree.leaves(some)[0].shape[0]

    def _cut(self, error: Exception) -> None:
        """Halve what a device is given, where it ran out of memory."""
        if not out_of_memory(error):
            raise error
        if self.capacity == 1:
            raise MemoryError(
                "a device has too little memory for one block of samples"
            ) from error
        self.capacity //= 2
        self.group = min(self.group, self.capacity)
        warnings.warn(
            f"a device ran out of memory: it is given {self.capacity} blocks of "
            "samples at a time from now on; the answers are the same",
            stacklevel=3,
        )

    def _launch(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> tuple[PyTree[Array], np.ndarray, PyTree[Array]]:
        """Run at most as many blocks as the devices take at once, to the end."""
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
        answers, counted = self._program(capacity)(shared, *inputs)

        # here memory may turn out to be too small, and not where they are looked at
        return jax.block_until_ready(answers), counts, counted

    def _program(self, capacity: int) -> Callable[..., PyTree[Array]]:
        """Return the compiled program for so many blocks a device."""
        which = capacity, self.group
        if which not in self._programs:
            axis = PartitionSpec(self._mesh.axis_names[0])
            spread = jax.shard_map(
                self._here,
                mesh=self._mesh,
                in_specs=(PartitionSpec(), axis, axis),
                out_specs=axis,
                check_vma=False,
            )
            self._programs[which] = jax.jit(spread)
        return self._programs[which]

    def _here(
        self, shared: PyTree[Array], count: Int[Array, "1"], each: PyTree[Array]
    ) -> PyTree[Array]:
        """Go through the blocks of one device."""
        each = jax.tree.map(lambda x: x[0], each)
        capacity, group = jax.tree.leaves(each)[0].shape[0], self.group
        reduce = self._reduce or Reduce(lambda _: (), lambda _, none, x: (none, x))

        def some(n: Array) -> PyTree[Array]:
            these = jax.tree.map(
                lambda x: jax.lax.dynamic_slice_in_dim(x, n * group, group), each
            )
            return self._blocks(shared, these)

        def step(n: Array, counts: PyTree[Array]) -> Any:
            # a barrier, so that nothing of what is done with answers goes into them
            return reduce.step(shared, counts, jax.lax.optimization_barrier(some(n)))

        none = reduce.empty(shared)
        _, like = jax.eval_shape(step, jax.ShapeDtypeStruct((), jnp.int32), none)
        empty = jax.tree.map(
            lambda x: jnp.zeros((capacity, *x.shape[1:]), x.dtype), like
        )

        def body(n: Array, so_far: Any) -> Any:
            counts, filled = so_far
            counts, kept = step(n, counts)
            filled = jax.tree.map(
                lambda whole, part: jax.lax.dynamic_update_slice_in_dim(
                    whole, part, n * group, 0
                ),
                filled,
                kept,
            )
            return counts, filled

        last = -(-count[0] // group)
        counts, filled = jax.lax.fori_loop(0, last, body, (none, empty))
        return jax.tree.map(lambda x: x[None], (filled, counts))


def _gathered(answers: PyTree[Array], counts: np.ndarray) -> PyTree[np.ndarray]:
    """Copy to the host what devices have: of a GPU no more than there is."""

    def part(x: Array, count: int) -> Any:
        (device,) = x.devices()
        # a slice of an array of JAX is a program of its own for each size
        return np.asarray(x)[0, :count] if device.platform == "cpu" else x[0, :count]

    def whole(x: Array) -> np.ndarray:
        there = [(x.addressable_shards[d].data, n) for d, n in enumerate(counts)]
        return np.concatenate([np.asarray(part(own, int(n))) for own, n in there if n])

    return jax.tree.map(whole, answers)


def out_of_memory(error: Exception) -> bool:
    """Whether an error says that memory ran out."""
    words = str(error).lower()
    said = "resource_exhausted" in words or "out of memory" in words
    return said or isinstance(error, MemoryError)
