import itertools
import math

import jax
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gammainc

from jblast.waves.waveform import (
    RISE_OVER_LAG,
    finite_rise_pressure,
    modified_friedlander_pressure,
)

PEAK, DURATION = 2e5, 4e-3


def convolved(time, decay, lag):
    """Integrate sharp pulse times kernel, in durations and peaks.

    By forty nodes of Gauss in each of cells that narrow towards the present.
    """
    nodes, weights = np.polynomial.legendre.leggauss(40)
    back = np.minimum(lag * np.array([0, 1, 3, 8, 20, 50, 120, 300, 1e9]), time)
    cells = np.diff(back)[:, None]
    age = back[:-1, None] + cells * (nodes + 1) / 2
    pulse = (1 - (time - age)) * np.exp(-decay * (time - age))
    return np.sum(pulse * age / lag**2 * np.exp(-age / lag) * cells * weights / 2)


@pytest.mark.parametrize("decay", [-0.9, 0.0, 1.0, 9.0])
@pytest.mark.parametrize("lag", [0.003, 1 / 9, 1.0, 20.0])
def test_it_is_the_sharp_pulse_seen_through_two_lags(decay, lag):
    # 9 * 1/9 and 1 * 1 are where decay and lag coincide and the textbook form is 0/0
    for time in (1e-3, 0.05, 0.7, 1.0, 3.0):
        ours = finite_rise_pressure(
            time * DURATION, PEAK, DURATION, decay, RISE_OVER_LAG * lag * DURATION
        )
        np.testing.assert_allclose(
            ours, PEAK * convolved(time, decay, lag), rtol=1e-10, atol=1e-10 * PEAK
        )


def test_the_rise_of_a_step_from_ten_to_ninety_per_cent_takes_the_rise_time():
    # a pulse so long that it is a step; the gamma distribution of order 2 is its rise
    rise = 1e-4
    time = rise / RISE_OVER_LAG * np.array([0.5318116, 3.8897202])
    step = finite_rise_pressure(time, 1.0, 1e9, 0.0, rise)
    np.testing.assert_allclose(step, [0.1, 0.9], rtol=0, atol=1e-8)
    every = np.linspace(0.0, 1e-3, 50)
    np.testing.assert_allclose(
        finite_rise_pressure(every, 1.0, 1e9, 0.0, rise),
        gammainc(2, every * RISE_OVER_LAG / rise),
        rtol=1e-11,
    )


def test_nothing_is_felt_before_the_arrival_and_it_starts_smoothly():
    slope = jax.jit(jax.grad(finite_rise_pressure))
    for time in (-1e6, -1e-9, 0.0):
        assert finite_rise_pressure(time, PEAK, DURATION, 1.0, 1e-4) == 0.0
        assert slope(time, PEAK, DURATION, 1.0, 1e-4) == 0.0
    # it leaves as P t^2/(2 tau^2)
    lag, time = 1e-4 / RISE_OVER_LAG, 1e-9
    np.testing.assert_allclose(
        slope(time, PEAK, DURATION, 1.0, 1e-4), PEAK * time / lag**2, rtol=1e-4
    )


@pytest.mark.parametrize("decay", [0.4, 1.0, 3.0])
@pytest.mark.parametrize("rise", [0.03, 1.0, 10.0])
def test_the_whole_record_keeps_its_impulse(decay, rise):
    cuts = [0.0, rise, 10.0 * rise + 1.0, 60.0 * rise + 100.0 / decay]
    area = math.fsum(
        quad(
            lambda t: float(finite_rise_pressure(t, 1.0, 1.0, decay, rise)),
            a,
            b,
            epsabs=1e-11,
            limit=400,
        )[0]
        for a, b in itertools.pairwise(cuts)
    )
    np.testing.assert_allclose(area, 1 / decay - 1 / decay**2, rtol=1e-8, atol=1e-8)


def test_a_short_rise_gives_the_sharp_pulse_later_by_two_lags():
    time = np.linspace(1e-3, 2e-2, 50)
    sharp = np.asarray(modified_friedlander_pressure(time, PEAK, DURATION, 1.5))
    for rise in (1e-6, 1e-8):
        lag = rise / RISE_OVER_LAG
        ours = np.asarray(finite_rise_pressure(time, PEAK, DURATION, 1.5, rise))
        # the slope is at most (1 + b) P/t_d
        assert np.abs(ours - sharp).max() < 2.5 * PEAK * 2 * lag / DURATION
    later = modified_friedlander_pressure(time - 2e-5, PEAK, DURATION, 1.5)
    blunt = finite_rise_pressure(time, PEAK, DURATION, 1.5, 1e-5 * RISE_OVER_LAG)
    # next order: tau^2 p'', a few times (lag/t_d)^2
    np.testing.assert_allclose(blunt, later, rtol=0, atol=5e-5 * PEAK)
