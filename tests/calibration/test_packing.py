"""Sloane's packings as they are kept: against what is proven."""

import math

import pytest

from calibration.packing import best_known, known_for
from jblast.sensors.camera.bake.recipe import sphere_bound

KNOWN = best_known()


def test_proven_packings_have_their_angles():
    # seven decimals of a degree are kept
    square = math.acos((math.sqrt(8.0) - 1.0) / 7.0)  # antiprism: 7 x^2 + 2 x = 1
    icosahedron = math.acos(1.0 / math.sqrt(5.0))
    for number, angle in ((6, math.pi / 2), (8, square), (12, icosahedron)):
        assert KNOWN[number] == pytest.approx(angle, abs=1e-9)


def test_none_exceeds_the_bound_and_more_points_never_stand_further_apart():
    for number, angle in KNOWN.items():
        assert angle <= sphere_bound(number) + 1e-9, number
    angles = [KNOWN[number] for number in sorted(KNOWN)]
    assert angles == sorted(angles, reverse=True)


def test_a_number_that_was_not_read_has_the_next_ones_angle():
    assert known_for(32, KNOWN) == (KNOWN[32], False)
    assert known_for(64, KNOWN) == (KNOWN[65], True)
    assert math.isnan(known_for(131, KNOWN)[0])
