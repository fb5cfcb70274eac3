"""On what a study runs: the devices of this machine, or workers."""

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.study.sampling.ran import Tiles


def devices_asked(words: str) -> int | None:
    """Return how many devices; None: all.

    Raises:
        InputError: It is neither a number nor "all".
    """
    if words == "all":
        return None
    if not words.isdigit() or int(words) < 1:
        raise InputError(f"--devices: expected all, or a whole number, got {words!r}")
    return int(words)


@contextlib.contextmanager
def tiles_asked(asked: argparse.Namespace) -> "Iterator[Tiles | None]":
    """Give what calculates tiles: workers; None: this process.

    Raises:
        InputError: Both kinds of workers are asked for, or none can be had.
    """
    if asked.workers is None and asked.scheduler is None:
        yield None
        return
    if asked.workers is not None and asked.scheduler is not None:
        raise InputError("--workers: expected it, or --scheduler, got both")
    import jblast
    from jblast.study.engine.cluster import client_of, shared, workers_here
    from jblast.study.sampling.worker import write_summary, write_tile

    store = str(Path(asked.out).resolve())
    workers: int | None = asked.workers
    address = str(asked.scheduler)
    cluster = client_of(address) if workers is None else workers_here(workers)
    with cluster as client:

        def tiles(
            missing: list[int], *, summary: bool = False
        ) -> "Iterator[tuple[int, None]]":
            task = write_summary if summary else write_tile
            for tile in shared(client, task, store, missing, jblast.__version__):
                yield tile, None

        yield tiles
