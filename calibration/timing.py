"""The duration of a call, and the machine on which it was measured."""

import os
import platform
import time
from collections.abc import Callable
from typing import Any

import jax

# The least of several repeats: other load on a machine can only lengthen a call.
REPEATS = 7
# Thousands of times the resolution of the clock and the time of the loop.
MIN_SECONDS = 2e-3
"""Shortest timed run; shorter calls are repeated within it [s]."""
# 1,024 calls: below 2 us each the loop itself would be timed.
MAX_CALLS = 1024
"""Largest number of calls in one timed run."""


def seconds(call: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Return the least time of a call, after a first call that compiles it [s]."""
    jax.block_until_ready(call())
    count = 1
    while True:
        start = time.perf_counter()
        for _ in range(count):
            jax.block_until_ready(call())
        took = time.perf_counter() - start
        if took >= MIN_SECONDS or count >= MAX_CALLS:
            break
        count *= 2
    best = took / count
    for _ in range(repeats - 1):
        start = time.perf_counter()
        for _ in range(count):
            jax.block_until_ready(call())
        best = min(best, (time.perf_counter() - start) / count)
    return best


def best_of(
    call: Callable[[], Any],
    repeats: int = REPEATS,
    first: Callable[[], Any] | None = None,
) -> tuple[float, Any]:
    """Return the least time of a long call [s], and its result.

    Args:
        call: The call.
        repeats: Number of timed repetitions.
        first: Untimed first call that compiles all programs; by default `call`.
    """
    jax.block_until_ready((first or call)())
    best, answer = float("inf"), None
    for _ in range(repeats):
        start = time.perf_counter()
        answer = jax.block_until_ready(call())
        best = min(best, time.perf_counter() - start)
    return best, answer


def machine() -> str:
    """Return the class of this machine, with the versions of Python and JAX."""
    device = jax.devices()[0]
    kind = (
        f"{os.cpu_count()} {platform.machine()} cores"
        if device.platform == "cpu"
        else device.device_kind
    )
    return f"{kind}, Python {platform.python_version()}, jax {jax.__version__}"
