"""Run of a study, from its file to a store or a data set.

A run writes tiles into a store, which stays valid if the process is killed, or returns
an xarray data set. Where samples are too many to store, statistics are written, and on
request the first samples. The store contains the text of the study, the scenes and the
versions; a resumed run of another study is refused.
"""

import contextlib
import json
import math
import os
import platform
import time
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jax.sharding import Mesh

import jblast
from jblast.errors import InputError, shown
from jblast.progress import Level, Progress, Task, reported
from jblast.study.engine.store import SCHEMA, Store, Variable, locked, open_store
from jblast.study.engine.summary import State, SummaryStore, merged_states, outcomes_of
from jblast.study.engine.tiles import (
    Columns,
    Estimates,
    InOrder,
    Moments,
    Numbering,
    Writer,
    ahead,
    calculated,
)
from jblast.study.file import Keep, Study, read_study, sha256_of
from jblast.study.sampling.work import Reduced, Work

if TYPE_CHECKING:
    import xarray

SHOWN = 3
"""Outcomes with running estimates in a progress line, which has 79 characters."""
Tiles = Callable[..., Iterable[tuple[int, Columns | None]]]
"""Function that computes tiles by their numbers, in any order. None in place of columns
means that a worker has written the tile. With `summary=True` they are tiles of
statistics."""


@reported("study")
def run(
    study: Study | str | os.PathLike[str],
    mesh: Mesh | None = None,
    *,
    progress: Progress = False,
) -> "xarray.Dataset":
    """Run a study in memory.

    Args:
        study: Study, or its file.
        mesh: Devices of the run, along one axis; None for all local ones.
        progress: As for `jblast.fit`.

    Returns:
        Data set with each parameter and outcome of each sample; attributes state its
        provenance.

    Raises:
        InputError: An outcome is unknown, or not available for the scene.

    Example:
        `jblast.study.run("study.toml")`
    """
    study = study if isinstance(study, Study) else read_study(study)
    work = Work(study, mesh)
    estimates = Estimates(work.variables, work.numbering)
    order = InOrder(estimates, study.sd_target, progress_reporter(work.numbering))
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


@dataclass
class Ran:
    """The result of a run.

    Attributes:
        store: Store.
        estimates: Running estimates of the outcomes.
        samples: Number of samples so far.
        new: Number of samples computed by this run.
        seconds: Duration of the computation, without preparation.
        complete: Whether the study is complete.
        reached: Whether it ended at its target errors.
        notes: Remarks on the calculation.
    """

    store: Store
    estimates: Estimates
    samples: int
    new: int
    seconds: float
    complete: bool
    reached: bool
    notes: tuple[str, ...] = field(default_factory=tuple)


@reported("study")
def run_into(
    study: Study | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    resume: bool = False,
    limit: int | None = None,
    mesh: Mesh | None = None,
    tiles: Tiles | None = None,
    progress: Progress = False,
) -> Ran:
    """Run a study into a new or existing store.

    Args:
        study: Study, or its file.
        path: Folder of the store.
        resume: Whether to continue an existing store.
        limit: Largest number of samples to compute, rounded up to whole tiles; None for
            all that are missing.
        mesh: Devices, as in `run`.
        tiles: Computation of tiles by other processes; None for this process.
        progress: As for `jblast.fit`.

    Raises:
        InputError: An outcome is not available, the store exists and `resume` is false,
            or the store belongs to another study.
        OSError: A tile cannot be written; the tiles before it are kept.
    """
    if limit is not None and limit < 1:
        raise InputError(f"limit: expected a positive whole number, got {limit}")
    store = open_store(path)
    if store is not None and not resume:
        raise InputError(
            f"{path}: expected a new store, got an existing one; resume it, or write "
            "to another"
        )
    study = study if isinstance(study, Study) else read_study(study)
    work = Work(study, mesh)
    if store is not None:
        check_same_study(store, work)
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
        # under the lock no other process writes partial files
        store.sweep()
        calculates = _run if study.keep == "all" else summarised
        try:
            return calculates(work, store, limit, tiles)
        except OSError as error:  # the error of a full disk does not name the folder
            raise OSError(
                error.errno,
                f"{path}: {error.strerror or error}; what is computed is kept, and a "
                "resumed study adds to it",
            ) from error


