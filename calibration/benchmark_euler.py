"""Cell-steps a second of `waves.euler`, and what a gradient costs.

A cell-step is one cell through one whole step (two stages). Point sources of energies
0.5 to 2 with 100 cells each, float32, from Sedov's start; the arrays are (cell, lane).
On a CPU chunks of lanes that stay in the cache go through one loop each, split over the
devices of JAX; on a GPU all lanes go at once. The gradient is that of the sum of
ln p at the end to all the energies, by reverse mode through the same steps.

Reverse mode keeps the state at each step, five numbers a cell: its memory grows with
cells times steps, 20 bytes of float32 for each. `frugal` keeps it at the records and
at the steps between two of them: with the square root of the steps, if stretches have
as many steps as there are of them; it runs all steps once more.
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
    FlowState,
    IdealGas,
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
LANES_KEPT = {"cpu": 64, "gpu": 1 << 15}
"""Lanes of the table of memory."""
GROWTH = ((100, (10, 20)), (100, (20, 20)), (200, (10, 20)))
"""Cells, and records and stride, of the table of memory."""
START, END = 0.02, 10.0
REPEATS = 5


def started(energies: Float[Array, " lane"], cells: int) -> tuple[Flow, FlowState]:
    """Return point sources side by side, the lane as last axis."""
    number = energies.dtype.type

    def one(energy):
        air = Ambient(
            jnp.ones_like(energy), jnp.ones_like(energy), IdealGas(number(1.4))
        )
        return start_sedov(energy, air, number(START), cells=cells, length=number(1.0))

    return eqx.filter_vmap(one, out_axes=eqx.if_array(-1))(energies)


def log_pressures(
    energies: Float[Array, " lane"],
    cells: int = CELLS,
    steps: tuple[int, int] = (RECORDS, STRIDE),
    frugal: bool = False,
) -> Float[Array, " lane"]:
    """Return ln of the pressure in the last cell after all steps."""
    flow, state = started(energies, cells)
    end = jnp.asarray(END, energies.dtype)
    last, _ = run(state, flow, end, records=steps[0], stride=steps[1], frugal=frugal)
    return jnp.log(primitives(last, flow.gas).pressure[-1])


def gradients(energies: Float[Array, " lane"], **options) -> Float[Array, " lane"]:
    """Return the derivative of each to its energy, by reverse mode."""
    return jax.grad(lambda e: jnp.sum(log_pressures(e, **options)))(energies)


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


def memory_lines(energies: Float[Array, " lane"]) -> list[str]:
    """Return what gradients of some lanes need, and their time over that of a run."""
    lines = [
        f"Reverse mode, {energies.size:,} lanes; memory by XLA's analysis",
        "   cells  steps  kept at     forward [MB]  gradient [MB]  bytes/cell-step  "
        "time over forward",
    ]
    for cells, steps in GROWTH:
        options: dict[str, Any] = {"cells": cells, "steps": steps}
        forward = _compiled(functools.partial(log_pressures, **options), energies)
        run_time = least_seconds(functools.partial(forward, energies))
        plain = _temporary_bytes(forward)
        for frugal in (False, True):
            reverse = _compiled(
                functools.partial(gradients, frugal=frugal, **options), energies
            )
            taken = least_seconds(functools.partial(reverse, energies))
            kept = _temporary_bytes(reverse)
            number = steps[0] * steps[1]
            each = kept / (energies.size * cells * number)
            lines.append(
                f"{cells:8d}{number:7d}  {'records' if frugal else 'steps':9s}"
                f"{plain / 1e6:14.1f}{kept / 1e6:15.1f}{each:17.1f}"
                f"{taken / run_time:19.2f}"
            )
    return lines


def _compiled(function, energies: Float[Array, " lane"]):
    return jax.jit(function).lower(energies).compile()


def _temporary_bytes(compiled) -> int:
    memory = compiled.memory_analysis()
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
    start = over_devices(lambda e: started(e, CELLS)[1].time)
    beginning = least_seconds(lambda: start(energies))
    whole = least_seconds(lambda: forward(energies))
    gradient = least_seconds(lambda: reverse(energies))
    cell_steps = chunks * lanes * CELLS * steps
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
            *memory_lines(energies[0, : LANES_KEPT[platform]]),
        ]
    )
