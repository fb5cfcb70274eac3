"""Arrivals slower than sound: reported where neither scatter nor a clock explains them.

The place, the time and the laws are those of the truth, so the apparent speed of every
arrival is the speed of sound over the factor by which its travel time is stretched.
"""

from dataclasses import replace

import pytest

from jblast.inference.fitting.assumptions import slower_than_sound
from jblast.report.messages import sentence_of
from tests.inference.fitting.test_still_air import SOUND, solved

KNOWN_TIME = ("charge_east_m", "charge_north_m")


def log_of(answer, factor=1.0, late=0.0):
    """Return the log of an answer with all travel times stretched and shifted."""
    made = answer.density.observations
    return replace(made, value=made.value * factor + late)


@pytest.fixture(scope="module")
def exact():
    return solved()


@pytest.fixture(scope="module")
def scattered():
    return solved(scatter=True)


@pytest.mark.slow
def test_arrivals_with_the_speed_of_sound_are_not_reported(exact, scattered):
    for answer in (exact, scattered):
        assert slower_than_sound(log_of(answer), answer) == []
        assert slower_than_sound(log_of(answer, 0.9), answer) == []


def test_sensors_and_speed_are_named(exact):
    (found,) = slower_than_sound(log_of(exact, 1.1), exact)
    assert set(found["sensors"]) == {"s0", "s1", "s2", "s3"}
    assert found["speed_m_s"] == pytest.approx(SOUND / 1.1, rel=1e-6)
    assert found["sound_m_s"] == pytest.approx(SOUND)
    said = sentence_of(found)
    assert "down to 309 m/s (speed of sound 340 m/s)" in said
    assert all(name in said for name in found["sensors"])


def test_scatter_of_laws_may_explain_a_slow_log(scattered):
    """Laws scatter by 1 % of the travel time a shot: 1 % more is one deviation."""
    assert slower_than_sound(log_of(scattered, 1.01), scattered) == []
    (found,) = slower_than_sound(log_of(scattered, 1.2), scattered)
    assert found["speed_m_s"] == pytest.approx(SOUND / 1.2, rel=1e-6)


def test_a_time_of_detonation_that_is_fitted_explains_a_common_delay(exact):
    late = 0.5
    assert slower_than_sound(log_of(exact, late=late), exact) == []
    known = solved(free=KNOWN_TIME)
    (found,) = slower_than_sound(log_of(known, late=late), known)
    # the nearest sensor, at 600 m, is the slowest
    assert found["sensors"][0] == "s0"
    assert found["speed_m_s"] == pytest.approx(600.0 / (600.0 / SOUND + late), rel=1e-6)


def test_a_tail_wind_is_part_of_the_speed_of_sound():
    """Of 20 m/s towards east sound has 360 m/s towards s0, and 320 m/s against it."""
    known = solved(wind=20.0, free=KNOWN_TIME)
    assert slower_than_sound(log_of(known), known) == []
    (found,) = slower_than_sound(log_of(known, late=1.0), known)
    assert found["sensors"][0] == "s0"
    assert found["sound_m_s"] == pytest.approx(SOUND + 20.0)
