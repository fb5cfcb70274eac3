"""No message of the library names an option of the command line: that adds them."""

import ast
import re
from pathlib import Path

import pytest

import jblast
from jblast.cli.arguments.options import option_for
from jblast.errors import InputError, argument
from jblast.scene import default_scene, freed

PACKAGE = Path(jblast.__file__).parent
EDGE = ("cli", "report", "verification")
"""Who speaks of the command line: it, what it prints, and what measures that."""
OPTION = re.compile(r"--[a-z]")


def messages(source: str) -> list[str]:
    """Return the texts of a module that are no docstrings."""
    tree = ast.parse(source)
    silent = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in silent
    ]


def test_no_message_outside_the_edge_names_an_option():
    named = {
        f"{path.relative_to(PACKAGE)}: {text}"
        for path in PACKAGE.rglob("*.py")
        if path.relative_to(PACKAGE).parts[0] not in EDGE
        for text in messages(path.read_text(encoding="utf-8"))
        if OPTION.search(text)
    }
    assert named == set()


def test_a_message_that_names_an_option_is_found_and_a_docstring_is_not():
    source = '"""Says --json."""\nraise ValueError(f"{x}: give --free")\n'
    assert [text for text in messages(source) if OPTION.search(text)] == [
        ": give --free"
    ]


def test_an_argument_has_its_own_name_and_that_of_its_option_at_the_edge():
    error = InputError(f"{argument('one_event')} is of one\n   shot")
    assert str(error) == "one_event is of one shot"
    assert error.worded(option_for) == "--one-event is of one shot"
    with pytest.raises(InputError, match=r"^freed nonsense: expected one of") as raised:
        freed(default_scene(), ["nonsense"])
    assert raised.value.worded(option_for).startswith("--free nonsense: expected one")
