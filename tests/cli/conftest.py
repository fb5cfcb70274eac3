"""A command run in this process, with files of its own."""

import pytest

from tests.cli.cli_files import Command


@pytest.fixture
def jblast(tmp_path, capsys):
    return Command(tmp_path, capsys)
