import jax
import jax.numpy as jnp
import numpy as np

from jblast.waves.pulse import (
    ground_pulse_displacement,
    ground_pulse_of,
    ground_pulse_velocity,
    ground_pulse_velocity_mean,
)

ARRIVAL, DISPLACEMENT, VELOCITY = 0.2, 3e-6, 1.5e-3
PULSE = ground_pulse_of(ARRIVAL, DISPLACEMENT, VELOCITY)


def test_peaks_are_those_asked_for_and_nothing_moves_before():
    time = np.linspace(0.19, 0.25, 60_001)  # 1 us
    moved = np.asarray(ground_pulse_displacement(PULSE, time))
    speed = np.asarray(ground_pulse_velocity(PULSE, time))
    # about a peak: half of (1 us / 1.7 ms)^2
    np.testing.assert_allclose(moved.max(), DISPLACEMENT, rtol=1e-6)
    np.testing.assert_allclose(speed.max(), VELOCITY, rtol=1e-6)
    assert np.abs(speed).max() == speed.max()  # it comes back more slowly
    assert not moved[time <= ARRIVAL].any()
    assert not speed[time <= ARRIVAL].any()
    assert moved[-1] < 1e-6 * DISPLACEMENT  # and comes back
    # differences of 1 us against a time constant of 1.7 ms, at mid points
    slope = np.diff(moved) / np.diff(time)
    np.testing.assert_allclose(
        slope, (speed[1:] + speed[:-1]) / 2, rtol=0, atol=1e-3 * VELOCITY
    )


def test_means_add_up_to_the_displacement_across_the_arrival():
    edges = ARRIVAL + np.arange(-3.3, 1000.0) / 48e3
    mean = np.asarray(ground_pulse_velocity_mean(PULSE, edges[:-1], edges[1:]))
    moved = np.asarray(ground_pulse_displacement(PULSE, edges))
    sums = np.concatenate([[0.0], np.cumsum(mean * np.diff(edges))])
    np.testing.assert_allclose(sums, moved, rtol=0, atol=1e-12 * DISPLACEMENT)


def test_what_never_comes_moves_nothing_and_has_gradients():
    def energy(arrival, displacement, velocity):
        pulse = ground_pulse_of(arrival, displacement, velocity)
        edges = np.linspace(0.0, 1.0, 11)
        mean = ground_pulse_velocity_mean(pulse, edges[:-1], edges[1:])
        return jnp.sum(mean**2)

    for arrival, size in ((np.inf, 1e-6), (0.5, 0.0), (np.inf, 0.0)):
        value, slopes = jax.value_and_grad(energy, argnums=(0, 1, 2))(
            arrival, size, size
        )
        assert value == 0.0
        assert np.all(np.isfinite(slopes))


def test_gradients_are_those_of_differences_the_arrival_among_them():
    edges = np.linspace(0.1993, 0.21, 12)  # none at the arrival: a corner

    def mean(theta):
        pulse = ground_pulse_of(ARRIVAL + theta[0], *(VELOCITY * theta[1:]))
        return ground_pulse_velocity_mean(pulse, edges[:-1], edges[1:])

    at = jnp.array([0.0, 2e-3, 1.0])
    slopes = np.asarray(jax.jit(jax.jacfwd(mean))(at))
    for i, step in enumerate((1e-7, 1e-8, 1e-5)):
        shift = step * np.eye(3)[i]
        difference = (mean(at + shift) - mean(at - shift)) / (2 * step)
        # second order: (1e-7 / 1.7e-3)^2, rounding 1e-16 / 6e-5
        np.testing.assert_allclose(
            slopes[:, i], difference, rtol=0, atol=1e-6 * np.abs(slopes[:, i]).max()
        )
