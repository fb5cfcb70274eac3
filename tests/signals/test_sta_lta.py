import numpy as np
import pytest

from jblast.errors import InputError
from jblast.signals import sta_lta, triggers


def test_the_ratio_is_of_powers_after_and_before():
    sound = np.random.default_rng(0).standard_normal(500)
    ratio = sta_lta(sound, 100.0, short_s=0.05, long_s=0.5)
    mid = np.median(sound)
    for k in (50, 200, 495):
        after = np.mean((sound[k : k + 5] - mid) ** 2)
        before = np.mean((sound[k - 50 : k] - mid) ** 2)
        assert ratio[k] == pytest.approx(after / before)
    assert ratio.size == 500
    assert not ratio[:50].any()
    assert not ratio[496:].any()


def test_a_step_of_power_is_one_trigger_where_it_begins():
    rng = np.random.default_rng(1)
    sound = rng.standard_normal(20_000)
    sound[8000:9000] *= 20
    found = triggers(sta_lta(sound, 1000.0, short_s=0.05, long_s=1.0), 1000.0)
    assert len(found) == 1
    assert 7.95 <= found[0].time_s <= 8.0
    assert 8.3 < found[0].end_s < 9.1
    assert found[0].ratio > 100


def test_gain_and_offset_do_not_matter():
    sound = np.random.default_rng(2).standard_normal(3000)
    first = sta_lta(sound, 1000.0)
    assert np.allclose(first, sta_lta(1e4 * sound + 300, 1000.0))


def test_after_silence_there_is_no_ratio():
    sound = np.r_[np.zeros(2000), np.ones(1), np.zeros(1000)]
    assert triggers(sta_lta(sound, 1000.0), 1000.0) == ()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"short_s": 1.0, "long_s": 0.1}, "a short window no longer than the long one"),
        ({"short_s": 1e-9}, "expected at least one sample"),
        ({"long_s": 10.0}, "recording: expected at least 10005 samples"),
        ({"short_s": -1.0}, "short_s: expected a positive number"),
    ],
)
def test_lengths_that_make_no_ratio_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        sta_lta(np.ones(3000), 1000.0, **options)


def test_a_trigger_goes_off_below_where_it_goes_on():
    with pytest.raises(InputError, match="expected positive ratios"):
        triggers(np.ones(10), 1.0, on=2.0, off=3.0)
