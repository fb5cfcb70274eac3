"""Files of samples to picks: whatever one file holds, the others are picked."""

import warnings
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import soundfile

from jblast.observations.records.formats import Scaling
from jblast.observations.records.stations import Station
from jblast.signals.picks import gathered
from tests.signals.records.made import picked_at_its_peak

with warnings.catch_warnings():  # of its own age
    warnings.simplefilter("ignore", DeprecationWarning)
    import obspy

RATE = 1000


@pytest.fixture(autouse=True)
def _no_fits(monkeypatch):
    module = import_module("jblast.signals.picks.pick_log")
    monkeypatch.setattr(module, "pick_records", picked_at_its_peak)


def sound(tmp_path, name, bangs, seconds=10.0):
    """White noise with bangs: (time [s], size)."""
    rng = np.random.default_rng(4)
    samples = 1e-3 * rng.standard_normal((round(seconds * RATE), len(bangs)))
    for channel, of in enumerate(bangs):
        for at, size in of:
            samples[round(at * RATE) : round(at * RATE) + 10, channel] += size
    path = tmp_path / name
    soundfile.write(path, samples, RATE, subtype="FLOAT")
    return path


def test_each_bang_of_each_channel_is_a_pick_told_apart_by_its_order(tmp_path):
    first = sound(tmp_path, "a.wav", [[(3.0, 20.0), (7.0, 10.0)], [(5.0, 30.0)]])
    second = sound(tmp_path, "b.wav", [[(4.0, 20.0)]], seconds=1.0 + 4.0)
    found = gathered([first, second], Scaling(full_scale_pa=1.0))
    assert found.named() == ("a.1#1", "a.1#2", "a.2", "b")
    times = [float(one.pick.air_arrival_s) for one in found.picks]
    np.testing.assert_allclose(times, [3.0, 7.0, 5.0, 4.0], atol=0.01)
    assert (found.channels, found.silent, found.refused) == (3, (), ())


def test_what_cannot_be_read_is_named_and_the_rest_picked(tmp_path):
    good = sound(tmp_path, "a.wav", [[(3.0, 20.0)]])
    silent = sound(tmp_path, "quiet.wav", [[]])
    dead = sound(tmp_path, "dead.wav", [[]])
    soundfile.write(dead, np.zeros(5000), RATE)
    short = tmp_path / "short.wav"
    soundfile.write(short, np.zeros(1), RATE)
    (tmp_path / "other").mkdir()
    twin = sound(tmp_path / "other", "a.wav", [[(3.0, 20.0)]])
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,p_pa\n0,1\n1,x\n")
    found = gathered([broken, good, silent, dead, short, twin])
    assert [one.record.name for one in found.picks] == ["a"]
    assert found.silent == ("quiet", "dead")
    said = [str(error) for error in found.refused]
    assert len(said) == 3
    assert "broken.csv: line 3, column p_pa: expected a number, got 'x'" in said[0]
    assert "short.wav: channel 1: expected 16 samples or more, got 1" in said[1]
    assert "expected records with different names, got a twice" in said[2]


def test_a_sensitivity_given_as_its_reciprocal_is_refused():
    # 62,500 counts per pascal, and a blast of 5 Pa
    path = Path("tests/data/counts_per_pa.mseed")
    (error,) = gathered([path], Scaling(sensitivity=62500.0)).refused
    assert "expected pressures below 1 GPa" in str(error)
    assert "write 1.6e-05 if 62500 is in volts or counts per pascal" in str(error)
    found = gathered([path], Scaling(sensitivity=1.6e-5))
    assert not found.refused
    assert float(found.picks[0].pick.air_arrival_s) == pytest.approx(40.0, abs=0.01)


