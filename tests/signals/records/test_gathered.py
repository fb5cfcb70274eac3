"""Files of samples to picks: whatever one file holds, the others are picked."""

import warnings
from datetime import UTC, datetime, timedelta
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import soundfile

from jblast.errors import InputError
from jblast.observations.records.formats import Scaling, record_files
from jblast.observations.records.stations import Station, read_stations
from jblast.signals.picks import gathered, log_of, pick_files
from tests.signals.records.made import picked_at_its_peak

with warnings.catch_warnings():  # of its own age
    warnings.simplefilter("ignore", DeprecationWarning)
    import obspy

RATE = 1000
PLACED = {name: Station((0.0, 0.0, 0.0), "") for name in ("s0", "s1", "s2", "c")}


@pytest.fixture(autouse=True)
def _no_fits(monkeypatch):
    module = import_module("jblast.signals.picks.gathered")
    monkeypatch.setattr(module, "pick_records", picked_at_its_peak)


def sound(tmp_path, name, bangs, seconds=10.0):
    """White noise with bangs: (time [s], size)."""
    rng = np.random.default_rng(4)
    samples = 1e-3 * rng.standard_normal((round(seconds * RATE), len(bangs)))
    for channel, of in enumerate(bangs):
        for at, size in of:
            samples[round(at * RATE) : round(at * RATE) + 10, channel] += size
    path = tmp_path / name
    subtype = "FLOAT" if path.suffix == ".wav" else "PCM_16"
    soundfile.write(path, samples, RATE, subtype=subtype)
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
    twin = sound(tmp_path, "a.flac", [[(3.0, 0.5)]])
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,p_pa\n0,1\n1,x\n")
    found = gathered([broken, good, silent, dead, short, twin])
    assert [one.record.name for one in found.picks] == ["a"]
    assert found.silent == ("quiet", "dead")
    said = [str(error) for error in found.refused]
    assert len(said) == 3
    assert "broken.csv: line 3, column p_pa: expected a number, got 'x'" in said[0]
    assert "expected records with different names, got a twice" in said[1]
    assert "short.wav: channel short: expected 16 samples or more, got 1" in said[2]


def test_a_sensitivity_given_as_its_reciprocal_is_refused():
    # 62,500 counts per pascal, and a blast of 5 Pa
    path = Path("tests/data/counts_per_pa.mseed")
    (error,) = gathered([path], Scaling(sensitivity=62500.0)).refused
    assert "expected pressures below 1 GPa" in str(error)
    assert "write 1.6e-05 if 62500 is in volts or counts per pascal" in str(error)
    table = Path("tests/data/counts_per_pa_station.xml")
    for found in (
        gathered([path], Scaling(sensitivity=1.6e-5)),
        gathered([path], stations=read_stations(table)),
    ):
        assert not found.refused
        pick = found.picks[0].pick
        assert float(pick.air_arrival_s) == pytest.approx(40.0, abs=0.01)
        assert float(pick.peak_overpressure_pa) == pytest.approx(5.0, rel=0.05)


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
    assert "(time of day: given), got a time of day: none; add" in str(error)
    assert "column start_utc of the table of stations" in str(error)
    start = datetime(2026, 3, 1, 23, 59, 59, 250_000, tzinfo=UTC)
    phone = PLACED | {"phone": Station((0.0, 0.0, 0.0), "", start=start)}
    together = gathered([*paths, wav], stations=phone)
    assert not together.refused
    # 1.25 s after the epoch, and the bang 3 s later
    assert float(together.picks[-1].pick.air_arrival_s) == pytest.approx(4.25, abs=0.01)
    # the table replaces a time of day in a file
    both = {"s0": Station((0.0, 0.0, 0.0), "", start=start)}
    (one,) = gathered([paths[0]], stations=both).picks
    assert float(one.pick.air_arrival_s) == pytest.approx(0.75, abs=1e-9)
    assert "time of day by start_utc of the table of stations" in one.record.notes
    # from a common trigger each begins at its own zero
    triggered = gathered([*paths, wav], trigger=True)
    assert (triggered.refused, triggered.epoch) == ((), None)
    times = [float(one.pick.air_arrival_s) for one in triggered.picks]
    np.testing.assert_allclose(times, [0.5, 0.5, 0.5, 3.0], atol=0.01)


