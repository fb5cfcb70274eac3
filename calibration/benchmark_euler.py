"""Cell-steps a second of `waves.euler`, and what a gradient costs.

A cell-step is one cell through one whole step (two stages). Point sources of energies
0.5 to 2 with 100 cells each, float32, from Sedov's start; the arrays are (cell, lane).
On a CPU chunks of lanes that stay in the cache go through one loop each, split over the
devices of JAX; on a GPU all lanes go at once. The gradient is that of the sum of
ln p at the end to all the energies, by reverse mode through the same steps.
"""

import functools
import os
import time
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, Float

from jblast.waves.euler import (
    Ambient,
    Flow,
    IdealGas,
    State,
    primitives,
    run,
    start_sedov,
)

CELLS = 100
LANES = {"cpu": 64, "gpu": 1 << 17}
"""Lanes in one loop."""
CHUNKS = {"cpu": 16, "gpu": 1}
"""Loops in one call, on each device."""
RECORDS, STRIDE = 10, 20
START, END = 0.02, 10.0
REPEATS = 5


def started(energies: Float[Array, " lane"]) -> tuple[Flow, State]:
    """Return point sources side by side, the lane as last axis."""
    number = energies.dtype.type

    def one(energy):
        air = Ambient(
            jnp.ones_like(energy), jnp.ones_like(energy), IdealGas(number(1.4))
        )
        return start_sedov(energy, air, number(START), cells=CELLS, length=number(1.0))

    return eqx.filter_vmap(one, out_axes=eqx.if_array(-1))(energies)


def log_pressures(energies: Float[Array, " lane"]) -> Float[Array, " lane"]:
    """Return ln of the pressure in the last cell after all steps."""
    flow, state = started(energies)
    end = jnp.asarray(END, energies.dtype)
    last, _ = run(state, flow, end, records=RECORDS, stride=STRIDE)
    return jnp.log(primitives(last, flow.gas).pressure[-1])


def gradients(energies: Float[Array, " lane"]) -> Float[Array, " lane"]:
    """Return the derivative of each to its energy, by reverse mode."""
    return jax.grad(lambda e: jnp.sum(log_pressures(e)))(energies)


def over_devices(
    function: Callable[[Float[Array, " lane"]], Float[Array, " lane"]],
) -> Callable[[Float[Array, "chunk lane"]], Float[Array, "chunk lane"]]:
    """Return the function of many chunks, split over the devices."""
    mesh = jax.make_mesh((len(jax.devices()),), ("device",), (AxisType.Auto,))
    split = PartitionSpec("device")
    return jax.jit(
        jax.shard_map(
            functools.partial(jax.lax.map, function),
            mesh=mesh,
            in_specs=split,
            out_specs=split,
            check_vma=False,
        )
    )


def least_seconds(call: Callable[[], Any]) -> float:
    """Return the least time of a call, once compiled [s]."""
    jax.block_until_ready(call())
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        jax.block_until_ready(call())
        times.append(time.perf_counter() - begin)
    return min(times)


def temporary_bytes(function, energies) -> int:
    """Return what one chunk needs beside its arguments [bytes]."""
    memory = jax.jit(function).lower(energies).compile().memory_analysis()
    return 0 if memory is None else int(memory.temp_size_in_bytes)


def euler_text() -> str:
    """Measure and return the table."""
    devices = jax.devices()
    platform = "cpu" if devices[0].platform == "cpu" else "gpu"
    name = devices[0].device_kind if platform == "gpu" else f"{os.cpu_count()} cores"
    lanes, chunks = LANES[platform], CHUNKS[platform] * len(devices)
    steps = RECORDS * STRIDE
    energies = jnp.exp(
        jax.random.uniform(
            jax.random.key(0),
            (chunks, lanes),
            jnp.float32,
            minval=-0.7,
            maxval=0.7,
        )
    )
    forward, reverse = over_devices(log_pressures), over_devices(gradients)
    start = over_devices(lambda e: started(e)[1].time)
    beginning = least_seconds(lambda: start(energies))
    whole = least_seconds(lambda: forward(energies))
    gradient = least_seconds(lambda: reverse(energies))
    cell_steps = chunks * lanes * CELLS * steps
    plain = temporary_bytes(log_pressures, energies[0])
    kept = temporary_bytes(gradients, energies[0])
    state = lanes * CELLS * 5 * 4
    rate = cell_steps / (whole - beginning)
    finite = bool(jnp.all(jnp.isfinite(reverse(energies))))
    return "\n".join(
        [
            f"Euler: {platform}, {name}, {len(devices)} devices of JAX "
            f"{jax.__version__}, float32, {chunks * lanes:,} point sources of "
            f"{CELLS} cells, {steps} steps",
            f"  cell-steps/s                      {rate:14.3g}",
            f"  cell-steps/s, starts included     {cell_steps / whole:14.3g}",
            f"  gradient over forward, in time    {gradient / whole:14.2f}",
            f"  gradients finite                  {finite!s:>14s}",
            f"  memory of a forward chunk [MB]    {plain / 1e6:14.1f}",
            f"  memory of a gradient chunk [MB]   {kept / 1e6:14.1f}",
            f"  of it the states at all steps [MB]{steps * state / 1e6:14.1f}",
        ]
    )
