"""Seconds of calls, and of the programs alone that they run.

On a GPU by the wall clock; on a CPU by processor time over the number of cores.
"""

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax

from jblast.study.engine.launch import Launcher

REPEATS = 2


def platform() -> str:
    """Return "cpu" or "gpu"."""
    return "cpu" if jax.default_backend() == "cpu" else "gpu"


def clock() -> float:
    """Return seconds: see the top of this file."""
    if platform() == "gpu":
        return time.perf_counter()
    return time.process_time() / (os.cpu_count() or 1)


def timed(call: Callable[[], Any]) -> float:
    """Return the seconds of a call and of what it leaves running."""
    begun = clock()
    jax.block_until_ready(call())
    return clock() - begun


def best(*calls: Callable[[], Any]) -> list[float]:
    """Return the least seconds of calls, which take turns; each is called before."""
    for call in calls:
        jax.block_until_ready(call())
    turns = [[timed(call) for call in calls] for _ in range(REPEATS)]
    return [min(one) for one in zip(*turns, strict=True)]


@contextlib.contextmanager
def watched() -> Iterator[list[tuple[Any, tuple[Any, ...]]]]:
    """Give the programs that launchers run meanwhile, and what each was given."""
    found: list[tuple[Any, tuple[Any, ...]]] = []
    program = Launcher._program

    def watching(self: Launcher, capacity: int) -> Any:
        compiled = program(self, capacity)

        def run(*given: Any) -> Any:
            found.append((compiled, given))
            return compiled(*given)

        return run

    Launcher._program = watching  # pyright: ignore[reportAttributeAccessIssue]  for the time of the block
    try:
        yield found
    finally:
        Launcher._program = program


def programs_of(call: Callable[[], Any]) -> Callable[[], Any]:
    """Return what runs the programs of a call alone, on what they were given.

    Each device has a thread of its own: a loop of a GPU asks the host whether to go on.
    """
    with watched() as found:
        call()
    by_device: dict[Any, list[tuple[Any, tuple[Any, ...]]]] = {}
    for program, given in found:
        (device,) = jax.tree.leaves(given)[0].devices()
        by_device.setdefault(device, []).append((program, given))

    def in_turn(programs: list[tuple[Any, tuple[Any, ...]]]) -> Any:
        last = None
        for program, given in programs:
            last = program(*given)
        return last

    def alone() -> Any:
        with ThreadPoolExecutor(len(by_device)) as pool:
            return list(pool.map(in_turn, by_device.values()))

    return alone
