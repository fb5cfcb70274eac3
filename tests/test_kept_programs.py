"""A kept program answers as the one it was made of, and never for another."""

import importlib
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

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


LAW = """
import jax
import jax.numpy as jnp
from {place}_constants import GAMMA
import {place}_constants as constants

def helper(z):
    return {factor} * z

@jax.jit
def law(z):
    return helper(z) ** GAMMA + constants.OFFSET + jnp.sum(z[..., 0])

def made(power):
    return lambda z: z ** power
"""


@pytest.fixture
def written(tmp_path_factory, monkeypatch):
    """Return a function that writes a user's module and imports it afresh."""
    home = tmp_path_factory.mktemp("user")
    monkeypatch.syspath_prepend(home)

    def write(factor="2.0", gamma="1.4", offset="0.0"):
        place = f"user_law_{len(list(home.iterdir()))}"
        text = f"GAMMA, OFFSET = {gamma}, {offset}\n"
        (home / f"{place}_constants.py").write_text(text)
        (home / f"{place}.py").write_text(LAW.format(factor=factor, place=place))
        return importlib.import_module(place)

    return write


def test_a_users_function_is_named_by_its_source_and_all_it_refers_to(written):
    own = written()
    same = spelled(written().made(2.0)), spelled(own.made(2.0))
    assert same[0] == same[1]
    assert spelled(own.made(3.0)) not in same
    base = fingerprints(own)
    assert fingerprints(own) == base
    assert fingerprints(written()) == base
    assert fingerprints(written(factor="3.0")) != base
    assert fingerprints(written(gamma="1.5")) != base
    assert fingerprints(written(offset="1.0")) != base


def fingerprints(module):
    """The fingerprint of a user's law, without the name of its module."""
    parts = [*kept_programs._Description().parts(module.law)]
    return [part.replace(module.__name__, "") for part in parts]


class Own(eqx.Module):
    """A module of a user's, given to a program."""

    gain: jax.Array

    def __call__(self, x):
        return self.gain * x


def test_a_users_module_is_named_by_the_code_of_its_methods():
    other: Any = type(
        "Own", (eqx.Module,), {**OWN, "__call__": lambda self, x: self.gain}
    )
    one = spelled(Own(jnp.asarray(1.0)))
    assert one == spelled(Own(jnp.asarray(2.0)))
    assert one != spelled(Own(jnp.ones(2)))
    assert one.partition("[")[0] != spelled(other(jnp.asarray(1.0))).partition("[")[0]


OWN = {"__annotations__": {"gain": jax.Array}, "__module__": __name__}


def test_what_refers_to_an_open_file_is_not_kept(tmp_path):
    with (tmp_path / "open").open("w") as file, pytest.raises(Unkept):
        spelled(lambda x: file.write(x))


def stronger(law):
    """The law of a user, by another function."""
    return replace(law, function=lambda time: 2.0 * law.function(time))


@pytest.mark.parametrize("change", [lambda law: replace(law, name="own"), stronger])
def test_with_a_law_of_a_users_programs_are_kept_under_another_key(
    store, found, change
):
    program, line = kept(climb), Line(jnp.asarray(2.0), 2)
    law = LAWS["flash_time_s", "light"]
    own = change(law)

    def kept_files():
        program(line, X)
        return set(store.glob("traced-*"))

    try:
        register(own)
        with_own = kept_files()
        assert len(with_own) == 1
        started_again(store)(line, X)
        assert TRACED[2] == 1
    finally:
        LAWS.pop((own.quantity, own.name))
        register(law)
    assert len(kept_files()) == 2
    assert TRACED[2] == 2


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
