"""Options of a verb, read from its help text.

The docstring of a verb's module is its help and its only declaration:

    Pick blasts from pressure records.

    example:
      jblast pick records/ --out picks.csv

    input:
      RECORD...                 path; records, or folders of them
      --positions STATIONS.csv  path; sensor positions
      ...reading
    model:
      --vehicles N              integer = 1; number of scenes
    output:
      --verbose                 all details

After the name of an option and of its value stand the kind of the value (`kinds.kind`),
and its help. `KIND*` can be repeated; `= VALUE` is the default; `? VALUE` is the value
of an option without one; `NAME!` is required. A positional argument `NAME...` takes one
value or more, and `[NAME]` and `[NAME...]` may be absent. The kind `choice` takes its
words from the name of the value: `--mode rgb|events|both`. An option without a value is
a flag. `...NAME` includes the options `SHARED[NAME]`.
"""

import argparse
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NoReturn

from jblast.cli.kinds import kind
from jblast.errors import InputError, closest, foreign_digits, shown
from jblast.parameters import PARAMETERS

WIDTH = 79
"""Characters in a line of help: one less than a terminal of 80 columns has."""
SECTIONS = ("input", "model", "output", "advanced")
SECTION = re.compile(rf"^(example|{'|'.join(SECTIONS)}):$", re.M)
OPTION = re.compile(r"^ {2}(\S+)(?: (\S+))?(?:$| {2,})", re.M)
"""First line of an option: two blanks, name, one blank, value, and two blanks."""
KIND = re.compile(r"([a-z_ ]+)(\*?)(?: = (.+?)| \? (.+?))?; (.*)")
VALUE = re.compile(r"(\[(?=.*\]$))?(.+?)((?<!,)\.\.\.)?(?(1)\])(!?)")
"""Name of a value: `[NAME]`, `NAME...`, `NAME!`; `NAME,...` is a name."""
NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[+-]?\d+)?([:,].*)?$", re.IGNORECASE)
"""Negative numbers, also `-1e-1`, `-1:2` and `-1,2`."""
SHARED = {
    "free": f"""
model:
  --free PARAMETER,...  names; parameters to fit without a prior (default: those of the
      scene): some of {", ".join(PARAMETERS)}; with several charges charge_mass_kg.NAME
      and so on; for a clock clock_offset_s.NAME
""",
    "law": """
model:
  --law auto|NAME|QUANTITY=NAME  text*; law for all of its quantities, or for one
      quantity; repeatable (default: as in the scene)
""",
    "noise": """
advanced:
  --noise student|gaussian  choice = student; distribution of the independent errors
""",
    "reading": """
input:
  --wide  wide log: one column for each quantity, such as peak_overpressure_kpa,
      optionally with sigma_peak_overpressure_kpa
  --date YYYY-MM-DD  text; date of the times in value_utc that have none, in their zone
  --zone ZONE  text; time zone of the times in value_utc that have none: +02:00, UTC,
      Asia/Beirut
""",
    "records": """
input:
  --positions STATIONS.csv  path; sensor positions of pressure records: columns sensor
      (stem of a file's name, or stem.channel, by name or number; or a channel's name
      that no other has), east_m, north_m, up_m or lat_deg, lon_deg, alt_m, and
      optionally clock and start_utc (time of the first sample); or KML, GeoJSON or
      StationXML
  ...scale
advanced:
  --trigger  times of all files count from a common trigger, whatever their times of day
      (default: times of day where files state them)
""",
    "scale": """
input:
  --full-scale PA  positive; pressure of a sample of 1 in WAV or FLAC [Pa] (default:
      unknown, such records give times only)
  --sensitivity PA  positive; pressure per volt of records in volts, or per count of
      miniSEED and SAC [Pa]
advanced:
  --high-pass HZ  positive; corner frequency of the recorders' first-order high-pass
      [Hz], whose effect on duration and impulse is corrected (default: none)
""",
    "json": """
output:
  --json  answer as JSON, instead of text
""",
    "out": """
output:
  --json   answer as JSON, instead of text
  --force  permission to overwrite existing files in --out
""",
}
"""Options that several verbs have, by name."""
HELP = "\n  --debug  traceback of an error\n"


