"""Benchmarks of two trees in turn: while one is timed the other waits."""

import pytest

from calibration import benchmarks_before
from calibration.benchmarks_before import in_turns

BENCHMARKS = "import sys, calibration.benchmark_toy as toy\ntoy.run(sys.argv[1])\n"
TOY = """
import os, time
LOG = {log!r}
def say(what):
    with open(LOG, "a") as file:
        file.write({name!r} + " " + what + "\\n")
def run(name):
    for turn in range({turns}):
        say("free")
        start = time.perf_counter()
        say("timed")
        sum(range(300_000))
        time.sleep(0.01)
        say("timed")
        took = time.perf_counter() - start
        assert took > 0 and {works}, "it failed"
    print(name, "said by {name}")
"""


@pytest.fixture
def tree(tmp_path):
    """Return what makes a tree with a benchmark that notes when it is timed."""

    def made(name, turns, works=True):
        about = {"name": name, "turns": turns, "works": works}
        package = tmp_path / name / "calibration"
        package.mkdir(parents=True)
        (package / "__init__.py").write_text("")
        (package / "benchmarks.py").write_text(BENCHMARKS)
        toy = TOY.format(log=str(tmp_path / "log"), **about)
        (package / "benchmark_toy.py").write_text(toy)
        return tmp_path / name

    return made


def test_while_one_is_timed_the_other_waits_and_they_take_turns(tree, tmp_path):
    printed = in_turns((tree("before", 5), tree("now", 3)), "toy")
    assert printed == ["toy said by before\n", "toy said by now\n"]
    timed, inside = [], ""
    for line in (tmp_path / "log").read_text().splitlines():
        name, what = line.split()
        assert inside in ("", name), f"{name} was about while {inside} was timed"
        if what == "timed":
            inside = "" if inside else name
            timed += [name] if inside else []
    assert timed == ["before", "now"] * 3 + ["before"] * 2


def test_a_benchmark_that_fails_is_said_with_its_reason(tree):
    with pytest.raises(RuntimeError, match="it failed"):
        in_turns((tree("before", 1), tree("now", 1, works=False)), "toy")


def test_a_tree_without_the_benchmark_runs_the_one_of_this_tree(tree, monkeypatch):
    now = tree("now", 1)
    beside = now / "calibration" / "benchmark_in_turns.py"
    beside.write_text(benchmarks_before.CHILD.read_text())
    toy = now / "calibration" / "benchmark_toy.py"
    toy.write_text(toy.read_text() + "\nif __name__ == '__main__':\n    run('toy')\n")
    monkeypatch.setattr(benchmarks_before, "CHILD", beside)
    earlier = tree("earlier", 1)
    (earlier / "calibration" / "benchmark_toy.py").unlink()
    assert in_turns((earlier, now), "toy") == ["toy said by now\n"] * 2