def test_times_of_day_share_the_clock_of_the_first(tmp_path):
    paths, began = [], datetime(2026, 3, 1, 23, 59, 58, 500_000, tzinfo=UTC)
    for k, later in enumerate((0.0, 3.25, 2 * 86400.0)):
        samples = np.zeros(1000, np.float32)
        samples[500:510] = 9.0
        header = {"sampling_rate": RATE, "starttime": obspy.UTCDateTime(began) + later}
        paths.append(tmp_path / f"s{k}.mseed")
        obspy.Trace(samples, header).write(str(paths[-1]), format="MSEED")
    wav = sound(tmp_path, "phone.wav", [[(3.0, 20.0)]])
    found = gathered([*paths, wav])
    assert found.epoch == began.replace(microsecond=0)
    times = [float(one.pick.air_arrival_s) for one in found.picks]
    np.testing.assert_allclose(times, [1.0, 4.25, 1.0 + 2 * 86400.0], rtol=0, atol=1e-9)
    (error,) = found.refused
    assert "phone.wav: expected a start at a time of day, as" in str(error)
    assert "column start_utc of the table of stations" in str(error)
    start = 1_772_409_599_250_000_000  # 2026-03-01T23:59:59.25Z, by `date -u -d`
    phone = {"phone": Station((0.0, 0.0, 0.0), "", start=start)}
    together = gathered([*paths, wav], stations=phone)
    assert not together.refused
    # 1.25 s after the epoch, and the bang 3 s later
    assert float(together.picks[-1].pick.air_arrival_s) == pytest.approx(4.25, abs=0.01)
    both = {"s0": Station((0.0, 0.0, 0.0), "", start=start)}
    (error,) = gathered([paths[0]], stations=both).refused
    assert "s0.mseed: expected no start_utc for 's0', as the file has" in str(error)


def test_channels_of_a_file_begin_together(tmp_path):
    wav = sound(tmp_path, "a.wav", [[(3.0, 20.0)], [(3.0, 20.0)]])
    one = {"a.1": Station((0.0, 0.0, 0.0), "", start=10**18)}
    found = gathered([wav], stations=one)
    assert found.epoch == datetime(2001, 9, 9, 1, 46, 40, tzinfo=UTC)
    two = one | {"a.2": Station((9.0, 0.0, 0.0), "", start=10**18 + 1)}
    (error,) = gathered([wav], stations=two).refused
    assert "a.wav: expected one start_utc for all channels of a file" in str(error)


def seismic(tmp_path, name, began, blasts):
    """Segments of a channel, 20 s apart, with a bang of each size at 0.5 s."""
    rng, stream = np.random.default_rng(5), obspy.Stream()
    for k, size in enumerate(blasts):
        samples = 1e-3 * rng.standard_normal(1000).astype(np.float32)
        samples[500:510] += size
        header = {"sampling_rate": RATE, "starttime": obspy.UTCDateTime(began) + 20 * k}
        stream.append(obspy.Trace(samples, header | {"channel": "HDF"}))
    stream.write(str(tmp_path / name), format="MSEED")
    return tmp_path / name


def test_segments_of_a_channel_are_picked_one_by_one(tmp_path):
    path = seismic(tmp_path, "a.mseed", "2024-05-17T11:53:00", (9.0, 0.0, 5.0))
    found = gathered([path])
    assert found.named() == ("a#1", "a#2")
    times = [float(one.pick.air_arrival_s) for one in found.picks]
    np.testing.assert_allclose(times, [0.5, 40.5], atol=0.01)
    # the loudest sample of a segment of noise is no onset of the channel
    assert (found.channels, found.quieter) == (1, {"a": 1})


def test_clocks_that_were_not_set_share_no_time(tmp_path):
    one = seismic(tmp_path, "a.mseed", "1970-01-01T00:00:10", (9.0,))
    other = seismic(tmp_path, "b.mseed", "1980-01-06T00:00:00", (9.0,))
    dated = seismic(tmp_path, "c.mseed", "2024-05-17T11:53:00", (9.0,))
    found = gathered([dated, one])
    assert len(found.picks) == 1
    assert "got none, as its clock was not set; add the time" in str(found.refused[0])
    found = gathered([one, other])
    assert (len(found.picks), found.epoch) == (1, None)
    assert "b.mseed: expected a start on the clock of" in str(found.refused[0])
    assert "got a clock that was not set" in str(found.refused[0])
    own = {
        name: Station((0.0, 0.0, 0.0), clock=name, start=None) for name in ("a", "b")
    }
    assert not gathered([one, other], stations=own).refused
    start = 1_715_946_780_000_000_000  # 2024-05-17T11:53:00Z
    given = {"a": Station((0.0, 0.0, 0.0), "", start=start)}
    together = gathered([dated, one], stations=given)
    times = [float(one.pick.air_arrival_s) for one in together.picks]
    np.testing.assert_allclose(times, [0.5, 0.5], atol=0.01)
