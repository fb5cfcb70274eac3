"""What a worker of a cluster does: the tiles of a store, by what the store says."""

import functools
from pathlib import Path

import jax

import jblast
from jblast.errors import InputError
from jblast.study.engine.store import Store, open_store
from jblast.study.file.read import sha256_of, study_from_text
from jblast.study.sampling.provenance import scenes_of
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
