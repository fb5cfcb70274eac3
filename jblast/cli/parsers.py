"""Verbs of the command line, their parsers, and messages about unknown words.

`VERBS` lists each verb with its group, one line of help and an example. A verb is a
module of `jblast.cli.verbs` with `add_arguments` and `run`. It is imported when it is
typed, so that the help and one verb do not import the other verbs.
"""

import argparse
import sys
import textwrap
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType
from typing import NamedTuple, NoReturn

from jblast import __version__
from jblast.cli import spec
from jblast.cli.arguments.verb_parser import WIDTH, VerbParser
from jblast.errors import closest, nearest

PROLOGUE = "Differentiable blast physics: fit a blast from sensor recordings."
EPILOGUE = (
    "Start with: jblast fit OBSERVATIONS.csv, or jblast calc --mass 15 --range 20. "
    "Options and an example of a verb: jblast VERB --help. Exit codes: 0 success; "
    "1 internal failure; 2 bad input; 3 nothing found; 4 computed, but not converged, "
    "not identifiable or not accurate enough. "
    "For safety engineering, forensics and sensing; designs no explosives."
)
GROUPS = {
    "main path": "from handbook laws, readings or pressure records to a blast",
    "logs": "conversion of a log, and a scene file for it",
    "analysis": "other recordings, trajectories, and sensor layouts",
    "simulation": "readings, recordings, worlds of blasts and Monte Carlo studies",
    "film": "images and camera events",
    "flight": "vehicles and their missions",
    "methods": "cost, accuracy and limits of the methods",
}
"""Headings of the root help, each with its subject."""


class Verb(NamedTuple):
    """A verb of the command line.

    Attributes:
        name: The word typed, and the name of the module.
        group: Heading in the help, a key of `GROUPS`.
        help: One line of help.
        example: A command line that works.
    """

    name: str
    group: str
    help: str
    example: str

    def module(self) -> ModuleType:
        """Return the module with its arguments (`add_arguments`) and action (`run`)."""
        return import_module(f"jblast.cli.verbs.{self.name}")


def verb_parser(verb: Verb) -> "VerbParser | spec.VerbParser":
    """Return the parser of one verb; no other verb is imported."""
    # One module only: importing those of all verbs would delay each command.
    module = verb.module()
    if not hasattr(module, "add_arguments"):
        read = spec.VerbParser(f"jblast {verb.name}", module.__doc__ or "")
        is_shown = getattr(module, "PROGRESS", True)
        read.set_defaults(progress=is_shown, verb=verb.name, run=module.run)
        return read
    parser = VerbParser(f"jblast {verb.name}", module.__doc__ or "", verb.example)
    # Before the arguments of the verb, which may turn it off (`jblast serve`).
    parser.set_defaults(progress=True)
    module.add_arguments(parser)
    parser.advanced.add_argument(
        "--debug", action="store_true", help="traceback of an error"
    )
    parser.advanced.add_argument(
        "-h", "--help", action="help", help="this help, and exit"
    )
    parser.set_defaults(verb=verb.name, run=module.run)
    return parser


