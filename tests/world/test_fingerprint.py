"""The same seed, the same world: as it was on the machine that the file was made on."""

import json

import numpy as np
import pytest

from tests.world.fingerprint import KEPT, by_laws

CLOSE = 1e-12
"""Relative, of the largest of its kind: rounding of other libraries of functions."""


@pytest.fixture(scope="module")
def kept():
    return json.loads(KEPT.read_text())


def compare(found, kept):
    assert found
    for name, values in found.items():
        if isinstance(values, str):
            assert values == kept[name], name
            continue
        expected = np.array(kept[name])
        scale = CLOSE * np.abs(expected[np.isfinite(expected)]).max()
        np.testing.assert_allclose(
            values, expected, rtol=CLOSE, atol=scale, err_msg=name
        )


def test_blasts_are_the_same_text_and_readings_the_same_numbers(kept):
    compare(by_laws(), kept)
