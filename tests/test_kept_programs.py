"""A kept program answers as the one it was made of, and never for another."""

import importlib
import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.waves  # noqa: F401  registers the laws
from jblast.kept_programs import Unkept, fingerprint, keep_in, kept, kept_once, spelled
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
    """Say that it was traced, and answer."""
    TRACED[line.power] += 1
    return {"total": jnp.sum(line.slope * x**line.power)}


# as if of the package: others' functions may change without a trace
climb.__module__ = Line.__module__ = "jblast.climb"
LINE = Line(jnp.asarray(2.0), 2)


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "jblast.climb", sys.modules[__name__])
    TRACED.clear()
    keep_in(tmp_path)
    yield tmp_path
    keep_in(None)


def started_again(store):
    """Forget what this process holds, as another process would."""
    keep_in(store)
    return kept(climb)


def files(store):
    return len(list(store.glob("traced-*")))


def test_a_second_start_answers_the_same_without_tracing_and_half_a_file_is_made_again(
    store,
):
    assert kept(climb)(LINE, X)["total"] == 2.0 * np.sum(X**2)
    assert started_again(store)(LINE, X)["total"] == 2.0 * np.sum(X**2)
    assert (files(store), TRACED[2]) == (1, 1)
    (file,) = store.glob("traced-*")
    whole = file.read_bytes()
    for size in (0, 10, len(whole) // 2):
        file.write_bytes(whole[:size])
        assert started_again(store)(LINE, X)["total"] == 2.0 * np.sum(X**2)
        assert file.read_bytes()[:10] == whole[:10]


def test_a_program_of_a_step_is_looked_up_once_for_each_layout(store):
    step = kept_once(climb)
    assert [
        float(step(Line(jnp.asarray(a), 2), X)["total"]) for a in (1.0, 2.0, 3.0)
    ] == [14.0, 28.0, 42.0]
    assert (files(store), TRACED[2]) == (1, 1)
    keep_in(store)
    assert kept_once(climb)(LINE, X)["total"] == 28.0
    assert TRACED[2] == 1


def test_arrays_are_given_and_all_else_is_another_program(store):
    program = kept(climb)
    program(LINE, X)
    assert program(Line(jnp.asarray(5.0), 2), X)["total"] == 5.0 * np.sum(X**2)
    assert files(store) == 1
    assert program(Line(jnp.asarray(2.0), 3), X)["total"] == 2.0 * np.sum(X**3)
    program(LINE, X[:2])
    program(Line(jnp.asarray(2.0, jnp.float32), 2), X.astype(np.float32))
    assert files(store) == 4


def test_a_fingerprint_is_that_of_the_source_alone(tmp_path):
    law = tmp_path / "law.py"
    law.write_text("x = 1\n")
    before = fingerprint(tmp_path)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "law.cpython-311.pyc").write_bytes(b"x")
    assert fingerprint(tmp_path) == before
    law.write_text("x = 2\n")
    assert fingerprint(tmp_path) != before


def test_derivatives_and_batches_go_through_the_function_itself():
    program = kept(climb)
    slope = jax.grad(lambda s: program(Line(s, 2), X)["total"])(jnp.asarray(2.0))
    assert slope == np.sum(X**2)
    many = jax.vmap(lambda s: program(Line(s, 2), X)["total"])(jnp.arange(3.0))
    np.testing.assert_array_equal(many, np.arange(3.0) * np.sum(X**2))


def test_numbers_within_a_program_and_open_files_have_no_name(tmp_path):
    with pytest.raises(Unkept):
        spelled(Table(np.array([1.0])))
    with (tmp_path / "open").open("w") as file, pytest.raises(Unkept):
        spelled(lambda x: file.write(x))


def test_a_users_function_is_named_by_its_source_and_all_it_refers_to(
    tmp_path_factory, monkeypatch
):
    home = tmp_path_factory.mktemp("user")
    monkeypatch.syspath_prepend(home)

    def named(power=2.0, factor="2.0", gamma="1.4"):
        place = f"user_law_{len(list(home.iterdir()))}"
        (home / f"{place}_constants.py").write_text(f"GAMMA = {gamma}\n")
        (home / f"{place}.py").write_text(
            f"from {place}_constants import GAMMA\ndef helper(z):\n"
            f"    return {factor} * z ** GAMMA\n"
            "def made(power):\n    return lambda z: helper(z) ** power\n"
        )
        return spelled(importlib.import_module(place).made(power)).replace(place, "")

    assert named() == named()
    others = named(power=3.0), named(factor="3.0"), named(gamma="1.5")
    assert len({named(), *others}) == 4


def later(time):
    """A user's law of the flash's time."""
    return 2.0 * time


def test_with_a_users_law_programs_are_kept_under_another_key(store):
    program, law = kept(climb), LAWS["flash_time_s", "light"]
    try:
        register(replace(law, function=later))
        program(LINE, X)
        started_again(store)(LINE, X)
        assert (files(store), TRACED[2]) == (1, 1)
    finally:
        LAWS.pop((law.quantity, law.name))
        register(law)
    program(LINE, X)
    assert (files(store), TRACED[2]) == (2, 2)


CALL = """
import json, sys
import jax
import jax.numpy as jnp
from jblast.kept_programs import kept, kept_between_runs
if sys.argv[1:]:
    jax.config.update("jax_compilation_cache_dir", sys.argv[1])
before = dict(jax.config.values)
def law(x):
    return jnp.sin(x)
@kept_between_runs()
def call():
    return float(kept(law)(jnp.asarray(0.5))), jax.config.jax_compilation_cache_dir
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
    assert any((tmp_path / "jblast").glob("traced-*")) == (keep == "1")


@pytest.mark.slow
def test_commands_answer_the_same_from_kept_programs(tmp_path):
    (tmp_path / "log.csv").write_text(TWO)
    calc = ["calc", "--mass", "15", "--range", "20"]
    for command in (calc, ["fit", str(tmp_path / "log.csv")]):
        answers = set()
        for keep in ("1", "1", "0"):  # made, read back, without
            env = {"XDG_CACHE_HOME": str(tmp_path), "JBLAST_KEEP_PROGRAMS": keep}
            words = [*JBLAST, *command, "--json"]
            answers.add(subprocess.check_output(words, env=os.environ | env))
        assert len(answers) == 1
        assert list(tmp_path.rglob("traced-*"))
