"""Verbs and options: their help, kinds and defaults, and what is imported for them."""

import functools
import json
import re
import shlex
import subprocess
import sys
from typing import NamedTuple

import pytest

from jblast.cli.kinds import KINDS, kind
from jblast.cli.main import parsed, verb_parser
from jblast.cli.spec import VerbParser
from jblast.cli.verbs import LIST, VERBS
from jblast.errors import InputError

TEXT = """Weigh records.

More of 5 %.

example:
  jblast weigh a.csv

input:
  RECORD...       path; records
  --home LAT,LON[,ALT]!  numbers; home
model:
  --vehicles N    integer = 1; number of
                  scenes
  --mode a|b      choice = a; mode
  --live [X]      positive ? 2; speed
  --law NAME      text*; law, repeatable
  --mass KG...    several mass; masses
  ...free
output:
  --verbose       all of 5 %
  ...out
"""


def parser() -> VerbParser:
    return VerbParser("jblast weigh", TEXT)


def test_options_have_their_kinds_and_defaults():
    words = "a b --home -1,2 --live --mass 1:100:3 2lb --law x --law y --free a,b"
    found = parser().parse_args(words.split())
    assert found.record == ["a", "b"]
    assert (found.home, found.vehicles, found.live) == ((-1.0, 2.0), 1, 2.0)
    assert found.mass == [pytest.approx((1.0, 10.0, 100.0)), (0.90718474,)]
    assert (found.law, found.free, found.mode) == (["x", "y"], ["a", "b"], "a")
    assert (found.verbose, found.json, found.force) == (False, False, False)
    bare = parser().parse_args(["a", "--home", "1,2,3"])
    assert (bare.live, bare.mass, bare.law, bare.free) == (None, None, [], [])


@pytest.mark.parametrize(
    ("name", "metavar", "word", "message"),
    [
        ("path", "", " ", "a path"),
        ("choice", "a|b|c", "d", "expected a or b or c, got 'd'"),
        ("number", "", "nan", "a finite number"),
        ("number", "", "1e300", "a size between"),
        ("positive", "", "-1", "a positive number"),
        ("size", "", "inf", "a positive number"),
        ("share", "", "1", "a share"),
        ("seed", "", "-1", "a whole number"),
        ("seed", "", str(2**63), "a whole number"),
        ("span", "", "2:1", "START before STOP"),
        ("span", "", "2", "START:STOP"),
        ("numbers", "X,Y,Z", "1,2", "X,Y,Z"),
        ("numbers", "A[,B]", "1,2,3", r"A\[,B\]"),
        ("several", "", "1,5", "which may be one number or two"),
        ("several", "", "1:2:1", "a COUNT"),
        ("several", "", "2:1:3", "write 1:2:3"),
        ("mass", "", "3ft", "a unit of mass"),
        ("mass", "", "3parsnip", "a unit of mass: kg, g, mg, lb, .*, as in 33lb"),
        ("mass", "", "5MT", "megatonne or tonne"),
        ("temperature", "", "20kg", "a unit of temperature"),
        ("share", "", "150%", "a share"),
        ("mass", "", "1,5kg", "a decimal point"),
        ("positive length", "", "-3ft", "a positive number"),
    ],
)
def test_a_wrong_value_is_refused(name, metavar, word, message):
    with pytest.raises(Exception, match=message):
        kind(name, metavar)(word)


@pytest.mark.parametrize(
    ("name", "word", "value"),
    [
        ("mass", "1kt", 1e6),
        ("mass", "2 Mt", 2e9),
        ("time", "12.4ms", 0.0124),
        ("pressure", "140dB", 200.0),
        ("temperature", "20C", 293.15),
        ("temperature", "-40 °F", 233.15),
        ("temperature", "288", 288.0),
        ("percentage", "50%", 0.5),
        ("share", "5%", 0.05),
    ],
)
def test_a_value_with_a_unit_is_in_si(name, word, value):
    assert kind(name, "")(word) == pytest.approx(value, rel=1e-15)


def test_digits_of_other_scripts_are_refused_by_name():
    with pytest.raises(InputError, match="--vehicles: expected the digits 0 to 9"):
        parser().parse_args(["a", "--home", "1,2", "--vehicles", "٣"])