def test_channels_of_a_file_begin_together(tmp_path):
    wav = sound(tmp_path, "a.wav", [[(3.0, 20.0)], [(3.0, 20.0)]])
    start = datetime(2001, 9, 9, 1, 46, 40, tzinfo=UTC)
    one = {"a.1": Station((0.0, 0.0, 0.0), "", start=start)}
    same = one | {"a.2": Station((9.0, 0.0, 0.0), "", start=start)}
    found = gathered([wav], stations=same)
    assert found.epoch == start
    two = one | {
        "a.2": Station((9.0, 0.0, 0.0), "", start=start + timedelta(seconds=1))
    }
    (error,) = gathered([wav], stations=two).refused
    assert "a.wav: expected one start_utc and one sensitivity for all" in str(error)


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
    assert "none, as its clock was not set; add the time" in str(found.refused[0])
    found = gathered([one, other])
    assert (len(found.picks), found.epoch) == (1, None)
    assert "b.mseed: expected a start on the clock of" in str(found.refused[0])
    own = {
        name: Station((0.0, 0.0, 0.0), clock=name, start=None) for name in ("a", "b")
    }
    assert not gathered([one, other], stations=own).refused
    start = datetime(2024, 5, 17, 11, 53, tzinfo=UTC)
    given = PLACED | {"a": Station((0.0, 0.0, 0.0), "", start=start)}
    together = gathered([dated, one], stations=given)
    times = [float(one.pick.air_arrival_s) for one in together.picks]
    np.testing.assert_allclose(times, [0.5, 0.5], atol=0.01)


def stationed(tmp_path, *names):
    """A table of stations 100 m apart."""
    path = tmp_path / "stations.csv"
    rows = [f"{name},{100 * k},0,0\n" for k, name in enumerate(names)]
    path.write_text("Gauge,East [m],North [m],Height [m]\n" + "".join(rows))
    return path


def text(path, *columns, peak=0.5, seconds=5.0):
    """Columns of pressure with a bang."""
    time = np.arange(round(seconds * RATE)) / RATE
    samples = np.where(abs(time - peak) < 5e-3, 9.0, 0.0)
    samples += 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    path.parent.mkdir(exist_ok=True)
    table = np.stack([time, *[samples] * len(columns)], axis=1)
    header = ",".join(("time_s", *(f"{name}_pa" for name in columns)))
    np.savetxt(path, table, header=header, delimiter=",", comments="")
    return path


def test_channels_are_named_by_station_number_or_a_name_that_is_unique(tmp_path):
    files = [text(tmp_path / f"logger_{n}.csv", f"P{n}", f"Q{n}") for n in "ab"]
    table = stationed(tmp_path, "Pa", "logger_a.2", "logger_b.Pb", "Qb")
    picked = pick_files(files, positions=table)
    assert picked.found.named() == ("Pa", "logger_a.2", "logger_b.Pb", "Qb")
    assert picked.log.observations.sensor[-1] == "Qb"
    # a name that two files have is the name of neither
    files = [text(tmp_path / f"logger_{n}.csv", "P", "Q") for n in "ab"]
    with pytest.raises(InputError, match=r"logger_a\.P, logger_a\.Q, logger_b\.P, log"):
        pick_files(files, positions=stationed(tmp_path, "P", "Q"))


def test_names_are_checked_before_samples_are_read(tmp_path, monkeypatch):
    files = [text(tmp_path / f"{name}.csv", "P") for name in ("gate", "mast")]
    module = import_module("jblast.signals.picks.gathered")
    monkeypatch.setattr(module, "open_record", lambda *_: pytest.fail("read"))
    with pytest.raises(InputError, match=r"a station for gate, mast, got gaet"):
        pick_files(files, positions=stationed(tmp_path, "gaet"))


