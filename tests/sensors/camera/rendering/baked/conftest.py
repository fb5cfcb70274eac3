"""A small explosion set, written once."""

import pytest

from jblast.sensors.camera.files.views import explosion_views
from tests.sensors.camera.rendering.baked.noise_set import write_noise_set


@pytest.fixture(scope="session")
def noise_set(tmp_path_factory):
    """The folder of a set of puffs of noise."""
    return write_noise_set(tmp_path_factory.mktemp("set"), lossless=True)


@pytest.fixture(scope="session")
def puffs(noise_set):
    """The set, read."""
    return explosion_views(noise_set)
