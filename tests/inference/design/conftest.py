"""The bound of one plan, found once."""

import pytest

from jblast.inference import bound
from tests.inference.design.plans import PLAN, TRUE


@pytest.fixture(scope="session")
def planned():
    return bound(PLAN, TRUE)