def test_folders_with_equal_names_are_shots_unless_the_table_names_them(tmp_path):
    for k, folder in enumerate(("one", "two")):
        for n, name in enumerate(("gate", "mast")):
            (tmp_path / "day").mkdir(exist_ok=True)
            text(tmp_path / "day" / folder / f"{name}.csv", "P", peak=0.5 + k + 0.1 * n)
    picked = pick_files(tmp_path / "day", positions=stationed(tmp_path, "gate", "mast"))
    rows = picked.log.observations
    assert set(zip(rows.sensor, rows.shot, rows.record, strict=True)) == {
        (name, folder, f"{folder}/{name}")
        for name in ("gate", "mast")
        for folder in ("one", "two")
    }
    names = [
        f"{folder}/{name}" for folder in ("one", "two") for name in ("gate", "mast")
    ]
    picked = pick_files(tmp_path / "day", positions=stationed(tmp_path, *names))
    assert sorted(set(picked.log.observations.sensor)) == sorted(names)
    # without a table, too
    found = gathered(record_files([tmp_path / "day"])[0])
    assert found.named() == tuple(names)
    assert log_of(found).bangs == 2


def test_one_cause_is_one_message(tmp_path):
    dated = seismic(tmp_path, "z.mseed", "2024-05-17T11:53:00", (9.0,))
    files = [text(tmp_path / f"g{n}.csv", "P") for n in range(6)]
    (error,) = gathered([dated, *files]).refused
    assert "g0.csv" in str(error)
    assert "and 3 more: expected a start on the clock of" in str(error)


def test_files_that_did_not_begin_together_are_no_several_blasts(tmp_path):
    peaks = {"gate": 0.5, "mast": 2.5, "hut": 4.0}
    files = [text(tmp_path / f"{k}.csv", "P", peak=v) for k, v in peaks.items()]
    table = stationed(tmp_path, *peaks)
    with pytest.raises(InputError, match=r"do not state when they begin: add .* clock"):
        pick_files(files, positions=table)
    # by a common trigger these are times
    assert pick_files(files, positions=table, trigger=True).log.bangs == 3


def bext(path, date, time, samples):
    """Insert a chunk of broadcast files into a WAV."""
    chunk = bytearray(602)
    chunk[320:330], chunk[330:338] = date.encode(), time.encode()
    chunk[338:346] = samples.to_bytes(8, "little")
    data = bytearray(path.read_bytes())
    data[12:12] = b"bext" + len(chunk).to_bytes(4, "little") + bytes(chunk)
    data[4:8] = (len(data) - 8).to_bytes(4, "little")
    path.write_bytes(data)
    return path


def test_recorders_begin_at_the_time_in_their_files(tmp_path):
    files, midnight = [], 50_700 * RATE  # 14:05:00
    for name, later in (("a", 0), ("b", 250)):
        file = sound(tmp_path, f"{name}.wav", [[(3.0 - later / RATE, 20.0)]])
        files.append(bext(file, "2024-05-17", "14:05:00", midnight + later))
    files.append(sound(tmp_path, "c.wav", [[(3.0, 20.0)]]))
    with soundfile.SoundFile(files[-1], "r+") as file:
        samples = file.read()
    with soundfile.SoundFile(files[-1], "w", RATE, 1, "PCM_16") as file:
        file.comment = "Recorded at 16:05:00 17/05/2024 (UTC+2) by AudioMoth 24F31901"
        file.write(np.asarray(samples / 40.0, np.float64))
    found = gathered(files, Scaling(full_scale_pa=40.0))
    assert not found.refused
    assert found.epoch == datetime(2024, 5, 17, 14, 5, tzinfo=UTC)
    times = [float(one.pick.air_arrival_s) for one in found.picks]
    np.testing.assert_allclose(times, 3.0, atol=5 / RATE)
    assert "read as UTC" in found.picks[0].record.notes[-1]
    # without a number of samples the time of day is that of the second; no date is none
    late = bext(sound(tmp_path, "d.wav", [[(3.0, 20.0)]]), "2024:05:17", "14:05:07", 0)
    assert gathered([late]).epoch == datetime(2024, 5, 17, 14, 5, 7, tzinfo=UTC)
    none = bext(sound(tmp_path, "e.wav", [[(3.0, 20.0)]]), "0000-00-00", "00:00:00", 0)
    assert gathered([none]).epoch is None
