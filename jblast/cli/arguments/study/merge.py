"""Stores put together by a command."""

import argparse
import sys


def merge(asked: argparse.Namespace) -> int:
    """Put stores together; return the exit code.

    Raises:
        InputError: There are fewer than two, they are of other studies, or what is to
            be written is there.
    """
    from jblast.errors import InputError
    from jblast.study.engine.merge import merged

    stores = asked.given[1:]
    if len(stores) < 2:
        raise InputError(f"merge: expected at least two stores, got {len(stores)}")
    store = merged(stores, asked.out or stores[0])
    done, tiles = len(store.done()), store.tiles
    if store.attributes["keep"] != "all":
        from jblast.study.engine.summary.merge import summary_of

        summary = summary_of(store)
        done, tiles = done + len(summary.done()), tiles + summary.tiles
    state = "complete" if store.attributes["complete"] else "not complete"
    sys.stdout.write(
        f"{store.path}: {done:,} of {tiles:,} tiles from {len(stores)} stores; "
        f"{state}\n"
    )
    return 0
