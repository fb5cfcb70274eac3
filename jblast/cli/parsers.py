"""The verbs of the command line, their parsers, and messages about unknown words.

`VERBS` lists each verb with its group and one line of help. A verb is a module of
`jblast.cli.verbs` with `add_arguments` and `run`; it is imported when it is typed, so
that help and one verb do not import the others.
"""

import argparse
import re
import sys
import textwrap
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple, NoReturn

from jblast import __version__
from jblast.errors import InputError, closest, nearest

NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[+-]?\d+)?([:,].*)?$", re.IGNORECASE)
WIDTH = 79
"""Of lines of help: that of a terminal of 80 columns."""
PROLOGUE = "Differentiable blast physics: fit a blast from sensor recordings."
EPILOGUE = (
    "Start with: jblast fit OBSERVATIONS.csv, or jblast calc --mass 15 --range 20. "
    "Options of a verb: jblast VERB --help. Exit codes: 0 answered; 1 our own failure; "
    "2 bad input; 3 nothing found; 4 computed, but not converged, not identifiable or "
    "not good enough. "
    "For safety engineering, forensics and sensing; designs no explosives."
)
GROUPS = {
    "measure": "from what recorders wrote to a log; what the laws say; a scene",
    "infer": "what a blast was, and what could be told",
    "simulate": "what would be recorded, filmed and flown through",
    "check": "a log before it is fitted; which method will do, where it breaks",
}


