"""Library calls keep programs between processes and leave JAX's settings alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NAMES = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)
SCRIPT = f"""
import json, sys
import jax
import jax.numpy as jnp
from jblast.kept_programs import kept, kept_between_runs

if sys.argv[1:]:
    jax.config.update("jax_compilation_cache_dir", sys.argv[1])
before = [getattr(jax.config, name) for name in {NAMES}]

def law(x):
    return jnp.sin(x)

@kept_between_runs()
def call():
    return float(kept(law)(jnp.asarray(0.5))), jax.config.jax_compilation_cache_dir

value, folder = call()
after = [getattr(jax.config, name) for name in {NAMES}]
print(json.dumps([value, folder, before == after]))
"""


def called(cache: Path, *words: str, **settings: str):
    env = {**os.environ, "XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)}
    env.pop("JBLAST_KEEP_PROGRAMS", None)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *words],
        env=env | settings,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("own", [False, True])
def test_programs_are_stored_and_settings_are_as_before(tmp_path, own):
    theirs = str(tmp_path / "theirs")
    value, folder, unchanged = called(tmp_path, *([theirs] if own else []))
    assert value == pytest.approx(0.479425538604203)
    assert unchanged
    # a cache of the user's own stays in use; traced programs are stored in ours
    assert folder == (theirs if own else str(tmp_path / "jblast"))
    assert list((tmp_path / "jblast").glob("traced-*"))


ONCE = """
import jax
import jax.numpy as jnp
from jblast.kept_programs import kept_between_runs, kept_once

traced = []

def law(x, sign):
    traced.append(1)
    return {"value": sign * jnp.sin(x)}

call = kept_once(law)
with kept_between_runs():
    for x in (0.5, 1.0):
        print(float(call(jnp.asarray(x), 1)["value"]))
print(len(traced), jax.config.jax_compilation_cache_dir)
print(float(call(jnp.asarray(0.5), -1)["value"]))
"""


def test_a_program_is_looked_up_once_for_each_layout_and_kept(tmp_path):
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(ROOT)}
    env.pop("JBLAST_KEEP_PROGRAMS", None)
    for traced in "10":  # the second process loads what the first one stored
        done = subprocess.run(
            [sys.executable, "-c", ONCE],
            env=env,
            capture_output=True,
            text=True,
            check=True,
        )
        half, one, *others, negative = done.stdout.split()
        assert float(half) == pytest.approx(0.479425538604203, rel=1e-6)
        assert float(one) == pytest.approx(0.841470984807897, rel=1e-6)
        assert others == [traced, "None"]
        assert float(negative) == pytest.approx(-0.479425538604203, rel=1e-6)


def test_it_can_be_turned_off(tmp_path):
    _, folder, _ = called(tmp_path, JBLAST_KEEP_PROGRAMS="0")
    assert folder is None
    assert not (tmp_path / "jblast").exists()
