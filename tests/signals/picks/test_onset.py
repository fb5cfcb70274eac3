"""When a record became loud, where no pulse fits it."""

from pathlib import Path

import numpy as np
import pytest

from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks import pick_records
from jblast.signals.picks.record_picks import onset_of

PHONES = Path(__file__).parents[3] / "calibration" / "data" / "inl_phones"


def coloured(rng, samples, fall):
    """Noise whose amplitude falls with that power of the frequency."""
    f = np.fft.rfftfreq(samples)
    f[0] = f[1]
    parts = rng.normal(size=f.size) + 1j * rng.normal(size=f.size)
    return np.fft.irfft(parts * f**-fall, samples)


def burst(rng, samples, at, ratio):
    """Noise that is louder by a ratio from a sample on, and dies away."""
    since = np.arange(samples) - at
    return rng.normal(size=samples) * np.where(
        since < 0, 1.0, ratio * np.exp(-np.maximum(since, 0) / 100.0)
    )


@pytest.mark.parametrize("fall", [0.0, 1.0])
def test_noise_of_any_usual_colour_has_no_onset(fall):
    rng = np.random.default_rng(1)
    assert not any(onset_of(coloured(rng, 2048, fall)) for _ in range(150))


@pytest.mark.parametrize(
    "samples",
    [
        np.zeros(512),
        np.ones(4),
        np.sin(0.1 * np.arange(4096)),
        np.linspace(0.0, 1.0, 4096) ** 6 + 1e-3 * np.cos(np.arange(4096.0)),
    ],
    ids=["silence", "four samples", "a hum", "a drift"],
)
def test_what_is_not_suddenly_loud_has_none(samples):
    assert onset_of(samples) is None


def test_a_burst_begins_where_it_does_as_often_as_the_error_says():
    rng, at = np.random.default_rng(2), 700
    found = [onset_of(burst(rng, 2048, at, 30.0)) for _ in range(200)]
    assert all(found)
    off = np.array([(o.sample - at) / o.sigma for o in found if o])
    # errors are told too wide rather than too narrow: two in three within one, at least
    assert np.mean(np.abs(off) < 1.0) > 0.68
    assert np.mean(np.abs(off) < 3.0) > 0.98


@pytest.mark.slow
def test_phones_two_kilometres_off_tell_their_onset_and_no_pulse():
    obspy = pytest.importorskip("obspy")
    trace = obspy.read(PHONES / "phone_1.mseed")[0]
    record = PressureRecord(
        "phone_1", trace.data.astype(float), rate_hz=8e3, calibrated=False
    )
    (one,) = pick_records([record])
    assert one.notes == ("onset_alone",)
    assert one.quality == "doubtful"
    # by eye the first half wave leaves zero between 0.315 and 0.325 s
    assert one.pick.air_arrival_s == pytest.approx(0.32, abs=0.005)
    assert one.pick.sd("air_arrival_s") < 0.02
    assert np.isnan(one.pick.positive_duration_s)
