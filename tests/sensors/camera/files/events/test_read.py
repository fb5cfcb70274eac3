"""Events that were written come back; files that hold none are refused by name."""

from itertools import pairwise

import h5py
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.files.event_files import (
    EVENT_FORMATS,
    read_events,
    write_events,
)

WRITTEN = [name for name, one in EVENT_FORMATS.items() if one.write]
COLUMNS = {"x": [3, 0, 1], "y": [2, 2, 0], "t": [0, 40, 999], "p": [1, 0, 1]}


def events_of(x, y, t, p) -> Events:
    """Events without empty places."""
    sign = 2 * np.asarray(p, int) - 1
    count, lost = np.array(len(sign)), np.zeros((), int)
    time = 1e-6 * np.asarray(t, float)
    return Events(np.asarray(x, int), np.asarray(y, int), time, sign, count, lost)


@st.composite
def streams(draw):
    """Columns of events of 300 x 200 pixels with gaps of all sizes, and block ends."""
    some = draw(st.integers(0, 60))
    numbers = lambda most: st.lists(  # noqa: E731 - one line, used four times
        st.integers(0, most), min_size=some, max_size=some
    )
    steps = draw(
        st.lists(
            st.sampled_from([0, 0, 1, 40, 4095, 4096, 4097, 1 << 20, 1 << 24, 3 << 24]),
            min_size=some,
            max_size=some,
        )
    )
    t = np.cumsum(np.array(steps, np.int64))
    columns = [draw(numbers(299)), draw(numbers(199)), t, draw(numbers(1))]
    cuts = sorted(draw(st.lists(st.integers(0, some), max_size=3)))
    return [np.asarray(column, np.int64) for column in columns], cuts


@pytest.mark.parametrize("suffix", WRITTEN)
@given(stream=streams())
@settings(max_examples=40, deadline=None)
def test_any_events_come_back_as_they_were(tmp_path_factory, suffix, stream):
    columns, cuts = stream
    path = tmp_path_factory.mktemp("events") / f"a{suffix}"
    edges = [0, *cuts, len(columns[0])]
    blocks = [
        events_of(*(column[a:b] for column in columns)) for a, b in pairwise(edges)
    ]
    written = write_events(path, blocks, 300, 200)
    found = read_events(path)
    assert (found.width, found.height) == (300, 200)
    assert written.events == len(found.t) == len(columns[0])
    for name, expected in zip("xytp", columns, strict=True):
        np.testing.assert_array_equal(getattr(found, name), expected)


