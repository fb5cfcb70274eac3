"""The text of gauges, made once."""

import pytest

from calibration.gauges import gauges_text


@pytest.fixture(scope="session")
def text():
    return gauges_text()


@pytest.fixture(scope="session")
def said(text):
    return " ".join(text.split())
