"""Run a Monte Carlo study: sample a scene many times and compute outcomes.

`jblast study STUDY.toml --out STUDY.zarr` runs the study of a file. --resume continues
an interrupted run without computing a sample twice. `jblast study report STUDY.zarr
--out DIR` writes a page of results. `jblast study merge A.zarr B.zarr --out C.zarr`
merges stores.
"""

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.options import add_force, add_json, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError, shown, whole_number
from jblast.files import writing

if TYPE_CHECKING:
    from jblast.study.sampling.run import Tiles


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "given",
        metavar="STUDY.toml | report STUDY.zarr | merge A.zarr B.zarr",
        nargs="*",
        type=path,
        help="study file; or report and a store; or merge and the stores to merge",
    )
    verb.model.add_argument(
        "--limit",
        metavar="N",
        type=int,
        help="approximate number of samples to compute in this run (default: all)",
    )
    verb.model.add_argument(
        "--resume",
        action="store_true",
        help="continuation of an existing store, or start of a new one",
    )
    verb.advanced.add_argument(
        "--devices",
        metavar="all|N",
        default="all",
        help="number of devices: GPUs of this machine, or cores of its CPU (default: "
        "all)",
    )
    verb.advanced.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask scheduler, such as tcp://HOST:8786, whose workers all "
        "see --out under the same path (default: none)",
    )
    verb.advanced.add_argument(
        "--allow-code",
        action="store_true",
        help="permission for outcomes that are Python functions, as "
        "python:module.function",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="STUDY.zarr",
        type=path,
        help="store, a folder; of a report the folder of page, figures and report.json",
    )
    verb.outputs.add_argument(
        "--list",
        action="store_true",
        help="list of the available outcomes, with their units",
    )
    add_json(verb)
    add_force(verb, "an existing --out of a report")


def run(options: argparse.Namespace) -> int:
    """Run or continue a study, merge stores, or report; return the exit code."""
    from jblast.cli.jax_start import start_jax

    if not options.list and not options.given:
        raise InputError("study: expected STUDY.toml, or merge and stores, got nothing")
    # Merging compiles nothing, so that JAX is not configured.
    if options.given[:1] == ["merge"]:
        return merge(options)
    if options.given[:1] == ["report"]:
        start_jax(quick=True)
        return report(options)
    # with a scheduler this process only distributes tiles
    start_jax(all_cores=options.scheduler is None)
    if options.list:
        from jblast.report.study_run import outcomes_text
        from jblast.study.outcome.registry import OUTCOMES

        sys.stdout.write(outcomes_text(OUTCOMES.values()))
        return 0
    if len(options.given) > 1:
        raise InputError(
            f"study: expected one STUDY.toml, got {' '.join(options.given)}"
        )
    if not options.out:
        raise InputError("--out: expected the folder of the store, got nothing")
    return _run(options)


def _run(options: argparse.Namespace) -> int:
    from jblast.report.study_run import run_text, study_answer
    from jblast.study.engine.launch import mesh_of
    from jblast.study.file import read_study
    from jblast.study.sampling.run import run_into

    study = read_study(options.given[0], allow_code=options.allow_code)
    # Each sample has a key of its own, so that results do not depend on the devices.
    mesh = mesh_of(device_count(options.devices))
    try:
        with tile_workers(options) as tiles:
            ran = run_into(
                study,
                Path(options.out),
                resume=options.resume,
                limit=options.limit,
                mesh=mesh,
                tiles=tiles,
            )
    except OSError as error:  # the error of a full disk does not name the folder
        message = (
            f"{options.out}: {error.strerror or error}; what is computed is kept, "
            "--resume adds to it"
        )
        raise OSError(error.errno, message) from error
    answer = study_answer(ran)
    sys.stdout.write(answer.to_json() if options.json else run_text(answer))
    return 0


def device_count(words: str) -> int | None:
    """Return the number of devices; None for all.

    Raises:
        InputError: The value is neither a number nor "all".
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
def tile_workers(options: argparse.Namespace) -> "Iterator[Tiles | None]":
    """Yield the function that computes tiles on workers; None for this process.

    Raises:
        InputError: No worker is available.
    """
    if options.scheduler is None:
        yield None
        return
    import jblast
    from jblast.study.sampling.cluster import (
        client_of,
        shared,
        write_summary,
        write_tile,
    )

    # Workers may have another current folder.
    store = str(Path(options.out).resolve())
    with client_of(options.scheduler) as client:

        def tiles(
            missing: list[int], *, summary: bool = False
        ) -> "Iterator[tuple[int, None]]":
            task = write_summary if summary else write_tile
            # Workers with another version would compute other samples and are refused.
            for tile in shared(client, task, store, missing, jblast.__version__):
                yield tile, None

        yield tiles


def merge(options: argparse.Namespace) -> int:
    """Merge stores; return the exit code.

    Raises:
        InputError: There are fewer than two stores, they belong to different studies,
            or the output exists.
    """
    from jblast.study.engine.merge import merged

    stores = options.given[1:]
    if len(stores) < 2:
        raise InputError(f"merge: expected at least two stores, got {len(stores)}")
    store = merged(stores, options.out or stores[0])
    done, tiles = len(store.done()), store.tiles
    # A study that keeps summaries only has a second store, with tiles of its own.
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


def report(options: argparse.Namespace) -> int:
    """Report on a store; return the exit code.

    Raises:
        InputError: There is not exactly one store, it has another format or no
            samples, or the output exists.
    """
    from jblast.report.fit.files import check_directory
    from jblast.report.study_page import study_report
    from jblast.report.study_stores import read_columns

    stores = options.given[1:]
    if len(stores) != 1:
        raise InputError(f"report: expected one store, got {len(stores)}")
    out = Path(options.out) if options.out else None
    if out is not None:
        check_directory(out, options.force)
    store = Path(stores[0])
    found = study_report(read_columns(str(store)), store.name)
    if out is not None:
        from jblast.report.study_page import write_report

        with writing(out):
            write_report(found, out)
    if options.json:
        sys.stdout.write(found.answer().to_json())
    else:
        sys.stdout.write(found.text())
        if out is not None:
            sys.stdout.write(f"Written: {out / 'report.html'}\n")
    return 0
