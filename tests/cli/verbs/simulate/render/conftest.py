"""`jblast render` beside a small scene."""

import pytest

from tests.cli.cli_files import Command
from tests.cli.verbs.simulate.render.scenes import CAMERA, CHARGE


@pytest.fixture
def jblast(tmp_path, capsys) -> Command:
    jblast = Command(tmp_path, capsys)
    jblast.file("scene.toml", CHARGE + CAMERA)
    return jblast
