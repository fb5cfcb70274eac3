"""Margins of the hold: closed forms, polynomials, and flights at their edge."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import Gains, named_gains
from jblast.vehicle.control.stability import LOOPS, decay_rate, hold_margins

HEADING = LOOPS.index("heading")


def simple(rate):
    none = jnp.zeros(3)
    return Gains(none, none, attitude=0.0, body_rate=rate, integral=none)


def test_an_integral_with_a_lag_has_the_phase_margin_of_the_closed_form():
    # |k / w| = sqrt(1 + (w tau)^2)
    k, tau, late = 20.0, 0.05, 0.003
    squared = (-1 + np.sqrt(1 + 4 * (k * tau) ** 2)) / (2 * tau**2)
    w = np.sqrt(squared)
    expected = np.degrees(np.pi / 2 - np.arctan(w * tau) - w * late)
    margins = hold_margins(simple(k), tau, late)
    assert float(margins.phase_deg[HEADING]) == pytest.approx(expected, abs=1e-3)


def test_an_integral_that_is_late_has_the_gain_margin_of_the_closed_form():
    # of k e^{-sT} / s: pi / (2 k T)
    margins = hold_margins(simple(20.0), 1e-9, 0.01)
    expected = 20 * np.log10(np.pi / (2 * 20.0 * 0.01))
    assert float(margins.up_db[HEADING]) == pytest.approx(expected, abs=1e-4)
    assert np.isinf(margins.down_db[HEADING])


def test_a_loop_whose_answer_shrinks_by_its_margin_has_a_root_on_the_axis():
    gains, lag = named_gains("iris", integral=True), 0.0125
    margins = hold_margins(gains, lag, 0.0)
    k_r, k_w = float(gains.attitude), float(gains.body_rate)
    k_p, k_d, k_i = (
        float(x[0]) for x in (gains.position, gains.velocity, gains.integral)
    )
    share = 10 ** (-float(margins.down_db[0]) / 20)
    back = share * np.array([k_w, k_r, k_r * k_d, k_r * k_p, k_r * k_i])
    roots = np.roots([lag, 1.0, *back])
    # the pair nearest to swinging for ever
    slowest = roots[np.argmax(roots.real)]
    assert abs(slowest.real) < 1e-4 * abs(slowest)


def test_distance_is_what_one_plus_the_loop_is_at_its_least():
    lag, late = 0.0125, 0.002
    gains = named_gains("iris", integral=True)
    s = 1j * np.geomspace(0.1, 1e3, 200_001)
    loop = np.exp(-late * s) / (lag * s + 1) * (20 / s + 150 / s**2)
    distance = hold_margins(gains, lag, late).distance[HEADING]
    assert float(distance) == pytest.approx(np.abs(1 + loop).min(), rel=1e-5)


def test_margins_have_the_slopes_of_differences():
    gains = named_gains("iris", integral=True)

    def of(by):
        changed = dataclasses.replace(
            gains,
            position=gains.position * by[0],
            velocity=gains.velocity * by[1],
            integral=gains.integral * by[2],
            attitude=gains.attitude * by[3],
            body_rate=gains.body_rate * by[4],
        )
        margins = hold_margins(changed, 0.0125, 0.004)
        return jnp.stack([margins.up_db[0], margins.down_db[0], margins.phase_deg[0]])

    slopes = jax.jit(jax.jacfwd(of))(jnp.ones(5))
    of, width = jax.jit(of), 0.02
    for n, step in enumerate(width * np.eye(5)):
        difference = (of(1 + step) - of(1 - step)) / (2 * width)
        np.testing.assert_allclose(slopes[:, n], difference, rtol=0.02, atol=0.02)


def test_stable_is_what_comes_back():
    gains = named_gains("iris", integral=True)
    assert decay_rate(gains, 0.0125, 5e-4) > 0
    limp = dataclasses.replace(gains, body_rate=gains.body_rate / 20)
    assert decay_rate(limp, 0.0125, 5e-4) < 0
