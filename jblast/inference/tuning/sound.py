r"""What a sound record says of a scene: Whittle's likelihood of its spectrum.

The record is $y = m(\theta) + n$: $m$ what `sensors.microphone` makes of the blast
without noise, $n$ Gaussian noise of the spectrum $S(f;\theta)$ (`noise_spectrum`). Of
its Fourier coefficients, which are independent where the record is long,

$$-\ln L = \sum_k \ln S_k + |Y_k - M_k|^2 / S_k$$

(Whittle 1953, from memory). So the wave form tells of absorption, filter and scale, the
powers of what is left tell of noise, in one likelihood. As least squares it is the sum
of two, whose gradients add up to its own at the place where $S$ and the powers are
taken from, which the solver moves on (`solve.py`):

- the wave form over the noise, $\sqrt2\,(Y_k - M_k(\theta))/\sqrt{S_k}$;
- in bands of frequency, of $n$ coefficients each, the deviance of the powers $P$ of
  what is left, $\pm\sqrt{2n\,(g - 1 - \ln g)}$ with $g$ the mean of $P_k/S_k(\theta)$.

The record is tapered by a cosine over a twentieth of it at either end, so that what is
loud does not leak to where it is quiet.
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
from jaxtyping import Array, Complex, Float, Int

from jblast.inference.tuning.limit_samples import filled, filling, padded_places
from jblast.inference.tuning.noise_spectrum import noise_spectrum
from jblast.inference.tuning.pieces import around_limit, bands_of, taper_of
from jblast.scene import Scene
from jblast.sensors import microphone, pressure_gauge

DEEPEST = 1e-9
"""Where the noise is less than this part of the loudest, a record of any length holds
what leaked from elsewhere, and is not looked at."""
FLOAT_STEP = 2.0**-24
"""Rounding of what floats of 32 bits hold."""

RECORDERS = {"microphone": microphone.record, "pressure": pressure_gauge.record}


class Weights(NamedTuple):
    """What is held while least squares are solved.

    Attributes:
        sd: Of each Fourier coefficient; infinite where it is not looked at.
        power: Of what is left of each.
        limit: What fills samples at the recorder's limit (`limit_samples`).
    """

    sd: Float[Array, " frequency"]
    power: Float[Array, " frequency"]
    limit: Float[Array, "limit limit"]


class SoundEvidence(eqx.Module):
    """A record, and what would be recorded.

    Attributes:
        samples: As the file holds them.
        index: Of the sensor in the scene.
        laws: Names of the laws, by quantity.
        by_full_scale: Whether a sample of 1 is the sensor's full scale.
        pascals: What it is otherwise [Pa].
        at_limit: Samples at the recorder's limit, which hold no noise: what is left
            there is what all others make likeliest.
        beside: For each sample where what is left is taken from: itself, or, where too
            many are at the limit for that, the samples before and after.
        share: Of the second of these.
        bands: Which band each Fourier coefficient is of; -1: none.
        counts: Coefficients of each band.
    """

    samples: Float[Array, " sample"]
    index: int = eqx.field(static=True)
    laws: tuple[tuple[str, str], ...] = eqx.field(static=True)
    by_full_scale: bool = eqx.field(static=True)
    pascals: Float[Array, ""]
    at_limit: Int[Array, " limit"]
    beside: Int[Array, "2 sample"]
    share: Float[Array, " sample"]
    bands: Int[Array, " frequency"]
    counts: Float[Array, " band"]

    def unit(self, scene: Scene) -> Float[Array, ""]:
        """Return what a sample of 1 in the file stands for [Pa]."""
        instrument = scene.sensors[self.index].instrument
        if self.by_full_scale and instrument is not None:
            assert instrument.full_scale is not None
            return instrument.full_scale
        return self.pascals

    def predicted(self, scene: Scene) -> Float[Array, " sample"]:
        """Return the record without noise, in the unit of the file."""
        sensor = scene.sensors[self.index]
        instrument = sensor.instrument
        assert instrument is not None, "it is there once unknowns are filled in"
        quiet = replace(instrument, noise=None, wind_noise=None, bits=None)
        ambient = scene.ambient
        if ambient is not None and ambient.loop is None:
            ambient = None
        still = replace(scene, ambient=ambient)
        record = RECORDERS[sensor.kind]
        seconds = self.samples.size / instrument.rate
        pressure = record(
            still,
            replace(sensor, instrument=quiet),
            seconds,
            jax.random.key(0),
            laws=dict(self.laws),
        )
        return pressure / self.unit(scene)

    def left(self, scene: Scene, weights: Weights) -> Complex[Array, " frequency"]:
        """Return the Fourier coefficients of what no blast explains."""
        left = self.samples - self.predicted(scene)
        before, after = left[self.beside[0]], left[self.beside[1]]
        left = (before + self.share * (after - before)) * self._taper()
        return jnp.fft.rfft(filled(left, self.at_limit, weights.sd, weights.limit))

    def noise(self, scene: Scene) -> Float[Array, " frequency"]:
        """Return the expected power of each Fourier coefficient of the noise."""
        sensor = scene.sensors[self.index]
        grid = noise_spectrum(scene, sensor) / jnp.square(self.unit(scene))
        floor = FLOAT_STEP * jnp.max(jnp.abs(self.samples))
        count = self.bands.size
        at = jnp.linspace(0.0, grid.size - 1.0, count)
        spread = jnp.interp(at, jnp.arange(grid.size, dtype=float), grid)
        taper = jnp.sum(jnp.square(self._taper()))
        return taper * (spread + jnp.square(floor))

    def weights(self, scene: Scene) -> Weights:
        """Return what is held while least squares are solved from a scene on."""
        noise = self.noise(scene)
        looked_at = (self.bands >= 0) & (noise > DEEPEST * jnp.max(noise))
        sd = jnp.where(looked_at, jnp.sqrt(noise), jnp.inf)
        held = filling(self.at_limit, sd, self.samples.size)
        left = self.left(scene, Weights(sd, noise, held))
        power = jnp.square(left.real) + jnp.square(left.imag)
        return Weights(sd, power, held)

    def residuals(
        self, scene: Scene, weights: Weights
    ) -> tuple[Float[Array, "2 frequency"], Float[Array, " band"]]:
        """Return those of the wave form, and those of the powers in bands."""
        left = self.left(scene, weights)
        white = over(left, weights.sd / jnp.sqrt(2.0))
        return jnp.stack([white.real, white.imag]), self.deviance(scene, weights)

    def deviance(self, scene: Scene, weights: Weights) -> Float[Array, " band"]:
        """Return how far the powers in bands are off, each of variance 1."""
        g = self.band_ratios(scene, weights)
        off = jnp.abs(g - 1.0) > 1e-4
        safe = jnp.where(off, g, 2.0)
        far = jnp.sign(safe - 1.0) * jnp.sqrt(2.0 * (safe - 1.0 - jnp.log(safe)))
        return jnp.sqrt(self.counts) * jnp.where(off, far, g - 1.0)

    def band_ratios(self, scene: Scene, weights: Weights) -> Float[Array, " band"]:
        """Return the mean of power over expected power in each band, 1 if none."""
        looked_at = jnp.isfinite(weights.sd)
        ratio = jnp.where(looked_at, weights.power / self.noise(scene), 1.0)
        number = jnp.where(self.bands < 0, self.counts.size, self.bands)
        total = jax.ops.segment_sum(ratio, number, self.counts.size)
        return total / self.counts

    def time_residuals(self, scene: Scene) -> Float[Array, " sample"]:
        """Return what is left over time, whitened: each of variance 1."""
        weights = self.weights(scene)
        n = self.samples.size
        white = over(self.left(scene, weights), weights.sd)
        taper = self._taper()
        scaled = jnp.fft.irfft(white, n) * n**0.5
        inside = taper > 0.5
        rms = jnp.sqrt(jnp.mean(jnp.square(taper)))
        return jnp.where(inside, scaled * rms / jnp.where(inside, taper, 1.0), 0.0)

    def _taper(self) -> Float[Array, " sample"]:
        return jnp.asarray(taper_of(self.samples.size))


def over(
    spectrum: Complex[Array, " frequency"], sd: Float[Array, " frequency"]
) -> Complex[Array, " frequency"]:
    """Return a spectrum over a standard deviation, without promotion of types."""
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
        samples: As the file holds them.
        index: Of the sensor in the scene.
        laws: By quantity.
        pascals: What a sample of 1 stands for; None: the sensor's full scale.
        limit: Magnitude at which samples hold no noise any more, in the file's unit.
    """
    clipped = np.abs(samples) >= limit
    at_limit = padded_places(clipped)
    beside, share = around_limit(clipped & (at_limit.size == 0))
    bands, counts = bands_of(samples.size)
    return SoundEvidence(
        samples=jnp.asarray(samples, float),
        index=index,
        laws=tuple(laws.items()),
        by_full_scale=pascals is None,
        pascals=jnp.asarray(1.0 if pascals is None else pascals, float),
        at_limit=jnp.asarray(at_limit),
        beside=jnp.asarray(beside),
        share=jnp.asarray(share, float),
        bands=jnp.asarray(bands),
        counts=jnp.asarray(counts),
    )
