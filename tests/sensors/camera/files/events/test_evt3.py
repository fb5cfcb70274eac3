"""EVT 3.0 read and written, against decoders of others."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.files.event_files import read_events, write_events
from jblast.sensors.camera.files.evt3 import BLOCK
from tests.sensors.camera.files.events.test_read import events_of

HEADER = b"% evt 3.0\n% format EVT3;height=480;width=640\n% end\n"


def decoded(path: Path) -> np.ndarray:
    """x, y, t, p of a file, word by word as the maker's page tells; no vectors."""
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


def written(path, *blocks, width=640, height=480) -> Path:
    write_events(path, [events_of(*block) for block in blocks], width, height)
    return path


def random_events(count: int, last_us: int) -> list[np.ndarray]:
    rng = np.random.default_rng(count)
    t = np.sort(rng.integers(0, last_us, count))
    return [rng.integers(0, 640, count), rng.integers(0, 480, count), t, t % 2]


def test_another_decoder_finds_the_same_events_over_minutes(tmp_path):
    columns = random_events(2000, 300 * 10**6)  # the time's 24 bits last 17 s
    halves = [c[:999] for c in columns], [c[999:] for c in columns]
    path = written(tmp_path / "a.raw", *halves)
    np.testing.assert_array_equal(decoded(path), columns)


def test_expelliarmus_finds_the_same_places_and_signs(tmp_path):
    # in a process of its own: it prints, and its times are off by steps of 4,096 us
    columns = random_events(2000, 4 * 10**6)
    path = written(tmp_path / "a.raw", columns)
    script = (
        "import sys, numpy, expelliarmus\n"
        "events = expelliarmus.Wizard('evt3').read(sys.argv[1])\n"
        "numpy.save(sys.argv[2], numpy.array([events[n] for n in 'xytp']))\n"
    )
    out = tmp_path / "a.npy"
    words = [sys.executable, "-c", script, str(path), str(out)]
    subprocess.run(words, check=True, capture_output=True)
    x, y, t, p = np.load(out)
    for found, name in ((x, 0), (y, 1), (p, 3)):
        np.testing.assert_array_equal(found, columns[name])
    np.testing.assert_array_equal(t % 4096, columns[2] % 4096)


def test_a_block_of_words_begins_where_the_last_one_ended(tmp_path):
    count = BLOCK // 2  # five words an event
    columns = random_events(count, 60 * 10**6)
    found = read_events(written(tmp_path / "a.raw", columns))
    for name, expected in zip("xytp", columns, strict=True):
        np.testing.assert_array_equal(getattr(found, name), expected)


def saved(path, *words: int, header: bytes = HEADER) -> Path:
    path.write_bytes(header + np.array(words, "<u2").tobytes())
    return path


def test_vectors_of_a_camera_are_taken_apart(tmp_path):
    path = saved(
        tmp_path / "a.raw",
        *(0x8123, 0x6004, 0x0010),  # 0x123 * 4096 + 4 us, row 16
        *(0x3805, 0x4801, 0x5081),  # from column 5 on, brighter: 5, 16, then 17, 24
        *(0x8123, 0xA001, 0x6007),  # the step again, a trigger, 3 us later
        *(0x2007, 0x3064, 0x5001),  # column 7, then 100, darker
        *(0x8124, 0x2008),  # a new step begins at 0
    )
    found = read_events(path)
    base = 0x123 * 4096
    assert found.x.tolist() == [5, 16, 17, 24, 7, 100, 8]
    assert set(found.y.tolist()) == {16}
    expected = [base + 4] * 4 + [base + 7] * 2 + [base + 4096]
    assert found.t.tolist() == expected
    assert found.p.tolist() == [1, 1, 1, 1, 0, 0, 0]
    assert (found.width, found.height) == (640, 480)


@pytest.mark.parametrize(
    ("high", "expected"),
    [
        ((0xFFF, 0x000), [0xFFF, 0x1000]),  # began again
        ((0x900, 0x0FF), [0x900, 0x10FF]),  # with steps left out
        ((0x000, 0xFFF), [0x000, 0xFFF]),
    ],
)
def test_upper_bits_that_fall_by_half_their_range_began_again(tmp_path, high, expected):
    first, second = (0x8000 | step for step in high)
    words = (first, 0x6000, 0x0000, 0x2001, second, 0x6000, 0x2001)
    found = read_events(saved(tmp_path / "a.raw", *words))
    assert (found.t // 4096).tolist() == expected


@pytest.mark.parametrize(
    ("header", "words", "said"),
    [
        (b"% evt 2.1\n% end\n", (), "EVT 3.0 or EVT 2.0 file, got one of '2.1'"),
        (b"", (0x8000,), "the header of an EVT 3.0 or EVT 2.0 file, got none"),
        (
            HEADER,
            (0x8000, 0xC000),
            "words of EVT 3.0, got some of the unknown type 0xc",
        ),
        (b"% evt 3.0\n", (0x8000,), "expected the width and height of the image"),
        (b"% evt 3.0\n% endianness big\n", (), "expected little-endian words"),
        (HEADER, (0x8002, 0x6000, 0x0000, 0x2001, 0x8001, 0x2001), "order of time"),
        (HEADER, (0x8000, 0x6000, 0x01E0, 0x2001), "y of event 0: expected 0 to 479"),
    ],
)
def test_what_is_no_evt3_is_refused(tmp_path, header, words, said):
    path = saved(tmp_path / "a.raw", *words, header=header)
    with pytest.raises(InputError, match=rf"a\.raw: .*{said}"):
        read_events(path)


def test_evt2_of_a_camera_is_read_beyond_its_28_bits(tmp_path):
    """Words by the maker's page: kind, 6 bits of time, column, row."""
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


def test_large_images_and_days_without_an_event_do_not_fit(tmp_path):
    with pytest.raises(InputError, match=r"images of at most 2,048 pixels per side"):
        written(tmp_path / "a.raw", ([0], [0], [0], [1]), width=2049)
    with pytest.raises(InputError, match="at most 24 hours between two events"):
        written(tmp_path / "a.raw", ([0, 0], [0, 0], [0, 10**11], [1, 1]))
    assert [*tmp_path.iterdir()] == []
