"""Find the equation of motion in a trajectory: which terms, how sure, is it a law.

Exit code 4: no law was found, or what it leaves over is more than noise, or could not
be judged, or, integrated from the first row, it does not give the data back, or nearly
collinear terms are exchangeable. Except for the last case, products of one column more
are tried then.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import seed, share
from jblast.cli.arguments.options import DOUBTFUL, check_out, given, path, save_figure
from jblast.files import save_text

FILES = ("discovery.json", "discovery.png")


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
        metavar="SHARE",
        help="least share of a derivative's root mean square for a term to stay "
        "(default: 0.05)",
    )
    verb.add_argument(
        "--ensemble",
        type=int,
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
    """Find, write, print; return the exit code."""
    from jblast.discovery.law_search import check_search, discover_law

    check_search(**given(asked, degree="degree", ensemble="members"))
    if asked.out:
        check_out(Path(asked.out), FILES, force=asked.force)
    search = discover_law(
        asked.trajectory,
        states=_names(asked.state),
        inputs=_names(asked.input),
        held=asked.held,
        drag=asked.drag,
        seed=asked.seed,
        **given(asked, degree="degree", threshold="threshold", ensemble="members"),
    )
    from jblast.report.discovery import discovery_answer, discovery_text

    data, found, again, further = search[:4]
    answer = discovery_answer(
        found,
        again,
        further,
        rows=len(data.time_s),
        inputs=tuple(data.names[len(found.states) :]),
        threshold=search.threshold,
        members=search.members,
        seed=search.seed,
    )
    text = answer.to_json()
    if asked.out:
        from jblast.report.discovery_figures import discovery_figure

        figure = discovery_figure(found, again, data.time_s, data.states)
        save_text(text, Path(asked.out) / FILES[0])
        save_figure(figure, Path(asked.out) / FILES[1])
    sys.stdout.write(text if asked.json else discovery_text(found, again, further))
    if asked.out and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(FILES)}\n")
    return 0 if search.certain else DOUBTFUL


def _names(words: str) -> list[str]:
    """Return the names that stand between commas."""
    return [name.strip() for name in words.split(",") if name.strip()]
