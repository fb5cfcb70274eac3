"""The regression of recordings: its form, gradient, scatter and range."""

import math

import numpy as np
import pytest

from calibration.ford_2021 import QUANTITIES, curve as fitted
from jblast.registry import law_for
from jblast.waves.laws.ford_2021 import ford_2021_form, ford_2021_law
from jblast.waves.regression import Regression, log_scaled_place, packaged

STANDARD = (101_325.0, 340.29)
IMPULSE, DURATION = "positive_impulse_pa_s", "positive_duration_s"
PACKAGED = packaged("ford_2021", ford_2021_form)
ford_2021_valid = law_for(IMPULSE, "ford_2021").valid


def curve(coefficients, covariance=None):
    covariance = np.zeros((4, 4)) if covariance is None else covariance
    sds = {"site_sd": 0.03, "shot_sd": 0.04, "path_sd": 0.2, "record_sd": 0.1}
    numbers = coefficients, covariance
    return Regression(ford_2021_form, *numbers, **sds, burial_sd=0.5)


BY_HAND = {
    IMPULSE: curve([6.0, -1.1, 5.0, 1.0]),
    DURATION: curve([-5.0, 0.2, 0.7, 1.0]),
}


def test_the_printed_form_agrees_with_arithmetic_by_hand():
    impulse, duration = (
        ford_2021_law(quantity, curve, "by hand") for quantity, curve in BY_HAND.items()
    )
    # W = 64 kg at half an atmosphere: S_d = (64/0.5)^(1/3); c doubles, times halve.
    scale = 128.0 ** (1 / 3)
    ground = 1.0 + math.exp(5.0 * 2.0 / scale)
    expected = 0.5 * scale * 0.5 * math.exp(6.0) * (300.0 / scale) ** -1.1 / ground
    got = impulse.function(300.0, 64.0, -2.0, 50_662.5, 680.58)
    assert got == pytest.approx(expected, rel=1e-12)
    got = duration.function(200.0, 1.0, 0.0, *STANDARD)
    assert got == pytest.approx(math.exp(-5.0) * 200.0**0.2 / 2.0, rel=1e-12)
    shot, path, record = impulse.scatter(np.array([300.0, 900.0]), 200.0, 1.0, 1e5)
    assert (shot.shape, path, record) == ((2,), 0.2, 0.1)
    assert impulse.title == "By hand"


def test_the_recording_of_hri_2_at_lv1_lies_within_the_scatter():
    air = (83_986.0, 340.29 * math.sqrt(299.6 / 288.15))
    place = (276.413, 539.77, 3.0)
    for quantity, seen in ((IMPULSE, 66.36568), (DURATION, 0.05525)):
        law = law_for(quantity, "ford_2021")
        total = np.sqrt(np.sum(np.square(law.scatter(*place, air[0]))))
        assert abs(math.log(seen / law.function(*place, *air))) < 2.0 * total


def test_high_above_ground_height_no_longer_matters_and_deep_below_it_is_exponential():
    law = law_for(IMPULSE, "ford_2021").function
    _, _, b3, b4 = PACKAGED[IMPULSE].coefficients
    high = [law(100.0, 1.0, h, *STANDARD) for h in (5.0, 10.0)]
    assert high[0] == pytest.approx(high[1], rel=1e-12)
    deep = [law(100.0, 1.0, h, *STANDARD) for h in (-5.0, -6.0)]
    assert deep[1] / deep[0] == pytest.approx(math.exp(-b3 * b4), rel=1e-9)


def test_validity_follows_the_recordings():
    for place, valid in (
        ((100.0, 1.0, 0.0), True),
        ((19.9, 1.0, 0.0), False),
        ((1001.0, 1.0, 0.0), False),
        # 8^(1/3) is not 2 to the last digit
        ((400.0, 8.0, -0.4 + 1e-12), True),
        ((400.0, 8.0, -0.4 - 1e-12), False),
        ((400.0, 8.0, 2.01), False),
    ):
        assert ford_2021_valid(*place) == valid


def test_the_scatter_of_the_shot_grows_with_burial_and_uncertain_coefficients():
    place = lambda height: log_scaled_place(300.0, 1.0, height, STANDARD[0])  # noqa: E731
    for height, expected in ((0.0, 0.05), (1.0, 0.05), (-0.2, math.hypot(0.05, 0.1))):
        shot, path, record = BY_HAND[IMPULSE].scatter(*place(height))
        assert shot == pytest.approx(expected, rel=1e-12)
        assert (path, record) == (0.2, 0.1)
    # only b1 uncertain, by 0.12: d ln y/d b1 = 1
    uncertain = curve([6.0, -1.1, 5.0, 1.0], np.diag([0.12**2, 0.0, 0.0, 0.0]))
    shot, _, _ = uncertain.scatter(*place(0.0))
    assert shot == pytest.approx(math.hypot(0.05, 0.12), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_packaged_coefficients_are_those_of_the_script(quantity):
    found = fitted(quantity)
    # The search stops where the likelihood is flat to 1e-13 of itself.
    for name in [name for name in vars(found) if name != "form"]:
        kept, value = getattr(PACKAGED[quantity], name), getattr(found, name)
        assert np.allclose(kept, value, rtol=1e-3, atol=1e-4), name
