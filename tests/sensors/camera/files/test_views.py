import numpy as np
import pytest
from PIL import Image

from jblast.errors import InputError
from jblast.sensors.camera.files.views import read_views
from jblast.waves.fireball import fireball_duration

TOP = "frames_hz = 30.0\nmetres_per_pixel = 0.05\ncharge_mass_kg = 5.0\n"
SOUTH = '[[view]]\nframes = "south"\nazimuth_deg = 180.0\n'


def save(path, value=0, size=(4, 6), channels=4):
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.full((*size, channels), value, np.uint8)).save(path)


@pytest.fixture
def folder(tmp_path):
    for name in ("south", "high"):
        for k in range(3):
            save(tmp_path / name / f"{k:04d}.png", 10 * k)

    def indexed(text):
        (tmp_path / "views.toml").write_text(text)
        return tmp_path

    return indexed


def test_an_index_says_where_each_view_was_taken_from(folder):
    high = (
        '[[view]]\nframes = ["high/0000.png", "high/0002.png", "high/0001.png"]\n'
        "direction = [0, 0, 2]\nmetres_per_pixel = 0.1\nanchor_px = [1, 3]\n"
    )
    east = '[[view]]\nframes = "south"\nazimuth_deg = 90\nelevation_deg = 30\n'
    views = read_views(folder(TOP + "srgb = false\n" + SOUTH + high + east))
    np.testing.assert_allclose(
        views.direction, [[0, -1, 0], [0, 0, 1], [0.75**0.5, 0, 0.5]], atol=1e-15
    )
    # pixels of 1 m/kg^(1/3)
    scale = 5.0 ** (1 / 3) / np.array([0.05, 0.1, 0.05])
    np.testing.assert_allclose(views.radius, np.tile(scale[:, None], 4))
    np.testing.assert_array_equal(views.anchor, [[2.5, 1.5], [1, 3], [2.5, 1.5]])
    np.testing.assert_array_equal(
        views.frames[:, :, 0, 0, 1],
        # linear light of 8 bits as sRGB, and a blank frame
        [[0, 56, 79, 0], [0, 79, 56, 0], [0, 56, 79, 0]],
    )
    assert views.frames.shape == (3, 4, 4, 6, 5)
    np.testing.assert_allclose(
        views.up, [[0, 0, 1], [0, 1, 0], [-0.5, 0, 0.75**0.5]], atol=1e-15
    )
    life = float(fireball_duration(5.0))
    np.testing.assert_allclose(views.phase, np.arange(4) / 30.0 / life)
    assert not views.hot


def test_the_up_of_a_picture_may_be_said_or_follows_from_the_azimuth(folder):
    east = '[[view]]\nframes = "high"\nazimuth_deg = 90\nelevation_deg = 90\n'
    turned = SOUTH + "up = [3, 4, 0]\n"
    views = read_views(folder(TOP + east + turned))
    # looking down from the east, north is to the right and west is up
    np.testing.assert_allclose(views.up, [[-1, 0, 0], [1, 0, 0]], atol=1e-15)


BAD = {
    "no frame rate": (SOUTH, "frames_hz: expected a positive number"),
    "no mass": (
        TOP.replace("charge_mass_kg = 5.0", "") + SOUTH,
        r"charge_mass_kg: expected the TNT .* write charge_mass_kg = 5\.0 above",
    ),
    "up along the view": (TOP + SOUTH + "up = [0, 1, 0]\n", "up: expected a vector"),
    "no scale": (
        "frames_hz = 30\ncharge_mass_kg = 5\n" + SOUTH,
        r"\[\[view\]\] 1 metres_per_pixel",
    ),
    "no views": (TOP, r"written \[\[view\]\], got none"),
    "unknown key": (TOP + "fps = 3\n" + SOUTH, "'fps': unknown key"),
    "misspelt key": (TOP + SOUTH + "azimut_deg = 1\n", "did you mean azimuth_deg"),
    "no direction": (TOP + '[[view]]\nframes = "south"\n', "azimuth_deg.*got neither"),
    "two directions": (TOP + SOUTH + "direction = [1, 0, 0]\n", "direction, got both"),
    "no length": (
        TOP + '[[view]]\nframes = "south"\ndirection = [0, 0, 0]\n',
        "not zero, got",
    ),
    "too high": (TOP + SOUTH + "elevation_deg = 91\n", "between -90 and 90, got 91"),
    "no such folder": (
        TOP + SOUTH.replace("south", "w"),
        "w: expected a directory .*got no such directory",
    ),
    "no frames": (TOP + "[[view]]\nazimuth_deg = 1\n", "a list of PNG files, got None"),
    "a missing file": (
        TOP + '[[view]]\nazimuth_deg = 0\nframes = ["a.png"]\n',
        "a.png: no such file",
    ),
}


@pytest.mark.parametrize(("text", "said"), BAD.values(), ids=BAD)
def test_an_index_that_cannot_be_used_is_refused(folder, text, said):
    with pytest.raises(InputError, match=said) as refused:
        read_views(folder(text))
    assert str(folder(text)) in str(refused.value)


def test_a_set_without_an_index_is_refused(folder, tmp_path):
    with pytest.raises(InputError, match=r"has no index; .* with views\.toml"):
        read_views(tmp_path)
    with pytest.raises(InputError, match="no such directory"):
        read_views(tmp_path / "nowhere")


HIGH = '[[view]]\nframes = "high"\nazimuth_deg = 0\n'
SPOILT = {
    "no alpha": ("south/0001.png", {"channels": 3}, r"south/0001\.png: .*alpha"),
    "a missing frame": ("south/0004.png", {}, "south: expected frame 3 after 0002"),
    "another size": (
        "south/0002.png",
        {"size": (5, 6)},
        r"0002\.png: expected 6 x 4 .*got 6 x 5",
    ),
    "another number": ("high/0003.png", {}, "2 frames: expected 3 frames .*got 4"),
}


@pytest.mark.parametrize(("name", "how", "said"), SPOILT.values(), ids=SPOILT)
def test_frames_that_do_not_fit_are_named(folder, tmp_path, name, how, said):
    save(tmp_path / name, **how)
    with pytest.raises(InputError, match=said):
        read_views(folder(TOP + SOUTH + HIGH))


@pytest.mark.parametrize("kept", [0, 60])
def test_a_corrupt_frame_is_named(folder, tmp_path, kept):
    path = tmp_path / "south" / "0001.png"
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(InputError, match=r"south/0001\.png: expected a"):
        read_views(folder(TOP + SOUTH))
