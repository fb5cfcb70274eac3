"""The wave with a rise: its values are those asked for, its means are integrals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import ArrayLike
from scipy.integrate import quad

from jblast.waves.pulse import LEVEL, pulse_mean, pulse_of, pulse_pressure
from jblast.waves.waveform import (
    modified_friedlander_pressure,
    negative_phase_pressure,
    weak_shock_rise_time,
)

ARRIVAL, PEAK, DURATION, SUCTION, SUCTION_IMPULSE = 0.2, 4e3, 6e-3, 1.5e3, 12.0
SHARES = (0.05, 0.2, 0.45, 0.5, 0.6, LEVEL, 0.75, 0.95)
RISES = (0.0, 1e-5, 4e-4)
END = ARRIVAL + DURATION + 16 / 9 * SUCTION_IMPULSE / SUCTION


def pulse(share: ArrayLike = 0.45, rise: ArrayLike = 1e-5, arrival=ARRIVAL):
    impulse = np.asarray(share) * PEAK * DURATION
    return pulse_of(arrival, PEAK, impulse, DURATION, rise, SUCTION, SUCTION_IMPULSE)


def independent(share, rise, time):
    """Return the wave at one instant, in NumPy, decay by bisection."""
    left = (share * DURATION - rise / 2) / (DURATION - rise)
    held = max(0.0, left - LEVEL) / (1 - LEVEL) * (DURATION - rise)
    low, b, high = -1.0, 99.5, 200.0
    for _ in range(100):
        k = quad(lambda s, b=b: (1 - s) * np.exp(-b * s), 0, 1, epsabs=1e-14)[0]
        low, high = (b, high) if k > min(left, LEVEL) else (low, b)
        b = (low + high) / 2
    t = np.asarray(time) - ARRIVAL
    x = t / rise if rise else np.full_like(t, 2.0)
    s = (t - rise - held) / (DURATION - rise - held)
    n = (t - DURATION) / (END - ARRIVAL - DURATION)
    return np.select(
        [t < 0, x < 1, s < 0, s < 1, n < 1],
        [
            0 * t,
            PEAK * (3 * x**2 - 2 * x**3),
            PEAK + 0 * t,
            PEAK * (1 - s) * np.exp(-b * np.clip(s, 0, 1)),
            -6.75 * SUCTION * n * (1 - n) ** 2,
        ],
        0.0,
    )


@pytest.mark.parametrize("rise", RISES)
@pytest.mark.parametrize("share", [0.05, 0.45, 0.95])
def test_it_is_the_shape_that_the_text_says(share, rise):
    time = np.linspace(ARRIVAL - 1e-3, END + 1e-3, 400)
    np.testing.assert_allclose(
        pulse_pressure(pulse(share, rise), time),
        independent(share, rise, time),
        atol=1e-7 * PEAK,  # bisection of quadratures
    )


def test_without_a_rise_it_is_friedlanders_pulse_and_the_cubic_suction():
    wave = pulse(0.3, 0.0)
    since = np.linspace(0, END - ARRIVAL, 300)
    known = np.where(
        since < DURATION,
        modified_friedlander_pressure(since, PEAK, DURATION, wave.decay),
        negative_phase_pressure(since, DURATION, SUCTION, wave.suction_duration),
    )
    # a rounding of the arrival over the duration
    np.testing.assert_allclose(
        pulse_pressure(wave, ARRIVAL + since)[1:], known[1:], atol=1e-11 * PEAK
    )


@pytest.mark.parametrize("width", [3e-7, 2e-5, 1e-3, 0.02])
def test_a_mean_is_the_integral_over_its_sample(width):
    rng = np.random.default_rng(0)
    shares, rises = np.meshgrid(SHARES, RISES)
    waves = pulse(shares.ravel()[:, None], rises.ravel()[:, None])
    start = rng.uniform(ARRIVAL - width, END + width / 4, (1, 24))
    means = np.asarray(jax.jit(pulse_mean)(waves, start, start + width))
    # Gauss points on 400 stretches of each sample; kinks and jumps leave their share
    points, weights = np.polynomial.legendre.leggauss(4)
    edges = np.linspace(0, 1, 401)
    nodes = ((edges[:-1] + edges[1:]) / 2)[:, None] + points / 800
    time = start[..., None] + width * nodes.ravel()
    deep = jax.tree.map(
        lambda x: jnp.reshape(x, (*jnp.shape(x), *[1] * (3 - x.ndim))), waves
    )
    values = np.asarray(jax.jit(pulse_pressure)(deep, time))
    quadrature = (values.reshape(*means.shape, 400, 4) @ (weights / 2)).mean(axis=-1)
    np.testing.assert_allclose(means, quadrature, atol=PEAK / 400)
    smooth = np.abs(np.diff(values, axis=-1)).max(axis=-1) < PEAK / 100
    assert smooth.mean() > 0.3
    np.testing.assert_allclose(means[smooth], quadrature[smooth], atol=2e-6 * PEAK)


@pytest.mark.parametrize("samples", [1, 7, 1000])
def test_means_over_all_samples_add_up_to_the_impulses(samples):
    shares, rises = (x.ravel()[:, None] for x in np.meshgrid(SHARES, RISES))
    waves = pulse(shares, rises)
    first = np.linspace(ARRIVAL - 0.001, ARRIVAL + DURATION, samples + 1)[None, :]
    second = np.linspace(ARRIVAL + DURATION, END + 0.001, samples + 1)[None, :]
    for edges, impulse in (
        (first, shares[:, 0] * PEAK * DURATION),
        (second, -SUCTION_IMPULSE),
    ):
        means = pulse_mean(waves, edges[:, :-1], edges[:, 1:])
        total = np.sum(means * np.diff(edges), axis=1)
        np.testing.assert_allclose(
            total, np.broadcast_to(impulse, total.shape), rtol=1e-10
        )


def test_the_peak_is_reached_and_nothing_exceeds_it():
    shares, rises = (x.ravel()[:, None] for x in np.meshgrid(SHARES, RISES))
    waves = pulse(shares, rises)
    time = np.linspace(ARRIVAL, END, 4001)[None, :]
    assert np.max(pulse_pressure(waves, time)) <= PEAK * (1 + 1e-12)
    at_top = pulse_pressure(waves, ARRIVAL + rises + 1e-15)
    np.testing.assert_allclose(at_top, np.full_like(at_top, PEAK), rtol=1e-9)
    assert np.all(np.asarray(pulse_pressure(waves, time + END)) == 0.0)


@pytest.mark.parametrize("share", [-0.1, 0.0, 1.0, 1.3])
def test_a_wave_that_cannot_be_is_no_number(share):
    assert np.isnan(pulse_mean(pulse(share), ARRIVAL + 1e-3, ARRIVAL + 2e-3))


def test_a_wave_that_never_comes_is_silent_with_finite_gradients():
    def energy(peak):
        wave = pulse_of(jnp.inf, peak, 10.0, DURATION, 1e-5, SUCTION, 12.0)
        edges = jnp.linspace(0.0, 1.0, 50)
        return jnp.sum(pulse_mean(wave, edges[:-1], edges[1:]) ** 2)

    assert energy(PEAK) == 0.0
    assert jax.grad(energy)(PEAK) == 0.0


def test_single_precision_keeps_its_digits_in_short_samples():
    shares, rises = (x.ravel()[:, None] for x in np.meshgrid(SHARES, RISES))
    edges = np.arange(-10, 2000) * 2.0**-16  # exact in single precision
    double = pulse(shares, rises, 0.0)
    single = jax.tree.map(lambda x: x.astype(np.float32), double)
    means = [
        jax.jit(pulse_mean)(w, e[:, :-1], e[:, 1:])
        for w, e in ((double, edges[None]), (single, edges[None].astype(np.float32)))
    ]
    assert means[1].dtype == np.float32
    # the time since arrival over the shortest piece is good to a few roundings
    np.testing.assert_allclose(means[1], means[0], atol=3e-6 * PEAK)


def test_gradients_are_those_of_differences_the_arrival_included():
    edges = jnp.linspace(ARRIVAL - 1e-3, END, 60)

    def means(arrival, peak, impulse, duration, rise):
        wave = pulse_of(arrival, peak, impulse, duration, rise, SUCTION, 12.0)
        return pulse_mean(wave, edges[:-1], edges[1:])

    at = (ARRIVAL, PEAK, 0.45 * PEAK * DURATION, DURATION, 1e-4)
    slopes = jax.jit(jax.jacfwd(means, argnums=tuple(range(5))))(*at)
    both = jax.jit(means)
    for i, slope in enumerate(slopes):
        step = 1e-6 * (at[i] if i else DURATION)
        above, below = (
            both(*at[:i], at[i] + side * step, *at[i + 1 :]) for side in (1, -1)
        )
        difference = (above - below) / (2 * step)
        np.testing.assert_allclose(slope, difference, atol=1e-6 * np.abs(slope).max())


def test_a_rise_is_short_near_by_and_leaves_every_pulse_possible():
    peak = np.geomspace(1e-3, 1e7, 40)[:, None]
    duration, share = 4e-3, np.linspace(0.02, 0.98, 30)[None, :]
    impulse = share * peak * duration
    rise = weak_shock_rise_time(peak, impulse, duration)
    wave = pulse_of(0.0, peak, impulse, duration, rise, 0.1 * peak, impulse)
    assert np.all(np.isfinite(wave.decay))
    assert np.all(wave.decay_duration > 0)
    np.testing.assert_allclose(weak_shock_rise_time(47.88, 2.0, 0.1), 1e-3, rtol=0.05)
    assert np.all(rise[-1] < 1e-8)
