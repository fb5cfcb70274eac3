"""The air as a filter: the standard's spectrum, nothing before the front."""

import math

import jax
import numpy as np
import pytest

from jblast.waves.propagation import absorption_transfer
from tests.waves.propagation.absorbing import absorb

RATE, BEFORE = 48e3, 1000
IMPULSE = np.zeros(48_000)
IMPULSE[BEFORE] = 1.0
AIRS = {"mild": (293.15, 0.5), "cold and dry": (263.15, 0.1), "hot": (313.15, 0.95)}


def relaxations(temperature, humidity):
    """Strength and frequency of both, by the standard, and its term in f^2."""
    theta = temperature / 293.15
    saturation = 10 ** (-6.8346 * (273.16 / temperature) ** 1.261 + 4.6151)
    h = 100.0 * humidity * saturation
    oxygen = 24 + 4.04e4 * h * (0.02 + h) / (0.391 + h)
    nitrogen = 9 + 280 * h * math.exp(-4.17 * (theta ** (-1 / 3) - 1))
    strong = theta**-2.5 * 0.01275 * math.exp(-2239.1 / temperature)
    weak = theta**-2.5 * 0.1068 * math.exp(-3352 / temperature)
    both = ((strong, oxygen), (weak, nitrogen / theta**0.5))
    return both, 1.84e-11 * theta**0.5


def decibels(frequency, distance, temperature, humidity):
    both, classical = relaxations(temperature, humidity)
    alpha = classical * frequency**2
    for a, f in both:
        alpha = alpha + a * frequency**2 / (f + frequency**2 / f)
    return -20 / math.log(10) * distance * alpha


def heard(distance, temperature, humidity, dtype=np.float64):
    air = [dtype(x) for x in (distance, temperature, 101325.0, humidity)]
    return jitted(IMPULSE.astype(dtype), *air)


@jax.jit
def jitted(samples, distance, temperature, pressure, humidity):
    return absorb(samples, RATE, distance, temperature, pressure, humidity)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("air", AIRS.values(), ids=AIRS)
def test_the_spectrum_is_the_standards_and_nothing_is_heard_before(air, dtype):
    frequency = np.fft.rfftfreq(IMPULSE.size, 1 / RATE)
    deepest = -100 if dtype == np.float64 else -60
    for distance in (50.0, 500.0, 5000.0):
        out = np.asarray(heard(distance, *air, dtype=dtype), float)
        expected = decibels(frequency, distance, *air)
        asked = (frequency >= 20) & (frequency <= 10e3) & (expected > deepest)
        found = 20 * np.log10(np.abs(np.fft.rfft(out)[asked]))
        # what is asked for; 3e-7 and 7e-4 dB are found
        np.testing.assert_allclose(found, expected[asked], rtol=0, atol=0.01)
        # amplitude before the front over the largest: roundings of the transforms
        level = 1e-13 if dtype == np.float64 else 1e-5
        assert np.abs(out[:BEFORE]).max() < level * np.abs(out).max()


def test_its_phase_is_the_dispersion_of_the_relaxations_and_a_delay():
    temperature, humidity = AIRS["mild"]
    distance, count = 1000.0, 2**16
    transfer = np.asarray(
        absorption_transfer(count, RATE, distance, temperature, 101325.0, humidity)
    )
    frequency = np.arange(1, 2000) * RATE / count  # up to 1.5 kHz
    phase = np.unwrap(np.angle(transfer[1:2000]))
    both, _ = relaxations(temperature, humidity)
    expected = sum(
        -distance * a * f * np.imag(1j * frequency / (f + 1j * frequency))
        for a, f in both
    )
    left = phase - expected
    late = np.polyfit(frequency, left, 1)
    # what is left is a delay: past half the rate nothing is absorbed, which bends it
    # by the cube of frequency over rate
    np.testing.assert_allclose(left, frequency * late[0], rtol=0, atol=2e-3)
    assert np.abs(expected).max() > 0.5


def test_no_way_leaves_a_signal_alone_and_two_ways_add_up():
    mild = AIRS["mild"]
    np.testing.assert_allclose(heard(0.0, *mild), IMPULSE, rtol=0, atol=1e-14)
    half = jitted(heard(400.0, *mild), 600.0, mild[0], 101325.0, mild[1])
    whole = np.asarray(heard(1000.0, *mild))
    np.testing.assert_allclose(half, whole, rtol=0, atol=1e-12)
