"""Run of a study, from its file to a store or a data set.

Slabs are calculated by the devices of this process or by the workers of a Dask cluster,
and written into a store, which stays valid if the process is killed. Statistics are
merged in the order of the slabs, so that a study with target errors ends at the same
draw on any number of devices. The store contains the text of the study, the scenes and
the versions; a resumed run of another study is refused, unless it only has more
samples.

A task of a worker is the number of a slab and the path of the store, which all workers
must see under the same path. A task that runs twice, for example after a lost
connection, writes the same bytes again.
"""

import contextlib
import functools
import itertools
import json
import math
import os
import platform
import queue
import time
import tomllib
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

import jblast
from jblast.errors import InputError, needed, require, shown
from jblast.progress import Level, Progress, Task, reported
from jblast.study.file import Study, read_study, sha256_of, study_from_text
from jblast.study.slabs import Slabs
from jblast.study.statistics import (
    NO_ANSWER,
    Moments,
    merged_moments,
    over_cases,
    share_error,
    standard_error,
)
from jblast.study.store import (
    MOMENTS,
    PLACES,
    SCHEMA,
    Store,
    locked,
    open_store,
    opened_store,
)

if TYPE_CHECKING:
    import xarray

SHOWN = 3
"""Outcomes with running estimates in a progress line, which has 79 characters."""
ALL = slice(None)
EXTRA, WHAT = "cluster", "work is shared among processes"
RETRIES = 5
"""Retries of a task whose worker ended: a task that ends its worker each time must
fail."""
AHEAD = 3
"""Tasks queued for each worker, so that it does not wait for the scheduler."""
CONNECT_S = 10.0
"""Time limit of a connection to a scheduler [s], declared."""
Computed = Iterator[dict[str, Moments]]
"""Moments of slabs that were calculated and written, in the order of their numbers."""
Compute = Callable[[Sequence[int]], Computed]
"""Function from the numbers of slabs to their moments."""


@reported("study")
def run(
    study: Study | str | os.PathLike[str],
    devices: Sequence[Any] | None = None,
    *,
    progress: Progress = False,
) -> "xarray.Dataset":
    """Run a study in memory.

    Args:
        study: Study, or its file.
        devices: Devices of the run; None for all local ones.
        progress: As for `jblast.fit`.

    Returns:
        Data set with each parameter and outcome of each sample; attributes state its
        provenance.

    Raises:
        InputError: An outcome is unknown, or not available for the scene.

    Example:
        `jblast.study.run("study.toml")`
    """
    import xarray
    from zarr.storage import MemoryStore

    study = study if isinstance(study, Study) else read_study(study)
    slabs, memory = Slabs(study), MemoryStore()
    store = create_store(memory, study.source, slabs, attributes_of(slabs))
    _calculated(slabs, store, here(slabs, store, devices), [None] * slabs.slabs)
    with xarray.open_zarr(memory, consolidated=False, chunks=None) as dataset:
        return dataset[list(store.columns)].load()


@dataclass
class StudyRun:
    """The result of a run.

    Attributes:
        store: Store.
        slabs: Slabs of the study.
        moments: Moments of the outcomes by case.
        samples: Number of samples so far.
        new: Number of samples computed by this run.
        seconds: Duration of the computation, without preparation.
        complete: Whether the study is complete.
        reached: Whether it ended at its target errors.
        notes: Remarks on the calculation.
    """

    store: Store
    slabs: Slabs
    moments: dict[str, Moments]
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
    devices: Sequence[Any] | None = None,
    scheduler: str | None = None,
    progress: Progress = False,
) -> StudyRun:
    """Run a study into a new or existing store.

    Args:
        study: Study, or its file.
        path: Folder of the store.
        resume: Whether to continue an existing store, also with more samples.
        limit: Largest number of samples to compute, rounded up to whole slabs; None for
            all that are missing.
        devices: Devices, as in `run`.
        scheduler: Address of a Dask scheduler, whose workers calculate; None for this
            process.
        progress: As for `jblast.fit`.

    Raises:
        InputError: An outcome is not available, the store exists and `resume` is false,
            the store belongs to another study, or no scheduler answers.
        OSError: A slab cannot be written; the slabs before it are kept.
    """
    require(limit is None or limit > 0, "limit", "a positive whole number", limit)
    store = open_store(path)
    got = "an existing one; resume it, or write to another"
    require(store is None or resume, path, "a new store", got)
    study = study if isinstance(study, Study) else read_study(study)
    slabs = Slabs(study, None if store is None else store.slab)
    if store is not None:
        check_same_study(store, slabs)
    try:
        with locked(Path(path)):
            if store is None:
                store = create_store(path, path, slabs, attributes_of(slabs))
            # under the lock no other process writes partial files
            store.sweep()
            if store.attributes["samples"] < study.samples:
                store.resized(study.samples, attributes_of(slabs))
            known = [store.states(n) for n in range(store.slabs)]
            computed = here(slabs, store, devices)
            if scheduler is not None:
                computed = functools.partial(on_workers, scheduler, store)
            return _calculated(slabs, store, computed, known, limit)
    except OSError as error:  # the error of a full disk does not name the folder
        raise OSError(
            error.errno,
            f"{path}: {error.strerror or error}; what is computed is kept, and a "
            "resumed study adds to it",
        ) from error


