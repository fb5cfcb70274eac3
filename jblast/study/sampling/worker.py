"""What a worker of a cluster does: the tiles of a store, by what the store says."""

import functools
from pathlib import Path

import jax

import jblast
from jblast.errors import InputError
from jblast.study.engine.store import Store, open_store
from jblast.study.engine.summary.store import SummaryStore
from jblast.study.file.read import sha256_of, study_from_text
from jblast.study.sampling.provenance import scenes_of
from jblast.study.sampling.reduced import Reduced
from jblast.study.sampling.summarise import opened_summary
from jblast.study.sampling.work import Work


def write_tile(path: str, tile: int) -> str:
    """Calculate a tile of a store and write it, unless it is there.

    Args:
        path: The store.
        tile: Its number.

    Returns:
        The version of jblast that this is; of another than the store's nothing is
        written.
    """
    stamp = (Path(path) / "zarr.json").stat().st_mtime_ns
    store, work = _opened(path, stamp)
    if store.attributes["jblast"] == jblast.__version__ and tile not in store.done():
        store.write_tile(tile, work.tile(tile))
    return jblast.__version__


def write_summary(path: str, tile: int) -> str:
    """Calculate the statistics of a tile and write them; likewise."""
    stamp = (Path(path) / "zarr.json").stat().st_mtime_ns
    store = _opened(path, stamp)[0]
    if store.attributes["jblast"] == jblast.__version__:
        summary, reduced = _summary(path, stamp)
        if tile not in summary.done():
            summary.write(tile, reduced.states(tile))
    return jblast.__version__


@functools.lru_cache(maxsize=2)
def _summary(path: str, stamp: int) -> tuple[SummaryStore, Reduced]:
    """Return the statistics of a store and what adds to them, made ready once."""
    return opened_summary(*_opened(path, stamp))


@functools.lru_cache(maxsize=2)
def _opened(path: str, stamp: int) -> tuple[Store, Work]:
    """Return a store and what calculates it, made ready once.

    Raises:
        InputError: This process does not see the store, or would count otherwise.
    """
    del stamp  # another of the same name
    jax.config.update("jax_enable_x64", True)
    store = open_store(path)
    if store is None:
        raise InputError(f"{path}: a worker sees no such store; expected the same path")
    said = store.attributes
    study = study_from_text(
        said["study"], scenes_of(said), allow_code=said["allow_code"]
    )
    assert sha256_of(study.text) == said["study_sha256"]
    work = Work(study)
    work.cut_as(store.tile)
    return store, work
