"""The plugin that tells how long tests take, and ends them in time."""

import pytest

pytest_plugins = ["pytester"]
TWO = "import time\ndef test_quick(): pass\ndef test_slow(): time.sleep(0.2)\n"


@pytest.fixture
def run(pytester, monkeypatch):
    """Run two tests, and one of another file, in a folder of their own."""
    pytester.makepyfile(test_one=TWO, test_two="def test_other(): pass\n")
    kept = pytester.path / ".jax_cache"
    kept.mkdir()
    (kept / "import_time_s").write_text("0.1\n")  # J, as measured before
    monkeypatch.delenv("CI", raising=False)
    plugin = ("-p", "tests.tools.minutes", "-v")
    return lambda *options: pytester.runpytest(*plugin, *options)


def test_the_slowest_are_printed_in_j_first(run):
    result = run()
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines(["The slowest, in J*0.10 s here", "*2.* J  *test_slow"])


def test_after_the_given_moment_none_begins_and_each_is_named(run):
    result = run("--until=0")
    result.assert_outcomes(skipped=3)
    result.stdout.fnmatch_lines(["NOT RUN, no time was left: 3 tests"])
    result.stdout.fnmatch_lines(["  test_one.py::test_quick", "*test_slow"])


def test_what_is_named_comes_first(run):
    lines = run("--first=test_two.py").outlines
    begun = [line for line in lines if "::" in line and "PASSED" in line]
    assert begun[0].startswith("test_two.py")
