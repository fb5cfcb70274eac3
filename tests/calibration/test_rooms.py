"""What runs is counted, lines by their kind, and the drawing shows every import."""

import sys

import pytest

from calibration.rooms import (
    ROOMS,
    WALKS,
    Tracer,
    imports_between,
    rooms_table,
    size_of,
)
from jblast.scene import Charge, Scene
from jblast.sensors import calculate


@pytest.fixture(scope="module")
def between():
    return imports_between()


def test_nothing_stands_above_the_diagonal(between):
    order = {room: place for place, room in enumerate(("", *ROOMS))}
    assert all(order[a] >= order[b] for a, b in between if a)  # the front door may
    assert between["inference", "sensors"] > 10


def test_each_room_has_its_line(between):
    heads, *lines = rooms_table(between).split("\n")
    assert [line.split()[0] for line in lines] == list(ROOMS)
    assert heads.split()[0] == "package"


MODULE = """
'Of the module,'

import ast
from os import (
    path,
)

X = 1  # beside code
# a remark


def f():
    'Text.'
    return X
"""


def test_lines_are_counted_by_what_stands_there(tmp_path):
    file = tmp_path / "a.py"
    file.write_text(MODULE)
    size = size_of([file])
    assert (size.modules, size.folders, size.lines) == (1, 1, 15)
    assert (size.imports, size.comments, size.code) == (4, 1, 3)


def test_a_tracer_counts_files_functions_and_calls_between_files():
    scene, tracer = Scene(Charge(mass_kg=15.0)), Tracer()
    calculate(scene, [20.0], 15.0)  # so that nothing is imported or tabulated any more
    before = sys.getprofile()
    sys.setprofile(tracer)
    calculate(scene, [20.0], 15.0)
    sys.setprofile(before)
    found = tracer.counted()
    assert any(file.endswith("sensors/calculator.py") for file, _ in tracer.functions)
    assert 2 <= found["files"] <= found["functions"]
    assert found["in one folder"] <= found["arrows"] <= found["calls"]


def test_commands_are_verbs():
    from jblast.cli.parsers import VERBS

    assert set(WALKS) <= {verb.name for verb in VERBS}
