"""What glitters from the beginning, or is blown up, is no blast."""

import numpy as np
import pytest

from jblast.signals.flash import detect_flashes
from jblast.signals.flash.search import (
    GROWS_ON,
    SAME_AS_REJECTED,
    SPARKLE,
    flash_threshold,
)

SHAPE = 60, 90
_Y, _X = np.mgrid[: SHAPE[0], : SHAPE[1]]


def searched(light, rate_hz=1000.0):
    times = np.arange(len(light)) / rate_hz
    blocks = [(times[a : a + 16], light[a : a + 16]) for a in range(0, len(times), 16)]
    return detect_flashes(blocks, rate_hz, flash_threshold(1.0))


def filmed(rng, light):
    """Frames of 8 bits with the noise of a sensor."""
    light = np.asarray(light)
    noisy = light + 0.01 * rng.standard_normal(light.shape)
    return (np.rint(255 * np.clip(noisy, 0.0, 1.0)) / 255).astype(np.float32)


def glitter(seed, frames=110, facets=800, share=0.1):
    """Facets of water that show the sun 5 frames on average, from the first frame on.

    A telegraph process at each of some places: stationary, no outline grows.
    """
    rng = np.random.default_rng(seed)
    behind = 0.15 + 0.05 * rng.random((80, 120))
    rows, columns = rng.integers(30, 78, facets), rng.integers(8, 110, facets)
    on, light = rng.random(facets) < share, []
    for _ in range(frames):
        draws = rng.random(facets)
        on = np.where(on, draws > 0.2, draws < 0.2 * share / (1.0 - share))
        image = behind.copy()
        for row, column in zip(rows[on], columns[on], strict=True):
            image[row : row + 2, column : column + 2] = 1.0
        light.append(image)
    return filmed(rng, light)


def growing_disc(radius, frames=115, bright=0.8):
    """Film of a disc with a radius for each number of frames since frame 30."""
    rng = np.random.default_rng(0)
    behind = 0.2 + 0.05 * rng.random(SHAPE)
    light = []
    for k in range(frames):
        size = radius(k - 30.0) if k >= 30 else 0.0
        away = np.hypot(_X - 45.0, _Y - 30.0)
        cover = np.clip(size + 0.5 - away, 0.0, 1.0) * (size > 0.0)
        light.append(behind + cover * (bright - behind))
    return filmed(rng, light)


def test_glitter_that_is_there_from_the_first_frame_on_is_no_blast():
    seen = [searched(glitter(seed)) for seed in (0, 1, 2)]
    assert not any(one.flashes for one in seen)
    reasons = [rejected.reason for one in seen for rejected in one.rejected]
    # without the check these are blasts
    assert SPARKLE in reasons
    assert {*reasons} <= {SPARKLE, SAME_AS_REJECTED}


# from 4 px on by the cube root the slope, 0.28, is that of the slowest fireball, 0.22,
# within the errors of such radii
@pytest.mark.parametrize(
    ("first", "power"),
    [(0.0, 1.0), (0.0, 1 / 2), (0.0, 1 / 3), (4.0, 1.0), (4.0, 1 / 2)],
)
def test_a_balloon_that_is_blown_up_is_no_blast(power, first):
    def radius(since):
        return first + (28.0 - first) * min(since / 110.0, 1.0) ** power

    seen = searched(growing_disc(radius))
    assert not seen.flashes
    assert seen.rejected[0].reason in (GROWS_ON, SPARKLE)
    assert {one.reason for one in seen.rejected[1:]} <= {SAME_AS_REJECTED}


@pytest.mark.parametrize("rate_hz", [30.0, 240.0])
def test_a_balloon_in_a_slow_film_is_no_blast(rate_hz):
    seen = searched(growing_disc(lambda since: min(0.5 * since, 28.0)), rate_hz)
    assert not seen.flashes


@pytest.mark.parametrize("tau", [1.0, 4.0, 10.0, 18.0])
def test_fireballs_of_up_to_a_tonne_are_blasts(tau):
    def radius(since):
        return -26.0 * np.expm1(-since / tau)

    seen = searched(growing_disc(radius, bright=1.0))
    assert [flash.frame for flash in seen.flashes] == [31]
    assert not seen.rejected


def test_a_fireball_of_another_law_is_a_blast():
    # a strong blast's power of 0.4 (Taylor 1950) that ends after 12 ms
    seen = searched(growing_disc(lambda since: 26.0 * min(since / 12.0, 1.0) ** 0.4))
    assert [flash.frame for flash in seen.flashes] == [31]


def test_a_fireball_in_the_dark_is_a_blast():
    # the logarithm of 0.02 of full scale is noisy: a tenth of all pixels at any time
    # change by more than a quarter
    rng, light = np.random.default_rng(0), []
    for k in range(115):
        size = -13.0 * np.expm1(-max(k - 30.0, 0.0) / 4.0)
        cover = np.clip(size + 0.5 - np.hypot(_X - 45.0, _Y - 30.0), 0.0, 1.0)
        light.append(0.02 + cover * (size > 0.0) * 0.98)
    seen = searched(filmed(rng, light))
    assert [flash.frame for flash in seen.flashes] == [31]
    assert not seen.rejected
