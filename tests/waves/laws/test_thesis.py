"""The thesis's sound: as loud everywhere, and silent past a switch."""

import numpy as np
import pytest

from jblast.registry import LAWS, RESERVED, is_law, law_for, names
from jblast.waves.laws.thesis import (
    coded_sound_pressure,
    thesis_sound_duration,
    thesis_sound_impulse,
    thesis_sound_pressure,
)


def test_it_is_as_loud_at_35_m_as_at_10_m():
    near, far = (float(thesis_sound_pressure(r)) for r in (10.0, 35.0))
    # 6.75e-8 Np/m over 25 m
    assert 1.0 - far / near == pytest.approx(25.0 * 6.75e-8, rel=5e-3)


def test_its_impulse_is_that_of_friedlanders_pulse_with_b_1():
    peak, duration = thesis_sound_pressure(20.0), float(thesis_sound_duration(20.0))
    time = np.linspace(0.0, duration, 100_001)
    pulse = float(peak) * (1.0 - time / duration) * np.exp(-time / duration)
    # the trapezium rule is off by a twelfth of a step's square of the curvature
    expected = np.trapezoid(pulse, time)
    assert float(thesis_sound_impulse(20.0)) == pytest.approx(expected, rel=1e-8)


def test_the_plugin_drops_a_blast_whose_shock_is_slower_than_sound():
    limit = 14.8 * np.sqrt(15.0)
    loud, silent = (
        float(coded_sound_pressure(r, 15.0)) for r in (0.99 * limit, 1.01 * limit)
    )
    assert loud == pytest.approx(float(thesis_sound_pressure(0.99 * limit)))
    assert silent < 1e-6


def test_such_laws_are_found_by_name_and_offered_nowhere():
    for quantity, name in RESERVED:
        assert is_law(quantity, name)
        assert law_for(quantity, name).name == name
        assert (quantity, name) not in LAWS
        assert name not in names()
