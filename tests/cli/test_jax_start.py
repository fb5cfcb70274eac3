from pathlib import Path

import pytest
from jax._src.lru_cache import LRUCache

from jblast.cli.jax_start import start_jax


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