@pytest.mark.parametrize("suffix", WRITTEN)
def test_what_cannot_be_is_not_written(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    for columns, said in (
        (([8], [0], [5], [1]), r"x of event 0: expected 0 to 7.*got 8"),
        (([0], [-1], [5], [1]), r"y of event 0: expected 0 to 5.*got -1"),
        (([0, 1], [0, 0], [5, 4], [1, 1]), r"in order of time, got 4 us after 5 us"),
        (([0], [0], [-3], [1]), r"got -3 us after 0 us"),
    ):
        with pytest.raises(InputError, match=said):
            write_events(path, [events_of(*columns)], 8, 6)
    late, early = events_of([0], [0], [9], [1]), events_of([0], [0], [3], [1])
    with pytest.raises(InputError, match="got 3 us after 9 us"):
        write_events(path, [late, early], 8, 6)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("suffix", EVENT_FORMATS)
def test_what_is_no_file_of_events_is_refused(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    with pytest.raises(InputError, match=rf"a{suffix}: no such file"):
        read_events(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match=rf"a{suffix}: is empty"):
        read_events(path)
    path.write_bytes(b"time_s,p_pa\n0,1\n" * 99)
    with pytest.raises(InputError, match=rf"a{suffix}: expected"):
        read_events(path)


@pytest.mark.parametrize("suffix", WRITTEN)
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_file_that_breaks_off_is_refused(tmp_path, suffix, share):
    path = tmp_path / f"a{suffix}"
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, 10**6, 3000))
    columns = rng.integers(0, 6, 3000), rng.integers(0, 6, 3000), t, t % 2
    write_events(path, [events_of(*columns)], 8, 6)
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
def test_columns_that_cannot_be_are_named(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    for change, said in (
        ({"t": [0, 999, 40]}, r"t: expected events in order of time, got 40 us after"),
        ({"x": [0, 1, 9]}, r"x of event 2: expected 0 to 3, .*got 9"),
        ({"y": [0, 1]}, r"as many of each column, got 3 of x, 2 of y"),
        (
            {"p": [0, 1, 2]},
            r"p of event 2: expected 1 for brighter, 0 for darker, got 2",
        ),
        ({"t": [0.0, np.nan, 0.2]}, r"t: expected microseconds up to"),
        ({"t": [b"0", b"1", b"2"]}, r"t: expected .*numbers"),
        ({"x": [0, 1.5, 3]}, r"x of event 1: expected 0 to 3, .*got 1\.5"),
    ):
        saved(path, COLUMNS | change, width=4, height=3)
        with pytest.raises(InputError, match=said):
            read_events(path)


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_file_that_does_not_tell_its_size_needs_it(tmp_path, suffix):
    path = saved(tmp_path / f"a{suffix}", COLUMNS | {"p": [1, -1, 1]})
    with pytest.raises(InputError, match="expected the width and height of the image"):
        read_events(path)
    found = read_events(path, size=(4, 3))
    assert (found.width, found.height) == (4, 3)
    assert found.p.tolist() == [1, 0, 1]  # minus one is darker, too


def test_other_arrays_and_other_suffixes_are_refused(tmp_path):
    path = saved(tmp_path / "a.npz", {"light": [1.0]})
    with pytest.raises(InputError, match=r"expected arrays x, y, t and p, got light"):
        read_events(path)
    with pytest.raises(InputError, match=r"a\.bin: expected a name ending in"):
        read_events(tmp_path / "a.bin")


def refused(path, said, **size):
    with pytest.raises(InputError, match=said):
        read_events(path, **size)


def test_files_of_v2e_and_prophesee_are_read(tmp_path):
    order = np.array([COLUMNS[name] for name in "txyp"], np.uint32).T
    path = tmp_path / "v2e.h5"
    with h5py.File(path, "w") as file:
        file["events"] = order
    refused(path, "expected the width and height of the image")
    assert read_events(path, size=(4, 3)).t.tolist() == COLUMNS["t"]
    kinds = [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]
    rows = np.zeros(3, kinds)
    for name, column in COLUMNS.items():
        rows[name] = column
    path = tmp_path / "prophesee.h5"
    with h5py.File(path, "w") as file:
        file["CD/events"] = rows
        file.attrs["geometry"] = "640x480"
    found = read_events(path)
    assert (found.width, found.height, found.x.tolist()) == (640, 480, COLUMNS["x"])
    with h5py.File(path, "w") as file:  # as by Prophesee's writer, with its codec
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((3,))
        plist.set_filter(0x8ECF, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((3,))
        kind = h5py.h5t.py_create(rows.dtype)
        group = file.create_group("CD")
        h5py.h5d.create(group.id, b"events", kind, space, plist)
    refused(
        path, r"Prophesee's ECF \(filter 36559\), which is not installed", size=(4, 3)
    )


def test_text_of_v2e_is_read(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(
        "#!events.txt\n# v2e\n0.000000000 3 2 1\n0.00004 0 2 0\n0.000999 1 0 1\n"
    )
    found = read_events(path, size=(4, 3))
    for name, column in COLUMNS.items():
        assert getattr(found, name).tolist() == column
    path.write_text("0.1 3 2.5 1\n0.2 0 2 0\n")
    refused(path, r"y of event 0: expected 0 to 2.*got 2\.5", size=(4, 3))


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        (".txt", "4 3\n0 3 2 1\n40 0 2 0\n999 1 0 1\n"),
        (".txt", "# x y p t\n# 4 3\n3 2 1 0\n0 2 0 0.00004\n1 0 1 0.000999\n"),
        (".csv", "%geometry:4,3\n3,2,1,0\n0,2,0,40\n1,0,1,999\n"),
        (
            ".csv",
            "% geometry 4x3\ntimestamp,x,y,polarity\n0,3,2,1\n40,0,2,0\n999,1,0,1\n",
        ),
    ],
)
def test_texts_of_other_programs_are_read(tmp_path, suffix, text):
    path = tmp_path / f"a{suffix}"
    path.write_text(text)
    found = read_events(path)
    assert (found.width, found.height) == (4, 3)
    for name, column in COLUMNS.items():
        assert getattr(found, name).tolist() == column


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


def test_a_stream_too_sparse_in_any_unit_is_doubted(tmp_path):
    columns = COLUMNS | {"t": [0, 10**12, 3 * 10**12]}
    path = saved(tmp_path / "a.npz", columns, width=4, height=3)
    assert (
        "1e-06 events a second over the whole image are few"
        in read_events(path).notes[0]
    )
    # a file that states its unit by its format may be sparse
    path = saved(tmp_path / "b.npz", columns, width=4, height=3, t_offset=0)
    assert not read_events(path).notes


def test_dat_files_of_prophesee_are_read(tmp_path):
    path = tmp_path / "a.dat"
    head = b"% Data file containing CD events\n% Version 2\n% Height 3\n% Width 4\n"
    t = np.array([0, 40, 999 + (1 << 32)])  # its counter begins again
    word = np.array(COLUMNS["x"]) | np.array(COLUMNS["y"]) << 14
    word |= np.array(COLUMNS["p"]) << 28
    data = np.stack([t, word], axis=1).astype(np.uint32).tobytes()
    path.write_bytes(head + b"\x0c\x08" + data)
    found = read_events(path)
    assert (found.width, found.height) == (4, 3)
    for name, column in COLUMNS.items():
        assert getattr(found, name).tolist() == column
    path.write_bytes(head + b"\x0c\x08" + data[:-3])
    refused(path, "expected a complete DAT file, got 5 of the 8 bytes")
    path.write_bytes(head + b"\x0e\x08" + data)
    refused(path, "of CD events of 8 bytes")


def test_files_that_declare_more_than_they_contain_are_refused(tmp_path):
    path = tmp_path / "large.h5"
    with h5py.File(path, "w") as file:
        for name in "xytp":
            file.create_dataset(
                f"events/{name}", (3 * 10**9,), np.int64, chunks=(1 << 16,)
            )
    refused(path, r"got one of [\d,]+ bytes that declares 24,000,000,000 bytes")
    zeros = np.zeros(5 * 10**6, np.int64)
    np.savez_compressed(tmp_path / "large.npz", x=zeros, y=zeros, t=zeros, p=zeros)
    refused(tmp_path / "large.npz", r"bytes that declares 160,000,\d+ bytes of numbers")
    with h5py.File(path, "w") as file:
        for name in "xytp":
            file[f"events/{name}"] = h5py.ExternalLink("other.h5", name)
    refused(path, r"expected a complete \.h5 file of events, which cannot be read")
    saved(path, COLUMNS, width=60000, height=60000)
    refused(path, "expected an image of 1 to 16,777,216 pixels, got 60000 x 60000")
