r"""Detection of the blast in noise by each microphone, and its latency.

The noise is the sum of the scene's ambient sound, the microphone's own noise and wind
noise (`sensor.wind_noise`). The detector is the filter matched to the pulse that
arrives, absorption by the air included. No linear filter has a higher signal-to-noise
ratio, so the result is an upper bound for detectors that use templates. With $S_k$ the
transform of the $n$ samples of the pulse and $P_k$ the spectrum of the noise (its mean
over the band is the mean square of the noise), the output is normal about the
deflection

$$d = \Big(\sum_k |S_k|^2 / (n P_k)\Big)^{1/2}$$

with standard deviation 1 (Kay 1998, Detection Theory, eqs. 4.16 and 5.14). The sum is
over all $n$ frequencies of the transform. A blast is detected if the output exceeds a
threshold $u$. Noise that is white in the band crosses $u$ upwards at half the sampling
rate times $e^{-u^2/2}$ at most (Rice 1945, eq. 3.3-11), so one false alarm in a time
$T$ requires $u = \sqrt{2 \ln(f_s T / 2)}$. The latency is the time from the arrival
until the part of the whitened pulse received by then suffices, as for a filter that
need not wait for the end of the pulse. It is undefined where nothing is detected.
"""

import math
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jblast.errors import require
from jblast.scene import Scene, Sensor
from jblast.scene.uncertain import with_values
from jblast.scene.values import finite
from jblast.sensors import record_laws, waves
from jblast.sensors.noise import power_spectrum
from jblast.sensors.sources import WIND_SLOPE, share_at_height, wind_pressure
from jblast.sensors.waves_met import mean_overpressure
from jblast.study.outcome.family import (
    YES_NO,
    Answers,
    Prepared,
    Setting,
    family,
    yes_no,
)
from jblast.study.outcome.quantities import check_sensors
from jblast.waves.propagation import absorption_transfer, ambient as ambient_of

RATE_HZ, SECONDS, BEFORE_S = 2000.0, 1.0, 0.02
"""Sampling rate [Hz], length of the record [s], and its part before the arrival [s], by
declaration: a second contains the pulse and the suction of some tons."""
FALSE_ALARMS_PER_HOUR = 1.0
"""The default of `jblast detect`, repeated because its import would load the
detectors."""
BAND = 4096
"""Frequencies of a band over which the mean of a smooth spectrum is taken."""
OPTIONS = {
    "false_alarms_per_hour": "accepted false alarms per hour (default: 1)",
    "detector_rate_hz": f"sampling rate of the detector [Hz] (default: {RATE_HZ:g})",
}


@family(
    "detection",
    4,
    {
        "detected": (YES_NO, "whether a microphone detects the blast, at each sensor"),
        "detection_statistic": (
            "1",
            "output of the matched filter, in standard deviations, at each sensor",
        ),
        "detection_latency_s": (
            "s",
            "time from the arrival to the detection, at each sensor",
        ),
    },
    per_sensor=True,
    needs="[[sensor]] and noise",
    block=64,
    options=OPTIONS,
)
def prepare(setting: Setting) -> Prepared:
    """Return the prepared detectors of a scene.

    Raises:
        InputError: A sensor has no position or no noise, or there is no sensor.
    """
    scene, source = setting.uncertain.scene, setting.uncertain.source or "scene"
    check_sensors(scene, source, "for detection")
    words = "noise for detection: noise_pa, wind_noise or [ambient] level_pa"
    for sensor in scene.sensors:
        where = f"{source}: [[sensor]] {sensor.name!r}"
        require(_noises(scene, sensor), where, words, "none")
    rate = _positive(setting.options, "detector_rate_hz", RATE_HZ)
    alarms = _positive(setting.options, "false_alarms_per_hour", FALSE_ALARMS_PER_HOUR)
    # Rice's rate of false alarms (module docstring): 1800 = 3600 s / 2
    threshold = math.sqrt(2 * math.log(max(1800.0 * rate / alarms, 2.0)))
    # a power of two for the FFT
    count = 1 << math.ceil(math.log2(rate * SECONDS))
    laws = record_laws(scene)

    def one(key, numbers) -> Answers:
        drawn = with_values(scene, numbers)
        # one number a sensor instead of noisy samples: the output of the matched filter
        # is normal
        errors = jax.random.normal(key, (len(drawn.sensors),))
        found = [
            _detection(drawn, sensor, error, rate, count, threshold, laws)
            for sensor, error in zip(drawn.sensors, errors, strict=True)
        ]
        whole = {name: jnp.stack([f[name] for f in found]) for name in found[0]}
        return {name: whole[name] for name in setting.names}

    note = (
        f"detected above {threshold:.3g} standard deviations of the output of the "
        f"filter matched to the pulse, at {rate:g} Hz"
    )
    return Prepared(jax.vmap(one), notes=(note,))


