"""The number of devices of a study, as it is written on the command line."""

import pytest

from jblast.cli.verbs.study import device_count
from jblast.errors import InputError


def test_devices_are_all_or_a_number():
    assert device_count("all") is None
    assert device_count("2") == 2


@pytest.mark.parametrize("words", ["0", "-1", "1.5", "²", "٣", "", "9" * 5000])
def test_what_is_no_number_of_devices_is_refused(words):
    with pytest.raises(InputError, match="--devices: expected all, or a whole number"):
        device_count(words)
