"""Scene files written by hand for the tests of their reader."""

import pytest

from jblast.scene import read_scene


@pytest.fixture
def scene(tmp_path):
    def read(content):
        path = tmp_path / "scene.toml"
        data = content if isinstance(content, bytes) else content.encode()
        path.write_bytes(data)
        return read_scene(path)

    return read
