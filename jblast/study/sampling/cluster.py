"""Distribution of the tiles of a study among the workers of a Dask cluster.

A task is the number of a tile and the path of the store: its worker reads the study
from the store, computes the tile and writes the chunks itself, each completely or not
at all. So a task that runs twice, for example after a lost connection, writes the same
bytes again, and a lost task is run by another worker. Only the completion of the
tile is returned. All workers must see the store under the same path.
"""

import contextlib
import functools
import itertools
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax

import jblast
from jblast.errors import InputError, needed
from jblast.study.engine.store import Store, open_store
from jblast.study.engine.summary import SummaryStore
from jblast.study.file import sha256_of, study_from_text
from jblast.study.sampling.run import Tiles, opened_summary, scenes_of
from jblast.study.sampling.work import Reduced, Work

EXTRA, WHAT = "cluster", "work is shared among processes"
RETRIES = 5
"""Retries of a task whose worker ended: a task that ends its worker each time must
fail."""
AHEAD = 3
"""Tasks queued for each worker, so that it does not wait for the scheduler."""
CONNECT_S = 10.0
"""Time limit of a connection to a scheduler [s], declared."""
Task = Callable[[str, int], str]
"""Function from the store and the number of a tile to the version of the worker."""


def write_tile(path: str, tile: int) -> str:
    """Compute and write a tile of a store, unless it is complete.

    Args:
        path: Folder of the store.
        tile: Number of the tile.

    Returns:
        Version of jblast of this worker. If it differs from that of the store, nothing
        is written.
    """
    stamp = (Path(path) / "zarr.json").stat().st_mtime_ns
    store, work = _opened(path, stamp)
    if store.attributes["jblast"] == jblast.__version__ and store.fault(tile):
        store.write_tile(tile, work.tile(tile))
    return jblast.__version__


def write_summary(path: str, tile: int) -> str:
    """Compute and write the statistics of a tile; otherwise as `write_tile`."""
    stamp = (Path(path) / "zarr.json").stat().st_mtime_ns
    store = _opened(path, stamp)[0]
    if store.attributes["jblast"] == jblast.__version__:
        summary, reduced = _summary(path, stamp)
        if summary.fault(tile):
            summary.write(tile, reduced.states(tile))
    return jblast.__version__


@functools.lru_cache(maxsize=2)
def _summary(path: str, stamp: int) -> tuple[SummaryStore, Reduced]:
    """Return the cached statistics of a store and their computation."""
    return opened_summary(*_opened(path, stamp))


@functools.lru_cache(maxsize=2)
def _opened(path: str, stamp: int) -> tuple[Store, Work]:
    """Return the cached store and its computation.

    Raises:
        InputError: The store does not exist for this process.
    """
    del stamp  # part of the cache's key: a new store may have the same path
    jax.config.update("jax_enable_x64", True)
    store = open_store(path)
    if store is None:
        raise InputError(
            f"{path}: no such store on a worker; expected the same path as here"
        )
    attributes = store.attributes
    study = study_from_text(
        attributes["study"],
        scenes_of(attributes),
        allow_code=attributes["allow_code"],
    )
    if sha256_of(study.text) != attributes["study_sha256"]:
        raise InputError(f"{path}: the text of the study is damaged")
    work = Work(study)
    work.cut_as(store.tile)
    return store, work


@contextlib.contextmanager
def client_of(address: str) -> Iterator[Any]:
    """Yield a client of a scheduler.

    Raises:
        InputError: Dask is not installed, or the scheduler does not answer.
    """
    distributed = needed("distributed", EXTRA, address, WHAT)
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"scheduler: expected one that answers at {address}, got "
            f"{' '.join(str(error).split()) or type(error).__name__}"
        ) from None
    with client:
        yield client


@contextlib.contextmanager
def tiles_on(
    scheduler: str | None, store: str | os.PathLike[str]
) -> Iterator[Tiles | None]:
    """Yield the function that computes tiles on workers; None for this process.

    Args:
        scheduler: Address of a scheduler; None for this process.
        store: Folder of the store.

    Raises:
        InputError: No scheduler answers.
    """
    if scheduler is None:
        yield None
        return
    # workers may have another current folder
    path = str(Path(store).resolve())
    with client_of(scheduler) as client:

        def tiles(
            missing: list[int], *, summary: bool = False
        ) -> Iterator[tuple[int, None]]:
            task = write_summary if summary else write_tile
            # workers with another version would compute other samples and are refused
            for tile in shared(client, task, path, missing, jblast.__version__):
                yield tile, None

        yield tiles


def shared(
    client: Any, task: Task, store: str, tiles: list[int], version: str
) -> Iterator[int]:
    """Compute and write tiles on workers; yield each number when it is complete.

    Args:
        client: Client of a cluster.
        task: Task of a worker.
        store: Folder of the store, the same for each worker.
        tiles: Numbers of the tiles.
        version: Required version of jblast.

    Raises:
        InputError: There is no worker, or a worker has another version.
    """
    from distributed import as_completed

    # -1 for all workers: the default lists the first few
    there = client.scheduler_info(n_workers=-1)["workers"]
    if not there:
        raise InputError("scheduler: expected at least one worker, got none")
    left = iter(tiles)
    most = AHEAD * len(there)

    def begun(tile: int) -> Any:
        return client.submit(task, store, tile, pure=False, retries=RETRIES)

    # a few tasks per worker: thousands would fill the memory of the scheduler
    futures = {begun(tile): tile for tile in itertools.islice(left, most)}
    waiting = as_completed(list(futures), loop=client.loop)
    for future in waiting:
        found = future.result()
        if found != version:
            raise InputError(
                f"workers: expected jblast {version}, as here, got {found}"
            )
        yield futures.pop(future)
        for tile in left:
            new = begun(tile)
            futures[new] = tile
            waiting.add(new)
            break
