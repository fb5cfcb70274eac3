"""The same seed, the same world: as it was on the machine that the file was made on."""

import json

import numpy as np
import pytest

from tests.world.fingerprint import KEPT, by_laws

CLOSE = 1e-12
"""Relative, of the largest of its kind: rounding of other libraries of functions.

The manual promises it. The tables of laws keep it: slopes have errors of 1e-13, and the
errors that decide how many nodes a table has are 3 % or more from their bound. Another
form, table or bound of a law changes times by up to its tolerance, 1e-7 in ln: then the
file is to be made again.
"""


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
