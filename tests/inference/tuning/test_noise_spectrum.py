"""The spectrum that a tuning expects of noise is the one that `listen` draws."""

from typing import Any

import jax
import numpy as np
import pytest
from scipy.signal import butter, sosfreqz

from jblast.inference.tuning.sound import noise_spectrum, passed_power
from jblast.scene import Ambient, Charge, Instrument, Scene, Sensor
from jblast.sensors import recording

RATE = 8000.0


def test_the_filters_power_is_that_of_the_filter():
    count, high_pass, low_pass = 65, 30.0, 900.0
    frequency = np.linspace(0.0, 0.5 * RATE, count)[1:-1]
    sections: Any = [
        butter(2, corner, side, fs=RATE, output="sos")
        for corner, side in ((high_pass, "high"), (low_pass, "low"))
    ]
    _, known = sosfreqz(np.concatenate(sections), frequency, fs=RATE)
    power = passed_power(RATE, high_pass, low_pass, count)[1:-1]
    # the grid stands 1e-6 of the rate short of its half
    np.testing.assert_allclose(power, np.square(np.abs(known)), rtol=2e-3, atol=1e-9)


@pytest.mark.slow
def test_what_a_microphone_draws_has_the_spectrum_that_is_expected():
    instrument = Instrument(RATE, noise=0.01, high_pass=30.0, low_pass=2000.0)
    sensor = Sensor("mic", (100.0, 0.0, 20.0), "microphone", instrument=instrument)
    never = Charge(time_s=np.inf)
    ambient = Ambient(level=0.1, slope=-3.0)
    scene = Scene(never, sensors=(sensor,), ambient=ambient)
    samples = recording(scene, sensor, jax.random.key(1)).samples(16.0)
    rows = np.asarray(samples)[:122880].reshape(-1, 512) * np.hanning(512)
    power = np.square(np.abs(np.fft.rfft(rows, axis=1))).mean(axis=0)
    power /= np.square(np.hanning(512)).sum()
    expected = np.asarray(noise_spectrum(scene, sensor))[:: (4096 // 256)]
    ratio = power[8:-2] / expected[8:-2]
    # 240 pieces: each ratio is known to 1/sqrt(240) = 6 %; their mean to 0.5 %
    assert abs(ratio.mean() - 1.0) < 0.02
    assert np.abs(ratio - 1.0).max() < 0.3
