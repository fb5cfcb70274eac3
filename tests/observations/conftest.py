"""Logs written to a file for the tests of their reader."""

import pytest


@pytest.fixture
def log(tmp_path):
    def write(content):
        path = tmp_path / "log.csv"
        data = content if isinstance(content, bytes) else content.encode()
        path.write_bytes(data)
        return path

    return write
