"""Stores merged: parts of one study, or the same study with other seeds.

Parts of one study share the numbers of their samples, so each tile is taken from the
store that has it. Studies that differ in their seed alone are placed one after another.
"""

import os
import shutil
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jblast.errors import InputError
from jblast.files import replacing
from jblast.study.engine.store import Store, open_store, places_of
from jblast.study.engine.summary import PARTS, Anchor, SummaryStore, outcomes_of

LIKE = ("scene_sha256", "design", "block", "cells", "variants", "jblast", "keep")


def merged(
    stores: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str]
) -> Store:
    """Put stores together.

    Args:
        stores: Their folders.
        out: Where the whole goes: a new folder, or the first store, which takes in
            what the others have of its own study.

    Returns:
        The whole; complete if no sample is missing.

    Raises:
        InputError: One is no store, or of another study, or the folder is another's.
        OSError: It cannot be written.
    """
    _refuse_twice(stores)
    found = [_opened(path) for path in stores]
    first = found[0]
    for other in found[1:]:
        _refuse_other(first, other)
    # a store that was merged has the seeds of its parts, in their order
    seeds = [
        list(store.attributes.get("seeds", [store.attributes["seed"]]))
        for store in found
    ]
    if all(one == seeds[0] for one in seeds):
        return _parts(found, Path(out))
    whole = [seed for one in seeds for seed in one]
    if len(set(whole)) < len(whole):
        said = ", ".join("+".join(map(str, one)) for one in seeds)
        raise InputError(
            f"{stores[0]}: expected all stores of one seed, or each of its own, so "
            f"that no sample counts twice, got seeds {said}"
        )
    return _seeds(found, Path(out), whole)


def _refuse_twice(stores: Sequence[str | os.PathLike[str]]) -> None:
    """Refuse a folder that is named twice, which is probably a mistake."""
    paths = [Path(path).resolve() for path in stores]
    for n, path in enumerate(paths):
        if path in paths[:n]:
            raise InputError(
                f"{stores[n]}: expected each store once, got it twice; a study merged "
                "with itself is no larger"
            )


def _opened(path: str | os.PathLike[str]) -> Store:
    store = open_store(path)
    if store is None:
        raise InputError(f"{path}: no such store; expected one that jblast study wrote")
    return store


def _refuse_other(first: Store, other: Store) -> None:
    """Refuse a store whose samples are not of the same kind."""
    a, b = first.attributes, other.attributes
    studies = [tomllib.loads(str(said["study"])) for said in (a, b)]
    for study in studies:
        study.pop("seed", None)  # the key of a table stays
    different = [name for name in LIKE if a[name] != b[name]]
    if studies[0] != studies[1]:
        different.insert(0, "study")
    if different or first.tile != other.tile or first.variables != other.variables:
        raise InputError(
            f"{other.path}: expected a store of the study of {first.path}, but for the "
            f"seed; got another {', '.join(different) or 'layout'}"
        )


def _begun(first: Store, out: Path, rows: int, more: dict[str, object]) -> Store:
    """Begin the whole in a folder of its own, for so many rows.

    Raises:
        InputError: There is something already.
    """
    if open_store(out) is not None:
        raise InputError(f"{out}: there is a study already; expected a new folder")
    attributes = first.attributes | {"complete": False} | more
    store = Store(out, first.variables, rows, first.tile, attributes)
    store.create(places_of(first))
    return store


