import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.bake.coding import read_exr
from tests.sensors.camera.bake.exr_file import exr_bytes

CHANNELS = {
    name: np.random.default_rng(7).normal(size=(4, 6)).astype(np.float32).tolist()
    for name in "RGBA"
}


def test_channels_come_back_as_they_were_written(tmp_path):
    path = tmp_path / "picture.exr"
    path.write_bytes(exr_bytes(CHANNELS))
    found = read_exr(path)
    assert set(found) == set("RGBA")
    for name, rows in CHANNELS.items():
        np.testing.assert_array_equal(found[name], np.array(rows, np.float32))


def test_every_cut_of_a_file_is_refused_by_name(tmp_path):
    whole, path = exr_bytes(CHANNELS), tmp_path / "cut.exr"
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"cut\.exr: expected"):
            read_exr(path)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (exr_bytes(CHANNELS, compression=3), "it is compressed"),
        (b"\x89PNG and so on", "got something else"),
        (b"", "got something else"),
        (b"\x76\x2f\x31\x01" + b"\xff" * 400, "cannot be read"),
    ],
)
def test_another_file_is_refused(tmp_path, data, words):
    (tmp_path / "a.exr").write_bytes(data)
    with pytest.raises(InputError, match=words):
        read_exr(tmp_path / "a.exr")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.exr"):
        read_exr(tmp_path / "none.exr")
