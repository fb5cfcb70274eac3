"""A batch of any size through compiled loops: block by block, over all devices."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, Float

from jblast.inference.many.lanes import LaneResults
from jblast.inference.many.loop import Inputs, Loop
from jblast.inference.many.residuals.readings import Readings

LANES = {"cpu": (16, 128), "gpu": (1 << 10, 1 << 14, 1 << 18, 1 << 20)}
"""Logs that go through one loop together, by platform: the least that suffices."""
CHUNKS = {"cpu": 128, "gpu": 1}
"""Loops that one call of the compiled program runs, on each device."""


class CompiledLoop:
    """Runs lanes through one loop's program, compiled for each size of block."""

    def __init__(self, loop: Loop, devices: int | None = None) -> None:
        self.loop, self.devices = loop, devices
        self.programs: dict[tuple[int, int], Callable[..., LaneResults]] = {}
        self.onwards = jax.jit(loop.onwards)

    def run(
        self,
        y: Float[Array, "unknown lane"] | None,
        readings: Readings,
        stragglers: float,
    ) -> LaneResults:
        """Fit lanes, but for a share of stragglers in each loop.

        Args:
            y: Where to start; nothing for the closed form.
            readings: Of the lanes.
            stragglers: The share.
        """
        count = readings.bad.size
        each, chunks, devices = _sizes(count, self.devices or len(jax.devices()))
        block = each * chunks * devices
        program = self._program(chunks, devices, each)
        parts = []
        for begin in range(0, count, block):
            cut = functools.partial(_cut, begin=begin, end=begin + block)
            inputs = jax.tree.map(cut, (y, readings))
            share = jnp.asarray(stragglers, readings.measured.dtype)
            parts.append(program(share, inputs))
        if len(parts) == 1 and count == block:
            return parts[0]
        return jax.tree.map(lambda *x: jnp.concatenate(x, axis=-1)[..., :count], *parts)

    def _program(
        self, chunks: int, devices: int, each: int
    ) -> Callable[..., LaneResults]:
        """Return what runs one block; compiled once."""
        if (chunks, each) not in self.programs:

            def here(stragglers, inputs):
                return _one_by_one(self.loop, chunks, stragglers, inputs)

            spread = here if devices == 1 else _over_devices(here, devices)
            self.programs[chunks, each] = jax.jit(spread)
        return self.programs[chunks, each]


def _sizes(count: int, devices: int) -> tuple[int, int, int]:
    """Return lanes of a loop, loops of a device, and devices, for so many lanes."""
    platform = "cpu" if jax.default_backend() == "cpu" else "gpu"
    share = -(-count // devices)
    each = next((n for n in LANES[platform] if n >= share), LANES[platform][-1])
    chunks = min(CHUNKS[platform], 1 << (-(-share // each) - 1).bit_length())
    return each, chunks, devices


def _cut(x: Array, begin: int, end: int) -> Array:
    """Return a block of lanes, filled up with bad ones, which are skipped."""
    x = x[..., begin:end]
    short = end - begin - x.shape[-1]
    around = [(0, 0)] * (x.ndim - 1) + [(0, short)]
    return jnp.pad(x, around, constant_values=1) if short else x


def _one_by_one(loop: Loop, chunks: int, stragglers, inputs: Inputs) -> LaneResults:
    """Go through the chunks of a device one by one."""
    if chunks == 1:
        return loop.fit(stragglers, inputs)
    split = jax.tree.map(
        lambda x: jnp.moveaxis(x.reshape(*x.shape[:-1], chunks, -1), -2, 0), inputs
    )
    results = jax.lax.map(lambda x: loop.fit(stragglers, x), split)
    return jax.tree.map(
        lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1), results
    )


def _over_devices(
    here: Callable[..., LaneResults], devices: int
) -> Callable[..., LaneResults]:
    """Give each device its share of the lanes."""
    mesh = jax.make_mesh((devices,), ("lane",), axis_types=(AxisType.Auto,))
    along: dict[int, Any] = {
        n: PartitionSpec(*[None] * (n - 1), "lane") for n in (1, 2, 3)
    }
    one = along[1]
    along_lanes = LaneResults(along[2], one, one, along[3], one, one, one, one)

    def everywhere(stragglers, inputs: Inputs) -> LaneResults:
        return jax.shard_map(
            here,
            mesh=mesh,
            in_specs=(PartitionSpec(), jax.tree.map(lambda x: along[x.ndim], inputs)),
            out_specs=along_lanes,
            check_vma=False,
        )(stragglers, inputs)

    return everywhere
