"""Rotor tones follow the speeds; a recording loops without a seam, at any rate."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from jblast.errors import InputError
from jblast.scene import Ambient
from jblast.sensors.microphone import (
    Rotors,
    ambient_block,
    ambient_sound,
    ambient_start,
    at_rate,
    rotor_phase,
    rotor_tones,
    seamless,
)
from jblast.sensors.samples import BLOCK, first_samples

RATE = 8000.0
TIME = np.array([1.0, 1.25, 1.5, 1.75])
SPEED = np.array([[300.0, 350.0], [500.0, 350.0], [250.0, 400.0], [260.0, 100.0]])
ROTORS = Rotors(TIME, SPEED, amplitude=np.array([1.0, 0.5]), reference_speed=300.0)
KEY = jax.random.key(2)
MIDDLE = (np.arange(8192) + 0.5) / RATE
ZERO = jnp.zeros(())


def heard(rotors, start_s=0.9, shift=(ZERO, ZERO)):
    phase = rotor_phase(rotors, jnp.asarray(start_s), KEY)
    return np.asarray(rotor_tones(phase, shift, jnp.asarray(MIDDLE), RATE)), phase


def test_the_tones_are_the_harmonics_of_a_phase_summed_step_by_step():
    samples, phase = heard(ROTORS)
    fine = np.linspace(0.0, MIDDLE[-1] + 0.01, 400_001) + 0.9
    expected = np.zeros(MIDDLE.size)
    for rotor, offset in enumerate(np.asarray(phase.offset)):
        speed = np.interp(fine, TIME, SPEED[:, rotor])
        turned = cumulative_trapezoid(speed, fine, initial=0.0)
        turned -= np.interp(TIME[0], fine, turned)  # phases are told at the first knot
        at = np.interp(MIDDLE + 0.9, fine, turned)
        now = np.interp(MIDDLE + 0.9, TIME, SPEED[:, rotor])
        for harmonic, amplitude in ((1, 1.0), (2, 0.5)):
            mean = np.sinc(2 * harmonic * now / (2 * np.pi) / RATE)
            tone = np.sin(2 * harmonic * at + offset[harmonic - 1])
            expected += (now / 300.0) ** 2 * amplitude * mean * tone
    # trapezia of 2.6 us miss each knot's kink by 1e-6 rad
    assert samples == pytest.approx(expected, abs=1e-4)


def test_the_first_phase_does_not_depend_on_where_the_record_starts():
    early, _ = heard(ROTORS, 0.9)
    late, _ = heard(ROTORS, 0.9 + 4000 / RATE)
    assert late[:4192] == pytest.approx(early[4000:], abs=1e-8)
    shifted, _ = heard(ROTORS, 0.9, (jnp.asarray(0.0), jnp.asarray(4000 / RATE)))
    assert shifted == pytest.approx(late, abs=1e-8)


def test_a_harmonic_above_half_the_rate_is_silent():
    fast = Rotors(TIME, SPEED * 60, np.array([1.0]), 300.0)
    samples, _ = heard(fast)
    assert (samples[-1000:] != 0).any()  # the second rotor has come down to 100 x 60
    blind = Rotors(TIME, SPEED[:, :1] * 60, np.array([1.0]), 300.0)
    assert not heard(blind)[0][5000:].any() or SPEED[-1, 0] * 60 / np.pi < RATE / 2
    assert not heard(Rotors(TIME, SPEED * 300, np.array([1.0]), 300.0))[0].any()


def test_hours_of_constant_speed_keep_the_phase_in_double_precision():
    steady = Rotors(np.array([0.0]), np.array([[400.0]]), np.array([1.0]), 400.0)
    hour, _ = heard(steady, 0.0, (jnp.asarray(3600.0), jnp.asarray(0.0)))
    _, phase = heard(steady, 0.0)
    exact = np.sin(2 * 400.0 * (3600.0 + MIDDLE) + np.asarray(phase.offset).ravel())
    mean = np.sinc(800 / (2 * np.pi) / RATE)
    assert hour == pytest.approx(mean * exact, abs=1e-7)


def test_speeds_that_do_not_fit_their_times_are_refused():
    with pytest.raises(InputError, match="knot, rotor"):
        Rotors(TIME, SPEED[:3], np.array([1.0]), 300.0)


def played(loop, loop_rate, rate, n):
    ambient = Ambient(loop=loop, loop_rate=loop_rate)
    sound = ambient_sound(ambient, rate, jax.random.key(0))
    return np.asarray(first_samples(ambient_block, sound, ambient_start(sound), n))


@pytest.mark.parametrize("size", [2, 30, BLOCK, 10_000])
def test_a_loop_repeats_for_ever(size):
    loop = np.random.default_rng(0).normal(size=size)
    fade = max(1, min(200, size // 4))
    turn = size - fade
    samples = played(loop, 4000.0, 4000.0, 3 * size + BLOCK)
    assert np.array_equal(samples[turn:], samples[:-turn])
    assert np.array_equal(samples[fade:turn], loop[fade:turn])
    # the first sample follows the last one of the turn as it did in the recording
    assert samples[turn] == loop[turn]


def test_the_cross_fade_keeps_the_loudness_of_noise():
    loops = np.random.default_rng(1).normal(size=(400, 4000))
    turns = np.asarray(jax.vmap(lambda loop: seamless(loop, 4000.0))(loops))
    level = turns.std(axis=0)
    assert level == pytest.approx(1.0, abs=5 / np.sqrt(2 * 400))


def test_a_tone_that_fits_the_loop_is_the_same_tone_at_another_rate():
    time = np.arange(4410) / 44_100.0
    tone = np.sin(2 * np.pi * 440.0 * time)
    for rate in (8000.0, 48_000.0):
        there = np.asarray(at_rate(jnp.asarray(tone), 44_100.0, rate))
        expected = np.sin(2 * np.pi * 440.0 * np.arange(there.size) / rate)
        assert there == pytest.approx(expected, abs=1e-10)