def _calculated(
    slabs: Slabs,
    store: Store,
    compute: Compute,
    known: Sequence[dict[str, Moments] | None],
    limit: int | None = None,
) -> StudyRun:
    """Compute the missing slabs of a store, in order, up to the targets."""
    size, targets = slabs.slab * slabs.cases, slabs.study.sd_target
    missing = [n for n, state in enumerate(known) if state is None]
    missing = missing[: None if limit is None else -(-limit // size)]
    damaged = [n for n in missing if n in store.faults]
    notes = slabs.notes + tuple(
        f"Damaged slab {n}, computed again: {store.faults[n]}" for n in damaged
    )
    coming, begun = compute(missing), time.monotonic()
    report = progress_reporter(slabs)
    whole: dict[str, Moments] = {}
    draws = new = 0
    reached = False
    for n, state in enumerate(known):
        if state is None:
            if n not in missing:
                break
            state = next(coming)
            new += slabs.draws_of(n) * slabs.cases
        whole = {
            name: merged_moments(whole[name], own) if whole else own
            for name, own in state.items()
        }
        draws += slabs.draws_of(n)
        report(draws * slabs.cases, new, whole)
        reached = _reached(slabs, whole, targets)
        if reached:
            break
    if isinstance(coming, Generator):
        coming.close()  # no further slabs are begun
    complete = reached or draws == slabs.study.samples
    if complete and not (store.attributes["complete"] and store.draws == draws):
        failed = {q: int(np.sum(m.lost + m.infinite)) for q, m in whole.items()}
        store.resized(draws, {"complete": True, "failed": failed})
    seconds = time.monotonic() - begun
    samples = draws * slabs.cases
    ended = complete and draws < slabs.study.samples
    return StudyRun(store, slabs, whole, samples, new, seconds, complete, ended, notes)


def _reached(
    slabs: Slabs, whole: Mapping[str, Moments], targets: Mapping[str, float]
) -> bool:
    """Return whether each standard error is at its target, by case and sensor."""
    errors = {
        v.name: (share_error if v.kind == "yes_no" else standard_error)(whole[v.name])
        for v in slabs.outcomes
        if v.name in targets
    }
    # `all` of no targets is true, but such a study runs to its last sample
    return bool(errors) and all((x <= targets[q]).all() for q, x in errors.items())


def here(slabs: Slabs, store: Store, devices: Sequence[Any] | None = None) -> Compute:
    """Return the computation of slabs on devices of this process."""
    there = list(devices or jax.local_devices())
    free: queue.SimpleQueue[Any] = queue.SimpleQueue()
    for device in there:
        free.put(device)

    def one(n: int) -> dict[str, Moments]:
        device = free.get()
        try:
            columns, states = slabs.compute(n, device)
        finally:
            free.put(device)
        store.write(n, columns, states)
        return states

    def computed(missing: Sequence[int]) -> Computed:
        # one more than devices: it writes while they calculate
        pool = ThreadPoolExecutor(len(there) + 1)
        try:
            yield from pool.map(one, missing)
        finally:
            pool.shutdown(cancel_futures=True)

    return computed


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


def on_workers(address: str, store: Store, missing: Sequence[int]) -> Computed:
    """Compute and write slabs on the workers of a scheduler; yield their moments.

    Raises:
        InputError: No scheduler answers, there is no worker, or a worker has another
            version of jblast.
    """
    with client_of(address) as client:
        yield from shared(client, store, missing)


def shared(client: Any, store: Store, missing: Sequence[int]) -> Computed:
    """Compute and write slabs on the workers of a client; yield their moments."""
    # -1 for all workers: the default lists the first few
    there = client.scheduler_info(n_workers=-1)["workers"]
    require(there, "scheduler", "at least one worker", "none")
    # workers may have another current folder
    path, left = str(store.path.resolve()), iter(missing)

    def begun(n: int) -> Any:
        return client.submit(write_slab, path, n, pure=False, retries=RETRIES)

    # a few tasks per worker: thousands would fill the memory of the scheduler
    waiting = [begun(n) for n in itertools.islice(left, AHEAD * len(there))]
    while waiting:
        version, states = waiting.pop(0).result()
        # another version would compute other samples
        own = jblast.__version__
        require(version == own, "workers", f"jblast {own}, as here", version)
        yield states
        waiting += [begun(n) for n in itertools.islice(left, 1)]


def write_slab(path: str, n: int) -> tuple[str, dict[str, Moments]]:
    """Compute and write a slab of a store, unless it is complete.

    Returns:
        Version of jblast of this worker, and the moments of the slab. If the version
        differs from that of the store, nothing is written.
    """
    jax.config.update("jax_enable_x64", True)
    store, slabs = _opened(path, (Path(path) / "zarr.json").stat().st_mtime_ns)
    if store.attributes["jblast"] != jblast.__version__:
        return jblast.__version__, {}
    states = store.states(n)
    if states is None:
        columns, states = slabs.compute(n)
        store.write(n, columns, states)
    return jblast.__version__, states


@functools.lru_cache(maxsize=2)
def _opened(path: str, stamp: int) -> tuple[Store, Slabs]:
    """Return the cached store and its slabs."""
    del stamp  # part of the cache's key: a new store may have the same path
    store = opened_store(path)
    return store, Slabs(study_of(store), store.slab)


def study_of(store: Store) -> Study:
    """Return the study of a store.

    Raises:
        InputError: Its text is damaged.
    """
    kept = store.attributes
    if sha256_of(kept["study"]) != kept["study_sha256"]:
        raise InputError(f"{store.path}: the text of the study is damaged")
    return study_from_text(
        kept["study"], scenes_of(kept), allow_code=kept["allow_code"]
    )


def progress_reporter(
    slabs: Slabs,
) -> Callable[[int, int, Mapping[str, Moments]], None]:
    """Return a reporter of the progress of a run, its rate and its estimates."""
    task, total, begun = Task(), slabs.study.samples * slabs.cases, time.monotonic()

    def report(samples: int, new: int, whole: Mapping[str, Moments]) -> None:
        # monotonic: a change of the clock gives no negative rate
        gone = time.monotonic() - begun
        # without the samples of an earlier run, which took no time here
        rate = new / gone if gone > 0 else 0.0
        means = "; ".join(_estimate_text(n, whole[n]) for n in [*whole][:SHOWN])
        words = f"{samples:,} of {total:,} samples, {rate:.3g}/s; {means}"
        # shares of this run, because the time left follows from them
        missing = max(total - samples + new, 1)
        slab = slabs.slab * slabs.cases / missing
        task(Level(words, new / missing, min(1.0 - new / missing, slab)))

    return report


def _estimate_text(name: str, state: Moments) -> str:
    """Return the mean of an outcome and its standard error as text."""
    whole = over_cases(state, ALL)
    mean, error = np.ravel(whole.mean)[0], np.ravel(standard_error(whole))[0]
    if not math.isfinite(error):
        return f"{name} {mean:.3g}"
    digits = max(0, 1 - math.floor(math.log10(error))) if error > 0 else 6
    return f"{name} {mean:.{min(digits, 9)}f} ± {error:.2g}"


def attributes_of(slabs: Slabs) -> dict[str, Any]:
    """Return the attributes of a new store."""
    study = slabs.study
    return {
        "jblast_study_schema": SCHEMA,
        "study": study.text,
        "study_sha256": sha256_of(study.text),
        **_scenes(study),
        "seed": study.seed,
        "design": study.design,
        "keep": slabs.keep if study.keep != "all" else study.samples,
        "allow_code": study.allow_code,
        "samples": study.samples,
        "draws": study.samples,
        "slab": slabs.slab,
        "columns": [v.name for v in (*slabs.inputs, *slabs.outcomes)],
        "outcomes": [v.name for v in slabs.outcomes],
        "complete": False,
        "jblast": jblast.__version__,
        "jax": jax.__version__,
        "numpy": np.__version__,
        "platform": platform.platform(),
        "device": jax.local_devices()[0].device_kind,
        "notes": list(slabs.notes),
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


def create_store(
    where: Any,
    path: str | os.PathLike[str],
    slabs: Slabs,
    attributes: Mapping[str, Any],
) -> Store:
    """Create a store without samples.

    Args:
        where: Folder, or a store of Zarr.
        path: Folder, or a name for messages.
        slabs: Slabs of the study.
        attributes: Attributes of the group.

    Raises:
        OSError: The folder is not writable.
    """
    import zarr
    from zarr.codecs import Crc32cCodec

    group = zarr.open_group(where, mode="a")

    def add(name: str, shape: Sequence[int], dims: Sequence[str], **more: Any) -> Any:
        like: dict[str, Any] = {
            "shape": tuple(shape),
            "dimension_names": tuple(dims),
            "chunks": tuple(shape),
            "dtype": "float64",
            "fill_value": math.nan,
            "filters": None,
            "compressors": (Crc32cCodec(),),
            # the default has a folder for each dimension
            "chunk_key_encoding": {"name": "v2", "separator": "."},
            "overwrite": True,
        }
        return group.create_array(name, **like | more)

    def add_words(name: str, words: Sequence[str], about: dict[str, Any]) -> None:
        kind = {"dtype": "string", "fill_value": "", "attributes": about}
        add(name, (len(words),), (name,), **kind)[:] = np.array(words, object)

    names = [axis.name for axis in slabs.axes]
    sizes = [len(axis.values) for axis in slabs.axes]
    for axis, size in zip(slabs.axes, sizes, strict=True):
        if isinstance(axis.values[0], str):
            add_words(axis.name, axis.values, axis.attributes())
        else:
            array = add(axis.name, (size,), (axis.name,), attributes=axis.attributes())
            array[:] = np.array(axis.values)
    if slabs.places:
        add_words("sensor", list(slabs.places), {"long_name": "sensor"})
        words = {"long_name": "place of the sensor: east, north, up", "units": "m"}
        dims = ("sensor", "direction")
        array = add(PLACES, (len(slabs.places), 3), dims, attributes=words)
        array[:] = np.array(list(slabs.places.values()))
    for v in (*slabs.inputs, *slabs.outcomes):
        shape = (slabs.keep, *sizes, *v.shape)
        dims = ("draw", *names, *(("sensor",) if v.sensors else ()))
        chunk = (max(1, min(slabs.slab, slabs.keep)), *shape[1:])
        kind = {"dtype": "int8", "fill_value": NO_ANSWER} if v.kind == "yes_no" else {}
        about = v.attributes() | ({"coordinates": PLACES} if v.sensors else {})
        add(v.name, shape, dims, chunks=chunk, attributes=about, **kind)
    group.require_group(MOMENTS)
    for v in slabs.outcomes:
        shape = (slabs.slabs, 7, *sizes, *v.shape)
        dims = ("slab", "moment", *names, *(("sensor",) if v.sensors else ()))
        about = {"moments": list(Moments._fields)}
        chunk = (1, *shape[1:])
        add(f"{MOMENTS}/{v.name}", shape, dims, chunks=chunk, attributes=about)
    # last, and by one file: a killed run leaves no attributes, and its folder is begun
    # again
    group.update_attributes(dict(attributes))
    return Store(group, path)


def check_same_study(store: Store, slabs: Slabs) -> None:
    """Check that a store belongs to a study, which may have more samples.

    Raises:
        InputError: The study, its scene or the version of jblast has changed; the
            message has the differences.
    """
    new, old = attributes_of(slabs), store.attributes
    kept = "what is computed stays there: change it back, or write to another store"
    changes = _changes(old["study"], new["study"])
    if slabs.study.samples < old["samples"]:
        changes = f"samples was {old['samples']}, is {slabs.study.samples}"
    if changes:
        raise InputError(
            f"{slabs.study.source}: has changed since {store.path} was begun "
            f"({changes}); {kept}"
        )
    if new["scene_sha256"] != old["scene_sha256"]:
        scenes = zip(scenes_of(old).values(), slabs.study.scenes.values(), strict=True)
        changes = "; ".join(filter(None, itertools.starmap(_changes, scenes)))
        raise InputError(
            f"{slabs.study.uncertain.source}: the scene has changed since {store.path} "
            f"was begun ({changes or 'in comments or spaces only'}); {kept}"
        )
    if new["jblast"] != old["jblast"]:
        raise InputError(
            f"{store.path}: was begun by jblast {old['jblast']}, this is jblast "
            f"{new['jblast']}: samples would not belong together; write to another "
            "store"
        )


def _changes(old: str, new: str) -> str:
    """Return the keys that differ, as text; "" without any."""
    before, after = _flat(tomllib.loads(old)), _flat(tomllib.loads(new))
    changes = [
        f"{key} was {shown(before.get(key, 'not there'), 40)}, is "
        f"{shown(after.get(key, 'not there'), 40)}"
        for key in dict.fromkeys([*before, *after])
        if before.get(key) != after.get(key) and key != "samples"
    ]
    return "; ".join(changes[:4])


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
