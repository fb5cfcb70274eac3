"""The table of what tests cost."""

from tests.tools.costs import by_room, used


def test_seconds_are_added_up_by_room():
    lines = [
        "9.000\tcollecting",
        "1.500\ttests/waves/laws/test_brode.py::test_it[a/b]",
        "0.500\ttests/waves/test_paths.py::test_it",
        "0.250\ttests/test_docs.py::test_it[docs/a.md]",
        "0.250\ttests/test_files.py::test_it",
    ]
    assert by_room(lines) == {"collecting": 9.0, "waves": 2.0, "tests/*.py": 0.5}


def test_work_is_counted():
    before = used()
    sum(range(3_000_000))
    assert used() > before
