"""Merging of stores: parts of one study.

Parts share the numbers of their samples, so each tile is taken from the store that has
it.
"""

import os
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jblast.errors import InputError
from jblast.study.engine.store import Store, Tiled, open_store, places_of
from jblast.study.engine.summary import PARTS, Anchor, SummaryStore, outcomes_of

# Attributes on which values or layout of the samples depend.
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
    return _parts(found, Path(out))


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
    different = [name for name in LIKE if a[name] != b[name]]
    if studies[0] != studies[1]:
        different.insert(0, "study")
    if different or first.tile != other.tile or first.variables != other.variables:
        raise InputError(
            f"{other.path}: expected the study of {first.path}, got "
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
                _copy(store, tile, whole)
                have.add(tile)
    complete = len(have) >= tiles
    if first.attributes["keep"] != "all":
        whole.attributes["samples"] = samples
        # rows and statistics have tiles of different sizes: both must be complete
        complete &= merge_summaries(found, whole)
    if complete and not whole.attributes["complete"]:
        whole.finish(samples, rows)
    return whole


def _copy(store: Store, tile: int, whole: Store) -> None:
    """Copy the chunks of a tile."""
    for variable in store.variables:
        whole.write_chunk(variable, tile, store.read_chunk(variable, tile))


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


def merge_summaries(found: Sequence[Store], whole: Store) -> bool:
    """Merge the statistics of stores; return whether no tile is missing.

    Args:
        found: Stores.
        whole: Merged store; it may be the first of them.

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
    if not into.there:
        into.create(anchors, tile)
    # `whole` may be the first store, whose tiles are not copied onto themselves
    have = into.written()
    for part in parts:
        for number in sorted(part.written()):
            if number not in have and number < into.tiles:
                _copy_summary(part, number, into)
                have.add(number)
    return len(have) == into.tiles


def _alike(a: dict[str, Anchor], b: dict[str, Anchor]) -> bool:
    return all(
        np.array_equal(x, y)
        for name in a
        for x, y in zip(a[name], b[name], strict=True)
    )


def _copy_summary(source: SummaryStore, tile: int, into: SummaryStore) -> None:
    """Copy the chunks of a tile."""
    for v in outcomes_of(source.variables):
        for part in PARTS[v.kind]:
            data = source.read_chunk(v, part, tile)
            into.write_chunk(v, part, tile, data)
