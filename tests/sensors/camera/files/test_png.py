from fractions import Fraction

import av
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.files import images
from jblast.sensors.camera.files.images import (
    frame_and_bits,
    read_colours,
    read_png,
    write_png,
)

# by hand from IEC 61966-2-1: 12.92 x below 0.0031308, 1.055 x^(1/2.4) - 0.055 above
LIGHT = np.array([-1.0, 0.0, 0.001, 0.18, 0.5, 1.0, 7.0])
VALUES = [0, 0, 3, 118, 188, 255, 255]


def test_light_is_clipped_and_written_as_srgb(tmp_path):
    path = tmp_path / "0000.png"
    write_png(path, np.stack([LIGHT] * 3, axis=-1)[None])
    np.testing.assert_array_equal(read_png(path)[0, :, 1], VALUES)
    light = read_colours(path)[0, 1:6, 0]
    # half a step of 8 bits is at most 0.0045 of light
    np.testing.assert_allclose(light, LIGHT[1:6], atol=0.0045)


def test_alpha_stays_linear(tmp_path):
    path = tmp_path / "0000.png"
    image = np.full((2, 3, 4), 0.5)
    write_png(path, image)
    np.testing.assert_array_equal(read_png(path)[0, 0], [188, 188, 188, 128])
    np.testing.assert_array_equal(image, 0.5)  # not written into
    with pytest.raises(InputError, match="expected an opaque frame"):
        read_colours(path)


def test_grey_is_one_channel_and_is_read_as_three(tmp_path):
    path = tmp_path / "0000.png"
    write_png(path, LIGHT[None, :, None])
    np.testing.assert_array_equal(frame_and_bits(path)[0][0], VALUES)
    assert read_colours(path).shape == (1, 7, 3)


def test_what_cannot_be_read_is_named(tmp_path):
    (tmp_path / "a.png").write_bytes(b"GIF89a")
    with pytest.raises(InputError, match=r"a\.png: expected a PNG image"):
        images.read_png(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"b\.png: .*No such file"):
        images.read_png(tmp_path / "b.png")


@pytest.mark.parametrize("filters", ["none", "sub", "up", "avg", "paeth", "mixed"])
@pytest.mark.parametrize("kind", ["rgb48", "rgba64", "ya16"])
def test_colours_of_16_bits_keep_all_of_them(tmp_path, filters, kind):
    path, rng = tmp_path / "a.png", np.random.default_rng(0)
    channels = {"rgb48": 3, "rgba64": 4, "ya16": 2}[kind]
    steps = rng.integers(0, 3000, (9, 14, channels))
    values = (np.cumsum(steps, axis=1) % 65536).astype(np.uint16)
    path.write_bytes(encoded(values, f"{kind}be", filters))
    np.testing.assert_array_equal(read_png(path), values)
    path.write_bytes(path.read_bytes()[:90])
    with pytest.raises(InputError, match=r"a\.png: expected a complete PNG image"):
        read_png(path)


def encoded(values: np.ndarray, kind: str, filters: str) -> bytes:
    """Return a PNG by FFmpeg's encoder."""
    coder = av.CodecContext.create("png", "w")
    coder.height, coder.width = values.shape[:2]
    coder.pix_fmt, coder.time_base = kind, Fraction(1, 1)
    coder.options = {"pred": filters}
    frame = av.VideoFrame(coder.width, coder.height, kind)
    plane = frame.planes[0]
    lines = np.zeros((coder.height, plane.line_size), np.uint8)
    packed = values.astype(">u2").view(np.uint8).reshape(coder.height, -1)
    lines[:, : packed.shape[1]] = packed
    plane.update(lines.tobytes())
    packets = [*coder.encode(frame), *coder.encode(None)]
    return b"".join(bytes(packet) for packet in packets)