def _noises(scene: Scene, sensor: Sensor) -> list[tuple[Any, Any]]:
    """Return level [Pa] and slope [dB/octave] of each noise of a microphone."""
    found, ambient = [], scene.ambient
    if ambient is not None and not ambient.file:
        share = share_at_height(ambient.height, sensor.position_m[2])
        found.append((ambient.level * share, ambient.slope))
    instrument = sensor.instrument
    if instrument is not None and instrument.noise is not None:
        slope = instrument.noise_slope
        found.append((instrument.noise, 0.0 if slope is None else slope))
    if instrument is not None and instrument.wind_noise is not None:
        found.append((instrument.wind_noise * wind_pressure(scene.air), WIND_SLOPE))
    return found


def _detection(
    scene: Scene, sensor: Sensor, error, rate: float, count: int, threshold: float, laws
) -> Answers:
    """Return the outcomes of one microphone for the first wave."""
    found = waves(scene, sensor.position_m, laws)
    wave = found[0]
    start = wave.pulse.arrival_time - BEFORE_S
    samples = mean_overpressure(found, start, jnp.arange(count + 1, dtype=float) / rate)
    humidity = scene.air.relative_humidity
    transfer = absorption_transfer(
        count, rate, wave.absorbed_m, *ambient_of(scene.air), humidity
    )
    native = rate if sensor.instrument is None else sensor.instrument.rate
    frequency = jnp.linspace(0.0, 0.5 * rate, count // 2 + 1)
    power = sum(
        jnp.square(level) * share_of_band(frequency, slope, max(native, rate), rate)
        for level, slope in _noises(scene, sensor)
    )
    spectrum = jnp.fft.rfft(samples) * transfer
    deflection, energy = whitened(spectrum, power, count)
    # the output of a matched filter is normal with standard deviation 1
    statistic = deflection + error
    known = jnp.isfinite(deflection) & ~scene.charge.never
    detected = statistic > threshold
    # the first sample whose energy so far suffices, for the latency
    enough = jnp.sqrt(energy) + error > threshold
    first = jnp.argmax(enough) / rate - BEFORE_S
    return {
        "detected": yes_no(detected, known),
        "detection_statistic": jnp.where(known, statistic, jnp.nan),
        "detection_latency_s": jnp.where(
            known & detected, jnp.maximum(first, 0.0), jnp.nan
        ),
    }


def share_of_band(frequency, slope, native: float, rate: float):
    """Return the spectrum of noise of rms 1, sampled more slowly.

    Its mean over the slower band is the share of the mean square that lies there.

    Args:
        frequency: Frequencies in the slower band [Hz].
        slope: Rise above 20 Hz [dB/octave].
        native: Sampling rate over whose band the rms is 1 [Hz].
        rate: Sampling rate of the slower band [Hz].
    """
    band = (np.arange(BAND) + 0.5) * (0.5 * native / BAND)
    # the mean over the native band, to which the rms of the noise refers
    mean = jnp.mean(power_spectrum(band, slope))
    return power_spectrum(frequency, slope) / mean * (rate / native)


def whitened(spectrum, power, count: int):
    """Return the deflection of a pulse in noise, and its square as it builds up.

    Args:
        spectrum: Spectrum of the pulse, at 0 to half the sampling rate [Pa].
        power: Mean square of white noise with the density at each frequency [Pa2].
        count: Number of samples.
    """
    white = jnp.fft.irfft(spectrum / jnp.sqrt(power), count)
    energy = jnp.cumsum(jnp.square(white))
    return jnp.sqrt(energy[-1]), energy


def _positive(options: Mapping[str, Any], name: str, default: float) -> float:
    value = finite(options.get(name, default), f"[options] {name}")
    require(value > 0, f"[options] {name}", "a positive number", f"{value:g}")
    return value
