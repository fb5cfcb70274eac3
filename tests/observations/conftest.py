"""Logs written to a file for the tests of their reader."""

import pytest

from jblast.observations import read


@pytest.fixture
def log(tmp_path):
    def write(content):
        path = tmp_path / "log.csv"
        data = content if isinstance(content, bytes) else content.encode()
        path.write_bytes(data)
        return path

    return write


@pytest.fixture
def table(tmp_path):
    def write(text, name="log.csv"):
        (tmp_path / name).write_text(text)
        return read(tmp_path / name)

    return write
