"""A study run: into a store that a kill does not harm, or into memory."""

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jax.sharding import Mesh

from jblast.errors import InputError
from jblast.study.engine.estimates import Estimates
from jblast.study.engine.lock import locked
from jblast.study.engine.store import Store, open_store
from jblast.study.engine.tiles import Columns, InOrder, Writer, calculated
from jblast.study.file.study import Study
from jblast.study.sampling.dataset import dataset_of
from jblast.study.sampling.provenance import attributes_of, refuse_other
from jblast.study.sampling.ran import Ran, Tiles, telling
from jblast.study.sampling.summarise import rows_of, summarised
from jblast.study.sampling.work import Work

if TYPE_CHECKING:
    import xarray


def run(study: Study, mesh: Mesh | None = None) -> "xarray.Dataset":
    """Run a study in memory.

    Args:
        study: The study.
        mesh: Devices among which samples are shared, along its one axis; None: all
            local ones.

    Returns:
        A value of every number that was drawn or set, and of every outcome, for each
        sample; attributes say how it came about.

    Raises:
        InputError: An outcome cannot be had of the scene, or there is none such.

    Example:
        `jblast.study.run(jblast.study.read_study("study.toml"))`
    """
    work = Work(study, mesh)
    estimates = Estimates(work.variables, work.numbering)
    order = InOrder(estimates, study.sd_target, telling(work.numbering))
    parts: list[Columns] = []
    for tile, columns in calculated(work, range(work.numbering.tiles)):
        parts.append(columns)
        order.take(tile, columns)
        if order.reached:
            break
    whole = {v.name: np.concatenate([p[v.name] for p in parts]) for v in work.variables}
    samples = len(next(iter(whole.values())))
    attributes = attributes_of(work) | {"complete": True, "samples": samples}
    return dataset_of(work.variables, whole, attributes, work.places)


def run_into(
    study: Study,
    path: str | os.PathLike[str],
    *,
    resume: bool = False,
    limit: int | None = None,
    mesh: Mesh | None = None,
    tiles: Tiles | None = None,
) -> Ran:
    """Run a study into a store, or go on with one.

    Args:
        study: The study.
        path: The store's folder.
        resume: Whether to go on where there is one already.
        limit: How many samples to calculate at most, rounded up to whole tiles; None:
            all that are missing.
        mesh: As in `run`.
        tiles: What calculates them in place of this process.

    Raises:
        InputError: An outcome cannot be had, there is a store and nobody said to go
            on, or it is another study's.
        OSError: It cannot be written; what was computed is kept.
    """
    if limit is not None and limit < 1:
        raise InputError(f"limit: expected a positive whole number, got {limit}")
    store = open_store(path)
    if store is not None and not resume:
        raise InputError(
            f"{path}: there is a study already; go on with it, or write to another"
        )
    work = Work(study, mesh)
    if store is not None:
        refuse_other(store, work)
        work.cut_as(store.tile)
    with locked(Path(path)):
        if store is None:
            numbering = work.numbering
            store = Store(
                path,
                work.variables,
                rows_of(study.keep, numbering.samples),
                numbering.tile,
                attributes_of(work),
            )
            store.create(work.places)
        store.sweep()
        calculates = _run if study.keep == "all" else summarised
        return calculates(work, store, limit, tiles)


def _run(work: Work, store: Store, limit: int | None, tiles: Tiles | None) -> Ran:
    """Calculate what a store lacks."""
    study, numbering = work.study, work.numbering
    estimates = Estimates(work.variables, numbering)
    order = InOrder(estimates, study.sd_target, telling(work.numbering))
    if store.attributes["complete"]:
        for tile in range(store.tiles):
            order.take(tile, store.read_tile(tile))
        reached = store.samples < numbering.samples
        return Ran(store, estimates, store.samples, 0, 0.0, True, reached, work.notes)
    done = store.done()
    missing = [tile for tile in range(numbering.tiles) if tile not in done]
    if limit is not None:
        missing = missing[: -(-limit // numbering.tile)]
    for tile in sorted(done):
        order.take(tile, store.read_tile(tile))
    begun, new = time.monotonic(), 0
    if not order.reached:
        with Writer(store) as writer:
            begun_tiles = tiles(missing) if tiles else calculated(work, missing)
            for tile, columns in begun_tiles:
                if columns is None:
                    columns = store.read_tile(tile)
                else:
                    writer.write(tile, columns)
                new += len(next(iter(columns.values())))
                order.take(tile, columns)
                if order.reached:
                    break
    seconds = time.monotonic() - begun
    complete = order.reached or order.samples == numbering.samples
    if complete:
        failed = {
            name: int(moments.failed.sum())
            for name, moments in estimates.moments.items()
        }
        store.finish(order.samples, failed=failed)
    return Ran(
        store,
        estimates,
        order.samples,
        new,
        seconds,
        complete,
        order.reached,
        work.notes,
    )
