"""Images come back exactly; others are refused by name."""

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from jblast.errors import InputError
from jblast.sensors.camera.files.images import (
    frame_and_bits,
    frame_files,
    read_colours,
    read_depth,
    read_pictures,
    read_png,
    read_webp,
    write_png,
)
from jblast.sensors.camera.geometry import pixel_rays
from tests.sensors.camera.fireball_scenes import small_camera

# by hand from IEC 61966-2-1: 12.92 x below 0.0031308, 1.055 x^(1/2.4) - 0.055 above
LIGHT = np.array([-1.0, 0.0, 0.001, 0.18, 0.5, 1.0, 7.0])
VALUES = [0, 0, 3, 118, 188, 255, 255]
CAMERA = small_camera((0.0, -60.0, 2.0), (0.0, 0.0, 2.0))
RGB, GREY_ALPHA, RGBA = 2, 4, 6


def chunk(name: bytes, data: bytes) -> bytes:
    crc = struct.pack(">I", zlib.crc32(name + data))
    return struct.pack(">I", len(data)) + name + data + crc


def deep_png(values: np.ndarray, kind: int) -> bytes:
    """Return a PNG of 16 bits per channel, without filters."""
    height, width = values.shape[:2]
    lines = b"".join(b"\0" + row.astype(">u2").tobytes() for row in values)
    head = struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0)
    parts = (b"IHDR", head), (b"IDAT", zlib.compress(lines)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


@pytest.mark.parametrize(("kind", "channels"), [(RGB, 3), (GREY_ALPHA, 2), (RGBA, 4)])
def test_colours_of_16_bits_keep_all_of_them(tmp_path, kind, channels):
    steps = np.random.default_rng(0).integers(0, 3000, (11, 14, channels))
    values = (np.cumsum(steps, axis=1) % 65536).astype(np.uint16)
    path = tmp_path / "a.png"
    path.write_bytes(deep_png(values, kind))
    np.testing.assert_array_equal(read_png(path), values)
    if kind != RGB:
        upper = read_pictures([path])[0][..., -channels:]
        np.testing.assert_array_equal(upper, values >> 8)


def test_light_is_clipped_and_written_as_srgb(tmp_path):
    path = tmp_path / "a.png"
    write_png(path, np.stack([LIGHT] * 3, axis=-1)[None])
    np.testing.assert_array_equal(read_png(path)[0, :, 1], VALUES)
    # half a step of 8 bits is at most 0.0045 of light
    np.testing.assert_allclose(read_colours(path)[0, 1:6, 0], LIGHT[1:6], atol=0.0045)
    write_png(path, LIGHT[None, :, None])
    np.testing.assert_array_equal(frame_and_bits(path)[0][0], VALUES)
    assert read_colours(path).shape == (1, 7, 3)


def test_grey_of_16_bits_becomes_light(tmp_path):
    values = np.array([[0, 1000, 65535]], np.uint16)
    Image.fromarray(values).save(tmp_path / "a.png")
    light, bits = frame_and_bits(tmp_path / "a.png")
    np.testing.assert_allclose(light, values / 65535)
    srgb, _ = frame_and_bits(tmp_path / "a.png", srgb=True)
    np.testing.assert_allclose(srgb[0], [0.0, 1000 / 65535 / 12.92, 1.0])
    assert bits == 16


def test_alpha_stays_linear(tmp_path):
    path, image = tmp_path / "a.png", np.full((2, 3, 4), 0.5)
    write_png(path, image)
    np.testing.assert_array_equal(read_png(path)[0, 0], [188, 188, 188, 128])
    np.testing.assert_array_equal(image, 0.5)  # not written into
    with pytest.raises(InputError, match="expected an opaque frame"):
        read_colours(path)


def test_webp_keeps_colours_below_transparent_pixels(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 4), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.webp", lossless=True, exact=True)
    np.testing.assert_array_equal(read_webp(tmp_path / "a.webp"), pixels)


@pytest.mark.parametrize("name", ["wall.png", "wall.npy"])
def test_depth_along_the_axis_becomes_distance_along_rays(tmp_path, name):
    metres = np.full((18, 24), 21.5)
    metres[3, 4] = np.inf
    if name == "wall.npy":
        np.save(tmp_path / name, metres)
    else:
        millimetres = np.where(np.isinf(metres), 0.0, 1e3 * metres).astype(np.uint16)
        Image.fromarray(millimetres).save(tmp_path / name)
    depth = read_depth(tmp_path / name, CAMERA)
    assert np.argwhere(np.isinf(depth)).tolist() == [[3, 4]]
    north = np.asarray(pixel_rays(CAMERA, ground=False).direction)[1]
    np.testing.assert_allclose(depth * north, metres, rtol=1e-12)


def numbered(folder, *names):
    for name in names:
        write_png(folder / f"{name}.png", np.zeros((2, 2, 1)))
    return folder


def test_frames_are_ordered_by_the_numbers_in_their_names(tmp_path):
    names = [path.stem for path in frame_files(numbered(tmp_path, "b10", "b9", "b8"))]
    assert names == ["b8", "b9", "b10"]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("0", "1", "3", "4"), r"d: expected frame 2 after 1\.png, got 3\.png"),
        (("01", "1", "2"), r"1\.png: expected one frame per number, got two"),
        (("1",), "d: expected at least two PNG frames, got 1"),
    ],
)
def test_missing_and_repeated_frames_are_named(tmp_path, names, message):
    (tmp_path / "d").mkdir()
    with pytest.raises(InputError, match=message):
        frame_files(numbered(tmp_path / "d", *names))
    with pytest.raises(InputError, match=r"none: expected a directory .*got no such"):
        frame_files(tmp_path / "none")


