"""How words become options: a parser a verb, and what is said of words it lacks."""

import argparse
import re
import sys
import textwrap
from collections.abc import Sequence
from typing import Any, NoReturn

from jblast import __version__
from jblast.cli.verbs.table import GROUPS, VERBS, Verb
from jblast.errors import InputError, closest, nearest

NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[+-]?\d+)?([:,].*)?$", re.IGNORECASE)
WIDTH = 79
PROLOGUE = "Differentiable blast physics: fit a blast from sensor recordings."
EPILOGUE = (
    "Start with: jblast fit OBSERVATIONS.csv, or jblast calc --mass 15 --range 20. "
    "Options of a verb: jblast VERB --help. Exit codes: 0 answered; 1 our own failure; "
    "2 bad input; 3 nothing found; 4 computed, but not converged, not identifiable or "
    "not good enough. "
    "For safety engineering, forensics and sensing; designs no explosives."
)


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
