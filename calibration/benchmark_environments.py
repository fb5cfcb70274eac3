"""Whole environment steps a second, of 10 ms: blasts, hold, observations, autoreset.

    python -m calibration.benchmarks environments
        > calibration/results/benchmark_environments.txt

Hover, two blasts of 5 to 15 kg in each episode of 10 s, single precision. Lanes begin
all through their episodes, so that in every step some are in a blast and some end. The
action is read from the observation, as a policy's would be: the place to hold moves a
little. A step is one of RK4 with the hold asked at its beginning. On a processor 4,096
lanes in chunks, shared among its cores; on a GPU a million at once. Seconds of
processors stand beside those of the wall, for others use the machine.
"""

import os
import time
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jblast.environments import (
    EnvironmentParams,
    EnvironmentState,
    environment_params,
    reset_lanes,
    step_lanes,
)
from jblast.environments.lanes import in_chunks
from jblast.kept_programs import WIDE
from jblast.scene import ByCount, Ring, Uniform, WorldSpec

STEPS, REPEATS = 200, 5
WORLD = WorldSpec(
    occurrence=ByCount(2),
    region=Ring(12.0, 40.0),
    about="vehicle",
    mass=Uniform(5.0, 15.0),
    time=Uniform(0.5, 8.0),
)
CPU_LANES, CPU_CHUNKS = 4096, (128, 512, 1024, 2048)
GPU_LANES = (2**16, 2**18, 2**20)


def rollout(chunk: int, devices: int) -> Any:
    """Return what takes all lanes through their steps, and sums what they earned.

    Of states and params: numbers of an environment that are known to XLA undo the
    branches of a step (`environments/lanes.py`).
    """

    def of_chunk(
        params: EnvironmentParams, states: EnvironmentState
    ) -> tuple[EnvironmentState, Any]:
        def one(carried: tuple, _: None) -> tuple[tuple, None]:
            states, seen, earned, ended = carried
            found = step_lanes(states, 0.1 * seen[:, :3], params)
            done = found.terminated | found.truncated
            return (
                found.state,
                found.observation,
                earned + found.reward,
                ended + done.astype(earned.dtype),
            ), None

        seen = jnp.zeros((chunk, 18), params.step_s.dtype)
        none = jnp.zeros(chunk, params.step_s.dtype)
        (states, _, earned, ended), _ = jax.lax.scan(
            one, (states, seen, none, none), None, length=STEPS
        )
        return states, (earned, ended)

    def run(states: EnvironmentState, params: EnvironmentParams) -> Any:
        return in_chunks(partial(of_chunk, params), states, chunk, devices)

    return eqx.filter_jit(run, **WIDE)


def begun(params: EnvironmentParams, lanes: int) -> EnvironmentState:
    """Return lanes all through their episodes."""
    states, _ = jax.jit(reset_lanes)(jax.random.key(0), jnp.arange(lanes), params)
    most = int(params.episode_steps)
    return states._replace(steps=(jnp.arange(lanes) * most // lanes).astype(jnp.int32))


def row(params: EnvironmentParams, lanes: int, chunk: int, devices: int) -> str:
    """Measure, and return a line of the table."""
    run, states = rollout(chunk, devices), begun(params, lanes)
    start = time.perf_counter()
    program = run.lower(states, params).compile()
    compiled = time.perf_counter() - start
    wall = cores = float("inf")
    earned = ended = jnp.zeros(())
    for _ in range(REPEATS):
        start, spent = time.perf_counter(), time.process_time()
        states, (earned, ended) = jax.block_until_ready(program(states, params))
        wall = min(wall, time.perf_counter() - start)
        cores = min(cores, time.process_time() - spent)
    steps = lanes * STEPS
    return (
        f"{lanes:>10,}{chunk:>10,}{devices:>8}{steps / wall:>14.3g}"
        f"{steps / cores:>18.3g}{compiled:>12.1f}"
        f"{float(jnp.mean(earned)) / STEPS:>10.3f}{int(jnp.sum(ended)):>8}"
    )


def environments_text() -> str:
    """Measure and return the table."""
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", False)
    try:
        params = environment_params("Hover", command="hold", world=WORLD)
        kind, devices = jax.default_backend(), len(jax.devices())
        lines = [
            f"Environments: {jax.devices()[0].device_kind}, {os.cpu_count()} cores, "
            f"{devices} devices of JAX {jax.__version__}, float32, {STEPS} steps of "
            f"10 ms, load average {os.getloadavg()[0]:.1f}",
            f"{'lanes':>10}{'chunk':>10}{'devices':>8}{'steps/s':>14}"
            f"{'of a core-second':>18}{'compiled s':>12}{'reward':>10}{'ended':>8}",
        ]
        if kind == "cpu":
            lines += [
                row(params, CPU_LANES, chunk, devices)
                for chunk in CPU_CHUNKS
                if CPU_LANES % (chunk * devices) == 0
            ]
        else:
            lines += [row(params, lanes, lanes, 1) for lanes in GPU_LANES]
        return "\n".join(lines)
    finally:
        jax.config.update("jax_enable_x64", before)
