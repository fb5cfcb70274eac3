"""Two cases of a custom profile, read from a file."""

import pytest

from jblast.vehicle.loads.impulse_table import read_custom_profile
from tests.vehicle.loads.impulse_table.rows import ROWS, written


@pytest.fixture
def cases(tmp_path):
    return read_custom_profile(written(tmp_path / "cases.csv", ROWS))
