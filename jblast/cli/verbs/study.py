"""Run a study: draw a scene many times over, and ask each sample what came of it.

`jblast study STUDY.toml --out STUDY.zarr` runs it, and is told by the file what is
varied and asked. What is killed goes on with --resume, and nothing is calculated twice.
`jblast study report STUDY.zarr --out DIR` tells what came of it, on one page.
`jblast study merge A.zarr B.zarr --out C.zarr` puts stores together.
"""

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.options import path
from jblast.errors import InputError, shown, whole_number
from jblast.files import writing

if TYPE_CHECKING:
    from jblast.study.sampling.run import Tiles

WORDS = ("merge", "report")
"""First words that are no study's file."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "given",
        metavar="STUDY.toml | report STUDY.zarr | merge A.zarr B.zarr",
        nargs="*",
        type=path,
        help="the study; or report and a store; or merge and the stores to put "
        "together",
    )
    verb.add_argument(
        "--out",
        metavar="STUDY.zarr",
        type=path,
        help="the store, a folder; of a report the folder of page, figures and "
        "report.json",
    )
    verb.add_argument(
        "--resume",
        action="store_true",
        help="go on with a store; of none begin it",
    )
    verb.add_argument(
        "--limit",
        metavar="N",
        type=int,
        help="calculate about so many samples, then stop (default: all)",
    )
    verb.add_argument(
        "--devices",
        metavar="all|N",
        default="all",
        help="of this machine: GPUs, or the cores of its CPU (default: all)",
    )
    verb.add_argument(
        "--workers",
        metavar="N",
        type=int,
        help="share the work among so many processes of this machine, by Dask",
    )
    verb.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="share it among the workers of a Dask scheduler, as tcp://HOST:8786; all "
        "see --out under the same path",
    )
    verb.add_argument(
        "--allow-code",
        action="store_true",
        help="let outcomes be functions of Python, as python:module.function",
    )
    verb.add_argument(
        "--list",
        action="store_true",
        help="print the outcomes that may be asked for, with their units",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out of a report"
    )


def run(asked: argparse.Namespace) -> int:
    """Run, go on, or put together; print; return the exit code."""
    from jblast.cli.jax_start import start_jax

    if not asked.list and not asked.given:
        raise InputError("study: expected STUDY.toml, or merge and stores, got nothing")
    if asked.given[:1] == ["merge"]:
        return merge(asked)
    if asked.given[:1] == ["report"]:
        start_jax(quick=True)
        return report(asked)
    start_jax(all_cores=asked.workers is None and asked.scheduler is None)
    if asked.list:
        from jblast.report.study_run import outcomes_text
        from jblast.study.outcome.registry import OUTCOMES

        sys.stdout.write(outcomes_text(OUTCOMES.values()))
        return 0
    if len(asked.given) > 1:
        raise InputError(f"study: expected one STUDY.toml, got {' '.join(asked.given)}")
    if not asked.out:
        raise InputError("--out: expected the folder of the store, got nothing")
    return _run(asked)


def _run(asked: argparse.Namespace) -> int:
    from jblast.report.study_run import run_text, study_answer
    from jblast.study.engine.launch import mesh_of
    from jblast.study.file import read_study
    from jblast.study.sampling.run import run_into

    study = read_study(asked.given[0], allow_code=asked.allow_code)
    mesh = mesh_of(devices_asked(asked.devices))
    try:
        with tiles_asked(asked) as tiles:
            ran = run_into(
                study,
                Path(asked.out),
                resume=asked.resume,
                limit=asked.limit,
                mesh=mesh,
                tiles=tiles,
            )
    except OSError as error:  # a disk that is full does not say which
        said = f"{asked.out}: {error.strerror or error}; what is computed is kept"
        raise OSError(error.errno, f"{said}, --resume adds to it") from error
    answer = study_answer(ran)
    sys.stdout.write(answer.to_json() if asked.json else run_text(answer))
    return 0


def devices_asked(words: str) -> int | None:
    """Return how many devices; None: all.

    Raises:
        InputError: It is neither a number nor "all".
    """
    if words == "all":
        return None
    count = whole_number(words)
    if not count:
        raise InputError(
            "--devices: expected all, or a whole number of 1 or more, got "
            f"{shown(words)}"
        )
    return count


@contextlib.contextmanager
def tiles_asked(asked: argparse.Namespace) -> "Iterator[Tiles | None]":
    """Give what calculates tiles: workers; None: this process.

    Raises:
        InputError: Both kinds of workers are asked for, or none can be had.
    """
    if asked.workers is None and asked.scheduler is None:
        yield None
        return
    if asked.workers is not None and asked.scheduler is not None:
        raise InputError("--workers: expected it, or --scheduler, got both")
    import jblast
    from jblast.study.sampling.cluster import (
        client_of,
        shared,
        workers_here,
        write_summary,
        write_tile,
    )

    store = str(Path(asked.out).resolve())
    workers: int | None = asked.workers
    address = str(asked.scheduler)
    cluster = client_of(address) if workers is None else workers_here(workers)
    with cluster as client:

        def tiles(
            missing: list[int], *, summary: bool = False
        ) -> "Iterator[tuple[int, None]]":
            task = write_summary if summary else write_tile
            for tile in shared(client, task, store, missing, jblast.__version__):
                yield tile, None

        yield tiles


def merge(asked: argparse.Namespace) -> int:
    """Put stores together; return the exit code.

    Raises:
        InputError: There are fewer than two, they are of other studies, or what is to
            be written is there.
    """
    from jblast.study.engine.merge import merged

    stores = asked.given[1:]
    if len(stores) < 2:
        raise InputError(f"merge: expected at least two stores, got {len(stores)}")
    store = merged(stores, asked.out or stores[0])
    done, tiles = len(store.done()), store.tiles
    if store.attributes["keep"] != "all":
        from jblast.study.engine.merge import summary_of

        summary = summary_of(store)
        done, tiles = done + len(summary.done()), tiles + summary.tiles
    state = "complete" if store.attributes["complete"] else "not complete"
    sys.stdout.write(
        f"{store.path}: {done:,} of {tiles:,} tiles from {len(stores)} stores; "
        f"{state}\n"
    )
    return 0


def report(asked: argparse.Namespace) -> int:
    """Report on a store; return the exit code.

    Raises:
        InputError: There is not one store, it is of another kind or keeps no samples,
            or what is to be written is there.
    """
    from jblast.report.fit.files import check_directory
    from jblast.report.study_page import study_report
    from jblast.report.study_stores import read_columns

    stores = asked.given[1:]
    if len(stores) != 1:
        raise InputError(f"report: expected one store, got {len(stores)}")
    out = Path(asked.out) if asked.out else None
    if out is not None:
        check_directory(out, asked.force)
    store = Path(stores[0])
    found = study_report(read_columns(str(store)), store.name)
    if out is not None:
        from jblast.report.study_page import write_report

        with writing(out):
            write_report(found, out)
    if asked.json:
        sys.stdout.write(found.answer().to_json())
    else:
        sys.stdout.write(found.text())
        if out is not None:
            sys.stdout.write(f"Written: {out / 'report.html'}\n")
    return 0
