"""Events of every format come back as they were; other files are refused by name."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import faery
import h5py
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.sensors.camera.files.event_files import (
    EVENT_FORMATS,
    read_events,
    write_events,
)
from jblast.sensors.camera.files.evt3 import BLOCK
from jblast.sensors.camera.pixel import Events

HERE = Path(__file__).parent
WRITTEN = [name for name, one in EVENT_FORMATS.items() if one.write]

COLUMNS = {"x": [3, 0, 1], "y": [2, 2, 0], "t": [0, 40, 999], "p": [1, 0, 1]}
EVT3 = b"% evt 3.0\n% format EVT3;height=480;width=640\n% end\n"
DAT = b"% Version 2\n% Height 3\n% Width 4\n"


def events_of(x, y, t, p) -> Events:
    """Events, with an empty place after the last."""
    sign, lost = 2 * np.asarray(p, int) - 1, np.zeros((), int)
    column, row = (np.append(np.asarray(place, int), -1) for place in (x, y))
    time = np.append(1e-6 * np.asarray(t, float), np.inf)
    return Events(column, row, time, np.append(sign, 0), np.array(len(sign)), lost)


@st.composite
def streams(draw):
    """Columns of events of 300 x 200 pixels with gaps of all sizes, and block ends."""
    some = draw(st.integers(0, 60))
    numbers = lambda values: draw(  # noqa: E731 - one line, used four times
        st.lists(values, min_size=some, max_size=some)
    )
    gaps = [0, 0, 1, 40, 4095, 4096, 4097, 1 << 20, 1 << 24, 3 << 24]
    steps = np.array(numbers(st.sampled_from(gaps)), np.int64)
    sides = (numbers(st.integers(0, most)) for most in (299, 199))
    columns = [*sides, np.cumsum(steps), numbers(st.integers(0, 1))]
    cuts = sorted(draw(st.lists(st.integers(0, some), max_size=3)))
    return [np.asarray(column, np.int64) for column in columns], cuts


@pytest.mark.parametrize("suffix", WRITTEN)
def test_any_events_come_back_as_they_were(tmp_path, suffix):
    # a file of AEDAT4 is read by a process of its own
    @settings(max_examples=4 if suffix == ".aedat4" else 40, deadline=None)
    @given(stream=streams())
    def check(stream):
        columns, cuts = stream
        edges = [0, *cuts, len(columns[0])]
        blocks = [events_of(*(c[a:b] for c in columns)) for a, b in pairwise(edges)]
        written = write_events(tmp_path / f"a{suffix}", blocks, 300, 200)
        found = read_events(tmp_path / f"a{suffix}")
        assert (found.width, found.height) == (300, 200)
        brighter = int(columns[3].sum())
        assert written == (len(found.t), brighter, len(found.t) - brighter)
        for name, expected in zip("xytp", columns, strict=True):
            np.testing.assert_array_equal(getattr(found, name), expected)

    check()


@pytest.mark.parametrize("suffix", WRITTEN)
def test_impossible_events_are_not_written(tmp_path, suffix):
    for columns, message in (
        ([([8], [0], [5], [1])], r"x of event 0: expected 0 to 7.*got 8"),
        ([([0], [-1], [5], [1])], r"y of event 0: expected 0 to 5.*got -1"),
        ([([0, 1], [0, 0], [5, 4], [1, 1])], "order of time, got 4 us after 5 us"),
        ([([0], [0], [-3], [1])], "got -3 us after 0 us"),
        ([([0], [0], [9], [1]), ([0], [0], [3], [1])], "got 3 us after 9 us"),
    ):
        with pytest.raises(InputError, match=message):
            write_events(
                tmp_path / f"a{suffix}", [events_of(*c) for c in columns], 8, 6
            )
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("suffix", EVENT_FORMATS)
def test_missing_empty_and_other_files_are_refused(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    with pytest.raises(InputError, match=rf"a{suffix}: no such file"):
        read_events(path)
    for content, got in ((b"", "got an empty file"), (b"time_s,p_pa\n0,1\n" * 99, "")):
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"a{suffix}: expected .*{got}"):
            read_events(path)


@pytest.mark.parametrize("suffix", WRITTEN)
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_file_that_breaks_off_is_refused(tmp_path, suffix, share):
    path = tmp_path / f"a{suffix}"
    t = np.sort(np.random.default_rng(0).integers(0, 10**6, 3000))
    write_events(path, [events_of(t % 6, t % 5, t, t % 2)], 8, 6)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=rf"a{suffix}: expected a complete"):
        read_events(path)


def saved(path, columns, **more):
    """Write columns as they are."""
    if path.suffix == ".npz":
        np.savez(path, allow_pickle=False, **columns, **more)
        return path
    with h5py.File(path, "w") as file:
        for name, column in columns.items():
            file[f"events/{name}"] = column
        if more:
            file["events"].attrs.update(more)
    return path


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": [0, 999, 40]}, "t: expected events in order of time, got 40 us after"),
        ({"x": [0, 1, 9]}, r"x of event 2: expected 0 to 3, .*got 9"),
        ({"y": [0, 1]}, "as many of each column, got 3 of x, 2 of y"),
        ({"p": [0, 1, 2]}, "p of event 2: expected 0 to 1, darker or brighter, got 2"),
        ({"t": [0.0, np.nan, 0.2]}, r"t of event 1: .* in microseconds, got nan"),
        ({"t": [0, 1, 1 << 62]}, r"t of event 2: .* in microseconds, got 4"),
        ({"t": [b"0", b"1", b"2"]}, r"t: expected a column of numbers|t: expected .*"),
        ({"x": [0, 1.5, 3]}, r"x of event 1: expected 0 to 3, .*got 1\.5"),
        ({"x": [[0], [1], [3]]}, r"x: expected a column of numbers, got .*\(3, 1\)"),
    ],
)
def test_impossible_columns_are_named(tmp_path, suffix, change, message):
    path = saved(tmp_path / f"a{suffix}", COLUMNS | change, width=4, height=3)
    with pytest.raises(InputError, match=message):
        read_events(path)


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_file_without_its_size_needs_it(tmp_path, suffix):
    path = saved(tmp_path / f"a{suffix}", COLUMNS | {"p": [1, -1, 1]})
    with pytest.raises(InputError, match="expected the width and height of the image"):
        read_events(path)
    found = read_events(path, size=(4, 3))
    assert (found.width, found.height) == (4, 3)
    assert found.p.tolist() == [1, 0, 1]  # minus one is darker, too


def rows(kinds):
    table: Any = np.zeros(3, kinds)
    for name, column in COLUMNS.items():
        table[name] = column
    return table


def v2e(path):
    with h5py.File(path, "w") as file:
        file["events"] = np.array([COLUMNS[name] for name in "txyp"], np.uint32).T


def prophesee(path, codec=None):
    table = rows([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    with h5py.File(path, "w") as file:
        file.attrs["geometry"] = "4x3"
        if codec is None:
            file["CD/events"] = table
            return
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((3,))
        plist.set_filter(codec, h5py.h5z.FLAG_OPTIONAL, ())
        space, kind = h5py.h5s.create_simple((3,)), h5py.h5t.py_create(table.dtype)
        group = file.create_group("CD")
        h5py.h5d.create(group.id, b"events", kind, space, plist)


def dat(path):
    x, y, p = (np.array(COLUMNS[name]) for name in "xyp")
    t = np.array([0, 40, 999 + (1 << 32)])  # its counter begins again
    words = np.stack([t, x | y << 14 | p << 28], axis=1).astype(np.uint32)
    path.write_bytes(DAT + b"\x0c\x08" + words.tobytes())


FROM_OTHERS = {
    "v2e.h5": v2e,
    "prophesee.h5": prophesee,
    "prophesee.dat": dat,
    "v2e.txt": "#!events.txt\n# v2e\n0.00000000 3 2 1\n0.00004 0 2 0\n0.000999 1 0 1\n",
    "a.txt": "4 3\n0 3 2 1\n40 0 2 0\n999 1 0 1\n",
    "b.txt": "# x y p t\n# 4 3\n3 2 1 0\n0 2 0 0.00004\n1 0 1 0.000999\n",
    "a.csv": "%geometry:4,3\n3,2,1,0\n0,2,0,40\n1,0,1,999\n",
    "b.csv": "% geometry 4x3\ntimestamp,x,y,polarity\n0,3,2,1\n40,0,2,0\n999,1,0,1\n",
}


@pytest.mark.parametrize("name", FROM_OTHERS)
def test_files_of_other_programs_are_read(tmp_path, name):
    path, made = tmp_path / name, FROM_OTHERS[name]
    path.write_text(made) if isinstance(made, str) else made(path)
    found = read_events(path, size=(4, 3) if name.startswith("v2e") else None)
    assert (found.width, found.height) == (4, 3)
    for column, expected in COLUMNS.items():
        assert getattr(found, column).tolist() == expected


def test_a_camera_s_aedat4_is_read():
    # frames and events of a DAVIS, compressed by LZ4, by dv-processing 2.0.4
    found = read_events(HERE / "davis.aedat4")
    assert found.x.tolist() == [0, 3, 6, 9, 12]
    assert found.y.tolist() == [0, 2, 4, 6, 8]
    assert found.t.tolist() == [10**15 + 7 * k for k in range(5)]  # time of the day
    assert found.p.tolist() == [1, 0, 1, 0, 1]
    assert (found.width, found.height) == (346, 260)
    with pytest.raises(
        InputError, match=r"s\.aedat4: expected one stream of events, got 0"
    ):
        read_events(HERE / "frames.aedat4")


@pytest.mark.parametrize(
    ("per_us", "kind", "note"),
    [
        (1, np.int64, ""),
        (1000, np.int64, "read as nanoseconds: in microseconds there are 10 events"),
        (1e-6, np.float64, ""),
        (1e-3, np.float64, "read as milliseconds: in seconds there are 10 events"),
    ],
)
def test_times_have_the_unit_that_gives_a_camera_s_rate(tmp_path, per_us, kind, note):
    t = np.linspace(0, 10**6, 10**4).round()
    some = np.zeros(len(t), int)
    columns = {"x": some, "y": some, "p": some, "t": (per_us * t).astype(kind)}
    found = read_events(saved(tmp_path / "a.npz", columns, width=4, height=3))
    np.testing.assert_array_equal(found.t, t)
    assert note in "".join(found.notes)
    assert bool(note) == bool(found.notes)


def declared(path):
    with h5py.File(path, "w") as file:
        for name in "xytp":
            shape = (3 * 10**9,)
            file.create_dataset(f"events/{name}", shape, np.int64, chunks=(1 << 16,))


def linked(path):
    with h5py.File(path, "w") as file:
        outside = [(str(path.with_suffix(".bin")), 0, 24)]
        for name in "xytp":
            file.create_dataset(f"events/{name}", (3,), np.int64, external=outside)


def zeros(path):
    some = np.zeros(5 * 10**6, np.int64)
    np.savez_compressed(path, x=some, y=some, t=some, p=some)


def pickled(path):
    np.savez(path, x=np.array([print]), y=[0], t=[0], p=[0])


def evt3(*words, header=EVT3):
    return header + np.array(words, "<u2").tobytes()


REFUSED = [
    ("a.h5", declared, r"got one of [\d,]+ bytes that declares 24,000,000,000 bytes"),
    ("a.h5", linked, "events/x: expected numbers in this file, not a link to another"),
    ("a.h5", lambda path: prophesee(path, 0x8ECF), "got the filter 36559, Prophesee"),
    ("a.npz", zeros, r"bytes that declares 160,000,\d+ bytes of numbers"),
    ("a.npz", pickled, "which cannot be read .*allow_pickle"),
    (
        "a.h5",
        lambda path: saved(path, COLUMNS, width=60000, height=60000),
        "expected an image of 1 to 16,777,216 pixels, got 60000 x 60000",
    ),
    (
        "a.npz",
        lambda path: saved(path, {"light": [1.0]}),
        "expected arrays x, y, t and p, got light",
    ),
    ("a.h5", lambda path: saved(path, {"light": [1.0]}), r"\(DSEC\), .* got events"),
    ("a.bin", b"x", "expected a name ending in"),
    ("a.txt", b"4 3\n0.1 3 2.5 1\n0.2 0 2 0\n", r"y of event 0: .* 0 to 2.*got 2\.5"),
    ("a.txt", b"4 3\n0.1 3 2\n", "such as 0.000123 33 39 1, got 3 numbers"),
    ("a.txt", b"# size 4x3, events 02\n0.1 3 2 1\n", "got 1 of 2 events"),
    ("a.dat", DAT + b"\x0c\x08" + bytes(13), "a complete DAT file.*got 5 bytes of the"),
    ("a.dat", DAT + b"\x0e\x08" + bytes(8), "of CD events of 8 bytes"),
    ("a.raw", b"% evt 2.1\n% end\n", "EVT 3.0 or EVT 2.0 file, got '2.1'"),
    ("a.raw", evt3(0x8000, header=b""), "header of an EVT 3.0 or .*, got 'none'"),
    ("a.raw", evt3(0x8000, 0xC000), "a known type, got some of type 0xc"),
    ("a.raw", evt3(0x8000, header=b"% evt 3.0\n"), "expected the width and height"),
    ("a.raw", b"% evt 3.0\n% endianness big\n", "expected little-endian words"),
    (
        "a.raw",
        evt3(0x8002, 0x6000, 0x0000, 0x2001, 0x8001, 0x2001),
        "order of time, got 4096 us after 8192 us",
    ),
    ("a.raw", evt3(0x8000, 0x6000, 0x1E0, 0x2001), "y of event 0: expected 0 to 479"),
]


@pytest.mark.parametrize(("name", "made", "message"), REFUSED)
def test_damaged_and_hostile_files_are_refused(tmp_path, name, made, message):
    path = tmp_path / name
    path.write_bytes(made) if isinstance(made, bytes) else made(path)
    with pytest.raises(InputError, match=rf"{name}: .*{message}"):
        read_events(path)


def decoded(path: Path) -> np.ndarray:
    """x, y, t, p of a file, word by word by the manufacturer's page; no vectors."""
    data = path.read_bytes()
    data = data[data.index(b"% end\n") + 6 :]
    found, high, loops, low, y = [], None, 0, 0, 0
    for word in np.frombuffer(data, "<u2").tolist():
        kind, value = word >> 12, word & 0xFFF
        if kind == 0x8:
            loops += high is not None and value < high
            high = value
        elif kind == 0x6:
            low = value
        elif kind == 0x0:
            y = value
        else:
            assert kind == 0x2
            assert high is not None
            t = (loops << 24) + (high << 12) + low
            found.append((value & 0x7FF, y, t, value >> 11))
    return np.array(found).T


