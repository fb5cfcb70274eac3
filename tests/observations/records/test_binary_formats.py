"""Files that each format's own library wrote come back: pascals, clock, epoch."""

import warnings
from datetime import UTC, datetime

import h5netcdf
import h5py
import numpy as np
import pytest
import scipy.io
import soundfile
import xarray as xr
from nptdms import ChannelObject, TdmsWriter

from jblast.errors import InputError
from jblast.observations.records.formats import Scaling, open_record
from jblast.units import si_factor
from tests.observations.records.bangs import RATE_HZ, START_S, pulse, times

with warnings.catch_warnings():  # of its own age
    warnings.simplefilter("ignore", DeprecationWarning)
    import obspy

BEGAN = datetime(2026, 3, 1, 12, 0, 7, 250_000, tzinfo=UTC)


def only(path, scaling=None):
    (recording,) = open_record(path, scaling)
    return recording


def check(recording, start_s=START_S, rtol=1e-12):
    """The pulse came back, whole and in part."""
    assert recording.rate_hz == pytest.approx(RATE_HZ, rel=1e-12)
    assert recording.start_s == pytest.approx(start_s, abs=1e-12)
    assert recording.calibrated
    whole, atol = recording.samples(0, 400)[0], rtol * 1200
    np.testing.assert_allclose(whole, pulse(), rtol=rtol, atol=atol)
    part = recording.record(0, 100, 200)
    np.testing.assert_allclose(part.samples, pulse()[100:200], rtol=rtol, atol=atol)
    assert part.start_s == pytest.approx(start_s + 100 / RATE_HZ, abs=1e-12)


@pytest.mark.parametrize("ending", ["wav", "flac"])
def test_sound_is_pascals_where_full_scale_is_told(tmp_path, ending):
    path = tmp_path / f"phone.{ending}"
    soundfile.write(path, pulse() / 2000.0, int(RATE_HZ), subtype="PCM_24")
    recording = only(path, Scaling(full_scale_pa=2000.0))
    check(recording, start_s=0.0, rtol=2e-7)  # of 24 bits, about full scale
    assert recording.full_scale == 2000.0 * (1 - 2**-23)
    plain = only(path)
    assert not plain.calibrated
    assert abs(plain.samples(0, 400)).max() < 1.0


@pytest.mark.parametrize("kind", ["MSEED", "SAC"])
def test_traces_begin_at_their_time_of_day(tmp_path, kind):
    header = {"sampling_rate": RATE_HZ, "starttime": obspy.UTCDateTime(BEGAN)}
    header |= {"station": "GATE", "channel": "HDF"}
    path = tmp_path / f"gate.{kind.lower()}"
    trace = obspy.Trace(pulse().astype(np.float32), header)
    trace.write(str(path), format=kind)
    recording = only(path, Scaling(sensitivity=1.0))
    check(recording, start_s=0.25, rtol=1e-7)  # of float32
    assert recording.epoch == BEGAN.replace(microsecond=0)
    assert not only(path).calibrated


def test_ground_motion_is_no_pressure(tmp_path):
    path = tmp_path / "ground.sac"
    trace = obspy.Trace(np.zeros(100, np.float32), {"sampling_rate": 100.0})
    trace.stats.sac = {"idep": 7}
    trace.write(str(path), format="SAC")
    with pytest.raises(InputError, match=r"expected pressure, .* \(ground motion"):
        open_record(path)


