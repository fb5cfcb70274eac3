"""Even samples of a pulse: what `pulse_mean` says of each, only sooner."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.pulse import pulse_mean, pulse_of, pulse_samples

RATE, COUNT = 48e3, 2000
PEAK, DURATION = 3e3, 8e-3


def waves(first, last, count=60):
    """Return pulses of all shapes, sharp and slow, that arrive from first to last."""
    rng = np.random.default_rng(1)
    rise = 10.0 ** rng.uniform(-7, -2.7, count)
    rise[::4] = 0.0
    share = np.tile([0.15, 0.3, 0.45, 0.5, 0.6, 0.85], count // 6)
    impulse = share * PEAK * DURATION
    arrival = np.linspace(first, last, count)
    return pulse_of(arrival, PEAK, impulse, DURATION, rise, 0.4 * PEAK, impulse)


def both(pulses, start):
    edges = start + np.arange(COUNT + 1) / RATE
    fast = jax.jit(
        jax.vmap(lambda w: pulse_samples(w, jnp.asarray(start), RATE, COUNT))
    )
    slow = jax.jit(jax.vmap(lambda w: pulse_mean(w, edges[:-1], edges[1:])))
    shaped = jax.tree.map(lambda x: jnp.broadcast_to(x, (60,)), pulses)
    return np.asarray(fast(shaped)), np.asarray(slow(shaped))


def test_every_sample_is_its_mean():
    """Whether it arrives before, within or after the record."""
    fast, slow = both(waves(1.95, 2.05), 2.0)
    assert np.abs(slow).max() > 0.9 * PEAK
    # the clock at 2 s rounds to 1e-11 of a sample
    np.testing.assert_allclose(fast, slow, rtol=0, atol=1e-9 * PEAK)


def test_an_arrival_on_an_edge_is_no_matter():
    pulses = waves(0.0, 0.0)._replace(arrival_time=np.arange(60) / RATE)
    fast, slow = both(pulses, 0.0)
    np.testing.assert_allclose(fast, slow, rtol=0, atol=1e-9 * PEAK)


@pytest.mark.parametrize("arrival", [np.inf, 1e9, -1e9])
def test_what_never_comes_or_is_long_over_is_silent(arrival):
    fast, _ = both(waves(0.0, 0.0)._replace(arrival_time=np.full(60, arrival)), 0.0)
    assert np.all(fast == 0.0)


def test_single_precision_keeps_the_front_far_into_a_record():
    """A minute in: counted in whole samples, the front is where it was."""
    pulses = waves(0.0, 0.0)._replace(arrival_time=60.0 + np.arange(60) / 64)
    start, count = jnp.float32(60.5), 30_000
    single = jax.tree.map(
        lambda x: jnp.broadcast_to(x, (60,)).astype(jnp.float32), pulses
    )
    found = jax.jit(jax.vmap(lambda w: pulse_samples(w, start, RATE, count)))(single)
    assert found.dtype == jnp.float32
    edges = 60.5 + np.arange(count + 1) / RATE
    shaped = jax.tree.map(lambda x: jnp.broadcast_to(x, (60,)), pulses)
    known = jax.jit(jax.vmap(lambda w: pulse_mean(w, edges[:-1], edges[1:])))(shaped)
    # arrivals of 1/64 s are exact; short rises start and end by rounded times
    np.testing.assert_allclose(found, known, rtol=0, atol=2e-4 * PEAK)
    off = np.abs(np.asarray(found) - np.asarray(known))
    assert np.median(off[np.asarray(known) != 0]) < 1e-6 * PEAK


@pytest.mark.slow
def test_gradients_are_those_of_the_means():
    edges = 2.0 + jnp.arange(COUNT + 1, dtype=float) / RATE
    weight = jnp.sin(jnp.linspace(0.0, 60.0, COUNT))

    def of(method):
        def total(arrival, peak, impulse, rise):
            wave = pulse_of(arrival, peak, impulse, DURATION, rise, 1e3, 8.0)
            return jnp.sum(weight * method(wave))

        return jax.jit(jax.grad(total, argnums=(0, 1, 2, 3)))

    at = 2.0031, PEAK, 0.4 * PEAK * DURATION, 1e-4
    fast = of(lambda w: pulse_samples(w, jnp.asarray(2.0), RATE, COUNT))(*at)
    slow = of(lambda w: pulse_mean(w, edges[:-1], edges[1:]))(*at)
    np.testing.assert_allclose(fast, slow, rtol=1e-8)
