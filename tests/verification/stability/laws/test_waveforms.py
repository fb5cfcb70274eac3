import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.calculator import COMBINATIONS
from jblast.verification.stability.waveforms import (
    closed_form,
    conwep_decay,
    impulse_errors,
    wave_form_failures,
)
from jblast.waves import (
    friedlander_decay,
    friedlander_impulse,
    friedlander_spectrum,
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
    modified_friedlander_pressure,
)


def test_the_closed_form_loses_its_digits_near_zero_and_ours_does_not():
    near_zero = wave_form_failures()[0]
    decay, bare, ours = impulse_errors()
    assert bare[decay > 1.01 * near_zero.boundary].max() < 1e-3
    assert bare[decay < near_zero.boundary].max() > 0.1
    assert ours.max() < 1e-6
    # half of nothing: the exact value is 1/2
    assert abs(float(closed_form(np.array([1e-6], np.float32))[0]) - 0.5) > 1e3
    one = jnp.ones((), jnp.float32)
    assert float(friedlander_impulse(one, one, jnp.float32(1e-6))) == pytest.approx(
        0.5, rel=1e-6
    )


def test_a_negative_decay_grows_without_end_and_has_no_spectrum():
    grown = modified_friedlander_pressure(jnp.array([5.0, 10.0, 20.0]), 1.0, 1.0, -0.5)
    assert -grown[2] > 100.0 * -grown[1] > 1000.0 * -grown[0] > 0.0
    for decay in (0.0, -0.5):
        with pytest.raises(ValueError, match="decay must be positive"):
            friedlander_spectrum(10.0, 1.0, 1.0, decay)
    assert np.isfinite(complex(friedlander_spectrum(10.0, 1.0, 1.0, 1e-6)))


def test_below_minus_one_the_front_is_not_the_peak_and_the_decay_is_marked():
    time = jnp.linspace(0.0, 1.0, 2001)
    for decay, risen in ((-0.99, False), (-1.01, True)):
        pressure = modified_friedlander_pressure(time, 1.0, 1.0, decay)
        assert (float(pressure.max()) > 1.0) == risen
        assert bool(COMBINATIONS["friedlander_decay"].holds(decay)) != risen


@pytest.mark.parametrize("fraction", [0.501, 0.6, 0.7, 1.0, 2.0])
def test_more_impulse_than_a_triangle_has_a_negative_decay(fraction):
    naive = conwep_decay(fraction)
    assert abs(naive) < 1e-5  # b = 0 solves what it solves, but has half the impulse
    decay = friedlander_decay(1.0, fraction, 1.0)
    assert float(decay) < 0.0
    assert float(friedlander_impulse(1.0, 1.0, decay)) == pytest.approx(
        fraction, rel=1e-12
    )


def test_at_less_impulse_both_find_the_same_decay():
    assert conwep_decay(0.3) == pytest.approx(
        float(friedlander_decay(1.0, 0.3, 1.0)), rel=1e-9
    )


def test_the_free_air_curves_reach_more_impulse_than_a_triangle():
    def fraction(z):
        of = (z, 1.0)
        peak = kingery_bulmash_pressure(*of, burst="free-air")
        duration = kingery_bulmash_duration(*of, burst="free-air")
        return float(kingery_bulmash_impulse(*of, burst="free-air") / (peak * duration))

    assert fraction(33.0) < 0.5 < fraction(34.0)
    assert math.isclose(fraction(40.0), 0.5, rel_tol=0.01)
