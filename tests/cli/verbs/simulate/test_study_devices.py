"""The number of devices of a study, as it is written on the command line."""

import pytest

from jblast.cli.verbs.study import devices_asked
from jblast.errors import InputError


def test_devices_are_all_or_a_number():
    assert devices_asked("all") is None
    assert devices_asked("2") == 2


@pytest.mark.parametrize("words", ["0", "-1", "1.5", "²", "٣", "", "9" * 5000])
def test_what_is_no_number_of_devices_is_refused(words):
    with pytest.raises(InputError, match="--devices: expected all, or a whole number"):
        devices_asked(words)