def test_other_decoders_find_the_same_events_over_minutes(tmp_path):
    # the time's 24 bits last 17 s
    t = np.sort(np.random.default_rng(0).integers(0, 300 * 10**6, 2000))
    columns, path = (t % 640, t % 480, t, t % 2), tmp_path / "a.raw"
    halves = [events_of(*(c[k : k + 1000] for c in columns)) for k in (0, 1000)]
    write_events(path, halves, 640, 480)
    np.testing.assert_array_equal(decoded(path), columns)
    events = np.concatenate([*faery.events_stream_from_file(path)])
    for name, expected in zip(("x", "y", "t", "on"), columns, strict=True):
        np.testing.assert_array_equal(events[name], expected)


@pytest.mark.parametrize("block", [1, 2, 3, BLOCK])
def test_vectors_and_repeated_times_of_a_camera_are_read(tmp_path, monkeypatch, block):
    monkeypatch.setattr("jblast.sensors.camera.files.evt3.BLOCK", block)
    words = (
        *(0x2009, 0x8123, 0x6004, 0x0010),  # 0x123 * 4096 + 4 us, row 16
        *(0x3805, 0x4801, 0x5081),  # from column 5 on, brighter: 5, 16, then 17, 24
        *(0x8123, 0xA001, 0x6007),  # the step again, a trigger, 3 us later
        *(0x2007, 0x3064, 0x5001),  # column 7, then 100, darker
        *(0x8124, 0x2008),  # a new step begins at 0
        *(0x8FFF, 0x2001, 0x8000, 0x2001),  # the upper bits begin again
        *(0x8900, 0x2001, 0x80FF, 0x2001),  # and again, with steps left out
    )
    (tmp_path / "a.raw").write_bytes(evt3(*words))
    found = read_events(tmp_path / "a.raw")
    assert found.x.tolist() == [5, 16, 17, 24, 7, 100, 8, 1, 1, 1, 1]
    assert {*found.y.tolist()} == {16}
    steps = [0x124, 0xFFF, 0x1000, 0x1900, 0x20FF]
    expected = [0x123 * 4096 + 4] * 4 + [0x123 * 4096 + 7] * 2
    assert found.t.tolist() == expected + [4096 * step for step in steps]
    assert found.p.tolist() == [1, 1, 1, 1] + [0] * 7


