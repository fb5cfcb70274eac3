"""Text of samples: any unit, separator and order of columns; what is amiss is named."""

import os
from datetime import UTC, datetime

import numpy as np
import pandas as pd
import pytest
import soundfile
from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.observations.records.formats import Scaling, open_record, record_files
from jblast.observations.records.recording import PressureRecord
from tests.observations.records.bangs import RATE_HZ, START_S, pulse, times


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("texts")


@settings(deadline=None, max_examples=40)
@given(
    unit=st.sampled_from(
        [("pa", 1.0), ("kPa", 1e3), ("mbar", 1e2), ("psi", 6894.757293168), ("V", 50.0)]
    ),
    clock=st.sampled_from([("s", 1.0), ("ms", 1e-3), ("us", 1e-6)]),
    dialect=st.sampled_from(
        [(",", "."), (";", ","), ("\t", ","), (";", "."), (" ", ".")]
    ),
    bracket=st.booleans(),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    channels=st.integers(1, 3),
)
def test_what_pandas_wrote_is_read(
    folder, unit, clock, dialect, bracket, encoding, channels
):
    path, (separator, decimal) = folder / "gate.csv", dialect
    blank = separator == " "
    named = "{}({})" if bracket and blank else "{} [{}]" if bracket else "{}_{}"
    table = pd.DataFrame({named.format("time", clock[0]): times() / clock[1]})
    for k in range(channels):
        table[named.format(f"ch{k}", unit[0])] = (k + 1) * pulse() / unit[1]
    table.to_csv(path, sep=separator, decimal=decimal, encoding=encoding, index=False)
    recordings = open_record(path, Scaling(sensitivity=50.0))
    assert len(recordings) == channels
    for k, one in enumerate(recordings):
        assert (one.rate_hz, one.start_s) == (RATE_HZ, pytest.approx(START_S))
        assert one.calibrated
        samples = one.samples(0, one.length)[0]
        np.testing.assert_allclose(samples, (k + 1) * pulse(), rtol=1e-7, atol=1e-9)


def text(tmp_path, body, name="gate.csv"):
    path = tmp_path / name
    path.write_text(body)
    return path


def test_a_row_of_units_below_the_names_is_theirs(tmp_path):
    body = "Time,Channel A\n(ms),(mV)\n0,1\n0.5,2\n1.0,3\n"
    (recording,) = open_record(text(tmp_path, body), Scaling(sensitivity=1e4))
    assert recording.rate_hz == 2000.0
    np.testing.assert_allclose(recording.samples(0, 3), [[10.0, 20.0, 30.0]])


@pytest.mark.parametrize("delimiter", [" ", ",", ";"])
def test_names_may_stand_in_the_comment_that_numpy_writes(tmp_path, delimiter):
    path, names = tmp_path / "saved.txt", ("time_ms", "pressure_kpa")
    table = np.stack([1e3 * times(), pulse() / 1e3], axis=1)
    np.savetxt(path, table, header=delimiter.join(names), delimiter=delimiter)
    (recording,) = open_record(path)
    np.testing.assert_allclose(recording.samples(0, recording.length)[0], pulse())
    np.savetxt(path, table, header="of a gate", delimiter=delimiter)
    with pytest.raises(InputError, match=r"expected (names of columns|pressure)"):
        open_record(path)


ROWS = "0,20,on,5\n1,20,,6\n"


@pytest.mark.parametrize(
    ("head", "rows", "others"),
    [
        ("Sample Time (s),step,unit,P (kPa)", ROWS, "step, unit"),
        ("time_s,dt,unit,kPa", ROWS, "dt, unit"),
        ("time_s,temperature_c,unit,CH2 (V)", ROWS, "temperature_c, unit"),
        ("Time (s),T,state,P\n,degC,n/a,kPa", ROWS, "T (degC), state (n/a)"),
        ("unit,time_s,x,kPa", "7,0,on,5\n7,1,,6\n", "unit, x"),
    ],
)
def test_columns_named_as_keys_of_a_preamble_are_columns(tmp_path, head, rows, others):
    body = f"{head}\n{rows}"
    (recording,) = open_record(text(tmp_path, body), Scaling(sensitivity=1e3))
    np.testing.assert_array_equal(recording.samples(0, 2), [[5e3, 6e3]])
    assert recording.notes == (f"left out, not pressure: {others}",)


