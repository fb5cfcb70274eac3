"""What commands say and load in a process of their own; one child answers for all."""

import functools
import json
import re
import shlex
import subprocess
import sys
from typing import NamedTuple

import pytest

from jblast.cli.main import parsed, verb_parser
from jblast.cli.verbs import LIST, VERBS

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
