"""What the camera's motion explains, and what it must not."""

import numpy as np

from jblast.signals.flash.watch import EgoMotion
from tests.signals.flash.films import SHAPE, disc


def texture(dx=0.0, dy=0.0, turn=0.0, zoom=1.0):
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    x, y = x - 40.0, y - 30.0
    x, y = zoom * (x - turn * y) - dx, zoom * (y + turn * x) - dy
    wave = np.sin(0.3 * x + 0.1 * y) + np.cos(0.17 * x - 0.23 * y) + np.sin(0.21 * y)
    return (0.2 * wave).astype(np.float32)


def left(after, before=None):
    before = texture() if before is None else before
    rest = EgoMotion(SHAPE).rest(before, after)[3:-3, 3:-3]
    return np.abs(rest).mean() / np.abs((after - before)[3:-3, 3:-3]).mean()


def test_a_camera_that_moves_turns_or_closes_in_explains_its_changes():
    # second order is left: 0.3 px of waves of 20 px, of the size of (0.3 k)^2 / 2
    assert left(texture(0.3, -0.2)) < 0.05
    assert left(texture(turn=0.004)) < 0.05
    assert left(texture(zoom=1.004)) < 0.05


def test_light_on_all_of_the_scene_is_taken_away():
    assert left(texture() + np.float32(0.4)) < 1e-3


def test_a_spot_that_lights_up_stays():
    spot = disc(40, 30, 6).astype(np.float32)
    rest = EgoMotion(SHAPE).rest(texture(), texture(0.2, 0.1) + 1.5 * spot)
    assert np.abs(rest[spot == 1] - 1.5).max() < 0.15


def test_a_scene_without_texture_is_no_error():
    flat = np.zeros(SHAPE, np.float32)
    assert not EgoMotion(SHAPE).rest(flat, flat).any()
    assert np.isfinite(EgoMotion((1, 3)).rest(flat[:1, :3], flat[:1, :3] + 1)).all()
