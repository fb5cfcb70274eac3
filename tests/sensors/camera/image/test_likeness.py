"""Likeness of pictures, held against the definition written out."""

import numpy as np
import pytest

from jblast.sensors.camera.image import psnr, ssim, structural_similarity


@pytest.fixture
def pair():
    draw = np.random.default_rng(0)
    one = draw.random((24, 31))
    return one, np.clip(one + 0.1 * draw.normal(size=one.shape), 0.0, 1.0)


def all_of(image):
    return np.ones(image.shape, bool)


def test_structure_is_that_of_the_equation_about_one_pixel(pair):
    """Wang et al. (2004), eq. 13, with the sums of eqs. 14 to 16 written out."""
    one, other = pair
    row, column = 12, 15
    step = np.arange(-5, 6)
    weight = np.exp(-(step[:, None] ** 2 + step[None] ** 2) / (2 * 1.5**2))
    weight /= weight.sum()
    x, y = (p[row - 5 : row + 6, column - 5 : column + 6] for p in pair)
    mx, my = np.sum(weight * x), np.sum(weight * y)
    vx, vy = np.sum(weight * (x - mx) ** 2), np.sum(weight * (y - my) ** 2)
    both = np.sum(weight * (x - mx) * (y - my))
    expected = (2 * mx * my + 1e-4) * (2 * both + 9e-4)
    expected /= (mx**2 + my**2 + 1e-4) * (vx + vy + 9e-4)
    found = structural_similarity(one, other)[row, column]
    assert found == pytest.approx(expected, rel=1e-9)


def test_the_same_is_one_and_the_negative_is_below_zero(pair):
    one, _ = pair
    assert ssim(one, one, all_of(one)) == pytest.approx(1.0, abs=1e-12)
    assert psnr(one, one, all_of(one)) == float("inf")
    assert ssim(one, 1.0 - one, all_of(one)) < 0.0


def test_of_even_greys_the_means_alone_are_left():
    one, other = np.full((20, 20), 0.4), np.full((20, 20), 0.5)
    expected = (2 * 0.4 * 0.5 + 1e-4) / (0.4**2 + 0.5**2 + 1e-4)
    assert ssim(one, other, all_of(one)) == pytest.approx(expected, rel=1e-6)
    # a tenth of full scale is 20 dB
    assert psnr(one, other, all_of(one)) == pytest.approx(20.0)


def test_pixels_that_do_not_count_are_left_out(pair):
    one, other = pair
    part = all_of(one)
    part[:, :10] = False
    spoiled = other.copy()
    spoiled[:, :3] = 0.0  # out of the windows' reach
    for measure in (psnr, ssim):
        assert measure(one, spoiled, part) == pytest.approx(measure(one, other, part))
        assert measure(one, spoiled, all_of(one)) < measure(one, other, all_of(one))