class VerbParser(argparse.ArgumentParser):
    """A parser that makes one message of a bad value, and knows the nearest option."""

    def __init__(self, **options: Any):
        super().__init__(**options)
        # argparse itself takes -1 for a number, but -1e-1 and -1:2 for options
        self._negative_number_matcher = NEGATIVE

    def error(self, message: str) -> NoReturn:
        """Raise InputError for a value (`numbers`), else print usage and exit 2."""
        option, _, said = message.removeprefix("argument ").partition(": ")
        if said.startswith("expected ") and message.startswith("argument "):
            raise InputError(f"{option}: {said}")
        super().error(message)

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Print usage, which words it does not know, and the nearest option; exit 2."""
        options = [word.partition("=")[0] for word in words if word[:1] == "-"]
        # dashes are all options' and make none alike
        known = {option.lstrip("-"): option for option in self._option_string_actions}
        close = (closest(option.lstrip("-"), known) for option in options)
        said = next((f"; did you mean {known[c]}?" for c in close if c), "")
        self.error(f"unrecognized arguments: {' '.join(words)}{said}")


class Verb(NamedTuple):
    """A verb of the command line.

    Attributes:
        name: What is typed, and the module's name.
        group: Under which heading the help lists it, one of `GROUPS`.
        help: What it does, in a line.
    """

    name: str
    group: str
    help: str

    def module(self) -> ModuleType:
        """Import what takes its words (`add_arguments`) and does it (`run`)."""
        return import_module(f"jblast.cli.verbs.{self.name}")


def verb_parser(verb: Verb) -> VerbParser:
    """Return the parser of one verb; no other is imported."""
    module = verb.module()
    parser = VerbParser(prog=f"jblast {verb.name}", description=module.__doc__)
    parser.set_defaults(progress=True)
    module.add_arguments(parser)
    parser.add_argument(
        "--debug", action="store_true", help="show the traceback of an error"
    )
    parser.set_defaults(verb=verb.name, run=module.run)
    return parser


def root_parser() -> argparse.ArgumentParser:
    """Return the parser of the first word, whose help lists the verbs."""
    root = argparse.ArgumentParser(
        prog="jblast",
        usage="%(prog)s [-h] [--version] VERB ...",
        description="\n\n".join([PROLOGUE, *map(_listed, GROUPS)]),
        epilog=textwrap.fill(EPILOGUE, WIDTH),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    root.add_argument("--version", action="version", version=f"jblast {__version__}")
    root.add_argument("verb", metavar="VERB", help=argparse.SUPPRESS)
    return root


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """Return what is asked for.

    Raises:
        InputError: An option's value cannot be used.
        SystemExit: Help was asked for (0); no such verb or option, or one too few (2).
    """
    root = root_parser()
    name = root.parse_args(words[:1]).verb
    verb = next((verb for verb in VERBS if verb.name == name), None)
    if verb is None:
        _refuse_verb(root, name)
    parser = verb_parser(verb)
    asked, unknown = parser.parse_known_args(words[1:])
    if unknown:
        parser.refuse(unknown)
    asked.words = ("jblast", *words)
    return asked


def _refuse_verb(root: argparse.ArgumentParser, name: str) -> NoReturn:
    """Say which verbs there are, with the usage of the nearest; exit 2."""
    names = [verb.name for verb in VERBS]
    close = closest(name, names)
    parser = root if close is None else verb_parser(VERBS[names.index(close)])
    parser.print_usage(sys.stderr)
    known = ", ".join(map(repr, names))
    root.exit(
        2,
        f"jblast: error: argument VERB: invalid choice: {name!r} "
        f"(choose from {known}){nearest(name, names)}\n",
    )


def _listed(group: str) -> str:
    """Return the verbs of a group as a paragraph of the help."""
    lines = [f"{group}: {GROUPS[group]}"]
    for verb in VERBS:
        if verb.group == group:
            lines.append(
                textwrap.fill(
                    f"  {verb.name:<11}{verb.help}", WIDTH, subsequent_indent=" " * 13
                )
            )
    return "\n".join(lines)


VERBS = (
    Verb(
        "pick", "measure", "pick blasts from records of pressure: a log, from samples"
    ),
    Verb("convert", "measure", "write a log in our columns and units, from others"),
    Verb("scene", "measure", "write a commented starter scene for a log"),
    Verb(
        "calc",
        "measure",
        "calculate a blast by every law, or the range or mass for a value",
    ),
    Verb("fit", "infer", "fit a blast to a log of sensor readings"),
    Verb(
        "tune",
        "infer",
        "tune sensors and media to recordings, or a vehicle's gains to blasts",
    ),
    Verb("detect", "infer", "find a blast in sound, film or events, and when it came"),
    Verb("bound", "infer", "say what a planned layout of sensors could tell"),
    Verb(
        "discover",
        "infer",
        "find the equations of motion in a trajectory, and how sure each term is",
    ),
    Verb("simulate", "simulate", "write what a scene's sensors would record"),
    Verb(
        "listen",
        "simulate",
        "write down what every sensor hears and feels over time: sound, pressure, wind",
    ),
    Verb("render", "simulate", "film a scene's blast: frames and events of its camera"),
    Verb(
        "bake", "simulate", "make pictures of an explosion from all sides, by Blender"
    ),
    Verb(
        "events",
        "simulate",
        "turn a sequence of frames into the events of an event camera",
    ),
    Verb(
        "fly",
        "simulate",
        "fly a scene's vehicle through its blasts: deviation, recovery, who flies on",
    ),
    Verb(
        "plan", "simulate", "write a plan for a vehicle: lanes over a field, a circle"
    ),
    Verb(
        "world",
        "simulate",
        "draw random blasts, and write what every sense of a scene perceives of them",
    ),
    Verb(
        "serve",
        "simulate",
        "let other simulators take part in a world, told of its blasts ahead of time",
    ),
    Verb(
        "study",
        "simulate",
        "draw a scene many times over, and ask each sample what came of it",
    ),
    Verb("report", "simulate", "show a world on one page: every sense on one clock"),
    Verb("check", "check", "say everything that is wrong with a log at once"),
    Verb("choose", "check", "name the cheapest method that is good enough for a scene"),
    Verb("chart", "check", "chart speed against accuracy, measured on this machine"),
    Verb(
        "stability",
        "check",
        "measure where each method breaks, and what is done there",
    ),
)
