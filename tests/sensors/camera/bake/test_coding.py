import numpy as np
from hypothesis import given, settings, strategies

from jblast.sensors.camera.bake.coding import (
    AIR_TEMPERATURE,
    REFERENCE_TEMPERATURE,
    Layers,
    columns_for,
    frames_of_sheet,
    heat_of_light,
    light_of_heat,
    sheet,
    sheet_layout,
)
from jblast.sensors.camera.image import blackbody_xyz


def drawn(number: int, size: int, seed: int = 0) -> list[Layers]:
    draw = np.random.default_rng(seed)
    return [
        Layers(
            draw.uniform(0.0, 1.0, (size, size)),
            draw.uniform(0.0, 1.0, (size, size, 3)),
            draw.uniform(0.1, 1.0, (size, size)),
        )
        for _ in range(number)
    ]


@given(heat=strategies.floats(0.05, 1.0))
def test_light_of_heat_is_coded_as_that_heat(heat):
    np.testing.assert_allclose(
        heat_of_light(light_of_heat(np.array([heat]))), heat, rtol=1e-9
    )


def test_nothing_emitted_is_hardly_any_heat_and_the_reference_is_one():
    heat = heat_of_light(np.array([0.0, 1.0, 7.0]))
    # what cannot be told from nothing: 1e-30 of the reference, which nobody sees
    assert 0.0 <= heat[0] < 0.02
    np.testing.assert_allclose(heat[1:], 1.0, rtol=1e-12)


def test_heat_means_a_black_body_of_its_temperature():
    """Within the 9 % that the docstring states of Wien's law at one wavelength."""
    temperature = np.linspace(1100.0, REFERENCE_TEMPERATURE, 23)
    span = REFERENCE_TEMPERATURE - AIR_TEMPERATURE
    coded = light_of_heat((temperature - AIR_TEMPERATURE) / span)
    luminance = np.asarray(blackbody_xyz(temperature))[:, 1]
    np.testing.assert_allclose(coded, luminance / luminance[-1], rtol=0.09)


@settings(deadline=None, max_examples=20)
@given(number=strategies.integers(1, 12), size=strategies.integers(2, 9))
def test_frames_come_back_from_a_sheet_within_its_eight_bits(number, size):
    frames = drawn(number, size)
    for columns in {1, columns_for(number), number}:
        found = frames_of_sheet(sheet(frames, columns), size, number)
        for frame, back in zip(frames, found, strict=True):
            half = 0.5 / 255 + 1e-9
            np.testing.assert_allclose(back.heat, frame.heat, atol=half)
            np.testing.assert_allclose(back.alpha, frame.alpha, atol=half)
            # the slope of sRGB's curve is at most 2.3
            np.testing.assert_allclose(back.shade, frame.shade, atol=2.3 * half)


def test_a_sheet_is_two_halves_of_the_same_tiles():
    picture = sheet(drawn(5, 4), 3)
    assert picture.shape == (2 * 2 * 4, 3 * 4, 4)
    assert sheet_layout(picture.shape, 4) == (3, 2)
    assert (picture[:8, :, 3] == 255).all()  # heat is opaque
    assert (picture[:8, :, 0] == picture[:8, :, 2]).all()  # and grey
    assert (picture[12:, 8:] == 0).all()  # the sixth tile is empty


def test_a_sheet_of_many_frames_is_about_square():
    for number in (1, 10, 40, 60):
        columns = columns_for(number)
        rows = 2 * -(-number // columns)
        assert 0.5 <= columns / rows <= 1.5


def test_where_nothing_is_no_heat_is_written():
    frame = Layers(np.ones((2, 2)), np.ones((2, 2, 3)), np.zeros((2, 2)))
    assert (sheet([frame], 1)[:2, :, :3] == 0).all()
