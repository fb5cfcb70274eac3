"""The duration of a call, and the machine on which it was measured."""

import os
import platform
import time
from collections.abc import Callable
from typing import Any

import jax

# The least of several repeats: other load on a machine can only lengthen a call.
REPEATS = 7
MIN_SECONDS = 2e-3
"""Shorter calls are repeated until they last this long [s]."""


def seconds(call: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Return what a call takes at best, in seconds.

    It is called once before, so that what compiles has compiled.
    """
    jax.block_until_ready(call())
    count = 1
    while True:
        start = time.perf_counter()
        for _ in range(count):
            jax.block_until_ready(call())
        took = time.perf_counter() - start
        if took >= MIN_SECONDS or count >= 1024:
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
    """Return the least seconds that a long call takes, and what it returns.

    Args:
        call: What is timed.
        repeats: How often.
        first: Called once before, so that what compiles has compiled; the call itself
            if not given.
    """
    jax.block_until_ready((first or call)())
    best, answer = float("inf"), None
    for _ in range(repeats):
        start = time.perf_counter()
        answer = jax.block_until_ready(call())
        best = min(best, time.perf_counter() - start)
    return best, answer


def machine() -> str:
    """Return the class of machine and the versions figures were measured with."""
    device = jax.devices()[0]
    kind = (
        f"{os.cpu_count()} {platform.machine()} cores"
        if device.platform == "cpu"
        else device.device_kind
    )
    return f"{kind}, Python {platform.python_version()}, jax {jax.__version__}"