def _run(work: Work, store: Store, limit: int | None, tiles: Tiles | None) -> Ran:
    """Compute the missing tiles of a store."""
    study, numbering = work.study, work.numbering
    estimates = Estimates(work.variables, numbering)
    order = InOrder(estimates, study.sd_target, progress_reporter(work.numbering))
    done, faults = store.checked()
    if store.attributes["complete"] and len(done) == store.tiles:
        for tile in range(store.tiles):
            order.take(tile, store.read_tile(tile))
        # only targets end a complete study before its last sample
        reached = store.samples < numbering.samples
        return Ran(store, estimates, store.samples, 0, 0.0, True, reached, work.notes)
    # of a complete store the damaged tiles only, which may end at a target
    missing = [tile for tile in range(store.tiles) if tile not in done]
    if limit is not None:
        missing = missing[: -(-limit // numbering.tile)]
    notes = work.notes + damage_notes(faults, missing)
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
        notes,
    )


def rows_of(keep: Keep, samples: int) -> int:
    """Return the number of samples that are stored, which are the first ones."""
    if keep == "all":
        return samples
    return 0 if keep == "summary" else min(keep, samples)


def damage_notes(faults: Mapping[int, str], missing: Sequence[int]) -> tuple[str, ...]:
    """Return a note on each damaged tile among those to compute."""
    return tuple(
        f"Damaged tile {tile}, computed again: {faults[tile]}"
        for tile in missing
        if tile in faults
    )


def opened_summary(store: Store, work: Work) -> tuple[SummaryStore, Reduced]:
    """Return the statistics of a store, new ones if necessary, and their computation.

    Raises:
        InputError: The statistics need too much memory.
        OSError: The statistics cannot be written.
    """
    groups = work.numbering.variants * work.numbering.cells
    summary = SummaryStore(store.path, store.variables, groups, 0)
    anchors = None
    if summary.there:
        with contextlib.suppress(InputError):  # damaged: computed again
            anchors = summary.anchors()
    reduced = Reduced(work, anchors)
    summary.tiles = reduced.tiles
    if anchors is None:
        summary.create(reduced.anchors, reduced.tile)
    return summary, reduced


def summarised(work: Work, store: Store, limit: int | None, tiles: Tiles | None) -> Ran:
    """Compute the missing stored samples, then the missing statistics, of a store.

    Args:
        work: Computation of samples.
        store: Store.
        limit: Largest number of samples to compute, rounded up to whole tiles.
        tiles: Computation of tiles by other processes; None for this process.
    """
    summary, reduced = opened_summary(store, work)
    run = _Run(work, summary, reduced)
    if store.attributes["complete"]:
        summary.tiles = summary.stored_tiles()
    (done, faults), (rows, row_faults) = summary.checked(), store.checked()
    whole = len(done) == summary.tiles and len(rows) == store.tiles
    if store.attributes["complete"] and whole:
        run.take(done)
        reached = run.samples < work.numbering.samples
        return Ran(store, run.estimates, run.samples, 0, 0.0, True, reached, work.notes)
    begun = time.monotonic()
    rows = [tile for tile in range(store.tiles) if tile not in rows]
    notes = work.notes + damage_notes(row_faults, rows)
    left = _rows(work, store, rows, limit, tiles)
    run.take(done)
    missing = [tile for tile in range(summary.tiles) if tile not in done]
    if left is not None:
        # rounded up: a limit below one tile still computes one
        missing = missing[: -(-left // reduced.tile)]
    notes += damage_notes(faults, missing)
    new, reached = 0, run.reached
    if not reached:

        def written(tile: int) -> None:
            summary.write(tile, reduced.states(tile))

        # a study that may stop at a target does not compute tiles beyond it
        most = 1 if work.study.sd_target else reduced.ahead
        here = ahead(written, missing, most)
        for number, _ in tiles(missing, summary=True) if tiles else here:
            new += reduced.samples_of(number)
            run.take({number})
            if run.reached:
                break
    complete = run.reached or run.next == summary.tiles
    if complete:
        # tiles beyond the target, which workers may have written, are not part of it
        summary.resized(run.next, reduced.tile)
        failed = {n: int(m.failed.sum()) for n, m in run.estimates.moments.items()}
        store.finish(run.samples, min(store.samples, run.samples), failed=failed)
    return Ran(
        store,
        run.estimates,
        run.samples,
        new,
        time.monotonic() - begun,
        complete,
        run.reached,
        notes,
    )


def _rows(
    work: Work,
    store: Store,
    missing: list[int],
    limit: int | None,
    tiles: Tiles | None,
) -> int | None:
    """Compute missing stored samples; return the remaining limit of samples."""
    if limit is not None:
        missing = missing[: -(-limit // store.tile)]
    if tiles is not None and missing:
        for _ in tiles(missing):
            pass
    elif missing:
        for tile in missing:
            store.write_tile(tile, work.tile(tile))
    return None if limit is None else max(0, limit - len(missing) * store.tile)


class _Run:
    """Running estimates from statistics, added in the order of their tiles."""

    def __init__(self, work: Work, summary: SummaryStore, reduced: Reduced) -> None:
        self._summary, self._reduced = summary, reduced
        self._targets = work.study.sd_target
        self._report = progress_reporter(work.numbering)
        self._there: set[int] = set()
        self._state: Mapping[str, State] = reduced.empty()
        self.estimates = Estimates(work.variables, work.numbering)
        self.next = self.samples = 0
        self.reached = False

    def take(self, tiles: Iterable[int]) -> None:
        """Add tiles that are written."""
        self._there |= set(tiles)
        variables = self._summary.variables
        while self.next in self._there and not self.reached:
            own = self._summary.read(self.next, self._reduced.anchors)
            self._state = merged_states(variables, self._state, own)
            self.samples += self._reduced.samples_of(self.next)
            self.next += 1
            for v in outcomes_of(variables):
                self.estimates.moments[v.name] = moments_of(v, self._state[v.name])
            self.reached = self.estimates.reached(self._targets)
        self._report(self.samples, self.estimates)


def moments_of(variable: Variable, state: State) -> Moments:
    """Return the running estimates of a state."""
    if variable.kind == "yes_no":
        share = state.yes / np.maximum(state.known, 1)
        # sum of squares about the share: n p (1 - p)
        square = state.yes * (1.0 - share)
        return Moments(state.known, state.lost, share, square)
    m = state.moments
    return Moments(m.finite, m.lost + m.infinite, m.mean, m.squares)


def progress_reporter(numbering: Numbering) -> Callable[[int, Estimates], None]:
    """Return a reporter of the progress of a run, its rate and its estimates."""
    task, total, begun = Task(), numbering.samples, time.monotonic()
    first: list[int] = []

    def report(samples: int, estimates: Estimates) -> None:
        if not first:
            first.append(samples)
        # monotonic: a change of the clock gives no negative rate
        gone = time.monotonic() - begun
        # without the samples of an earlier run, which took no time here
        rate = (samples - first[0]) / gone if gone > 0 else 0.0
        means = "; ".join(
            _estimate_text(name, estimates) for name in [*estimates.moments][:SHOWN]
        )
        words = f"{samples:,} of {total:,} samples, {rate:.3g}/s; {means}"
        # shares of this run, because the time left follows from them
        missing = max(total - first[0], 1)
        through = (samples - first[0]) / missing
        task(Level(words, through, min(1.0 - through, numbering.tile / missing)))

    return report


def _estimate_text(name: str, estimates: Estimates) -> str:
    """Return the mean of an outcome and its standard error as text."""
    whole = estimates.moments[name].whole()
    mean, error = float(whole.mean.flat[0]), float(whole.standard_error().flat[0])
    if not math.isfinite(error):
        return f"{name} {mean:.3g}"
    digits = max(0, 1 - math.floor(math.log10(error))) if error > 0 else 6
    return f"{name} {mean:.{min(digits, 9)}f} ± {error:.2g}"


def attributes_of(work: Work) -> dict[str, Any]:
    """Return the attributes of a new store."""
    study = work.study
    return {
        "jblast_study_schema": SCHEMA,
        "study": study.text,
        "study_sha256": sha256_of(study.text),
        **_scenes(study),
        "seed": study.seed,
        "design": study.design,
        "keep": study.keep,
        "allow_code": study.allow_code,
        "samples": work.numbering.samples,
        "block": work.numbering.block,
        "cells": work.numbering.cells,
        "variants": work.numbering.variants,
        "complete": False,
        "jblast": jblast.__version__,
        "jax": jax.__version__,
        "numpy": np.__version__,
        "platform": platform.platform(),
        "device": work.mesh.devices.flat[0].device_kind,
        "notes": list(work.notes),
    }


def _scenes(study: Study) -> dict[str, Any]:
    """Return the attributes of the scene; several scenes are stored by name."""
    texts = dict(study.scenes)
    scene = next(iter(texts.values()), "") if len(texts) < 2 else texts
    whole = scene if isinstance(scene, str) else json.dumps(scene)
    return {"scene": scene, "scene_sha256": sha256_of(whole)}


def scenes_of(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Return the scenes of a store, by their names in the study."""
    scene = attributes["scene"]
    if isinstance(scene, Mapping):
        return dict(scene)
    return {tomllib.loads(attributes["study"])["scene"]: scene}


def check_same_study(store: Store, work: Work) -> None:
    """Check that a store belongs to a study.

    Raises:
        InputError: The study, its scene or the version of jblast has changed; the
            message has the differences.
    """
    new, old = attributes_of(work), store.attributes
    if new["study_sha256"] != old["study_sha256"]:
        what = _changes(str(old["study"]), new["study"])
        raise InputError(
            f"{work.study.source}: has changed since {store.path} was begun{what}; "
            "what is computed stays there: change it back, or write to another store"
        )
    if new["scene_sha256"] != old["scene_sha256"]:
        what = _changes(str(old["scene"]), str(new["scene"]))
        raise InputError(
            f"{work.study.uncertain.source}: the scene has changed since {store.path} "
            f"was begun{what}; what is computed stays there: change it back, or write "
            "to another store"
        )
    for name in ("jblast", "block"):
        if new[name] != old[name]:
            raise InputError(
                f"{store.path}: was begun by {name} {old[name]}, this is {name} "
                f"{new[name]}: samples would not belong together; write to another "
                "store"
            )


def _changes(old: str, new: str) -> str:
    """Return the keys that differ, as text."""
    try:
        before, after = _flat(tomllib.loads(old)), _flat(tomllib.loads(new))
    except tomllib.TOMLDecodeError:
        return ""
    changes = [
        f"{key} was {shown(before.get(key, 'not there'), 40)}, is "
        f"{shown(after.get(key, 'not there'), 40)}"
        for key in dict.fromkeys([*before, *after])
        if before.get(key) != after.get(key)
    ]
    return (
        f" ({'; '.join(changes[:4])})" if changes else " (in comments or spaces only)"
    )


def _flat(tables: Any, name: str = "") -> dict[str, Any]:
    """Return all values by their dotted keys."""
    if isinstance(tables, dict):
        pairs = ((f"{name}.{k}" if name else k, v) for k, v in tables.items())
    elif isinstance(tables, list) and any(isinstance(one, dict) for one in tables):
        pairs = ((f"{name}[{n}]", v) for n, v in enumerate(tables))
    else:
        return {name: tables}
    found: dict[str, Any] = {}
    for key, value in pairs:
        found |= _flat(value, key)
    return found


def dataset_of(
    variables: Sequence[Variable],
    columns: Mapping[str, np.ndarray],
    attributes: Mapping[str, Any],
    places: Mapping[str, Sequence[float]],
) -> "xarray.Dataset":
    """Return columns as a data set, equal to the one that xarray reads from a store.

    Args:
        variables: Columns of the study.
        columns: Values of the columns.
        attributes: Attributes of the data set.
        places: Positions of the sensors by name: east, north, up [m].
    """
    import xarray

    data = {v.name: (v.dims, columns[v.name], v.attributes()) for v in variables}
    coordinates: dict[str, Any] = {}
    if places:
        where = np.array(list(places.values()))
        position_attributes = {
            "long_name": "place of the sensor: east, north, up",
            "units": "m",
        }
        coordinates = {
            "sensor": (
                "sensor",
                np.array(list(places), object),
                {"long_name": "sensor"},
            ),
            "sensor_position_m": (("sensor", "direction"), where, position_attributes),
        }
    return xarray.Dataset(data, coordinates, dict(attributes))
