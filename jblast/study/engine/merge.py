"""Merging of stores: parts of one study, or one study with several seeds.

Parts of one study share the numbers of their samples, so each tile is taken from the
store that has it. Studies that differ in their seed alone are placed one after another.
"""

import os
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jblast.errors import InputError
from jblast.study.engine.store import Store, Tiled, open_store, places_of
from jblast.study.engine.summary import PARTS, Anchor, SummaryStore, outcomes_of

# Attributes on which values or layout of the samples depend; the seed may differ.
LIKE = ("scene_sha256", "design", "block", "cells", "variants", "jblast", "keep")


def merged(
    stores: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str]
) -> Store:
    """Merge stores into one.

    Args:
        stores: Folders of the stores.
        out: New folder, or the first store, to which the tiles of the others are added
            if they are parts of the same study.

    Returns:
        Merged store, complete if no sample is missing.

    Raises:
        InputError: A folder is no store, a store is damaged or belongs to another
            study, or the output is another study.
        OSError: The output cannot be written.
    """
    paths = [Path(path).resolve() for path in stores]
    for n, path in enumerate(paths):
        if path in paths[:n]:
            raise InputError(f"{stores[n]}: expected each store once, got it twice")
    found = [opened_intact(path) for path in stores]
    first = found[0]
    for other in found[1:]:
        _check_same_study(first, other)
    # a merged store lists the seeds of its parts, in their order
    seeds = [
        list(store.attributes.get("seeds", [store.attributes["seed"]]))
        for store in found
    ]
    if all(one == seeds[0] for one in seeds):
        return _parts(found, Path(out))
    whole = [seed for one in seeds for seed in one]
    if len(set(whole)) < len(whole):
        listed = ", ".join("+".join(map(str, one)) for one in seeds)
        raise InputError(
            f"{stores[0]}: expected stores with one seed, or with a different seed "
            f"each, so that no sample counts twice, got seeds {listed}"
        )
    return _seeds(found, Path(out), whole)


def opened_intact(path: str | os.PathLike[str]) -> Store:
    """Return the store at a path after checking its chunks.

    Raises:
        InputError: There is no store, a chunk is damaged, or a complete store lacks a
            tile.
    """
    store = open_store(path)
    if store is None:
        raise InputError(f"{path}: no such store; expected a store of jblast study")
    parts: list[Tiled] = [store]
    if store.attributes["keep"] != "all":
        parts.append(summary_of(store))
    for part in parts:
        intact, faults = part.checked()
        if store.attributes["complete"]:
            lacking = set(range(part.tiles)) - intact - set(faults)
            faults |= {tile: part.fault(tile) for tile in lacking}
        if faults:
            tile, first = min(faults.items())
            among = f", the first of {len(faults)}" if len(faults) > 1 else ""
            raise InputError(
                f"{first} (tile {tile}{among}); a resumed study computes damaged tiles "
                "again"
            )
    return store


def _check_same_study(first: Store, other: Store) -> None:
    """Check that the samples of two stores belong to the same study."""
    a, b = first.attributes, other.attributes
    studies = [tomllib.loads(str(attributes["study"])) for attributes in (a, b)]
    for study in studies:
        study.pop("seed", None)
    different = [name for name in LIKE if a[name] != b[name]]
    if studies[0] != studies[1]:
        different.insert(0, "study")
    if different or first.tile != other.tile or first.variables != other.variables:
        raise InputError(
            f"{other.path}: expected the study of {first.path}, with any seed; got "
            f"another {', '.join(different) or 'layout'}"
        )


def _begun(first: Store, out: Path, rows: int, more: dict[str, object]) -> Store:
    """Return a new store for the merged rows.

    Raises:
        InputError: The folder has a study.
    """
    if open_store(out) is not None:
        raise InputError(f"{out}: expected a new folder, got one with a study")
    attributes = first.attributes | {"complete": False} | more
    store = Store(out, first.variables, rows, first.tile, attributes)
    store.create(places_of(first))
    return store


