"""A long log thinned out: rows enough to search by, spread over who recorded what.

Where a long log has its optima, some of its rows have theirs nearby; the search goes
through these, and climbs by all rows from where it ends (see `optimum`).
"""

from collections.abc import Collection

import numpy as np
from jaxtyping import Int

from jblast.inference.posterior.posterior import Posterior
from jblast.parameters import CLOCK_OFFSET
from jblast.scene import Free
from jblast.sensors import Layout
from jblast.sensors.record import path_effects

MOST_ROWS = 1000
"""A search goes through no more rows than these."""
MOST_PATHS = 32
"""Nor, where paths have effects of their own, through more paths of a kind."""


def is_long(posterior: Posterior) -> bool:
    """Return whether a log has more than a search should go through."""
    layout = posterior.layout
    if len(layout.quantity) > MOST_ROWS:
        return True
    return len(set(layout.group)) > MOST_PATHS and _has_path_effects(posterior)


def row_subset(posterior: Posterior) -> Posterior:
    """Keep some rows of every kind: of each quantity, charge and clock that is free.

    Errors that readings share are taken as independent, of the same sizes.
    """
    posterior = posterior.independent()
    paths = MOST_PATHS if _has_path_effects(posterior) else None
    free = [
        name.partition(".")[2]
        for name, belief in zip(
            posterior.parameters.names, posterior.parameters.beliefs, strict=True
        )
        if name.startswith(f"{CLOCK_OFFSET}.") and isinstance(belief, Free)
    ]
    rows = spread_rows(posterior.layout, MOST_ROWS, paths=paths, clocks=free)
    return Posterior(
        parameters=posterior.parameters,
        layout=posterior.layout.only(rows),
        measured=posterior.measured[rows],
        sigma=posterior.sigma[rows],
        laws=posterior.laws,
        noise=posterior.noise,
        lower_bound=None
        if posterior.lower_bound is None
        else posterior.lower_bound[rows],
    )


def spread_rows(
    layout: Layout, most: int, *, paths: int | None = None, clocks: Collection[str] = ()
) -> Int[np.ndarray, " kept"]:
    """Pick rows of every kind in equal numbers, from all paths in turn.

    Args:
        layout: Rows of a log.
        most: Rows wanted in all; more only if there are more kinds.
        paths: Paths wanted of each kind, if not all.
        clocks: Clocks whose rows are kinds of their own.
    """
    of_clock = [clock if clock in clocks else "" for clock in layout.clock]
    kinds: dict[tuple, list[int]] = {}
    for row, kind in enumerate(
        zip(layout.quantity, layout.shot, of_clock, strict=True)
    ):
        kinds.setdefault(kind, []).append(row)
    group = np.array(layout.group)
    kept: list[np.ndarray] = []
    left = most
    # the rarest first: what it leaves of its share goes to the others
    for count, rows in enumerate(sorted(kinds.values(), key=len)):
        share = max(left // (len(kinds) - count), 1)
        some = _in_turn(np.array(rows), group[rows], share, paths)
        kept.append(some)
        left -= len(some)
    return np.sort(np.concatenate(kept))


def _in_turn(rows, group, share: int, paths: int | None) -> np.ndarray:
    """Pick the first row of every path, then the second of every path, ..."""
    ways, way = np.unique(group, return_inverse=True)
    if paths is not None and len(ways) > paths:
        chosen = np.isin(way, np.linspace(0, len(ways) - 1, paths).astype(int))
        rows, way = rows[chosen], way[chosen]
    order = np.argsort(way, kind="stable")
    start = np.searchsorted(way[order], way[order])
    turn = np.empty(len(rows), int)
    turn[order] = np.arange(len(rows)) - start
    by_turn = np.lexsort((way, turn))
    if len(by_turn) <= share:
        return rows
    last = turn[by_turn[share - 1]]  # of the last round only some paths are taken
    whole = by_turn[turn[by_turn] < last]
    part = by_turn[turn[by_turn] == last]
    some = np.linspace(0, len(part) - 1, share - len(whole)).astype(int)
    return rows[np.concatenate([whole, part[some]])]


def _has_path_effects(posterior: Posterior) -> bool:
    return bool(
        path_effects(posterior.parameters.scene, posterior.layout, dict(posterior.laws))
    )