def _parts(found: Sequence[Store], out: Path) -> Store:
    """Take each tile from whoever has it."""
    first = found[0]
    rows = max(store.samples for store in found)
    samples = max(store.attributes["samples"] for store in found)
    ended = [store for store in found if store.attributes["complete"]]
    if ended:  # by targets, perhaps, after fewer samples than there might be
        rows, samples = ended[0].samples, ended[0].attributes["samples"]
    same = out.resolve() == first.path.resolve()
    whole = first if same else _begun(first, out, rows, {"samples": samples})
    have, tiles = whole.done(), -(-rows // first.tile)
    for store in found:
        for tile in sorted(store.done() - have):
            if tile < tiles:
                _copy(store, tile, whole, tile)
                have.add(tile)
    complete = len(have) >= tiles
    if first.attributes["keep"] != "all":
        whole.attributes["samples"] = samples
        complete &= merge_summaries(found, whole, apart=False)
    if complete and not whole.attributes["complete"]:
        whole.finish(samples, rows)
    return whole


def _seeds(found: Sequence[Store], out: Path, seeds: Sequence[int]) -> Store:
    """Put one study after another; the last alone may end within a tile."""
    for store in found:
        if not store.attributes["complete"]:
            raise InputError(
                f"{store.path}: expected a complete study, as the seeds differ, got "
                f"{len(store.done())} of {store.tiles} tiles"
            )
    if any(store.path.resolve() == out.resolve() for store in found):
        raise InputError(
            f"{out}: expected a new folder, as the seeds differ, got one of the stores"
        )
    rows = sum(store.samples for store in found)
    samples = sum(store.attributes["samples"] for store in found)
    more = {"seeds": list(seeds), "samples": samples}
    whole = _begun(found[0], out, rows, more)
    if all(store.samples % store.tile == 0 for store in found[:-1]):
        at = 0
        for store in found:
            for tile in range(store.tiles):
                _copy(store, tile, whole, at + tile)
            at += store.tiles
    else:
        _rewritten(found, whole)
    if whole.attributes["keep"] != "all":
        merge_summaries(found, whole, apart=True)
    whole.finish(samples, rows)
    return whole


def _rewritten(found: Sequence[Store], whole: Store) -> None:
    """Cut the rows of stores, joined one after another, into whole tiles."""
    left: dict[str, np.ndarray] = {}
    tile = 0
    rows = (store.read_tile(n) for store in found for n in range(store.tiles))
    for columns in rows:
        left = {
            name: np.concatenate([left[name], values]) if left else values
            for name, values in columns.items()
        }
        while len(next(iter(left.values()))) >= whole.tile:
            now = {name: values[: whole.tile] for name, values in left.items()}
            whole.write_tile(tile, now)
            left = {name: values[whole.tile :] for name, values in left.items()}
            tile += 1
    if len(next(iter(left.values()))):
        whole.write_tile(tile, left)


def _copy(store: Store, tile: int, whole: Store, onto: int) -> None:
    """Copy the chunks of a tile."""
    for variable in store.variables:
        source = store.chunk_path(variable, tile)
        with replacing(whole.chunk_path(variable, onto), durable=False) as temporary:
            shutil.copyfile(source, temporary)


def summary_of(store: Store) -> SummaryStore:
    """Return the statistics of a store.

    Raises:
        InputError: None were begun.
    """
    groups = int(store.attributes["cells"]) * int(store.attributes["variants"])
    summary = SummaryStore(store.path, store.variables, groups, 0)
    if not summary.there:
        raise InputError(
            f"{store.path}: expected statistics of tiles, got none: it was killed "
            "as it was begun"
        )
    summary.tiles = summary.tiles_said()
    return summary


def merge_summaries(found: Sequence[Store], whole: Store, *, apart: bool) -> bool:
    """Bring the statistics of stores into one; return whether no tile is missing.

    Args:
        found: The stores.
        whole: The one; perhaps the first of them.
        apart: Whether their samples are different ones, which follow one another.

    Raises:
        InputError: Their numbers are counted from different values.
        OSError: It cannot be written.
    """
    parts = [summary_of(store) for store in found]
    anchors, tile = parts[0].anchors(), parts[0].tile_samples()
    for store, part in zip(found[1:], parts[1:], strict=True):
        if part.tile_samples() != tile or not _alike(anchors, part.anchors()):
            raise InputError(
                f"{store.path}: expected sketches that are counted from the same "
                f"values as those of {found[0].path}, got others"
            )
    into = SummaryStore(whole.path, whole.variables, parts[0].groups, 0)
    into.tiles = -(-int(whole.attributes["samples"]) // tile)
    if apart:
        into.tiles = sum(part.tiles for part in parts)
    if not into.there:
        into.create(anchors, tile)
    have, begin = into.done(), 0
    for part in parts:
        for number in sorted(part.done()):
            onto = begin + number
            if onto not in have and onto < into.tiles:
                _copy_summary(part, number, into, onto)
                have.add(onto)
        begin += part.tiles if apart else 0
    return len(have) == into.tiles


def _alike(a: dict[str, Anchor], b: dict[str, Anchor]) -> bool:
    return all(
        np.array_equal(x, y)
        for name in a
        for x, y in zip(a[name], b[name], strict=True)
    )


def _copy_summary(
    source: SummaryStore, tile: int, into: SummaryStore, onto: int
) -> None:
    """Copy the chunks of a tile."""
    for v in outcomes_of(source.variables):
        for part in PARTS[v.kind]:
            path = into.chunk_path(v, part, onto)
            with replacing(path, durable=False) as temporary:
                shutil.copyfile(source.chunk_path(v, part, tile), temporary)