def test_times_of_few_digits_give_the_rate_that_all_of_them_tell(tmp_path):
    rows = "".join(f"{k / 44100:.6f},{k}\n" for k in range(4410))
    (recording,) = open_record(text(tmp_path, "time_s,pressure_pa\n" + rows))
    assert recording.rate_hz == pytest.approx(44100.0, rel=1e-7)


HEAD = "time_s,pressure_kpa\n"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (HEAD + "0,1\n0.1,2\n0.1,3\n", "line 4, column time_s: .* too few digits"),
        (HEAD + "0,1\n0.1,2\n0.05,3\n", "line 4, column time_s: expected a time after"),
        (HEAD + "0,1\n0.1,2\n0.2,3\n0.6,3\n", "line 5.* a gap of 0.4 s after 0.2 s"),
        (HEAD + "0,1\n# cut\n0.1,\n0.2,3\n", "line 4, column pressure_kpa.*nothing"),
        (HEAD + "0,1\ninf,2\n0.2,3\n", "line 3, column time_s: .*'inf'"),
        (HEAD + "0,1\n0.1,nan\n0.2,3\n", "line 3, column pressure_kpa.*'nan'"),
        (HEAD + "0,inf\n0.1,-inf\n", "column pressure_kpa: .* no finite number"),
        (HEAD + "0,\n0.1,\n", "line 2, column pressure_kpa: .* got nothing"),
        (
            HEAD + "(s),(psi)\n0,1\n1,2\n",
            "column pressure_kpa: .*kpa in its name",
        ),
        (HEAD + "0,1\n0.1\n", "line 3: expected 2 fields as in the header, got 1"),
        (HEAD + "0,1,5\n1,2,7\n", "line 1: .* each of 3, .*got 'time_s pressure_kpa'"),
        (HEAD + "0,1\n", "expected at least two samples, got 1"),
        (HEAD, "line 1: .* got no numbers"),
        ("sensor,quantity,value\na,air_arrival_s,1\n", "is a log, which jblast fit"),
        (
            "utc,pressure_kpa\n15:08:18,1\n",
            "got 'utc'; times of day belong in column start_utc",
        ),
        ("0,1\n1,2\n", "line 1: expected names of columns"),
        ("time,pressure_pa\n0,1\n", "one column of time .* as time_s or .* got 'time'"),
        ("time_s,pressure_kpx\n0,1\n", "as pressure_kpa, .* 'time_s, pressure_kpx'"),
        (
            "time_s,t_ms,p_pa\n0,1,2\n",
            "column of time of its 1 .* 'time_s, t_ms'",
        ),
        ("time_s,time_ms,p_pa\n0,1,2\n", "got 'time_s, time_ms'"),
        ("time_s,time_s,p_pa\n0,1,2\n", "got 'time_s, time_s'"),
        ("time_s,p_kpa,p_psi\n0,1,2\n", "columns p_kpa and p_psi: .*one unit"),
        ("time_s,P (kPa),p_mV\n0,1,2\n", r"columns P \(kPa\) and p_mV: .*got kPa and"),
        ("time_s,kPa,psi\n0,1,2\n", "columns kPa and psi: .* got kPa and psi"),
        ("p_pa,q_pa\n0,1\n", "expected one column of time"),
        ("time_s;p_pa\n0,5;1.5\n", "expected a decimal point or a decimal comma"),
        (
            "time_s,ch_v\n0,1\n1,2\n",
            "column ch_v: expected pressure, got v; .*sensitivity",
        ),
    ],
)
def test_what_is_no_record_is_refused_by_line_and_column(tmp_path, body, said):
    with pytest.raises(InputError, match=said):
        open_record(text(tmp_path, body))


def test_an_uneven_clock_is_refused_and_a_jittering_one_is_not(tmp_path):
    rng = np.random.default_rng(1)
    for share, good in ((0.2, True), (0.4, False)):
        t = np.arange(1000) + share * rng.uniform(-1, 1, 1000)
        body = HEAD + "".join(f"{x:.6f},0\n" for x in t)
        path = text(tmp_path, body)
        if good:
            (recording,) = open_record(path)
            # the line through 1000 times of 0.12 sd: 0.12 sqrt(12 / 1000^3) a step
            assert recording.rate_hz == pytest.approx(1.0, abs=3e-5)
            continue
        with pytest.raises(InputError, match=r"steps off|gap"):
            open_record(path)


