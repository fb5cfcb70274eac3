"""Launch of blocks of samples with one compiled program, on all devices of a mesh.

A device computes its blocks one by one; their number is an argument of the program, not
part of it. Each device runs its own program: the program that XLA compiles for several
devices together runs flights at half the speed. A block therefore runs the same
instructions in a tile of any size and on any number of devices, and the results are
equal bit for bit on one kind of processor.
"""

import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh
from jaxtyping import Array, Int, PyTree

from jblast.errors import InputError, argument, shown, whole_number
from jblast.kept_programs import WIDE

LANES = "lanes"
"""Axis of the mesh along which samples are shared."""
Blocks = Callable[[PyTree[Array], PyTree[Array]], PyTree[Array]]
"""Function from shared arrays and arrays of blocks (block first) to the outcomes of
each sample (block, sample)."""
Launched = tuple[PyTree[Array], int, PyTree[Array]]
"""Result of a device: outcomes of blocks or groups, their number, and counts."""


def mesh_of(devices: int | str | None = None) -> Mesh:
    """Return a mesh of all local devices, or of the first `devices` of them.

    Args:
        devices: Their number, which may be text; None or "all" for all.

    Raises:
        InputError: It is no number, or the machine has fewer devices.
    """
    there = jax.local_devices()
    every = devices in (None, "all")
    count = len(there) if every else whole_number(str(devices))
    if count is None or not 1 <= count <= len(there):
        raise InputError(
            f"{argument('devices')}: expected all, or a whole number from 1 to "
            f"{len(there)}, the devices of this machine, got {shown(str(devices))}"
        )
    return Mesh(np.array(there[:count]), (LANES,), axis_types=(AxisType.Auto,))


class Reduce(NamedTuple):
    """Reduction of blocks on the device that computes them.

    Attributes:
        empty: Initial integer counts of a device, from the shared arrays.
        step: New counts and reduced outcomes of a group of blocks (first axis 1), from
            the shared arrays, the counts so far, and the outcomes of the group.
        end: Output from the counts of all groups.
    """

    empty: Callable[[PyTree[Array]], PyTree[Array]]
    step: Callable[..., tuple[PyTree[Array], PyTree[Array]]]
    end: Callable[[PyTree[Array]], PyTree[Array]] = lambda counts: counts


