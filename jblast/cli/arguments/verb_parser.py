"""Parser of one verb: option groups, help text, and messages about wrong options."""

import argparse
import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

from jblast.errors import InputError, closest, foreign_digits, shown

NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[+-]?\d+)?([:,].*)?$", re.IGNORECASE)
"""Negative numbers, also `-1e-1`, `-1:2` and `-1,2`."""
WIDTH = 79
"""Characters in a line of help: one less than a terminal of 80 columns has."""


class VerbParser(argparse.ArgumentParser):
    """Parser of a verb whose options are grouped by purpose.

    Attributes:
        summary: First line of the description.
        details: Its other paragraphs, printed after the options.
        example: A command line.
        inputs: Group for input files and the options for reading them.
        model: Group for scene, laws, priors and method.
        outputs: Group for output files and printed formats.
        advanced: Group for options that most users do not need.
    """

    def __init__(self, prog: str, description: str, example: str):
        self.summary, _, details = description.strip().partition("\n\n")
        self.details, self.example = filled(details), example
        super().__init__(
            prog=prog,
            description=f"{filled(self.summary)}\n\nexample:\n  {example}",
            epilog=self.details or None,
            formatter_class=_Formatter,
            add_help=False,
        )
        # argparse takes -1 for a number, but -1e-1 and -1:2 for options
        self._negative_number_matcher = NEGATIVE
        self.inputs, self.model, self.outputs, self.advanced = map(
            self.add_argument_group, ("input", "model", "output", "advanced")
        )

    def error(self, message: str) -> NoReturn:
        """Raise InputError for a bad value (`numbers`), else print usage and exit 2."""
        option, _, reason = message.removeprefix("argument ").partition(": ")
        if reason.startswith("expected ") and message.startswith("argument "):
            raise InputError(f"{option}: {reason}")
        super().error(message)

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        """Return the value of an option; numbers need the digits 0 to 9."""
        value = super()._get_value(action, arg_string)
        # a file name may have any digits
        if isinstance(value, int | float | tuple) and foreign_digits(arg_string):
            raise argparse.ArgumentError(
                action, f"expected the digits 0 to 9, got {shown(arg_string)}"
            )
        return value

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Print usage, the unknown words and the nearest option; exit 2."""
        # Without its dashes: the two that all options share would make any two similar.
        known = {option.lstrip("-"): option for option in self._option_string_actions}
        unknown = [word.partition("=")[0] for word in words if word[:1] == "-"]
        close = (closest(option.lstrip("-"), known) for option in unknown)
        hint = next((f"; did you mean {known[c]}?" for c in close if c), "")
        self.error(f"unrecognized arguments: {' '.join(words)}{hint}")


def filled(text: str) -> str:
    """Return paragraphs with their lines filled; indented paragraphs stay."""
    return "\n\n".join(
        part if part.startswith(" ") else textwrap.fill(" ".join(part.split()), WIDTH)
        for part in text.strip("\n").split("\n\n")
    )


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Formatter whose usage has required arguments only: the groups list the others."""

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[Any],
        prefix: str | None = None,
    ) -> None:
        # members of a required exclusive group are not required one by one
        either = [a for g in groups if g.required for a in g._group_actions]
        needed = [a for a in actions if a.required or not a.option_strings]
        rest = argparse.Action([], "options", nargs="?", metavar="OPTION ...")
        super().add_usage(usage, [*needed, *either, rest], groups, prefix)
