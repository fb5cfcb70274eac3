r"""Whittle's likelihood of a sound record.

The record is $y = m(\theta) + n$: $m$ is the noise-free output of `sensors.recording`
for the blast, $n$ Gaussian noise of the spectrum $S(f;\theta)$. For its Fourier
coefficients, which are independent where the record is long,

$$-\ln L = \sum_k \ln S_k + |Y_k - M_k|^2 / S_k$$

(Whittle 1953, from memory). So the wave form constrains absorption, filter and scale,
and the power of the residual constrains the noise, in one likelihood. As least squares
it is the sum of two parts, whose gradients add up to its own at the point where $S$ and
the powers are evaluated, which the solver updates (`search.solve`):

- the wave form over the noise, $\sqrt2\,(Y_k - M_k(\theta))/\sqrt{S_k}$;
- in bands of frequency, of $n$ coefficients each, the deviance of the powers $P$ of
  the residual, $\pm\sqrt{2n\,(g - 1 - \ln g)}$ with $g$ the mean of
  $P_k/S_k(\theta)$.

The record is tapered by a cosine over a twentieth of it at either end, so that strong
frequencies do not leak into weak ones.

The noise is that of the place and of the wind, which the instrument filters, and of the
instrument itself. With $H$ the filter's response and $q$ the smallest step that is
recorded,

$$S(f) = |H|^2 \big(e^{-2h/H_a} S_a + S_w\big) + S_i + q^2/12$$

each from the taps from which `sensors.noise` draws it. White noise of rms
$\sigma$ has $S = \sigma^2$: the mean over frequency is the square of the rms.

Samples at the recorder's limit are inferred from the others. With $K$ the inverse
covariance of the noise, a circulant of $1/S(f)$, the most probable residual at the
samples $a$, given the others $b$, is

$$x_a = -K_{aa}^{-1} K_{ab}\,x_b$$

so that least squares of the filled record are those of the others: a clipped sample
adds no information. A line between the samples before and after would count those two
as often as there are samples between.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Int

from jblast.scene import Instrument, Scene, Sensor
from jblast.scene.sensor_kinds import hears_ambient
from jblast.sensors import recording
from jblast.sensors.noise import BLOCK, coloured_noise
from jblast.sensors.sources import WIND_SLOPE, share_at_height, wind_pressure

MIN_NOISE_POWER = 1e-9
"""Noise power relative to the largest below which a frequency is not used: leakage from
other frequencies dominates there in a record of any length."""
FLOAT_STEP = 2.0**-24
"""Relative rounding of 32-bit floats: a floor of the noise of a noiseless file."""
MAX_FILLED = 2048
"""Largest number of clipped samples that are inferred. The inverse of their matrix
takes a time of the third power; more are interpolated linearly."""
CLIPPED_BLOCK = 64
"""Records share a program if their numbers of clipped samples round up to the same
multiple of this.
"""
TAPER = 0.05
"""Share of a record that is faded in, and out."""
# about four bands an octave for a second at 48 kHz: spectra are powers of frequency
BANDS = 48
MIN_COEFFICIENTS = 12
"""Smallest number of Fourier coefficients in a band: the deviance is then close to a
squared normal."""
SKIPPED = 4
"""Number of lowest Fourier coefficients that are not used: taper and drift distort
them."""


class Weights(NamedTuple):
    """Quantities that are fixed during one least-squares search.

    Attributes:
        sd: Standard deviation of each Fourier coefficient; infinite for unused ones.
        power: Power of the residual of each.
        limit: Matrix that infers clipped samples (see `filling`).
    """

    sd: Float[Array, " frequency"]
    power: Float[Array, " frequency"]
    limit: Float[Array, "limit limit"]


class SoundEvidence(eqx.Module):
    """A record, and its prediction.

    Attributes:
        samples: Samples in the unit of the file.
        index: Index of the sensor in the scene.
        laws: Names of the laws, by quantity.
        by_full_scale: True if a sample of 1 is the sensor's full scale.
        pascals: Pressure of a sample of 1 otherwise [Pa].
        at_limit: Samples at the recorder's limit. Their residuals are inferred from all
            others.
        unclipped: With too many clipped samples to infer, all others, between which
            residuals are interpolated; else none. Noise is strongest at low
            frequencies, so a line approximates it.
        bands: Band of each Fourier coefficient; -1 for none.
        counts: Number of coefficients of each band.
    """

    samples: Float[Array, " sample"]
    index: int = eqx.field(static=True)
    laws: tuple[tuple[str, str], ...] = eqx.field(static=True)
    by_full_scale: bool = eqx.field(static=True)
    pascals: Float[Array, ""]
    at_limit: Int[Array, " limit"]
    unclipped: Float[Array, " unclipped"]
    bands: Int[Array, " frequency"]
    counts: Float[Array, " band"]

    def unit(self, scene: Scene) -> Float[Array, ""]:
        """Return the pressure of a sample of 1 in the file [Pa]."""
        instrument = scene.sensors[self.index].instrument
        if self.by_full_scale and instrument is not None:
            assert instrument.full_scale is not None
            return instrument.full_scale
        return self.pascals

    def predicted(self, scene: Scene) -> Float[Array, " sample"]:
        """Return the record without noise, in the unit of the file."""
        sensor = scene.sensors[self.index]
        instrument = sensor.instrument
        assert instrument is not None, "`unknowns.filled` adds an instrument"
        # without noise and rounding, so that the record is a smooth function of the
        # numbers; recorded ambient loops are part of the prediction
        quiet = replace(instrument, noise=None, wind_noise=None, bits=None)
        ambient = scene.ambient
        if ambient is not None and ambient.loop is None:
            ambient = None
        still = replace(scene, ambient=ambient)
        sensor, key = replace(sensor, instrument=quiet), jax.random.key(0)
        made = recording(still, sensor, key, laws=dict(self.laws))
        return made.samples(self.samples.size / instrument.rate) / self.unit(scene)

    def left(self, scene: Scene, weights: Weights) -> Complex[Array, " frequency"]:
        """Return the Fourier coefficients of the residual."""
        left = self.samples - self.predicted(scene)
        if self.unclipped.size:
            every = jnp.arange(left.size, dtype=left.dtype)
            left = jnp.interp(every, self.unclipped, left[self.unclipped.astype(int)])
        left = left * self._taper()
        return jnp.fft.rfft(filled(left, self.at_limit, weights.sd, weights.limit))

    def noise(self, scene: Scene) -> Float[Array, " frequency"]:
        """Return the expected power of each Fourier coefficient of the noise."""
        sensor = scene.sensors[self.index]
        grid = noise_spectrum(scene, sensor) / jnp.square(self.unit(scene))
        # a noiseless file has rounding noise at least: the likelihood stays finite
        floor = FLOAT_STEP * jnp.max(jnp.abs(self.samples))
        count = self.bands.size
        # the spectrum is computed on a fixed grid and interpolated to the record's
        # frequencies
        at = jnp.linspace(0.0, grid.size - 1.0, count)
        spread = jnp.interp(at, jnp.arange(grid.size, dtype=float), grid)
        # power of a tapered record: the sum of squares of the taper replaces its length
        taper = jnp.sum(jnp.square(self._taper()))
        return taper * (spread + jnp.square(floor))

    def weights(self, scene: Scene) -> Weights:
        """Return the weights of a least-squares search from a scene."""
        noise = self.noise(scene)
        is_used = (self.bands >= 0) & (noise > MIN_NOISE_POWER * jnp.max(noise))
        sd = jnp.where(is_used, jnp.sqrt(noise), jnp.inf)
        # with the noise of the scene: fixed during the search, updated with the weights
        held = filling(self.at_limit, sd, self.samples.size)
        left = self.left(scene, Weights(sd, noise, held))
        power = jnp.square(left.real) + jnp.square(left.imag)
        return Weights(sd, power, held)

    def residuals(
        self, scene: Scene, weights: Weights
    ) -> tuple[Float[Array, "2 frequency"], Float[Array, " band"]]:
        """Return the residuals of the wave form, and those of the powers in bands."""
        left = self.left(scene, weights)
        white = over(left, weights.sd / jnp.sqrt(2.0))
        return jnp.stack([white.real, white.imag]), self.deviance(scene, weights)

    def deviance(self, scene: Scene, weights: Weights) -> Float[Array, " band"]:
        """Return the signed deviances of the powers in bands, each of variance 1."""
        g = self.band_ratios(scene, weights)
        # near g = 1 the root has no slope: its series is g - 1, exact to 1e-8
        off = jnp.abs(g - 1.0) > 1e-4
        safe = jnp.where(off, g, 2.0)
        far = jnp.sign(safe - 1.0) * jnp.sqrt(2.0 * (safe - 1.0 - jnp.log(safe)))
        return jnp.sqrt(self.counts) * jnp.where(off, far, g - 1.0)

    def band_ratios(self, scene: Scene, weights: Weights) -> Float[Array, " band"]:
        """Return the mean of power over expected power in each band, 1 if none."""
        is_used = jnp.isfinite(weights.sd)
        ratio = jnp.where(is_used, weights.power / self.noise(scene), 1.0)
        # coefficients without a band get an index past the end, which the sum drops
        number = jnp.where(self.bands < 0, self.counts.size, self.bands)
        total = jax.ops.segment_sum(ratio, number, self.counts.size)
        return total / self.counts

    def time_residuals(self, scene: Scene) -> Float[Array, " sample"]:
        """Return the whitened residual over time, each sample of variance 1."""
        weights = self.weights(scene)
        n = self.samples.size
        white = over(self.left(scene, weights), weights.sd)
        taper = self._taper()
        scaled = jnp.fft.irfft(white, n) * n**0.5
        # divided by the taper again, but not at its ends, where rounding would be
        # amplified
        inside = taper > 0.5
        rms = jnp.sqrt(jnp.mean(jnp.square(taper)))
        return jnp.where(inside, scaled * rms / jnp.where(inside, taper, 1.0), 0.0)

    def band_densities(
        self, power: Float[Array, " frequency"], scene: Scene, rate_hz: float
    ) -> tuple[Float[np.ndarray, " band"], Float[np.ndarray, " band"]]:
        """Return the middle frequency [Hz] and the mean density [Pa2/Hz] of each band.

        Args:
            power: Squared magnitude of a spectrum, as of `noise` and `weights`.
            scene: Scene with the sensor's unit.
            rate_hz: Sampling rate.
        """
        bands, counts = np.asarray(self.bands), np.asarray(self.counts)
        frequency = np.linspace(0.0, 0.5 * rate_hz, bands.size)
        used = bands >= 0
        total = np.bincount(bands[used], np.asarray(power)[used], counts.size)
        with np.errstate(divide="ignore"):  # frequency 0 is in no band
            ln = np.bincount(bands[used], np.log(frequency[used]), counts.size)
        # one-sided density: 2 |X|^2 over the sample rate and the energy of the taper
        weight = float(np.square(np.asarray(self._taper())).sum()) * 0.5 * rate_hz
        sizes = np.bincount(bands[used], minlength=counts.size)
        middle = np.exp(ln / sizes)
        return middle, float(self.unit(scene)) ** 2 * total / counts / weight

    def _taper(self) -> Float[Array, " sample"]:
        """Return the taper of the record: 1 with a cosine ramp at both ends."""
        count = self.samples.size
        faded = max(1, round(TAPER * count))
        rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(faded) + 0.5) / faded)
        flat = np.ones(count - 2 * faded)
        return jnp.asarray(np.concatenate([rise, flat, rise[::-1]]))


def over(
    spectrum: Complex[Array, " frequency"], sd: Float[Array, " frequency"]
) -> Complex[Array, " frequency"]:
    """Return a spectrum over a standard deviation, in the same precision."""
    return lax.complex(spectrum.real / sd, spectrum.imag / sd)


def sound_evidence(
    samples: Float[np.ndarray, " sample"],
    index: int,
    laws: Mapping[str, str],
    pascals: float | None,
    limit: float = math.inf,
) -> SoundEvidence:
    """Return a record as evidence.

    Args:
        samples: Samples in the unit of the file.
        index: Index of the sensor in the scene.
        laws: Names of laws by quantity.
        pascals: Pressure of a sample of 1 [Pa]; None for the sensor's full scale.
        limit: Magnitude at which samples are clipped, in the unit of the file.
    """
    clipped = np.abs(samples) >= limit
    at_limit = padded_places(clipped)
    is_bridged = clipped.any() and not at_limit.size
    unclipped = np.flatnonzero(~clipped) if is_bridged else []
    bands, counts = bands_of(samples.size)
    return SoundEvidence(
        samples=jnp.asarray(samples, float),
        index=index,
        laws=tuple(laws.items()),
        by_full_scale=pascals is None,
        pascals=jnp.asarray(1.0 if pascals is None else pascals, float),
        at_limit=jnp.asarray(at_limit),
        unclipped=jnp.asarray(unclipped, float),
        bands=jnp.asarray(bands),
        counts=jnp.asarray(counts),
    )


def noise_spectrum(scene: Scene, sensor: Sensor) -> Float[Array, " frequency"]:
    """Return the spectrum at `BLOCK` + 1 frequencies from 0 to half the rate [Pa2].

    Args:
        scene: The scene.
        sensor: A microphone, or a pressure gauge, which records no ambient sound.
    """
    instrument = sensor.instrument or Instrument()
    rate = instrument.rate
    heard = jnp.zeros(BLOCK + 1)
    if hears_ambient(sensor.kind):
        heard = _around(scene, sensor, instrument)
    high_pass, low_pass = instrument.high_pass, instrument.low_pass
    if high_pass is not None or low_pass is not None:
        heard = heard * passed_power(rate, high_pass, low_pass, BLOCK + 1)
    if instrument.noise is not None and instrument.noise_slope is not None:
        own = coloured_noise(
            jax.random.key(0), rate, instrument.noise, instrument.noise_slope
        )
        heard = heard + _power(own.response)
    elif instrument.noise is not None:
        heard = heard + jnp.square(instrument.noise)
    if instrument.bits is not None and instrument.full_scale is not None:
        step = instrument.full_scale / 2.0 ** (instrument.bits - 1)
        heard = heard + jnp.square(step) / 12.0
    return heard


def passed_power(
    rate: float,
    high_pass: Float[ArrayLike, ""] | None,
    low_pass: Float[ArrayLike, ""] | None,
    count: int,
) -> Float[Array, " frequency"]:
    r"""Return the power gain of an instrument's filter, from 0 to half the rate [-].

    With $w = \tan(\pi f/f_s)/\tan(\pi f_c/f_s)$, $1/(1 + w^4)$ of a Butterworth
    low-pass of second order turned by the bilinear transform,
    $w^4/(1 + w^4)$ of a high-pass. It is a closed form, because XLA's pool of threads
    on the CPU may wait in vain for batches of solved systems within a program that
    differentiates them (jaxlib 0.10).

    Args:
        rate: Sampling rate [Hz].
        high_pass: Corner frequency [Hz]; None for no filter.
        low_pass: Corner frequency [Hz]; None for no filter.
        count: Number of frequencies.
    """
    # the last frequency is just below half the rate, where the tangent is infinite
    turn = jnp.linspace(0.0, 0.5 - 1e-6, count)
    passed = jnp.ones(count)
    for corner, is_high in ((high_pass, True), (low_pass, False)):
        if corner is None:
            continue
        over = jnp.tan(jnp.pi * turn) / jnp.tan(jnp.pi / rate * jnp.asarray(corner))
        fourth = jnp.square(jnp.square(over))
        passed = passed * (fourth if is_high else 1.0) / (1.0 + fourth)
    return passed


def _around(
    scene: Scene, sensor: Sensor, instrument: Instrument
) -> Float[Array, " frequency"]:
    """Return the spectrum of ambient and wind noise, before the instrument."""
    heard, ambient = jnp.zeros(BLOCK + 1), scene.ambient
    if ambient is not None and ambient.loop is None:
        unit = coloured_noise(jax.random.key(0), instrument.rate, 1.0, ambient.slope)
        share = share_at_height(ambient.height, sensor.position_m[2])
        heard = heard + jnp.square(share * ambient.level) * _power(unit.response)
    if instrument.wind_noise is not None:
        level = wind_pressure(scene.air)
        unit = coloured_noise(jax.random.key(0), instrument.rate, 1.0, WIND_SLOPE)
        heard += jnp.square(instrument.wind_noise * level) * _power(unit.response)
    return heard


def _power(response) -> Float[Array, " frequency"]:
    return jnp.square(response.real) + jnp.square(response.imag)


def padded_places(clipped: Bool[np.ndarray, " sample"]) -> Int[np.ndarray, " limit"]:
    """Return the clipped samples to infer; none if there are too many.

    They are padded to a multiple of `CLIPPED_BLOCK` with indices past the end, which
    are ignored.
    """
    places = np.flatnonzero(clipped)
    if places.size > MAX_FILLED or places.size == clipped.size:
        return np.zeros(0, int)
    more = -places.size % CLIPPED_BLOCK
    return np.pad(places, (0, more), constant_values=clipped.size)


def filling(
    places: Int[Array, " limit"], sd: Float[Array, " frequency"], count: int
) -> Float[Array, "limit limit"]:
    r"""Return $K_{aa}^{-1}$.

    Args:
        places: Samples at the limit.
        sd: Standard deviation of each Fourier coefficient; infinite for unused ones.
        count: Number of samples of the record.
    """
    if not places.size:
        return jnp.zeros((0, 0), sd.dtype)
    kernel = jnp.fft.irfft(jnp.square(1.0 / sd), count)
    inside = places < count
    both = inside[:, None] & inside[None, :]
    between = (places[:, None] - places[None, :]) % count
    # padding has its own diagonal, so it does not change the inverse of the rest
    own = kernel[0] * jnp.eye(places.size, dtype=sd.dtype)
    return jnp.linalg.inv(jnp.where(both, kernel[between], own))


def filled(
    left: Float[Array, " sample"],
    places: Int[Array, " limit"],
    sd: Float[Array, " frequency"],
    held: Float[Array, "limit limit"],
) -> Float[Array, " sample"]:
    """Return the residual with the most probable values at clipped samples.

    Args:
        left: Residual of a tapered record.
        places: Samples at the limit.
        sd: Standard deviation of each Fourier coefficient; infinite for unused ones.
        held: Matrix of `filling`.
    """
    if not places.size:
        return left
    others = left.at[places].set(0.0, mode="drop")
    of, share = jnp.fft.rfft(others), jnp.square(1.0 / sd)
    # K_ab x_b by convolution with the inverse spectrum: no matrix of all samples
    pulls = jnp.fft.irfft(lax.complex(share * of.real, share * of.imag), left.size)
    pulls = pulls.at[places].get(mode="fill", fill_value=0.0)
    return others.at[places].set(-held @ pulls, mode="drop")


def bands_of(
    count: int,
) -> tuple[Int[np.ndarray, " frequency"], Float[np.ndarray, " band"]]:
    """Return the band of each Fourier coefficient of a record, and their sizes.

    Bands are uniform in the logarithm of frequency where they have enough coefficients.
    The lowest few coefficients and the one at half the rate, which is real, are in
    none.
    """
    size = count // 2 + 1
    number, edges = np.arange(size), [SKIPPED]
    # one edge more than bands
    for edge in np.ceil(np.geomspace(SKIPPED, size - 1, BANDS + 1)[1:]):
        if edge - edges[-1] >= MIN_COEFFICIENTS:
            edges.append(int(edge))
    # the remainder after the last full band joins that band
    edges[-1] = size - 1
    band = np.searchsorted(edges, number, side="right") - 1
    band[number >= size - 1] = -1
    return band, np.diff(edges).astype(float)