class Launcher:
    """Launcher of blocks of one kind on a mesh.

    Attributes:
        capacity: Blocks of a device in one launch; halved if memory runs out.
        group: Blocks computed together: one on a core, many on a GPU.
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
        self._on_cpu = mesh.devices.flat[0].platform == "cpu"
        self.group = max(1, min(group, capacity))
        # whole groups: the loop over groups has no remainder
        self.capacity = max(self.group, capacity // self.group * self.group)
        self._programs: dict[tuple[int, int], Any] = {}

    def __call__(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> PyTree[np.ndarray]:
        """Return the outcomes of blocks, in their order.

        Args:
            shared: Arrays that all blocks share.
            each: Arrays of the blocks, which are their first axis.

        Raises:
            MemoryError: A single block does not fit into a device.
        """
        return self.reduced(shared, each)[0]

    def reduced(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> tuple[PyTree[np.ndarray], PyTree[np.ndarray]]:
        """Return the reduced outcomes of each group, and the counts of all groups.

        Groups are the same on any number of devices, unless one runs out of memory.
        """
        parts, counts = [], None
        for launched in self._launches(shared, each):
            for answers, own, counted in launched:
                parts.append(_gathered(answers, own))
                # integers: their sum is exact in any order of the devices
                totals = jax.tree.map(np.asarray, counted)
                if counts is not None:
                    totals = jax.tree.map(np.add, counts, totals)
                counts = totals
        return jax.tree.map(lambda *x: np.concatenate(x), *parts), counts

    def pieces(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> list[PyTree[Array]]:
        """Return the outcomes of blocks in their order, one chunk for each device."""
        return [
            jax.tree.map(lambda x, n=own: x[:n], answers)
            for launched in self._launches(shared, each)
            for answers, own, _ in launched
        ]

    def _launches(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> Iterator[list[Launched]]:
        """Yield the results of the devices, launch by launch."""
        count, done = jax.tree.leaves(each)[0].shape[0], 0
        while done < count:
            begun = self.capacity * self._mesh.size
            some = jax.tree.map(lambda x, a=done, n=begun: x[a : a + n], each)
            try:
                launched = self._launch(shared, some)
            except (MemoryError, jax.errors.JaxRuntimeError) as error:
                self._halve(error)
                continue
            yield launched
            done += jax.tree.leaves(some)[0].shape[0]

    def _halve(self, error: Exception) -> None:
        """Halve the capacity after a lack of memory; raise any other error."""
        words = str(error).lower()
        named = "resource_exhausted" in words or "out of memory" in words
        # XLA has no class for a lack of memory: its message is the only sign
        if not named and not isinstance(error, MemoryError):
            raise error
        if self.capacity == 1:
            raise MemoryError(
                "a device has too little memory for one block of samples"
            ) from error
        self.capacity //= 2
        self.group = min(self.group, self.capacity)
        warnings.warn(
            f"a device ran out of memory: continuing with {self.capacity} blocks of "
            "samples at a time; the results are the same",
            stacklevel=3,
        )

    def _launch(
        self, shared: PyTree[Array], each: PyTree[np.ndarray]
    ) -> list[Launched]:
        """Return the results of at most `capacity` blocks for each device."""
        devices, capacity = list(self._mesh.devices.flat), self.capacity
        count = jax.tree.leaves(each)[0].shape[0]
        share = -(-count // len(devices))
        if self._reduce:  # whole groups, the same on any number of devices
            share = -(-share // self.group) * self.group
        program = self._program(capacity)

        def one(begin: int) -> Launched:
            own = min(share, count - begin)

            def filled(x: np.ndarray) -> np.ndarray:
                """Return the blocks of a device, padded to its capacity."""
                x = x[begin : begin + own]
                # padded, so that all launches have one shape and one program
                return np.pad(x, [(0, capacity - own)] + [(0, 0)] * (x.ndim - 1))

            given = shared, np.int32(own), jax.tree.map(filled, each)
            # committed to a device, the program runs there
            given = jax.device_put(given, devices[begin // share])
            # waits here, so that a lack of memory is raised here and not at first use
            answers, counted = jax.block_until_ready(program(*given))
            return answers, -(-own // self.group) if self._reduce else own, counted

        # one thread a device: a launch on a CPU blocks its thread
        with ThreadPoolExecutor(len(devices)) as pool:
            return list(pool.map(one, range(0, count, share)))

    def _program(self, capacity: int) -> Callable[..., Any]:
        """Return the program for a capacity; each device compiles its own."""
        which = capacity, self.group
        if which not in self._programs:
            self._programs[which] = jax.jit(self._here, **WIDE)
        return self._programs[which]

    def _here(
        self, shared: PyTree[Array], count: Int[Array, ""], each: PyTree[Array]
    ) -> tuple[PyTree[Array], PyTree[Array]]:
        """Return the results of the blocks of one device (traced by JAX)."""
        capacity, group = jax.tree.leaves(each)[0].shape[0], self.group
        reduce = self._reduce or Reduce(lambda _: (), lambda _, none, x: (none, x))

        def some(n: Array) -> PyTree[Array]:
            these = jax.tree.map(
                lambda x: jax.lax.dynamic_slice_in_dim(x, n * group, group), each
            )
            return self._blocks(shared, these)

        def none_of(n: Array) -> PyTree[Array]:
            # the other branch of the condition, with the same shapes; never executed,
            # because the loop has no step without blocks
            return jax.tree.map(jnp.zeros_like, jax.eval_shape(some, n))

        def step(n: Array, counts: PyTree[Array]) -> Any:
            # XLA must not fuse the reduction into the outcomes: their last digit would
            # depend on it
            if self._on_cpu:  # on a CPU XLA removes a barrier before it fuses
                answers = jax.lax.cond(count > 0, some, none_of, n)
            else:
                answers = jax.lax.optimization_barrier(some(n))
            return reduce.step(shared, counts, answers)

        none = reduce.empty(shared)
        _, like = jax.eval_shape(step, jax.ShapeDtypeStruct((), jnp.int32), none)
        steps = capacity // group
        empty = jax.tree.map(
            lambda x: jnp.zeros((steps * x.shape[0], *x.shape[1:]), x.dtype), like
        )

        def body(n: Array, so_far: Any) -> Any:
            counts, filled = so_far
            counts, kept = step(n, counts)
            filled = jax.tree.map(
                lambda whole, part: jax.lax.dynamic_update_slice_in_dim(
                    whole, part, n * part.shape[0], 0
                ),
                filled,
                kept,
            )
            return counts, filled

        # a traced number of steps: the padding of a short launch costs no time
        last = -(-count // group)
        counts, filled = jax.lax.fori_loop(0, last, body, (none, empty))
        return filled, reduce.end(counts)


def _gathered(answers: PyTree[Array], count: int) -> PyTree[np.ndarray]:
    """Return the first `count` outcomes of a device on the host."""

    def part(x: Array) -> np.ndarray:
        (device,) = x.devices()
        # on a GPU the slice saves copying the padding; on a CPU there is no copy, and
        # each size of a slice would compile a program
        here = device.platform == "cpu"
        return np.asarray(x)[:count] if here else np.asarray(x[:count])

    return jax.tree.map(part, answers)
