"""A kept program answers as the one it was made of, and never for another."""

import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves  # noqa: F401  registers the laws
from jblast import kept_programs
from jblast.kept_programs import Unkept, keep_in, kept, spelled
from jblast.registry import LAWS, register

TRACED = Counter()


class Pair(NamedTuple):
    """What a program answers with."""

    total: jax.Array
    parts: dict[str, jax.Array]


class Line(eqx.Module):
    """What a program is given: an array, and a number that is part of it."""

    slope: jax.Array
    power: int = eqx.field(static=True)


@dataclass(frozen=True)
class Table:
    """Holds numbers that are part of a program, which their shape does not tell."""

    numbers: np.ndarray


def climb(line, x):
    """Say that it was traced, and answer."""
    TRACED[line.power] += 1
    value = line.slope * x**line.power
    return Pair(jnp.sum(value), {"each": value})


# as if of the package: others' functions may change without a trace
for own in (climb, Pair, Line):
    own.__module__ = "jblast.climb"


@pytest.fixture(autouse=True)
def store(tmp_path):
    TRACED.clear()
    keep_in(tmp_path)
    yield tmp_path
    keep_in(None)


def started_again(store):
    """Forget what this process holds, as another process would."""
    keep_in(store)
    return kept(climb)


X = np.array([1.0, 2.0, 3.0])


@pytest.fixture
def found(monkeypatch):
    """Let what is read back find the classes of this file."""
    monkeypatch.setitem(sys.modules, "jblast.climb", sys.modules[__name__])


def test_a_second_start_answers_the_same_without_tracing(store, found):
    line = Line(jnp.asarray(2.0), 2)
    first = kept(climb)(line, X)
    assert len(list(store.glob("traced-*"))) == 1
    second = started_again(store)(line, X)
    assert TRACED[2] == 1
    assert isinstance(second, Pair)
    np.testing.assert_array_equal(second.parts["each"], 2.0 * X**2)
    np.testing.assert_array_equal(first.total, second.total)


def test_arrays_are_given_and_all_else_is_another_program(store, found):
    program = kept(climb)
    program(Line(jnp.asarray(2.0), 2), X)
    assert program(Line(jnp.asarray(5.0), 2), X).total == 5.0 * np.sum(X**2)
    assert len(list(store.glob("traced-*"))) == 1
    assert program(Line(jnp.asarray(2.0), 3), X).total == 2.0 * np.sum(X**3)
    program(Line(jnp.asarray(2.0), 2), X[:2])
    program(Line(jnp.asarray(2.0, jnp.float32), 2), X.astype(np.float32))
    assert len(list(store.glob("traced-*"))) == 4


def test_another_state_of_the_package_is_another_program(store, found, monkeypatch):
    program, line = kept(climb), Line(jnp.asarray(2.0), 2)
    program(line, X)
    monkeypatch.setattr(kept_programs, "_source", lambda: "edited")
    program(line, X)
    assert TRACED[2] == 2


def test_what_python_compiled_leaves_the_fingerprint_as_it_is(tmp_path):
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "law.py").write_text("x = 1\n")
    before = kept_programs.fingerprint(tmp_path)
    (tmp_path / "room" / "__pycache__").mkdir()
    (tmp_path / "room" / "__pycache__" / "law.cpython-311.pyc").write_bytes(b"x")
    assert kept_programs.fingerprint(tmp_path) == before
    (tmp_path / "room" / "law.py").write_text("x = 2\n")
    assert kept_programs.fingerprint(tmp_path) != before


def test_files_are_read_anew_only_once_one_was_touched(store, tmp_path, monkeypatch):
    law = tmp_path / "room" / "law.py"
    law.parent.mkdir()
    law.write_text("x = 1\n")
    read = []
    whole = kept_programs.fingerprint
    monkeypatch.setattr(
        kept_programs, "fingerprint", lambda root: read.append(root) or whole(root)
    )
    room = law.parent
    first = kept_programs._contents(room)
    assert kept_programs._contents(room) == first == whole(room)
    assert len(read) == 1
    law.write_text("x = 2\n")  # as long as before
    assert kept_programs._contents(room) == whole(room) != first
    assert len(read) == 2


def test_half_a_file_is_made_again(store, found):
    line = Line(jnp.asarray(2.0), 2)
    kept(climb)(line, X)
    (file,) = store.glob("traced-*")
    whole = file.read_bytes()
    for size in (0, 10, len(whole) // 2):
        file.write_bytes(whole[:size])
        assert started_again(store)(line, X).total == 2.0 * np.sum(X**2)
        assert file.read_bytes()[:10] == whole[:10]


def test_derivatives_and_batches_go_through_the_function_itself(found):
    program = kept(climb)
    slope = jax.grad(lambda s: program(Line(s, 2), X).total)(jnp.asarray(2.0))
    assert slope == np.sum(X**2)
    many = jax.vmap(lambda s: program(Line(s, 2), X).total)(jnp.arange(3.0))
    np.testing.assert_array_equal(many, np.arange(3.0) * np.sum(X**2))


def test_numbers_within_a_program_have_no_name():
    with pytest.raises(Unkept):
        spelled(Table(np.array([1.0])))
    with pytest.raises(Unkept):
        spelled(lambda x: x)
    with pytest.raises(Unkept):
        spelled(test_numbers_within_a_program_have_no_name)  # not of the package


@pytest.mark.parametrize("name", ["light", "light by another's numbers"])
def test_beside_a_law_that_is_not_the_packages_nothing_is_kept(store, found, name):
    program, line = kept(climb), Line(jnp.asarray(2.0), 2)
    law = LAWS["flash_time_s", "light"]
    register(replace(law, name=name))
    try:
        assert program(line, X).total == 2.0 * np.sum(X**2)
        assert not list(store.iterdir())
    finally:
        del LAWS["flash_time_s", name]
        register(law)
    program(line, X)
    assert list(store.glob("traced-*"))


def test_without_a_folder_nothing_is_kept(store):
    keep_in(None)
    kept(climb)(Line(jnp.asarray(2.0), 2), X)
    assert not list(store.iterdir())


SOLVERS = """
import subprocess
import sys
import jax.numpy as jnp
from jblast.kept_programs import keep_in, kept

def doubled(x):
    return x + x

def root(x):
    return jnp.linalg.cholesky(x)

doubled.__module__ = root.__module__ = "jblast.climb"
keep_in(sys.argv[1])
assert kept(doubled)(jnp.ones(2)).tolist() == [2.0, 2.0]
print("scipy.linalg" in sys.modules)
print(kept(root)(4.0 * jnp.eye(2)).tolist())
"""


def test_scipy_s_solvers_are_loaded_where_a_program_calls_them_alone(store):
    done = subprocess.run(
        [sys.executable, "-c", SOLVERS, str(store)], capture_output=True, text=True
    )
    assert done.stdout.splitlines() == ["False", "[[2.0, 0.0], [0.0, 2.0]]"]