def _parts(found: Sequence[Store], out: Path) -> Store:
    """Return the merged store of parts of one study."""
    first = found[0]
    rows = max(store.samples for store in found)
    samples = max(store.attributes["samples"] for store in found)
    ended = [store for store in found if store.attributes["complete"]]
    if ended:  # a study that reached its targets has fewer samples
        rows, samples = ended[0].samples, ended[0].attributes["samples"]
    same = out.resolve() == first.path.resolve()
    whole = first if same else _begun(first, out, rows, {"samples": samples})
    # `opened_intact` has read all chunks
    have, tiles = whole.written(), -(-rows // first.tile)
    for store in found:
        for tile in sorted(store.written() - have):
            if tile < tiles:
                _copy(store, tile, whole, tile)
                have.add(tile)
    complete = len(have) >= tiles
    if first.attributes["keep"] != "all":
        whole.attributes["samples"] = samples
        # rows and statistics have tiles of different sizes: both must be complete
        complete &= merge_summaries(found, whole, apart=False)
    if complete and not whole.attributes["complete"]:
        whole.finish(samples, rows)
    return whole


def _seeds(found: Sequence[Store], out: Path, seeds: Sequence[int]) -> Store:
    """Return the merged store of studies with different seeds, one after another."""
    for store in found:
        if not store.attributes["complete"]:
            raise InputError(
                f"{store.path}: expected a complete study for merging seeds, got "
                f"{len(store.written())} of {store.tiles} tiles"
            )
    if any(store.path.resolve() == out.resolve() for store in found):
        raise InputError(
            f"{out}: expected a new folder for merging seeds, got one of the stores"
        )
    rows = sum(store.samples for store in found)
    samples = sum(store.attributes["samples"] for store in found)
    more = {"seeds": list(seeds), "samples": samples}
    whole = _begun(found[0], out, rows, more)
    # whole tiles are copied as files; else all rows move to other tiles
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
    """Write the rows of stores, one after another, in whole tiles."""
    left: dict[str, np.ndarray] = {}
    tile = 0
    # a generator: about two tiles are in memory, whatever the size of the stores
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
        whole.write_chunk(variable, onto, store.read_chunk(variable, tile))


def summary_of(store: Store) -> SummaryStore:
    """Return the statistics of a store.

    Raises:
        InputError: The store has no statistics.
    """
    groups = int(store.attributes["cells"]) * int(store.attributes["variants"])
    summary = SummaryStore(store.path, store.variables, groups, 0)
    if not summary.there:
        raise InputError(
            f"{store.path}: expected statistics of tiles, got none: the run was killed "
            "at its start"
        )
    summary.tiles = summary.stored_tiles()
    return summary


def merge_summaries(found: Sequence[Store], whole: Store, *, apart: bool) -> bool:
    """Merge the statistics of stores; return whether no tile is missing.

    Args:
        found: Stores.
        whole: Merged store; it may be the first of them.
        apart: Whether the stores have different samples, one after another.

    Raises:
        InputError: The histograms have different origins.
        OSError: The output cannot be written.
    """
    parts = [summary_of(store) for store in found]
    anchors, tile = parts[0].anchors(), parts[0].tile_samples()
    for store, part in zip(found[1:], parts[1:], strict=True):
        if part.tile_samples() != tile or not _alike(anchors, part.anchors()):
            raise InputError(
                f"{store.path}: expected the tile size and bin origins of "
                f"{found[0].path}, got different ones (tiles of {part.tile_samples()} "
                f"and {tile} samples)"
            )
    into = SummaryStore(whole.path, whole.variables, parts[0].groups, 0)
    # a ceiling division
    into.tiles = -(-int(whole.attributes["samples"]) // tile)
    if apart:
        # each seed may end with a short tile, so that tiles are not merged
        into.tiles = sum(part.tiles for part in parts)
    if not into.there:
        into.create(anchors, tile)
    # `whole` may be the first store, whose tiles are not copied onto themselves
    have, begin = into.written(), 0
    for part in parts:
        for number in sorted(part.written()):
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
            data = source.read_chunk(v, part, tile)
            into.write_chunk(v, part, onto, data)
