"""The chart of views: what a set shows from a side that it has, and from another."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.camera import explosion_views
from jblast.verification.benchmark import BENCHMARKS, cameras
from jblast.verification.benchmark.cameras import LEFT_OUT


@pytest.fixture(scope="module")
def left_out():
    """The views left out, and the set's that is nearest to the first of them."""
    return explosion_views(LEFT_OUT)


@pytest.fixture(scope="module")
def near(left_out):
    return explosion_views(towards=np.asarray(left_out.direction[:1]), sides=3)


def one(left_out, frame=3):
    return iter([(left_out, 0, frame)])


@pytest.mark.slow  # two programs
def test_a_view_is_like_itself_and_less_like_what_the_set_shows(left_out, near):
    peak, structure = cameras.likeness(left_out, one(left_out))
    assert np.isinf(peak).all()
    assert structure == pytest.approx(1.0)
    peak, structure = cameras.likeness(replace(near, sides=1), one(left_out))
    assert 10.0 < peak[0] < 30.0
    assert 0.2 < structure[0] < 0.9


def test_all_pictures_left_out_are_looked_at_and_every_other_frame(left_out):
    assert len(list(cameras.between_sides(left_out))) == 80
    thin = cameras.thinned(left_out)
    np.testing.assert_array_equal(thin.phase, left_out.phase[::2])
    assert thin.frames.shape[1] == thin.radius.shape[1] == len(thin.phase) == 5
    frames = {frame for _, _, frame in cameras.between_frames(left_out)}
    assert frames == {1, 3, 5, 7}


def test_of_two_frames_the_nearer_is_shown_alone(left_out):
    views = cameras.nearer(left_out)
    low, high = np.asarray(left_out.phase)[4:6]
    for part, frame in ((0.3, 4), (0.7, 5)):
        phase = jnp.asarray(low + part * (high - low))
        which, share = views.frames_at(phase)
        assert which.tolist() == [frame]
        assert share.tolist() == [1.0]


def test_it_is_entered_among_the_charts():
    assert BENCHMARKS["views"].measure is cameras.view_points
