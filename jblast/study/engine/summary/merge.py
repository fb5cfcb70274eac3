"""Statistics of stores put together: tiles of one study, or one study after another."""

import shutil
from collections.abc import Sequence

import numpy as np

from jblast.errors import InputError
from jblast.files import replacing
from jblast.study.engine.store import Store
from jblast.study.engine.summary.states import Anchor, outcomes_of
from jblast.study.engine.summary.store import PARTS, SummaryStore


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
                _copy(part, number, into, onto)
                have.add(onto)
        begin += part.tiles if apart else 0
    return len(have) == into.tiles


def _alike(a: dict[str, Anchor], b: dict[str, Anchor]) -> bool:
    return all(
        np.array_equal(x, y)
        for name in a
        for x, y in zip(a[name], b[name], strict=True)
    )


def _copy(source: SummaryStore, tile: int, into: SummaryStore, onto: int) -> None:
    """Copy the chunks of a tile."""
    for v in outcomes_of(source.variables):
        for part in PARTS[v.kind]:
            path = into.chunk_path(v, part, onto)
            with replacing(path, durable=False) as temporary:
                shutil.copyfile(source.chunk_path(v, part, tile), temporary)