def test_what_is_not_there_or_of_no_format_is_refused(tmp_path):
    for name, held, said in (
        ("a.wav", None, "a.wav: no such file"),
        ("a", None, "a: no such file"),
        ("a.mp3", b"ID3", r"a.mp3: expected a record of samples, its name ending in"),
        ("a.wave", b"RIFF", r"did you mean \.wav"),
        ("a.csv", b"", "a.csv: is empty"),
        ("a.wav", b"time_s,p_pa\n0,1\n", "a.wav: expected a sound file"),
        ("b.mseed", b"time_s,p_pa\n0,1\n", "b.mseed: expected a complete .mseed"),
        ("b.tdms", b"time_s,p_pa\n0,1\n", "b.tdms: expected pressure"),
        ("b.nc", b"time_s,p_pa\n0,1\n", "b.nc: expected a complete .nc file"),
        ("b.mat", b"time_s,p_pa\n0,1\n" * 20, "b.mat: expected a .mat file"),
        ("b.csv", b"\x00\x01\xff" * 50, "b.csv: line 1: expected"),
    ):
        path = tmp_path / name
        if held is not None:
            path.write_bytes(held)
        with pytest.raises(InputError, match=said):
            open_record(path)


def test_a_mistaken_extension_is_told_from_what_the_file_begins_with(tmp_path):
    path = tmp_path / "a.csv"
    soundfile.write(path, np.zeros(9), 8000, format="WAV")
    with pytest.raises(InputError, match=r"begins like \.wav or \.flac; rename it"):
        open_record(path)


def test_ten_gigabytes_of_text_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,p_pa\n0,1\n")
    os.truncate(path, 10**10)  # sparse: takes no room
    with pytest.raises(InputError, match=r"at most 2 GB of \.csv.* got 10 GB"):
        open_record(path)


def test_a_sample_that_is_no_number_is_named_when_it_is_read(tmp_path):
    path = tmp_path / "a.wav"
    samples = np.zeros((100, 2), np.float32)
    samples[40, 1] = np.nan
    soundfile.write(path, samples, 1000, subtype="FLOAT")
    (recording,) = open_record(path, Scaling(full_scale_pa=1.0))
    recording.samples(0, 40)
    with pytest.raises(InputError, match=r"a.wav: channel a.2, sample 41 \(0.04 s\)"):
        recording.samples(20, 60)
    samples[:, 0] = np.nan
    soundfile.write(path, samples, 1000, subtype="FLOAT")
    with pytest.raises(InputError, match=r"a\.1: expected samples, got no finite"):
        recording.samples(0, 100)


def test_a_folder_gives_its_records_by_name(tmp_path):
    record = "time_s,p_pa\n0,1\n1,2\n"
    for name in ("b.csv", "a.CSV", ".hidden.csv"):
        text(tmp_path, record, name)
    stations = text(tmp_path, "sensor,east_m,north_m,up_m\na,0,0,0\n", "places.csv")
    other = text(tmp_path, "sensor,lat_deg,lon_deg\na,0,0\n", "degrees.csv")
    notes = text(tmp_path, "a note", "README.md")
    (tmp_path / "deeper").mkdir()
    files, left_out = record_files([tmp_path], str(stations))
    assert files == (tmp_path / "a.CSV", tmp_path / "b.csv")
    assert left_out == (notes, other)
    # a file that is named is taken, whatever it is
    assert record_files([notes, tmp_path])[0] == (notes, *files)


def test_a_folder_without_records_is_refused(tmp_path):
    with pytest.raises(InputError, match="folder of records of samples, got none"):
        record_files([tmp_path])
    text(tmp_path, "a note", "README.md")
    with pytest.raises(InputError, match="got 1 other files"):
        record_files([tmp_path])


def test_times_begin_where_the_record_does_and_step_by_the_rate():
    record = PressureRecord("a", np.zeros(5), rate_hz=4.0, start_s=10.0)
    np.testing.assert_array_equal(record.time_s, [10.0, 10.25, 10.5, 10.75, 11.0])
    assert record.seconds == 1.25


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"rate_hz": 0.0}, "rate_hz must be positive"),
        ({"rate_hz": float("nan")}, "rate_hz must be positive"),
        ({"start_s": float("inf")}, "start_s must be finite"),
        ({"epoch": datetime(2026, 1, 1)}, "epoch must have a time zone"),
    ],
)
def test_what_is_no_record_is_refused(changed, named):
    good = {"rate_hz": 1.0, "start_s": 0.0, "epoch": datetime(2026, 1, 1, tzinfo=UTC)}
    with pytest.raises(ValueError, match=named):
        PressureRecord("a", np.zeros(2), **(good | changed))
