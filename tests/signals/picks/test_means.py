"""Slopes of means over bins against differences of the means themselves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.signals.picks.preparation import bins_about_front
from jblast.signals.picks.pulse_means import (
    mean_columns,
    mean_slopes,
    means_over,
    oscillation,
    ringing,
    sine_and_cosine,
)
from jblast.signals.picks.unknowns import NEGATIVES, RISES, Form
from jblast.waves.pulse import Pulse

BINS = bins_about_front(512)
STEP = 1e-5
"""Squared it is 1e-10, over it rounding is 1e-11; a bin's edge may lie at a kink."""

PULSES = {
    "long": (0.3, 1.0, 2.0, 300.0, 1.2, 0.3, 700.0),
    "within a few samples": (0.31, 1.0, 0.7, 8.0, 0.6, 0.3, 20.0),
    "level behind the front": (-0.2, 0.9, 3.0, 80.0, -0.7, -0.1, 60.0),
    "a decay of nothing": (-0.2, 0.9, 3.0, 80.0, 0.0, 0.2, 60.0),
}


FORMS = [(rise, negative) for rise in RISES for negative in NEGATIVES]


def form_of(rise: int, negative: int) -> Form:
    """Return a form by its places."""
    return Form(jnp.asarray(float(rise)), jnp.asarray(float(negative)))


@jax.jit
def _slopes(numbers, form):
    return mean_slopes(BINS, numbers, form)


@jax.jit
def _means(numbers, form):
    def one(x):
        return means_over(BINS, Pulse(*x, hold_time=jnp.zeros(())), form)

    return jax.vmap(jax.vmap(one))(numbers)


def pressure(numbers, rise: int, negative: int, time):
    """Return the pressure of a form at instants, by its formulas again."""
    arrival, peak, tau, duration, decay, suction, fall = numbers
    u = time - arrival
    x, s = np.clip(u / tau, 0.0, 1.0), (u - tau) / (duration - tau)
    if rise == 4:
        s = u / duration
        grid = np.linspace(0.0, 1.0, 400001)
        risen = -np.expm1(-3.0 * grid * duration / tau)
        peak = peak / np.max((1 - grid) * np.exp(-decay * grid) * risen)
        ramp, x = -np.expm1(-3.0 * np.maximum(u, 0.0) / tau), np.ones_like(u)
    else:
        bent = (1.0 + decay) * tau / (duration - tau)
        polynomials = [3 * x**2 - 2 * x**3, 10 * x**3 - 15 * x**4 + 6 * x**5, x]
        ramp = [*polynomials, x + bent * x * (1.0 - x)][rise]
    falls = (1.0 - s) * np.exp(-decay * np.maximum(s, 0.0))
    positive = peak * (ramp * falls if rise == 4 else np.where(x < 1, ramp, falls))
    r = np.clip((u - duration) / fall, 0.0, 1.0)
    deep = [
        6.75 * r * (1 - r) ** 2,
        np.sin(np.pi * r),
        np.where(r < 0.25, 4 * r, (1 - r) / 0.75),
    ]
    if negative < 3:
        positive = np.where(u < duration, positive, -suction * deep[negative])
    return np.where(u < 0, 0.0, positive)


@pytest.mark.parametrize(("rise", "negative"), FORMS)
def test_means_of_each_form_are_those_of_its_formulas(rise, negative):
    numbers = np.array(PULSES["long"])
    made = _means(jnp.asarray(numbers)[None, None], form_of(rise, negative))[0, 0]
    share = (np.arange(2000) + 0.5) / 2000
    time = BINS.start[:, None] + share * BINS.width[:, None]
    # the midpoint rule is off by 1/24 of the change of slope at a kink, squared step
    expected = pressure(numbers, rise, negative, time).mean(axis=1)
    np.testing.assert_allclose(made, expected, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize("numbers", PULSES.values(), ids=PULSES)
@pytest.mark.parametrize(("rise", "negative"), FORMS)
def test_slopes_of_means_are_their_differences(numbers, rise, negative):
    if numbers[4] < 0.0 and negative == 3:
        pytest.skip("a pulse that continues with a negative decay has no end")
    at, form = np.array(numbers), form_of(rise, negative)
    moves = STEP * np.maximum(np.abs(at), 0.1) * np.eye(at.size)
    up, down = np.asarray(_means(np.stack([at + moves, at - moves]), form))
    differences = (up - down) / (2.0 * moves.diagonal())[:, None]
    made = np.asarray(_slopes(jnp.asarray(at), form))
    size = np.maximum(np.abs(made).max(axis=1, keepdims=True), 1e-3)
    np.testing.assert_allclose(made / size, differences / size, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("numbers", PULSES.values(), ids=PULSES)
def test_what_a_peak_and_a_suction_of_one_make_are_the_slopes_by_these(numbers):
    pulse = Pulse(*(jnp.asarray(x) for x in numbers), hold_time=jnp.zeros(()))
    slopes = np.asarray(_slopes(jnp.asarray(numbers), form_of(0, 0)))
    columns = jax.jit(lambda pulse: mean_columns(BINS, pulse))(pulse)
    np.testing.assert_allclose(columns, slopes[[1, 5]], rtol=0, atol=1e-12)


@pytest.mark.slow  # a ring's slopes take long to compile
def test_slopes_of_a_ring_are_its_differences():
    at = np.array([*PULSES["long"], 0.8, 0.05])

    @jax.jit
    def mean(x):
        pulse = Pulse(*x[:7], hold_time=jnp.zeros(()))
        return ringing(BINS, pulse, x[7], x[8]).mean

    made = np.asarray(jax.jit(jax.jacfwd(mean))(jnp.asarray(at)))
    for k in range(at.size):
        move = STEP * max(abs(at[k]), 0.1) * (np.arange(at.size) == k)
        apart = (mean(at + move) - mean(at - move)) / (2.0 * move[k])
        size = np.abs(made[:, k]).max()
        np.testing.assert_allclose(made[:, k] / size, apart / size, atol=1e-5)


@pytest.mark.parametrize("farthest", [1.0, 1e3, 1e6])
def test_sines_and_cosines_are_numpys_to_two_units_in_the_last_place(farthest):
    phase = np.random.default_rng(0).uniform(-farthest, farthest, 10_000)
    sine, cosine = jax.jit(sine_and_cosine)(jnp.asarray(phase))
    np.testing.assert_allclose(sine, np.sin(phase), rtol=0, atol=5e-16)
    np.testing.assert_allclose(cosine, np.cos(phase), rtol=0, atol=5e-16)


def test_an_oscillation_is_the_exponential_of_a_complex_number():
    elapsed = np.linspace(0.0, 400.0, 300)
    real, imaginary = jax.jit(oscillation)(
        jnp.asarray(-0.02), jnp.asarray(1.3), jnp.asarray(elapsed)
    )
    size = np.exp(-0.02 * elapsed)
    np.testing.assert_allclose(real, size * np.cos(1.3 * elapsed), rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        imaginary, size * np.sin(1.3 * elapsed), rtol=0, atol=1e-14
    )