def test_tdms_is_read_by_its_properties(tmp_path):
    path = tmp_path / "daq.tdms"
    wave = {"wf_increment": 1 / RATE_HZ, "wf_start_offset": 0.0}
    wave |= {"wf_start_time": np.datetime64(BEGAN.replace(tzinfo=None), "us")}
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("a", "p1", pulse() / 1e3, wave | {"unit_string": "kPa"}),
                ChannelObject("a", "p2", pulse() / 50, wave | {"unit_string": "V"}),
                ChannelObject("a", "T", pulse(), wave | {"unit_string": "degC"}),
            ]
        )
    recordings = open_record(path, Scaling(sensitivity=50.0))
    assert [r.names for r in recordings] == [("daq.p1",), ("daq.p2",)]
    assert [r.aliases[0] for r in recordings] == [("daq.1", "p1"), ("daq.2", "p2")]
    for recording in recordings:
        check(recording, start_s=0.25)
        assert recording.epoch == BEGAN.replace(microsecond=0)
        assert recording.notes == ("left out, not pressure: T (degC)",)
    with pytest.raises(InputError, match="column p2: expected pressure, got V"):
        open_record(path)


@pytest.mark.parametrize(
    ("name", "unit", "pascals"),
    [
        ("p", "lbf/in^2", si_factor("psi")),
        ("p", "PoundsPerSquareInch", si_factor("psi")),
        ("p", "psia", si_factor("psi")),
        ("p", "N/m2", 1.0),
        ("p", "inH2O", 249.08891),
        ("p [kPa]", "", 1e3),
        ("p_kPa", "None", 1e3),
    ],
)
def test_tdms_with_time_stamps_is_read_in_any_unit(tmp_path, name, unit, pascals):
    path = tmp_path / "daq.tdms"
    began = np.datetime64(BEGAN.replace(tzinfo=None), "ns")
    stamps = began + np.rint(np.arange(400) * 1e9 / RATE_HZ).astype("timedelta64[ns]")
    held = {"unit_string": unit} if unit else {}
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("a", "Time", stamps.astype("datetime64[us]")),
                ChannelObject("a", name, pulse() / pascals, held),
                ChannelObject("a", "q [V]", pulse()),
                ChannelObject("a", "remark", ["a", "b"]),
            ]
        )
    recording, other = open_record(path, Scaling(sensitivity=1.0))
    check(recording, start_s=0.25)
    assert recording.epoch == BEGAN.replace(microsecond=0)
    assert (recording.names, recording.aliases) == (("daq.p",), (("daq.1", "p"),))
    assert other.names == ("daq.q",)
    assert recording.notes == ("left out, not pressure: remark (text)",)


def test_tdms_with_a_scale_that_npTDMS_does_not_apply_is_refused(tmp_path):
    path = tmp_path / "daq.tdms"
    wave = {"wf_increment": 1 / RATE_HZ, "unit_string": "Pa"}
    scale = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled"}
    scale |= {"NI_Scale[0]_Scale_Type": "Reciprocal"}
    with TdmsWriter(path) as writer:
        p = ChannelObject("a", "p", pulse(), wave)
        writer.write_segment([p, ChannelObject("a", "raw", pulse(), wave | scale)])
    with pytest.raises(InputError, match=r"channel raw: .*raw numbers \(nptdms: Uns"):
        open_record(path)[1].samples(0, 1)


def test_tdms_that_is_cut_short_is_refused(tmp_path):
    path = tmp_path / "daq.tdms"
    wave = {"wf_increment": 1 / RATE_HZ, "unit_string": "Pa"}
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("a", "p", pulse(), wave)])
    path.write_bytes(path.read_bytes()[:-800])
    with pytest.raises(InputError, match=r"daq\.tdms: is cut short"):
        open_record(path)


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_netcdf_is_read_by_its_units(tmp_path, engine):
    path = tmp_path / "field.nc"
    since = "milliseconds since 2026-03-01 12:00:07"
    data = xr.Dataset(
        {"p": (("channel", "time"), np.array([pulse(), 2 * pulse()]) / 1e3)},
        {"time": ("time", 1e3 * times(), {"units": since})},
    )
    data.p.attrs["units"] = "kPa"
    data.to_netcdf(path, engine=engine)
    recording = only(path)
    check(recording)
    assert recording.names == ("field.1", "field.2")
    assert recording.epoch == BEGAN.replace(microsecond=0)
    np.testing.assert_allclose(recording.samples(0, 400)[1], 2 * pulse())