def test_a_kind_that_does_not_exist_is_an_error():
    assert "text" in KINDS
    with pytest.raises(KeyError):
        kind("colour", "")


QUESTIONS = (
    ("--help",),
    ("calc", "--help"),
    ("bound", "--help"),
    ("choose", "--help"),
    ("clac",),
)

CHILD = """
import contextlib, io, json, os, sys
for words in json.loads(sys.argv[1]):
    if not os.fork():  # each command has modules of its own
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
            from jblast.cli.main import main
            main(words)
        print(json.dumps([said.getvalue(), sorted(sys.modules)]), flush=True)
        os._exit(0)
    if os.wait()[1]:
        sys.exit(f"{words} did not end")
"""


class Told(NamedTuple):
    """What a command wrote to stdout, and the modules that were loaded by then."""

    out: str
    modules: frozenset[str]


@functools.cache
def told() -> dict[tuple[str, ...], Told]:
    """Ask all questions."""
    run = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(QUESTIONS)],
        check=True,
        capture_output=True,
        text=True,
    )
    lines = map(json.loads, run.stdout.splitlines())
    return {
        words: Told(out, frozenset(modules))
        for words, (out, modules) in zip(QUESTIONS, lines, strict=True)
    }


GROUPS = re.findall(r"^(\w[\w ]*):", LIST, re.M)


def test_help_lists_every_verb_once_under_its_group(jblast):
    code, out, _ = jblast("--help")
    assert code == 0
    headings = [line.split(":")[0] for line in out.splitlines() if line[:1] != " "]
    assert [word for word in headings if word in GROUPS] == GROUPS
    listed = [line.split()[0] for line in out.splitlines() if line[2:3].isalpha()]
    assert [word for word in listed if word in VERBS] == list(VERBS)
    assert all(len(line) < 80 for line in out.splitlines())


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_a_description_and_a_module_that_runs_it(verb):
    parser = verb_parser(verb)
    assert parser.description
    assert parser.get_default("run").__module__ == f"jblast.cli.verbs.{verb}"


@pytest.mark.parametrize("verb", VERBS)
def test_the_help_of_a_verb_has_a_summary_of_one_line_and_an_example(verb):
    parser = verb_parser(verb)
    assert "\n" not in parser.summary
    shown = parser.format_help()
    assert f"\n\nexample:\n  {parser.example}\n\n" in shown
    options = parsed(shlex.split(parser.example)[1:])
    assert options.verb == verb


@pytest.mark.parametrize("verb", VERBS)
def test_every_option_stands_in_one_of_four_groups_and_has_a_help(verb):
    groups = re.findall(r"^(\w[\w ]*):$", verb_parser(verb).format_help(), re.M)
    ordered = ["example", "input", "model", "output", "advanced"]
    assert groups == [name for name in ordered if name in groups]
    for action in verb_parser(verb)._actions:
        assert action.help


@pytest.mark.parametrize("words", [("--help",), ("choose", "--help"), ("clac",)])
def test_no_other_verb_is_imported_and_nothing_heavy(words):
    loaded = told()[words].modules
    own = {"clac": "calc"}.get(words[0], words[0])
    others = {f"jblast.cli.verbs.{name}" for name in VERBS if name != own}
    assert loaded.isdisjoint(others | {"jax", "numpy"})


def test_a_misspelt_verb_is_told_the_nearest_and_its_usage(jblast):
    said = jblast.refused("clac", "--mass", "15")
    assert "invalid choice: 'clac'" in said
    assert said.endswith("did you mean calc?\n")
    assert said.startswith("usage: jblast calc ")
    assert jblast.refused("frobnicate").startswith("usage: jblast [-h]")


def test_a_bad_number_is_one_message_and_debug_shows_where(jblast):
    said = jblast.refused("render", "s.toml", "--out", "o", "--times=2:1")
    assert said == "jblast: --times: expected START before STOP, got '2:1'\n"
    _, _, said = jblast("simulate", "s.toml", "--out", "o", "--seed=-1", "--debug")
    assert "Traceback" in said
    assert said.splitlines()[-1] == (
        "jblast: --seed: expected a whole number from 0 to 2^63 - 1, got '-1'"
    )
