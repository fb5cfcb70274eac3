from tests.tools.changed import ALWAYS, asked_for


def of(*files: str) -> set[str]:
    return set(asked_for(files)) - set(ALWAYS)


def test_a_module_asks_for_the_asked_for_its_room():
    assert of("jblast/waves/euler.py", "jblast/cli/verbs/fit.py") == {
        "tests/waves",
        "tests/cli",
    }
    assert of("calibration/fit.py") == {"tests/calibration"}
    assert of("notebooks/01.ipynb") == {"tests/test_notebooks.py"}


def test_a_test_asks_for_its_room_or_itself():
    assert of("tests/vehicle/flights.py") == {"tests/vehicle"}
    assert of("tests/test_float32.py") == {"tests/test_float32.py"}


def test_what_all_rooms_use_asks_for_all_tests():
    assert asked_for(["jblast/constants.py"]) == ["tests"]
    assert asked_for(["tests/conftest.py", "README.md"]) == ["tests"]
    assert asked_for(["pyproject.toml"]) == ["tests"]
    assert asked_for(["tests/tools/slopes.py"]) == ["tests"]


def test_a_page_of_text_asks_for_what_is_always_run():
    assert asked_for(["README.md"]) == sorted(ALWAYS)