@pytest.mark.parametrize("block", [1, BLOCK])
def test_evt2_of_a_camera_is_read_beyond_its_28_bits(tmp_path, monkeypatch, block):
    """Words by the manufacturer's page: kind, 6 bits of time, column, row."""
    monkeypatch.setattr("jblast.sensors.camera.files.evt3.BLOCK", block)
    word = lambda kind, low, x, y: kind << 28 | low << 22 | x << 11 | y  # noqa: E731
    words = [
        word(1, 5, 9, 9),  # before any time
        0x8 << 28 | 0x0FFFFFFF,
        *(word(1, 3, 100, 200), word(0, 63, 639, 479)),
        *(0xA << 28 | 0x101, 0x8 << 28 | 0x2, word(1, 0, 1, 2)),
    ]
    header = b"% evt 2.0\n% format EVT2;height=480;width=640\n% end\n"
    path = tmp_path / "a.raw"
    path.write_bytes(header + np.array(words, "<u4").tobytes() + b"\0\0\0")
    found = read_events(path)
    base = 0x0FFFFFFF * 64
    assert found.t.tolist() == [base + 3, base + 63, (2**28 + 2) * 64]
    assert found.x.tolist() == [100, 639, 1]
    assert found.y.tolist() == [200, 479, 2]
    assert found.p.tolist() == [1, 0, 1]
    assert "(3 of 4 bytes)" in found.notes[0]