class VerbParser(argparse.ArgumentParser):
    """Parser of a verb, whose options are grouped by purpose.

    Attributes:
        summary: First line of the description.
        details: Its other paragraphs, printed after the options.
        example: A command line.
    """

    def __init__(self, prog: str, text: str):
        sections = _sections(text)
        self.summary, _, details = sections.pop("").strip().partition("\n\n")
        self.details = filled(details)
        self.example = sections.pop("example", "").strip()
        super().__init__(
            prog=prog,
            description=f"{filled(self.summary)}\n\nexample:\n  {self.example}",
            epilog=self.details or None,
            formatter_class=_Formatter,
            add_help=False,
        )
        # argparse takes -1 for a number, but -1e-1 and -1:2 for options
        self._negative_number_matcher = NEGATIVE
        self.groups = {name: self.add_argument_group(name) for name in SECTIONS}
        self._add(sections | {"advanced": sections.get("advanced", "") + HELP})
        self.groups["advanced"].add_argument(
            "-h", "--help", action="help", help="this help, and exit"
        )

    def _add(self, sections: dict[str, str]) -> None:
        """Add the options of sections."""
        for section, text in sections.items():
            for name, metavar, words in _options(text):
                if name.startswith("..."):
                    self._add(_sections(SHARED[name[3:]]))
                else:
                    _add_option(self.groups[section], name, metavar, words)

    def error(self, message: str) -> NoReturn:
        """Raise InputError for a bad value (`kinds`), else print usage and exit 2."""
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


def _sections(text: str) -> dict[str, str]:
    """Return a help text by section; its description has the name ""."""
    first, *rest = SECTION.split(text)
    return {"": first} | dict(zip(rest[::2], rest[1::2], strict=True))


def _options(text: str) -> Iterator[tuple[str, str, str]]:
    """Yield name, name of the value ("" for none) and words of each option."""
    found = [*OPTION.finditer(text)]
    ends = [*(match.start() for match in found[1:]), len(text)]
    for match, end in zip(found, ends, strict=bool(found)):
        words = " ".join(text[match.end() : end].split())
        yield match[1], match[2] or "", words


def _add_option(group: Any, name: str, metavar: str, words: str) -> None:
    """Add an option or a positional argument to a group of a parser."""
    is_option = name.startswith("--")
    if is_option and not metavar:
        group.add_argument(name, action="store_true", help=_escaped(words))
        return
    value = VALUE.fullmatch(metavar if is_option else name)
    found = KIND.fullmatch(words)
    assert value, f"{name}: expected a name of its value, got {metavar!r}"
    assert found, f"{name}: expected KIND; help, got {words!r}"
    optional, metavar, several, required = value.groups()
    of, repeated, default, constant, text = found.groups()
    if default is not None and "(default" not in text:
        text += f" (default: {default})"
    values: dict[str, Any] = {"metavar": metavar, "help": _escaped(text)}
    values["type"] = kind(of, metavar)
    if repeated:
        # argparse copies the list before it appends, so that commands in one process
        # do not share it
        values |= {"action": "append", "default": []}
    elif default is not None or of == "names":
        values["default"] = default or ""
    if constant is not None:
        values |= {"nargs": "?", "const": constant}
    elif several or optional:
        values["nargs"] = ("*" if optional else "+") if several else "?"
    if is_option:
        group.add_argument(name, required=bool(required), **values)
    else:
        group.add_argument(re.split(r"\W", metavar)[0].lower(), **values)


def _escaped(text: str) -> str:
    return text.replace("%", "%%")


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Formatter whose usage has required arguments only: the groups list the others."""

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[Any],
        prefix: str | None = None,
    ) -> None:
        needed = [a for a in actions if a.required or not a.option_strings]
        rest = argparse.Action([], "options", nargs="?", metavar="OPTION ...")
        super().add_usage(usage, [*needed, rest], groups, prefix)