def test_plain_hdf5_is_read_by_its_attributes(tmp_path):
    path = tmp_path / "daq.h5"
    with h5py.File(path, "w") as file:
        file["p"], file["T"] = pulse() / 100, np.zeros(3)
        file["p"].attrs.update({"units": "mbar", "rate_hz": RATE_HZ})
    recording = only(path)
    check(recording, start_s=0.0)
    assert recording.notes == ("left out, not pressure: T",)
    with h5netcdf.File(path, "r", phony_dims="sort") as file:  # another's reading
        np.testing.assert_allclose(np.asarray(file["p"][:]), pulse() / 100)


def test_each_group_of_hdf5_has_its_own_times(tmp_path):
    path = tmp_path / "daq.h5"
    with h5py.File(path, "w") as file:
        file.attrs["rate_hz"] = RATE_HZ / 2
        file["gate/a/p_kpa"] = pulse() / 1e3
        file["gate/a"].attrs["rate_hz"] = RATE_HZ
        file["mast/p_pa"], file["mast/time_s"] = pulse(), times()
        file["mast/T"] = np.zeros(3)
    gate, mast = open_record(path)
    check(gate, start_s=0.0)
    check(mast)
    assert gate.names == ("daq.gate.a.p",)
    assert mast.notes == ("left out, not pressure: mast.T",)
    with h5py.File(path, "w") as file:
        file["gate/T"] = np.zeros(3)
    with pytest.raises(InputError, match=r"got 'gate\.T'"):
        open_record(path)


@pytest.mark.parametrize("seventh", [False, True])
def test_each_struct_of_matlab_has_its_own_times(tmp_path, seventh):
    path = tmp_path / "daq.mat"
    one = {"time_ms": 1e3 * times(), "p_kpa": pulse() / 1e3}
    other = {"fs": np.array([RATE_HZ]), "p_pa": pulse(), "T": np.zeros(3)}
    if seventh:  # as others than MATLAB write it
        with h5py.File(path, "w") as file:
            for name, struct in (("gate", one), ("mast", other)):
                for field, array in struct.items():
                    file[f"{name}/{field}"] = array
    else:
        scipy.io.savemat(path, {"gate": one, "mast": other})
    gate, mast = open_record(path)
    check(gate)
    check(mast, start_s=0.0)
    assert (gate.names, mast.names) == (("daq.gate.p",), ("daq.mast.p",))
    assert mast.notes == ("left out, not pressure: mast.T",)


@pytest.mark.parametrize(
    ("held", "said"),
    [
        ({"p_pa": [1.0, 2.0]}, "expected one column of time of its 2 samples"),
        ({"time_s": [0.0, 1.0]}, "expected pressure"),
        ({"p_pa": [1.0, 2.0], "fs": [0.0]}, "fs: expected one positive"),
        (
            {"p_kpa": [1.0, 2.0], "p_psi": [1.0, 2.0], "time_s": [0.0, 1.0]},
            "daq.mat: columns p_kpa and p_psi: expected one unit",
        ),
        (
            {"p_pa": [1.0, 2.0], "time_s": [0.0, 1.0, 2.0]},
            r"of its 2 samples.* got 'time_s \(3\)'",
        ),
    ],
)
def test_variables_that_are_no_record_are_refused(tmp_path, held, said):
    path = tmp_path / "daq.mat"
    scipy.io.savemat(path, held)
    with pytest.raises(InputError, match=said):
        open_record(path)


def test_a_damaged_mat_file_that_ends_scipys_process_is_refused(tmp_path):
    path = tmp_path / "daq.mat"
    scipy.io.savemat(path, {"rate_hz": 8000.0, "p_pa": np.ones(50)})
    data = bytearray(path.read_bytes())
    # SciPy uses the type of an element, here that of 50 doubles, as an index
    data[data.index(np.array([9, 400], "<u4").tobytes())] = 200
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a \.mat file, which SciPy cannot read \(ex"):
        open_record(path)
