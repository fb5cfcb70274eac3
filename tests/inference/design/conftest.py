"""The bound of one plan, found once."""

import pytest


@pytest.fixture(scope="session")
def planned():
    # here: this file may be read before float64 is chosen and types are checked
    from jblast.inference import bound
    from tests.inference.design.plans import PLAN, TRUE

    return bound(PLAN, TRUE)
