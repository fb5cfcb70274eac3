"""Find the equation of motion in a trajectory: which terms, how sure, is it a law.

Exit code 4: no law was found, or what it leaves over is more than noise, or could not
be judged, or, integrated from the first row, it does not give the data back, or nearly
collinear terms are exchangeable. Except for the last case, products of one column more
are tried then.
"""

import argparse
import contextlib
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import seed, share
from jblast.cli.arguments.options import (
    path,
    refuse_existing,
    save_figure,
    save_text,
    writing,
)
from jblast.errors import InputError

FILES = ("discovery.json", "discovery.png")
MOST_TERMS = 100
"""Candidates: more are neither found fast nor told apart."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "trajectory",
        metavar="TRAJECTORY.csv",
        type=path,
        help="CSV with a header: time_s and columns of numbers, a row a time",
    )
    verb.add_argument(
        "--state",
        metavar="COLUMN,...",
        default="",
        help="columns to find equations for (default: all but time_s and the inputs)",
    )
    verb.add_argument(
        "--input",
        metavar="COLUMN,...",
        default="",
        help="columns that drive them: a wind, a command; taken as exact",
    )
    verb.add_argument(
        "--held",
        action="store_true",
        help="inputs keep their value until the next row, as commands do; by default "
        "they are linear between rows",
    )
    verb.add_argument(
        "--degree",
        type=int,
        default=2,
        metavar="N",
        help="look among products of up to N columns (default: 2)",
    )
    verb.add_argument(
        "--drag",
        action="store_true",
        help="look also among |x| x of each column x",
    )
    verb.add_argument(
        "--threshold",
        type=share,
        default="0.05",
        metavar="SHARE",
        help="least share of a derivative's root mean square for a term to stay "
        "(default: 0.05)",
    )
    verb.add_argument(
        "--ensemble",
        type=int,
        default=100,
        metavar="N",
        help="records with new noise that say how sure a term is, 19 or more "
        "(default: 100)",
    )
    verb.add_argument("--seed", type=seed, default=0, help="of the noise (default: 0)")
    verb.add_argument(
        "--out", metavar="DIR", type=path, help=f"also write {' and '.join(FILES)}"
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite these files in --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Read, find, judge, print; return the exit code."""
    import json

    from jblast.discovery.discover import FEWEST_OF_INTERVAL
    from jblast.progress import stages

    threshold = asked.threshold
    least_members = "; fewer have no 5 % and 95 % quantiles"
    for option, value, least, most, why in (
        ("--degree", asked.degree, 1, 6, ""),
        ("--ensemble", asked.ensemble, FEWEST_OF_INTERVAL, 10_000, least_members),
    ):
        if not least <= value <= most:
            raise InputError(
                f"{option}: expected a whole number from {least} to {most}, got "
                f"{value}{why}"
            )
    if asked.out:
        _check_out(Path(asked.out), force=asked.force)
    from jblast.discovery.trajectory_file import read_trajectory

    begin = stages({"reading": 4.0, "finding": 5.0, "one degree more": 5.0})
    begin("reading")
    data = read_trajectory(asked.trajectory, _names(asked.state), _names(asked.input))
    _check_size(len(data.names), asked.degree, asked.drag)

    from jblast.discovery.discover import discover, replay
    from jblast.discovery.sparse_regression import polynomial
    from jblast.report.discovery import certain, discovery_answer, discovery_text

    def find(degree: int):
        candidates, outside = (
            polynomial(data.names, n, signed_squares=asked.drag)
            for n in (degree, degree + 1)
        )
        found = discover(
            data.time_s,
            data.states,
            data.inputs,
            names=data.names,
            candidates=candidates,
            outside=outside,
            held=asked.held,
            threshold=threshold,
            members=asked.ensemble,
            seed=asked.seed,
        )
        own = replay(found, data.time_s, data.states, data.inputs, held=asked.held)
        return found, own

    begin("finding")
    found, again = find(asked.degree)
    sure, further = certain(found, again), None
    few = _terms(len(data.names), asked.degree + 1, asked.drag) <= MOST_TERMS
    # more candidates do not distinguish exchangeable terms
    if not sure and few and not any(found.exchangeable):
        begin("one degree more")
        with contextlib.suppress(InputError):  # a term that overflows is none to try
            further = find(asked.degree + 1)
    answer = discovery_answer(
        found,
        again,
        further,
        rows=len(data.time_s),
        inputs=tuple(data.names[len(found.states) :]),
        threshold=threshold,
        members=asked.ensemble,
        seed=asked.seed,
    )
    document = {"schema": 1} | answer.to_dict()
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if asked.out:
        from jblast.report.discovery_figures import discovery_figure

        figure = discovery_figure(found, again, data.time_s, data.states)
        _write(Path(asked.out), text, figure)
    sys.stdout.write(text if asked.json else discovery_text(found, again, further))
    if asked.out and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(FILES)}\n")
    return 0 if sure else 4


def _names(words: str) -> list[str]:
    """Return the names that stand between commas."""
    return [name.strip() for name in words.split(",") if name.strip()]


def _check_size(columns: int, degree: int, drag: bool) -> None:
    """Refuse more candidates than can be told apart.

    Raises:
        InputError: There are more than 100.
    """
    terms = _terms(columns, degree, drag)
    if terms > MOST_TERMS:
        raise InputError(
            f"{columns} columns to degree {degree}: expected at most {MOST_TERMS} "
            f"candidates, got {terms}; name fewer by --state and --input, or lower "
            "--degree"
        )


def _terms(columns: int, degree: int, drag: bool) -> int:
    """Return how many candidates there are."""
    import math

    return math.comb(columns + degree, degree) + columns * drag


def _check_out(directory: Path, *, force: bool) -> None:
    """Refuse a directory that cannot be written to, before anything is computed."""
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        refuse_existing(directory / name, force=force)


def _write(directory: Path, text: str, figure) -> None:

    save_text(text, directory / FILES[0])
    save_figure(figure, directory / FILES[1])
