"""A kept program answers as the one it was made of, and never for another."""

import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves  # noqa: F401  registers the laws
from jblast.kept_programs import Unkept, keep_in, kept, spelled
from jblast.registry import LAWS, register
from tests.cli.cli_files import JBLAST, TWO

ROOT = Path(__file__).parents[1]
TRACED = Counter()
X = np.array([1.0, 2.0, 3.0])


class Line(eqx.Module):
    """What a program is given: an array, and a number that is part of it."""

    slope: jax.Array
    power: int = eqx.field(static=True)


@dataclass(frozen=True)
class Table:
    """Holds numbers that are part of a program, which their shape does not tell."""

    numbers: np.ndarray


def climb(line, x):
    """Say that it was traced; answer with arrays in modules, among other values."""
    TRACED[line.power] += 1
    whole: dict[str, Any] = {
        "total": jnp.sum(line.slope * x**line.power),
        "line": line,
        "unit": "m",
    }
    return whole


# as if of the package: others' functions may change without a trace
climb.__module__ = Line.__module__ = "jblast.climb"
LINE = Line(jnp.asarray(2.0), 2)


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "jblast.climb", sys.modules[__name__])
    TRACED.clear()
    keep_in(tmp_path / "programs")
    yield tmp_path / "programs"
    keep_in(None)


def started_again(store):
    """Forget what this process holds, as another process would."""
    keep_in(store)
    return kept(climb)(LINE, X)


def files(store):
    return sorted(store.glob("program-*"))


def test_a_second_start_answers_the_same_without_tracing(store):
    for answer in (kept(climb)(LINE, X), started_again(store)):
        assert answer["total"] == 2.0 * np.sum(X**2)
        assert (answer["unit"], answer["line"].power) == ("m", 2)
        assert answer["line"].slope == 2.0
    assert (len(files(store)), TRACED[2]) == (1, 1)


def test_a_damaged_file_is_compiled_again(store):
    started_again(store)
    (file,) = files(store)
    whole = file.read_bytes()
    middle = len(whole) // 2
    other = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    for traced, damaged in enumerate((b"", whole[:10], whole[:middle], other), 2):
        file.write_bytes(damaged)
        assert started_again(store)["total"] == 2.0 * np.sum(X**2)
        assert TRACED[2] == traced
        started_again(store)
        assert TRACED[2] == traced


def test_the_folder_is_closed_to_others_and_that_of_another_user_is_not_used(
    store, monkeypatch
):
    store.chmod(0o777)
    started_again(store)
    assert store.stat().st_mode & 0o777 == 0o700
    monkeypatch.setattr(os, "getuid", lambda: store.stat().st_uid + 1)
    with pytest.warns(UserWarning, match="belongs to another user"):
        started_again(store)
    assert (len(files(store)), TRACED[2]) == (1, 2)


def test_arrays_are_given_and_all_else_is_another_program(store):
    program = kept(climb)
    program(LINE, X)
    assert program(Line(jnp.asarray(5.0), 2), X)["total"] == 5.0 * np.sum(X**2)
    assert len(files(store)) == 1
    assert program(Line(jnp.asarray(2.0), 3), X)["total"] == 2.0 * np.sum(X**3)
    program(LINE, X[:2])
    program(Line(jnp.asarray(2.0, jnp.float32), 2), X.astype(np.float32))
    assert len(files(store)) == 4
    program(LINE, X)
    assert TRACED[2] == 3


def test_derivatives_and_batches_go_through_the_function_itself():
    program = kept(climb)
    slope = jax.grad(lambda s: program(Line(s, 2), X)["total"])(jnp.asarray(2.0))
    assert slope == np.sum(X**2)
    many = jax.vmap(lambda s: program(Line(s, 2), X)["total"])(jnp.arange(3.0))
    np.testing.assert_array_equal(many, np.arange(3.0) * np.sum(X**2))


def later(time):
    """A user's law of the flash's time."""
    return 2.0 * time


def test_values_without_a_lasting_description_have_no_key():
    for value in (Table(np.array([1.0])), later, lambda x: x, {"open": {1, 2}}):
        with pytest.raises(Unkept):
            spelled(value)


def triple(time):
    """Another law under its name."""
    return 3.0 * time


def seen(x):
    """Look a law up by name, as programs do."""
    return LAWS["flash_time_s", "light"].function(x)


def test_a_law_that_is_replaced_is_another_program_and_is_not_stored(store):
    seen.__module__ = "jblast.climb"
    law, program = LAWS["flash_time_s", "light"], kept(seen)
    whole = kept(lambda x: program(x))  # within another program, too
    first, stored = program(X), files(store)
    try:
        for factor, function in ((2.0, later), (3.0, triple)):
            register(replace(law, function=function))
            np.testing.assert_array_equal(program(X), factor * X)
            np.testing.assert_array_equal(whole(X), factor * X)
        assert files(store) == stored  # a law of a user may depend on anything
    finally:
        LAWS.pop((law.quantity, law.name))
        register(law)
    np.testing.assert_array_equal(program(X), first)


CALL = """
import json, sys
import jax
import jax.numpy as jnp
from jblast.kept_programs import kept, kept_between_runs
from jblast.waves.laws.line_of_sight import light_arrival_time
if sys.argv[1:]:
    jax.config.update("jax_compilation_cache_dir", sys.argv[1])
before = dict(jax.config.values)
@kept_between_runs()
def call():
    value = kept(jnp.sin)(jnp.asarray(0.5)), kept(light_arrival_time)(3e8)
    return float(value[0]), jax.config.jax_compilation_cache_dir
print(json.dumps([*call(), dict(jax.config.values) == before]))
"""


@pytest.mark.parametrize(
    ("words", "keep", "used"),
    [((), "1", "jblast"), (("theirs",), "1", "theirs"), ((), "0", None)],
)
def test_calls_store_programs_leave_settings_alone_and_can_be_told_not_to(
    tmp_path, words, keep, used
):
    env = os.environ | {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(ROOT)}
    script = [sys.executable, "-c", CALL, *(str(tmp_path / word) for word in words)]
    said = subprocess.check_output(script, env=env | {"JBLAST_KEEP_PROGRAMS": keep})
    value, folder, unchanged = json.loads(said)
    assert (value, unchanged) == (pytest.approx(0.479425538604203), True)
    assert folder == (used and str(tmp_path / used))
    assert any((tmp_path / "jblast").glob("program-*")) == (keep == "1")


@pytest.mark.slow
def test_a_command_answers_the_same_from_kept_programs(tmp_path):
    (tmp_path / "log.csv").write_text(TWO)
    words = [*JBLAST, "fit", str(tmp_path / "log.csv"), "--json"]
    answers = set()
    for keep in ("1", "1", "0"):  # made, read back, without
        env = {"XDG_CACHE_HOME": str(tmp_path), "JBLAST_KEEP_PROGRAMS": keep}
        answers.add(subprocess.check_output(words, env=os.environ | env))
    assert len(answers) == 1
    assert list(tmp_path.rglob("program-*"))