def root_parser() -> argparse.ArgumentParser:
    """Return the parser of the first word, whose help lists the verbs."""
    root = argparse.ArgumentParser(
        prog="jblast",
        usage="%(prog)s [-h] [--version] VERB ...",
        description="\n\n".join([PROLOGUE, *map(_group_help, GROUPS)]),
        epilog=textwrap.fill(EPILOGUE, WIDTH),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    root.add_argument("--version", action="version", version=f"jblast {__version__}")
    # The description lists the verbs by group; argparse would list them once more.
    root.add_argument("verb", metavar="VERB", help=argparse.SUPPRESS)
    return root


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command line.

    Raises:
        InputError: An option has a value that cannot be used.
        SystemExit: Help is requested (0); a verb or an option is unknown, or a required
            argument is missing (2).
    """
    root = root_parser()
    # Only the first word: subparsers of argparse would need the options of all verbs,
    # and would import every module.
    name = root.parse_args(words[:1]).verb
    verb = next((verb for verb in VERBS if verb.name == name), None)
    if verb is None:
        _refuse_verb(root, name)
    # `parse_args` would end with a message that names no similar option.
    parser = verb_parser(verb)
    options, unknown = parser.parse_known_args(words[1:])
    if unknown:
        parser.refuse(unknown)
    # Reports and runs store the command line that made them.
    options.words = ("jblast", *words)
    return options


def _refuse_verb(root: argparse.ArgumentParser, name: str) -> NoReturn:
    """Print the known verbs, with the usage of the nearest; exit 2."""
    names = [verb.name for verb in VERBS]
    close = closest(name, names)
    # Usage of the verb that was probably meant; without one, of the root.
    parser = root if close is None else verb_parser(VERBS[names.index(close)])
    parser.print_usage(sys.stderr)
    known = ", ".join(map(repr, names))
    root.exit(
        2,
        f"jblast: error: argument VERB: invalid choice: {name!r} "
        f"(choose from {known}){nearest(name, names)}\n",
    )


def _group_help(group: str) -> str:
    """Return the verbs of a group as a paragraph of the help."""
    lines = [f"{group}: {GROUPS[group]}"]
    for verb in VERBS:
        if verb.group == group:
            lines.append(
                textwrap.fill(
                    # The longest name, stability, is followed by two blanks.
                    f"  {verb.name:<11}{verb.help}",
                    WIDTH,
                    subsequent_indent=" " * 13,
                )
            )
    return "\n".join(lines)


VERBS = (
    Verb(
        "calc",
        "main path",
        "calculate a blast by every law, or the range or mass for a value",
        "jblast calc --mass 15 --range 20",
    ),
    Verb(
        "check",
        "main path",
        "list all errors and warnings of a log before a fit",
        "jblast check log.csv",
    ),
    Verb(
        "fit",
        "main path",
        "fit a blast to a log of sensor readings, or to pressure records",
        "jblast fit log.csv --scene scene.toml --out report",
    ),
    Verb(
        "pick",
        "main path",
        "pick blasts from pressure records and write a log",
        "jblast pick records/ --positions stations.csv --out picks.csv",
    ),
    Verb(
        "convert",
        "logs",
        "convert a log with other columns and units",
        "jblast convert theirs.xlsx --out log.csv",
    ),
    Verb(
        "scene",
        "logs",
        "write a commented scene file for a log",
        "jblast scene log.csv --out scene.toml",
    ),
    Verb(
        "detect",
        "analysis",
        "detect a blast in sound, film or camera events",
        "jblast detect recording.wav --charge 5 --range 80",
    ),
    Verb(
        "tune",
        "analysis",
        "estimate sensor and medium parameters from a recording, or tune a vehicle's "
        "gains",
        "jblast tune scene.toml phone.wav --free noise_pa,low_pass_hz --out tuned",
    ),
    Verb(
        "bound",
        "analysis",
        "predict the uncertainty of a fit for a planned sensor layout",
        "jblast bound scene.toml --at charge_mass_kg=25 --map map.png",
    ),
    Verb(
        "discover",
        "analysis",
        "identify the equations of motion of a trajectory",
        "jblast discover flight.csv --input push_m_s2 --drag",
    ),
    Verb(
        "simulate",
        "simulation",
        "simulate the readings of a scene's sensors",
        "jblast simulate scene.toml --out log.csv --seed 1",
    ),
    Verb(
        "listen",
        "simulation",
        "simulate recordings over time: sound, pressure, wind, ground motion",
        "jblast listen scene.toml --out recordings --seconds 10",
    ),
    Verb(
        "world",
        "simulation",
        "simulate random blasts as all sensors of a scene record them",
        "jblast world world.toml --out run --seed 1",
    ),
    Verb(
        "report",
        "simulation",
        "write an HTML page for a run of `jblast world`",
        "jblast report run --fit",
    ),
    Verb(
        "serve",
        "simulation",
        "serve a world of blasts to other simulators and autopilots",
        "jblast serve world.toml --seed 3 --seconds 4",
    ),
    Verb(
        "study",
        "simulation",
        "run a Monte Carlo study of a scene",
        "jblast study study.toml --out study.zarr",
    ),
    Verb(
        "render",
        "film",
        "render a scene's blast: frames and camera events",
        "jblast render scene.toml --out film --views explosion",
    ),
    Verb(
        "events",
        "film",
        "convert frames to the events of an event camera",
        "jblast events frames/ --fps 1000 --noise off --out events.h5",
    ),
    Verb(
        "fly",
        "flight",
        "fly a scene's vehicle through its blasts: path error and recovery",
        "jblast fly flight.toml --vehicles 500 --out flights",
    ),
    Verb(
        "plan",
        "flight",
        "write a mission plan: lanes over a field, or a circle",
        "jblast plan field.plan --grid 40,20,10 --home 35.3075,-80.7353,200 --up 15",
    ),
    Verb(
        "choose",
        "methods",
        "choose the cheapest method that is accurate enough for a scene",
        "jblast choose scene.toml --quantity air_arrival_s --tolerance 0.01",
    ),
)
