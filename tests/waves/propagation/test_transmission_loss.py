import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.propagation import (
    DECIBELS_PER_NEPER,
    stokes_absorption,
    transmission_loss,
)
from tests.tools.slopes import check_slopes

AIR = (293.15, 101325.0, 0.7)
"""20 C, 70 %: 0.335, 4.98 and 77.6 dB/km at 125 Hz, 1 and 8 kHz."""


def test_a_kilometre_of_air_costs_the_table_and_sixty_decibels():
    loss = transmission_loss(
        np.array([125.0, 1e3, 8e3]), 1001.0, 1.0, *AIR, burst="free-air"
    )
    # 20 lg 1001 = 60.009; three printed digits each
    np.testing.assert_allclose(loss - 60.009, [0.335, 4.98, 77.6], rtol=3e-3)


def test_the_ground_gives_three_decibels_at_every_range_and_frequency():
    frequency, ranges = np.array([[10.0], [5e3]]), np.array([[1.0, 30.0, 4e3]])
    air, ground = (
        transmission_loss(frequency, ranges, 1.0, *AIR, burst=burst)
        for burst in ("free-air", "surface")
    )
    np.testing.assert_allclose(air - ground, 10 * np.log10(2), rtol=1e-9)


def test_nothing_is_lost_before_the_reference():
    assert transmission_loss(1000.0, 7.0, 7.0, *AIR, burst="free-air") == 0.0


def test_losses_add_along_the_way():
    whole = transmission_loss(500.0, 900.0, 1.0, *AIR, burst="free-air")
    parts = [
        transmission_loss(500.0, *ends, *AIR, burst="free-air")
        for ends in ((30.0, 1.0), (900.0, 30.0))
    ]
    np.testing.assert_allclose(whole, sum(parts), rtol=1e-13)


def test_stokes_alone_would_let_the_blast_of_the_thesis_through_unweakened():
    # omega = 500 rad/s, 313 K: 0.007 % of the amplitude over a kilometre
    frequency = 500.0 / (2 * np.pi)
    stokes = 1000.0 * stokes_absorption(frequency, 1.2, 340.0, 313.0)
    assert round(100 * float(-jnp.expm1(-stokes)), 3) == 0.007
    loss = transmission_loss(
        frequency, 1001.0, 1.0, 313.0, 101325.0, 0.5, burst="free-air"
    )
    absorbed = (loss - 20 * np.log10(1001.0)) / DECIBELS_PER_NEPER
    # relaxation makes it two orders of magnitude more, 1.2 % of the amplitude,
    assert 100 < absorbed / stokes < 300
    np.testing.assert_allclose(-np.expm1(-absorbed), 0.0123, atol=5e-5)
    # and spreading leaves a thousandth
    assert 9.8e-4 < 10 ** (-loss / 20) < 9.9e-4


def test_gradients_are_the_derivatives():
    at = (1e3, 500.0, 2.0, 290.0, 1e5, 0.5)
    for burst in ("surface", "free-air"):
        check_slopes(
            jax.jit(
                lambda x, burst=burst: transmission_loss(
                    *(a * u for a, u in zip(at, x, strict=True)), burst=burst
                )
            ),
            (jnp.ones(len(at)),),
            order=2,
        )


def test_a_batch_is_a_loop():
    frequency, ranges = jnp.geomspace(20.0, 1e4, 5), jnp.geomspace(0.5, 5e3, 5)
    together = jax.vmap(lambda f, r: transmission_loss(f, r, 1.0, *AIR))(
        frequency, ranges
    )
    alone = [
        transmission_loss(float(f), float(r), 1.0, *AIR)
        for f, r in zip(frequency, ranges, strict=True)
    ]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_a_burst_that_is_none_is_refused():
    with pytest.raises(ValueError, match="burst must be 'surface' or 'free-air'"):
        transmission_loss(100.0, 10.0, 1.0, *AIR, burst="ground")
