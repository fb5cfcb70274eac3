"""Answers of random worlds' fits, a row each, in a file that grows."""

import csv
import time
from collections.abc import Callable, Iterable, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from jblast.cli.jax_start import start_jax


class Answer(NamedTuple):
    """One world's answer by one subset of its readings.

    Attributes:
        subset: Name of it.
        world: Its seed.
        method: "laplace", "walk" or "weights".
        reached: Whether the method reached what it should: of a walk, that quantiles
            are known as well as wanted.
        k_hat: Of the weights of draws about the optimum.
        sd: Of ln(mass).
        least: What data and priors allow at best of it.
        rank: Share of the posterior below the truth: east, north, mass, time.
    """

    subset: str
    world: int
    method: str
    reached: bool
    k_hat: float
    sd: float
    least: float
    rank: tuple[float, ...]


def kept(path: Path) -> list[Answer]:
    """Return what was found before."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return [
            Answer(
                subset,
                int(world),
                method,
                reached == "True",
                float(k_hat),
                float(sd),
                float(least),
                tuple(map(float, rank)),
            )
            for subset, world, method, reached, k_hat, sd, least, *rank in list(
                csv.reader(file)
            )[1:]
        ]


def add(path: Path, answers: Iterable[Answer]) -> None:
    """Write rows behind the others."""
    fresh = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if fresh:
            writer.writerow((*Answer._fields[:-1], "east", "north", "mass", "time"))
        for *first, rank in answers:
            numbers = (f"{x:.6g}" for x in (*first[4:], *rank))
            writer.writerow((*first[:4], *numbers))


def go_on(
    path: Path,
    subsets: Sequence[str],
    worlds: int,
    at_once: int,
    answers: Callable[[str, Sequence[int]], list[Answer]],
    seconds: float,
    processes: int,
) -> None:
    """Answer what a file does not hold yet, few worlds of each subset in turn.

    Args:
        path: The file.
        subsets: Which.
        worlds: Seeds 0 to so many.
        at_once: Worlds of a subset before the next subset's turn.
        answers: Answers some worlds by a subset.
        seconds: After which none is begun.
        processes: That answer beside each other.
    """
    end = time.monotonic() + seconds
    done = {(one.subset, one.world) for one in kept(path)}
    left = []
    for first in range(0, worlds, at_once):
        for subset in subsets:
            seeds = range(first, min(first + at_once, worlds))
            some = [seed for seed in seeds if (subset, seed) not in done]
            left += [(subset, some)] if some else []
    with get_context("spawn").Pool(processes, initializer=start_jax) as pool:
        waiting = [pool.apply_async(answers, task) for task in left[:processes]]
        for task in [*left[processes:], *[None] * processes]:
            if not waiting:
                return
            add(path, waiting.pop(0).get())
            if task is not None and time.monotonic() < end:
                waiting.append(pool.apply_async(answers, task))
