import os
from pathlib import Path

import pytest
from jax._src.lru_cache import LRUCache

from jblast.cli.jax_start import QUICK, UNOPTIMISED, start_jax


def test_a_kept_program_has_its_name_only_once_it_is_whole(tmp_path, monkeypatch):
    start_jax()
    cache = LRUCache(str(tmp_path), max_size=-1)

    def killed(*_):
        raise KeyboardInterrupt

    replace = Path.replace
    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        cache.put("key", b"program")
    monkeypatch.setattr(Path, "replace", replace)
    assert cache.get("key") is None
    cache.put("key", b"program")
    assert cache.get("key") == b"program"
    assert [file.name for file in tmp_path.glob("*-cache")] == ["key-cache"]


def test_what_the_user_asks_of_xla_comes_last_and_wins(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_backend_optimization_level=3")
    start_jax(quick=True)
    start_jax(quick=True)
    flags = os.environ["XLA_FLAGS"]
    assert flags.count(UNOPTIMISED) == 1
    assert flags.endswith(" --xla_backend_optimization_level=3")


def test_a_version_of_jaxlib_nobody_tried_is_given_no_flag_it_may_not_know(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr("jblast.cli.jax_start.version", lambda _: "0.99.1")
    start_jax(quick=True)
    assert os.environ["XLA_FLAGS"] == UNOPTIMISED
    assert not any(flag in UNOPTIMISED for flag in QUICK.values())


def test_without_being_asked_the_flags_stay(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_enable_fast_math=false")
    start_jax()
    assert os.environ["XLA_FLAGS"] == "--xla_cpu_enable_fast_math=false"
