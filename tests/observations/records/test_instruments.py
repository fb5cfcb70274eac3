"""Text that loggers and oscilloscopes write: preambles, units, steps, over-range."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.formats import Scaling, open_record
from jblast.units import si_factor
from tests.observations.records.bangs import RATE_HZ, START_S, pulse, times

VOLTS = 50.0
"""Sensitivity [Pa/V]."""


def rows(template, *, one=1.0, clock=1.0, marks=(".", ",")):
    """One row a sample, of number k, time t and value v and twice that, w."""
    values = pulse() / one
    lines = [
        template.format(k=k, t=f"{t / clock:.7f}", v=f"{v:.7f}", w=f"{2 * v:.7f}")
        for k, (t, v) in enumerate(zip(times(), values, strict=True))
    ]
    text = "\n".join(lines) + "\n"
    return text if marks[0] == "." else text.replace(".", marks[0])


LOGGER = (
    "Messung;Tür 3\nDatum;01.02.2026\nAbtastrate;2000 Hz\n"
    + "".join(f"Kanal {k};Gerät {k};{k};°C\n" for k in range(16))
    + "Bemerkung;\n\nZeit [ms];Tür [kPa];Wand [kPa];Temp [°C]\n"
)
TEKTRONIX = (
    "Model,MSO44\nFirmware Version,1.0\n\nHorizontal Units,s,\nHorizontal Scale,4e-05\n"
    "Sample Interval,0.0005,\nRecord Length,400,\nProbe Attenuation,10\n"
    "Vertical Units,V,{more}\nVertical Offset,0\nVertical Scale,0.5\n"
    "Vertical Position,-3.7\n,\n,\nLabel,,\n"
)
OLD_LEFT = (
    "Record Length,400,Points",
    "Sample Interval,5.0e-04,s",
    "Vertical Units,V,",
)
OLD = "\n".join(
    f"{OLD_LEFT[k] if k < 3 else ',,'},{row}"
    for k, row in enumerate(rows("{t},{v},", one=VOLTS).splitlines())
)
LECROY = (
    "LECROYWR64Xi,21153,Waveform\nSegments,1,SegmentSize,400\n"
    "Segment,TrigTime,TimeSinceSegment1\n#1,16-Mar-2022 14:45:39,0\n"
)
LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\t{}\n"
    "Date\t2024/05/01\nTime\t12:00:00.1234\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\t\nSamples\t400\t400\t\nDate\t2024/05/01\t2024/05/01\t\n"
    "Y_Unit_Label\tVolts\tVolts\t\nX_Dimension\tTime\tTime\t\nX0\t0.25\t0.25\t\n"
    "Delta_X\t0.000500\t0.000500\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tVoltage_0\tVoltage_1\tComment\n"
)
DTS = (
    "Test Id,T1\nTest Date,2024-05-01\nSample Rate (sps),2000\nChannel,1,2\n"
    "EU,psi,psi\nRange,100,200\nOffset,0,1\nTime,Gauge 1,Gauge 2\n"
)
GW_INSTEK = (
    "Memory Length,400,\nVertical Units,V,\nVertical Scale,5.0e-02,\n"
    "Vertical Position,1.04e-01,\nHorizontal Units,S,\nSampling Period,5.0e-04,\n"
    "Time, ,\nWaveform Data,\n"
)
ONE, TWO = rows("{t},{v}", one=VOLTS), rows("{t},{v},{w}", one=VOLTS)
FORMATS = {
    "logger.csv": (
        LOGGER + rows("{t};{v};{w};20", one=1e3, clock=1e-3, marks=(",", ";")),
        ("Tür", "Wand"),
    ),
    "rigol_z.csv": (
        "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,2.5e-01,5.0e-04\n"
        + rows("{k},{v},{w},", one=VOLTS),
        ("CH1", "CH2"),
    ),
    "rigol_e.csv": (
        "Time,X(CH1),X(CH2)\nSecond,Volt,Volt\n" + TWO,
        ("X(CH1)", "X(CH2)"),
    ),
    "rigol_2.csv": (
        "X,CH1,CH2,\nSecond,Volt,Volt,\n" + rows("{t},{v},{w},", one=VOLTS),
        ("CH1", "CH2"),
    ),
    "rigol_5.csv": (
        "CH1(V),CH2(V),t0 = 0.25s, tInc = 0.0005s,\n" + rows("{v},{w},", one=VOLTS),
        ("CH1", "CH2"),
    ),
    "rigol_1.csv": (
        "CH1(V),t0 = 0.25s, tInc = 0.0005s,\n" + rows("{v},", one=VOLTS),
        (),
    ),
    "rigol_d.csv": ("Time(s),CH1V,CH2V\n" + TWO, ("CH1", "CH2")),
    "rigol_7.csv": ("Time(s),CH1(V)\n" + ONE, ()),
    "tek.csv": (TEKTRONIX.format(more="") + "TIME,CH2\n" + ONE, ()),
    "tek_2.csv": (
        TEKTRONIX.format(more="V") + "TIME,CH1,CH2\n" + TWO,
        ("CH1", "CH2"),
    ),
    "tek_remarks.csv": (
        TEKTRONIX.format(more="V").replace("\n", "\n#") + "\nTIME,CH1,CH2\n" + TWO,
        ("CH1", "CH2"),
    ),
    "tek_old.csv": (OLD, ()),
    "lecroy.csv": (LECROY + "Time,Ampl\n" + ONE, ()),
    "lecroy_2.csv": (LECROY + "Time, Ampl1, Ampl2\n" + TWO, ("Ampl1", "Ampl2")),
    "pico.csv": (
        "Time;Channel A;Channel B\n(ms);(V);(V)\n\n"
        + rows("{t};{v};{w}", one=VOLTS, clock=1e-3, marks=(",", ";")),
        ("Channel A", "Channel B"),
    ),
    "one_x.lvm": (
        LABVIEW.format("One") + rows("{t}\t{v}\t{w}\t", one=VOLTS),
        ("Voltage_0", "Voltage_1"),
    ),
    "no_x.lvm": (
        LABVIEW.format("No") + rows("\t{v}\t{w}\t", one=VOLTS),
        ("Voltage_0", "Voltage_1"),
    ),
    "dts.csv": (
        DTS + rows("{t},{v},{w}", one=si_factor("psi")),
        ("Gauge 1", "Gauge 2"),
    ),
    "instek.csv": (GW_INSTEK + rows("{v},", one=VOLTS), ()),
    "dated.csv": (
        "Sample rate [kHz];2\nt0;0,25\nDatum;Zeit;P1 [kPa]\n"
        + rows("01.02.2026;12:00:00;{v}", one=1e3),
        (),
    ),
    "seismograph.txt": (
        '"Pre-trigger Length : 0.25 sec"\n"Sample Rate : 2000 sps"\n'
        '"Units : mm/s and psi(L)"\n"Title : quarry"\n\n   Tran     MicL\n'
        + rows("   {w}   {v}", one=si_factor("psi")),
        (),
    ),
    "plain.txt": (
        "Sample rate: 2 kHz\nUnit: kPa\nStart: 250 ms\n" + rows("{v}", one=1e3),
        (),
    ),
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_text_of_an_instrument_is_read(tmp_path, name):
    text, channels = FORMATS[name]
    path = tmp_path / name
    path.write_bytes(text.encode("cp1252"))
    recordings = open_record(path, Scaling(sensitivity=VOLTS))
    # the memory of this instrument begins at the trigger
    start_s = {"instek.csv": 0.0, "seismograph.txt": -0.25}.get(name, START_S)
    names = tuple((f"{path.stem}.{one}",) for one in channels) or ((path.stem,),)
    assert tuple(one.names for one in recordings) == names
    for k, one in enumerate(recordings):
        assert one.rate_hz == pytest.approx(RATE_HZ, rel=1e-9)
        assert one.start_s == pytest.approx(start_s, abs=1e-9)
        assert one.calibrated
        # of seven decimals of a value, in its unit
        np.testing.assert_allclose(one.samples(0, 400)[0], (k + 1) * pulse(), atol=2e-3)
        told = "text that is not UTF-8 is read as Windows-1252" in one.notes
        assert told == (not text.isascii())


def test_samples_beyond_the_range_are_clipped(tmp_path):
    path = tmp_path / "pico.csv"
    lines = [str(line) for line in TWO.splitlines()]
    for row, sign in ((100, "∞"), (101, "1e99"), (102, "inf"), (160, "-∞")):
        time, _, other = lines[row].split(",")
        lines[row] = f"{time},{sign},{other}"
    path.write_text("Time (s),A (V),B (V)\n" + "\n".join(lines))
    clipped, whole = open_record(path, Scaling(sensitivity=VOLTS))
    assert (whole.names, clipped.names) == (("pico.B",), ("pico.A",))
    assert whole.full_scale is None
    # the front is at sample 100: the next finite one is that of 1.5 ms
    assert clipped.full_scale is not None
    assert clipped.full_scale == pytest.approx(pulse()[103], abs=1e-5)
    samples = clipped.samples(0, 400)[0]
    np.testing.assert_array_equal(samples[[100, 101, 102]], clipped.full_scale)
    assert samples[160] == -clipped.full_scale
    assert "4 samples beyond the range of the recorder" in clipped.notes


@pytest.mark.parametrize(
    "rate", ["Sample Rate,10,kHz", "# Sample rate: 10,000 Hz", "fs (kHz),10,10"]
)
def test_the_unit_of_a_rate_and_its_thousands_are_read(tmp_path, rate):
    path = tmp_path / "gate.csv"
    path.write_text(f"{rate}\nn,p_pa,q_pa\n0,1,2\n1,2,3\n2,3,4\n")
    assert open_record(path)[0].rate_hz == 1e4


STEPPED = "Sample interval,0.1\n"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (
            "time_s,p_kpa\n0,1\nx,2\n" + "0.2,3\n" * 9,
            "line 3: expected numbers .*'x,2'",
        ),
        (
            STEPPED + "time,p_kpa\n0,1\n1e-3,2\n2e-3,3\n",
            "apart, as the preamble states",
        ),
        (STEPPED + "n,p_kpa\n0,1\n1,2\n2,2\n4,3\n", "line 6.* a gap of 0.2 s"),
        ("Model,X\nA,B\n0,1\n1,2\n", "expected pressure, .* got 'A, B'"),
        (STEPPED + "p_kpa\n" + "1\n" * 300 + "-\n", "line 303, column p_kpa: .*'-'"),
        (
            "Date,Time,p_kpa\n1.2.26,12:00,1\n1.2.26,12:00,2\n",
            "got 'Date, Time'; times of day belong",
        ),
    ],
)
def test_a_preamble_does_not_hide_faults(tmp_path, body, said):
    path = tmp_path / "gate.csv"
    path.write_text(body)
    with pytest.raises(InputError, match=said):
        open_record(path)


def test_dates_and_velocities_next_to_pressures_are_left_out(tmp_path):
    path = tmp_path / "gate.csv"
    path.write_text("Date,time_s,p_kpa\n" + rows("2026-02-01 12:00,{t},{v}", one=1e3))
    (recording,) = open_record(path)
    assert recording.notes == ("left out, not pressure: Date",)
    path.write_text(FORMATS["seismograph.txt"][0])
    assert "left out, not pressure: Tran (mm/s)" in open_record(path)[0].notes
