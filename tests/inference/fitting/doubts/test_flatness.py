"""The error of flat ground against the arc of a great circle."""

import numpy as np
import pytest

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.fitting.assumptions import EARTH_RADIUS, flat_ground
from jblast.observations import Observations
from jblast.observations.places import Frame


def log(east, sigma):
    position = np.array([[0.0, 0.0, 0.0], [east, 0.0, 0.0]])
    nan = np.full(2, np.nan)
    names = ("",) * 2
    return Observations(
        sensor=("near", "far"),
        quantity=("air_arrival_s",) * 2,
        value=np.array([1.0, 100.0]),
        sigma=np.full(2, sigma),
        position=position,
        slant_range=nan,
        time=nan,
        path=names,
        shot=names,
        clock=names,
        frame=Frame(10.0, 20.0, 0.0),
    )


def told(east, sigma, charge=(0.0, 0.0, 0.0)):
    made = log(east, sigma)
    at = np.tile(charge, (2, 1))
    ranges = np.linalg.norm(made.position - at, axis=1)
    return flat_ground(made, at, ranges)


def test_a_site_of_a_kilometre_is_flat():
    assert told(1e3, 1e-3) == []
    assert told(20e3, 1e-3) == []  # 8 mm, 0.02 of a sigma of 1 ms


def test_a_chord_is_shorter_than_the_arc():
    (found,) = told(1e5, 1e-3)
    assert found["sensor"] == "far"
    arc = 2 * EARTH_RADIUS * np.arcsin(1e5 / (2 * EARTH_RADIUS))
    # the next term of the series is 2e-5 of the first
    assert found["error_m"] == pytest.approx(arc - 1e5, rel=1e-3)
    assert found["sigmas"] == pytest.approx(
        found["error_m"] / STANDARD_SOUND_SPEED / 1e-3
    )


def test_a_charge_far_from_the_origin_stands_above_the_ground():
    # 30 km away it is 71 m up; a sensor 1 km nearer sees it 2.5 m further off
    (found,) = told(29e3, 1e-2, charge=(30e3, 0.0, 0.0))
    up = 30e3**2 / (2 * EARTH_RADIUS)
    assert found["error_m"] == pytest.approx(np.hypot(1e3, up) - 1e3, rel=1e-3)