def png(mode="RGBA", share=1.0):
    def save(path):
        Image.new(mode, (24, 18)).save(path)
        data = path.read_bytes()
        path.write_bytes(data[: int(share * len(data))])

    return save


def deep(share):
    values = np.random.default_rng(0).integers(0, 65536, (18, 24, 3))
    data = deep_png(values, RGB)
    return lambda path: path.write_bytes(data[: int(share * len(data))])


def array(values, **options):
    return lambda path: np.save(path, values, **options)


def depth(path):
    return read_depth(path, CAMERA)


FULL = np.full((18, 24), 1.0)
REFUSED = [
    (read_png, "b.png", lambda path: None, "no such file; expected a complete PNG"),
    (read_png, "a.png", lambda path: path.write_bytes(b"GIF89a"), "got something else"),
    (read_png, "a.png", png(share=0.7), "expected a complete PNG image"),
    (read_png, "a.png", deep(0.9), "expected a complete PNG image"),
    (read_webp, "a.webp", lambda path: None, "no such file; expected a complete WebP"),
    (read_webp, "a.webp", lambda path: path.write_bytes(b"RIFF0000WAVE"), "something"),
    (read_webp, "a.webp", png(share=0.7), "expected a complete WebP image"),
    (read_webp, "a.webp", png("RGB"), "an image with alpha, got RGB"),
    (frame_and_bits, "a.npy", array(np.ones((3, 4, 2))), r"got shape \(3, 4, 2\)"),
    (frame_and_bits, "a.npy", array([[1, 2]]), "expected an array of floats, got int"),
    (frame_and_bits, "a.npy", array([{}], allow_pickle=True), "an array of floats, wh"),
    (depth, "a.npy", array(np.ones((18, 23))), "expected 24 x 18 .* has, got 23 x 18"),
    (depth, "a.npy", array(-FULL), "above 0 m, got -1 at row 0, column 0"),
    (depth, "a.npy", array(np.nan * FULL), "above 0 m, got nan at row 0, column 0"),
    (depth, "a.npy", array(np.ones((18, 24, 3))), r"metres, got .*\(18, 24, 3\)"),
    (depth, "a.npy", lambda path: path.write_bytes(b"none"), "expected an array of"),
    (depth, "a.png", png("L"), "a grey PNG of 16 bits.*got 8 bits"),
    (depth, "a.png", deep(1.0), r"a grey PNG of 16 bits.*shape \(18, 24, 3\)"),
]


@pytest.mark.parametrize(("read", "name", "made", "message"), REFUSED)
def test_other_images_are_refused_by_name(tmp_path, read, name, made, message):
    made(tmp_path / name)
    with pytest.raises(InputError, match=rf"{name}: .*({message})|{message}"):
        read(tmp_path / name)
