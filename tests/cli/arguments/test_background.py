"""The word after `--background`."""

import numpy as np
import pytest

from jblast.cli.arguments.background import background_named
from jblast.errors import InputError
from jblast.scene import Camera
from jblast.sensors.camera.files.png import write_png

EYE = Camera(
    position=np.array([0.0, -40.0, 2.0]),
    quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
    focal=np.full(2, 30.0),
    center=np.array([15.5, 11.5]),
    width=32,
    height=24,
)


def test_it_may_be_light_an_image_or_an_image_a_frame(tmp_path):
    assert background_named("0.25", EYE, 4) == 0.25
    colour = background_named("0.1, 0.2,0.3", EYE, 4)
    np.testing.assert_array_equal(np.asarray(colour), [0.1, 0.2, 0.3])
    files = tuple(tmp_path / f"{k}.png" for k in range(5))
    for k, file in enumerate(files):
        write_png(file, np.full((24, 32, 3), 0.2 * k))
    image = background_named(str(files[3]), EYE, 4)
    # half a step of 8 bits is at most 0.0045 of light
    np.testing.assert_allclose(
        np.asarray(image), np.full((24, 32, 3), 0.6), atol=0.0045
    )
    assert background_named(str(tmp_path), EYE, 4) == files[:4]


@pytest.mark.parametrize("text", ["1,2", "-0.1", "2", "nan", "0.1,0.2,0.3,0.4", "sky"])
def test_a_word_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="--background: expected"):
        background_named(text, EYE, 2)


def test_files_of_another_size_and_too_few_are_refused(tmp_path):
    for k in range(2):
        write_png(tmp_path / f"{k}.png", np.zeros((24, 31, 3)))
    with pytest.raises(InputError, match=r"0\.png: expected 32 x 24 .*got 31 x 24"):
        background_named(str(tmp_path / "0.png"), EYE, 2)
    with pytest.raises(InputError, match=r"expected at least 3 frames.*got 2"):
        background_named(str(tmp_path), EYE, 3)
