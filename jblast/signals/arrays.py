r"""Arrays of microphones: arrivals of one blast, times, and direction of the source.

In a bin of the window's transform, sound of power $S$ is common to all records $X_i$,
and each has noise of its own power $N_i$. For Gaussian sound and noise the
log-likelihood of the times $t_i$ at which the front passes is

$$\ln L = \sum_\omega q \left|\sum_i X_i e^{i\omega t_i}/N_i\right|^2, \qquad
  q = \frac{S}{1 + S\sum_i 1/N_i},$$

up to a constant, with the Fisher information
$J_{ij} = -2\sum_\omega \omega^2 q S/(N_i N_j)$ for $i \ne j$ and rows that sum to
zero: delays do not constrain the mean time. Its pseudo-inverse is the covariance of
times relative to the mean of all microphones. For two microphones this is the bound
$\sigma^{-2} = 2\sum \omega^2\gamma^2/(1-\gamma^2)$ of the delay, with the coherence
$\gamma^2 = S^2/((S+N_1)(S+N_2))$. Sums run over the bins above zero and below half the
rate. The search begins at the delays from the microphone with the least noise, the
maxima of

$$C(\tau) = \sum_\omega \psi\, \mathrm{Re}\,(X_1^* X_2 e^{i\omega\tau}), \qquad
  \psi = \frac{S}{S(N_1+N_2) + N_1 N_2}.$$

Noise is assumed independent between microphones. Wind and electronics satisfy this, a
distant road does not: an array smaller than its wavelength records it as another front.

A plane wave from the unit direction $n$ passes the microphone at $r_i$ at
$t_i = t_0 - n\cdot r_i/c$. Weighted least squares give the slowness $p = n/c$ with its
covariance, in as many dimensions as the microphones span. The direction is the one
nearest to it, with $c$ known to some extent:

$$Q(n, \ln c) = (n/c - p)^T K\,(n/c - p) + (\ln c - \ln c_0)^2/\sigma_{\ln c}^2.$$

The rank of the information $K$ is the number of dimensions that the microphones span.
Two microphones, or several in a line, identify only the angle from that line; those in
a plane do not distinguish its two sides. The result lists the angles that are not
identified.

The air between source and array scatters travel times, and so turns and ruffles the
front: microphones a distance $D$ apart at the range $R$ differ by a standard deviation
of $s (R/c) \sqrt{2 (1 - \rho(D/R))}$, with the scatter $s$ of a travel time and the
correlation $\rho$ of neighbouring paths (`jblast.sensors.path_scatter`). This adds to
the covariance of the times, however precise they are. As in a fit, several
correlation functions are weighed by the times, whose departures from a plane measure
the roughness of the air; the covariance of the angles is the mean over all of them.
By the typical one the bearing of an array has a standard deviation of about
$0.03 (R/D)^{1/6}$ rad. The range is not known, and hardly matters: from 50 m to 5 km
this grows by a factor of 2.2. The same function decides whether the times contradict a
plane wave.

The front is assumed flat otherwise. At the range $R$ an array of width $D$ records a
curvature of $D^2/8Rc$ [s], which a symmetric array does not take for a rotation.

References:
    Knapp and Carter (1976), IEEE Trans. ASSP 24(4), 320-327: the weights of pairs in
    their table I; the bound with a sum over bins for their integral.
    Hahn and Tretter (1973), IEEE Trans. Inf. Theory 19(5), 608-614: several sensors.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from numpy.typing import ArrayLike

from jblast.errors import InputError
from jblast.signals.detection import Detection
from jblast.signals.noise import checked_samples

MIN_MICROPHONES, MAX_MICROPHONES = 2, 8
"""Number of microphones of an array. One has no delays; more than eight are no array of
one recorder."""
AVERAGED_BINS = 16
"""Bins on either side over which powers are averaged: 33 in all give the power of the
sound to 17 % at the resolution that a blast's smooth spectrum needs."""
SOUND_SIGNIFICANCE = 6.0
"""Excess of the average power over the noise at which a bin contains sound [standard
deviations of the average]: noise alone does not reach it in thousands of bins."""
LEAST_NOISE_SHARE = 1e-12
"""Smallest noise, over the loudest bin, of digital silence: its weights would be
infinite, as if delays were exact."""
TAPERED_SHARE = 0.05
"""Share of a window over which it fades in, and out: samples cut off at the ends would
correlate at zero delay. The blast is well inside."""
PEAK_SIGNIFICANCE = 10.0
"""Smallest height of a correlation peak [standard deviations of noise alone]. Noise
reaches five or six among the lags of a window; a wrong peak would be a wrong bearing
with a small error, so the limit is far above."""
LAGS_PER_SAMPLE = 8
"""Lags per sample among which the maximum is searched: at half the sampling rate an
eighth is a 16th of a period, from which the scoring of all times converges."""
SCORINGS = 8
"""Steps of Fisher scoring, whose error falls tenfold or more in each."""
FLAT_SHARE = 1e-6
"""Smallest extent of an array in a dimension that it spans, over its largest. A smaller
one is rounding, far below the error of any survey."""
LEAST_LOG_SPEED_SD = 1e-3
"""Smallest standard deviation of ln of the speed: that by 0.6 K. Searches along the
sphere of an exact speed would need thousands of steps."""
IDENTIFIED_SD_RAD = 0.5
"""Largest standard deviation of an identified angle [rad]. Beyond it the linearized
covariance means little, and the 90 % interval covers a quarter of the circle."""
MIRROR_CHI2 = 6.0
"""Difference of chi-squared below which another direction is equally possible: 95 % of
a chi-squared of two angles."""
ANGLES = ("bearing_rad", "elevation_rad")
SAME_DIRECTION_SD = 2.0
"""Largest distance of two directions that count as one [standard deviations]: their
intervals overlap."""
PATH_SCATTER = 0.01
"""Standard deviation of ln of a travel time, as for the laws of arrivals in air."""
SOURCE_RANGE = 2000.0
"""Range at which the scatter of neighbouring paths is evaluated [m]. It is rather too
large than too small: at 50 m standard deviations of angles are 1.8 times too large, at
5 km 1.2 times too small."""
SLOWEST_FRONT = 300.0
"""Slowest speed of a front [m/s]: sound at -50 degrees Celsius."""
TRAVEL_MARGIN_S = 0.01
"""Margin on the travel time between microphones [s]: 3 m of position errors."""


class RelativeTimes(NamedTuple):
    """Times at which a front passed each microphone, relative to their mean.

    Attributes:
        time: Times relative to the mean of all [s]; NaN if one has no delay from the
            clearest.
        covariance: Covariance of these times [s^2]; singular, since their sum is zero.
    """

    time: Float[np.ndarray, " channel"]
    covariance: Float[np.ndarray, "channel channel"]

    @property
    def complete(self) -> bool:
        """True if the delays found connect all microphones."""
        return bool(np.isfinite(self.time).all())


def relative_times(
    samples: ArrayLike,
    rate_hz: float,
    noise_variance: ArrayLike,
    largest_s: ArrayLike | float,
) -> RelativeTimes:
    """Return the times at which a front passed each microphone.

    Args:
        samples: Two to eight records of one window on one clock; an even number of
            samples, with the blast well inside.
        rate_hz: Sampling rate [Hz].
        noise_variance: Variance of the noise in each bin of the window's unitary
            transform (`noise.bin_variances`) [unit of the samples, squared].
        largest_s: Largest delay of all pairs, or of each [s]: the distance between the
            microphones over the speed of sound, with a margin.

    Raises:
        InputError: Too few or too many records, an odd window, or samples that are not
            finite.
    """
    samples = np.array([checked_samples("samples", row) for row in np.asarray(samples)])
    count, length = samples.shape
    if not MIN_MICROPHONES <= count <= MAX_MICROPHONES:
        raise InputError(
            f"samples: expected {MIN_MICROPHONES} to {MAX_MICROPHONES} microphones, "
            f"got {count}"
        )
    if length % 2 or length < 4 * AVERAGED_BINS:
        raise InputError(
            f"samples: expected an even number, {4 * AVERAGED_BINS} or more, "
            f"got {length}"
        )
    # a window that fades only at its ends (Tukey's)
    ends = max(int(TAPERED_SHARE * length), 1)
    rise = 0.5 * (1 - np.cos(np.pi * (np.arange(ends) + 0.5) / ends))
    fade = np.concatenate([rise, np.ones(length - 2 * ends), rise[::-1]])
    spectra = np.fft.rfft((samples - samples.mean(axis=1, keepdims=True)) * fade)
    noise = np.asarray(noise_variance, float) * np.sum(fade**2)
    loudest = np.max(np.abs(spectra) ** 2, axis=1, keepdims=True)
    # simulated records may have no noise, and weights must be finite
    noise = np.maximum(noise, LEAST_NOISE_SHARE * loudest)
    gain, sound = _gain_and_sound(np.abs(spectra) ** 2, noise)
    # microphones of unlike gain record one sound: equal signals are what the weights
    # of pairs assume
    spectra, noise = spectra / np.sqrt(gain)[:, None], noise / gain[:, None]
    # of a dead microphone none
    precision = np.divide(1.0, noise, out=np.zeros_like(noise), where=noise > 0)
    reach = np.broadcast_to(np.asarray(largest_s, float), (count, count))
    first = int(np.argmax(precision @ sound))
    time = np.array(
        [
            _delay(spectra[[first, n]], sound, precision[[first, n]], rate_hz, most)
            if n != first
            else 0.0
            for n, most in enumerate(reach[first])
        ]
    )
    time -= time.mean()
    if np.isnan(time).any():
        return RelativeTimes(time, np.full((count, count), np.nan))
    omega = 2 * np.pi * np.arange(len(sound)) * rate_hz / length
    weight = sound / (1 + sound * precision.sum(axis=0))
    # spectra are real at zero and at half the rate: no phase is defined there
    weight[[0, -1]] = 0.0
    # the pseudo-inverse is for a mean of zero, which delays do not constrain
    between = 2 * (weight * sound * omega**2 * precision) @ precision.T
    np.fill_diagonal(between, 0.0)
    covariance = np.linalg.pinv(np.diag(between.sum(axis=1)) - between, hermitian=True)
    for _ in range(SCORINGS):
        beams = spectra * precision * np.exp(1j * omega * time[:, None])
        slope = -2 * np.imag(np.conj(beams.sum(axis=0)) * beams) @ (weight * omega)
        time = time + covariance @ slope
    return RelativeTimes(time, covariance)


def _gain_and_sound(
    power: Float[np.ndarray, "channel bin"], noise: Float[np.ndarray, "channel bin"]
) -> tuple[Float[np.ndarray, " channel"], Float[np.ndarray, " bin"]]:
    """Return the relative power gain of each record, and the common power of the sound.

    The power is zero in bins where the sound is not distinguished from the noise.
    """
    width = 2 * AVERAGED_BINS + 1
    kernel = np.full(width, 1 / width)
    above = np.array([np.convolve(p, kernel, "same") for p in power - noise])
    over = np.divide(above, noise, out=np.zeros_like(above), where=noise > 0)
    # power of noise has a relative error of 1; of all records and bins averaged, the
    # sum of the relative excess has a variance of records / width
    audible = over.sum(axis=0) > SOUND_SIGNIFICANCE * np.sqrt(len(power) / width)
    audible &= (above > 0).all(axis=0)
    if not audible.any():
        return np.ones(len(power)), np.zeros(power.shape[1])
    gain = above[:, audible].sum(axis=1)
    gain = gain / gain.mean()
    return gain, np.where(audible, (above / gain[:, None]).mean(axis=0), 0.0)


def _delay(
    spectra: Complex[np.ndarray, "2 bin"],
    sound: Float[np.ndarray, " bin"],
    precision: Float[np.ndarray, "2 bin"],
    rate_hz: float,
    largest_s: float,
) -> float:
    """Return the delay of the second of two records [s]; NaN if none is found."""
    product = precision[0] * precision[1]
    sound = sound / (1 + sound * precision.sum(axis=0))
    sound[[0, -1]] = 0.0
    size = 2 * (len(sound) - 1) * LAGS_PER_SAMPLE
    cross = sound * product * np.conj(spectra[0]) * spectra[1]
    fine = np.fft.irfft(cross, size) * (size / 2)
    reach = min(int(largest_s * rate_hz * LAGS_PER_SAMPLE), size // 2 - 1)
    lags = np.arange(-reach, reach + 1)
    lag = lags[np.argmax(fine[lags])]
    # standard deviation of the same sum for noise alone, whose phases are random
    by_chance = np.sqrt(0.5 * np.sum(sound**2 * product))
    if not fine[lag] > PEAK_SIGNIFICANCE * by_chance:
        return np.nan
    return float(lag) / (rate_hz * LAGS_PER_SAMPLE)


class Direction(NamedTuple):
    """Direction of the source of a front.

    Attributes:
        bearing: Bearing of the source, clockwise from north [rad]; NaN if not
            identified.
        elevation: Its elevation above the horizon [rad]; NaN if not identified.
        covariance: Covariance of bearing and elevation [rad^2]; NaN if not identified.
        mirror: Bearing and elevation of an equally possible direction, on the other
            side of the plane of the microphones; None without one.
        undetermined: Angles that these microphones do not identify: `bearing_rad`,
            `elevation_rad`.
        layout: Layout of the microphones: `two`, `collinear`, `coplanar` or `spatial`.
        chi2: Chi-squared of the times about the plane wave.
        dof: Its degrees of freedom; zero without redundant times.
    """

    bearing: float
    elevation: float
    covariance: Float[np.ndarray, "2 2"]
    mirror: tuple[float, float] | None
    undetermined: tuple[str, ...]
    layout: str
    chi2: float
    dof: int


def direction(
    positions: ArrayLike,
    times: RelativeTimes,
    sound_speed: float,
    sound_speed_sigma: float = 0.0,
    *,
    path_scatter: float = PATH_SCATTER,
    source_range: float = SOURCE_RANGE,
) -> Direction:
    """Return the direction of the source of a front.

    Args:
        positions: East, north, up of the microphones [m].
        times: Times at which the front passed each of them.
        sound_speed: Speed of the front over the ground [m/s]; that of sound for a weak
            one.
        sound_speed_sigma: Its standard deviation [m/s], including the wind's.
        path_scatter: Standard deviation of ln of a travel time, most of which is common
            to neighbouring paths. 0 assumes uniform air.
        source_range: Range for the scatter of neighbouring paths [m].

    Raises:
        InputError: All microphones have one position, or one has no time.
    """
    positions = np.asarray(positions, float)
    if positions.shape != (len(times.time), 3):
        raise InputError(
            f"positions: expected {len(times.time)} rows of east, north, up; got "
            f"shape {positions.shape}"
        )
    if not times.complete:
        missing = int(np.argmin(np.isfinite(times.time))) + 1
        raise InputError(
            f"times: expected a time for each microphone, got NaN for {missing}"
        )
    apart = positions - positions.mean(axis=0)
    _, sizes, axes = np.linalg.svd(apart, full_matrices=False)
    span = int((sizes > FLAT_SHARE * sizes[0]).sum()) if sizes[0] > 0 else 0
    if span == 0:
        raise InputError(
            "positions: expected different positions, got one for all microphones"
        )
    basis, center = axes[:span].T, np.eye(len(positions)) - 1 / len(positions)
    between = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    # grouping of picks needs no scatter, whose package imports JAX
    from jblast.sensors.path_scatter import KERNELS, TYPICAL, correlation

    # The first function of the correlation, rough at small separations, is left out for
    # arrays that are small compared with the range: at D/R = 0.001 it gives bearings a
    # standard deviation of 80 degrees; those of eight infrasound arrays are off by 3.6.
    # Three microphones have no redundant times that could exclude it.
    small_aperture = np.eye(len(KERNELS))[1:]
    travel_sd = path_scatter * source_range / sound_speed
    fits = []
    for weights in small_aperture if path_scatter > 0 else [TYPICAL]:
        lacking = 1 - correlation(np.square(between / source_range), weights)
        # covariance relative to the mean time; the common part of the scatter cancels
        of_air = -(travel_sd**2) * center @ lacking @ center
        fits.append(
            _plane_wave_fit(
                apart,
                basis,
                times.time,
                times.covariance + of_air,
                sound_speed,
                max(sound_speed_sigma / sound_speed, LEAST_LOG_SPEED_SD),
            )
        )
    best = fits[int(np.argmax([fit.log_evidence for fit in fits]))]
    typical = fits[int(np.argmax(small_aperture @ TYPICAL))] if len(fits) > 1 else best
    resolved, covariance, mirror = _resolved_angles(best, _averaged(fits, best), span)
    hidden = ~resolved
    values = np.where(resolved, angles_of(best.found), np.nan)
    names = {1: "two" if len(positions) == 2 else "collinear", 2: "coplanar"}
    return Direction(
        bearing=float(values[0]),
        elevation=float(values[1]),
        covariance=np.where(hidden[:, None] | hidden, np.nan, covariance),
        mirror=mirror,
        undetermined=tuple(name for name, lost in zip(ANGLES, hidden) if lost),  # noqa: B905
        layout=names.get(span, "spatial"),
        chi2=typical.chi2,
        dof=len(positions) - 1 - min(span, 2),
    )


class PlaneWaveFit(NamedTuple):
    """A plane wave fitted to times with one correlation function of the air.

    Attributes:
        wave: Measurements of the front.
        found: Slowness of the most probable front, as in `PlaneWave`.
        other: The one on the other side of the plane of the microphones.
        chi2: Chi-squared of the times about the first.
        log_evidence: ln of the probability of the times, up to a constant.
    """

    wave: "PlaneWave"
    found: Float[np.ndarray, "3"]
    other: Float[np.ndarray, "3"]
    chi2: float
    log_evidence: float


def _plane_wave_fit(
    apart: Float[np.ndarray, "channel 3"],
    basis: Float[np.ndarray, "3 dimension"],
    time: Float[np.ndarray, " channel"],
    covariance: Float[np.ndarray, "channel channel"],
    sound_speed: float,
    log_speed_sd: float,
) -> PlaneWaveFit:
    """Fit a plane wave to times relative to their mean.

    Args:
        apart: Positions of the microphones relative to their mean [m].
        basis: Directions that they span.
        time: Times [s].
        covariance: Covariance of the times [s^2].
        sound_speed: Expected speed [m/s].
        log_speed_sd: Standard deviation of its ln.
    """
    design = -apart @ basis
    # pseudo-inverse: the covariance of times relative to their mean is singular
    weight = np.linalg.pinv(covariance, rcond=1e-9, hermitian=True)
    inside = design.T @ weight @ design
    slowness = basis @ np.linalg.solve(inside, design.T @ weight @ time)
    left = time + apart @ slowness
    information = basis @ inside @ basis.T / sound_speed**2
    wave = PlaneWave(information, slowness * sound_speed, log_speed_sd)
    found = wave.nearest(wave.start())
    other = wave.mirrored(found)
    # microphones in a plane do not distinguish its sides at all
    if basis.shape[1] == 3:
        other = wave.nearest(other)
    if wave.misfit(other) < wave.misfit(found):
        found, other = other, found
    chi2 = float(left @ weight @ left) + wave.misfit(found)
    # determinant without the zero eigenvalue of the mean; flat prior of the slowness
    sizes = np.linalg.eigvalsh(covariance)[1:]
    size = np.sum(np.log(sizes)) + np.linalg.slogdet(inside)[1]
    return PlaneWaveFit(wave, found, other, chi2, float(-0.5 * (chi2 + size)))


def _averaged(
    fits: Sequence[PlaneWaveFit], best: PlaneWaveFit
) -> Float[np.ndarray, "2 2"]:
    """Return the covariance of angles about the best fit, averaged over fits."""
    evidence = np.array([fit.log_evidence for fit in fits])
    # relative to the largest, as exponentials of a precise array's evidence underflow
    weights = np.exp(evidence - evidence.max())
    total = np.zeros((2, 2))
    for fit, weight in zip(fits, weights / weights.sum(), strict=True):
        same = max(fit.found, fit.other, key=lambda side: side @ best.found)
        off = angles_of(same) - angles_of(best.found)
        off = (off + np.pi) % (2 * np.pi) - np.pi
        total += weight * (fit.wave.covariance(fit.found) + np.outer(off, off))
    return total


class PlaneWave(NamedTuple):
    """Measurements of a plane wave by an array.

    Slownesses, toward the source, are relative to the expected one: of a front of
    that speed the length is 1.

    Attributes:
        information: Information on the slowness in the directions that the microphones
            span.
        slowness: Slowness in these directions.
        log_sd: Standard deviation of ln of the speed.
    """

    information: Float[np.ndarray, "3 3"]
    slowness: Float[np.ndarray, "3"]
    log_sd: float

    def axes(self) -> Float[np.ndarray, "3 3"]:
        """Return directions, as columns, by how well the slowness is constrained."""
        return np.linalg.eigh(self.information)[1]

    def start(self) -> Float[np.ndarray, "3"]:
        """Return the measured slowness, completed along the normal by the speed."""
        normal = self.axes()[:, 0]
        along = float(self.slowness @ normal)
        inside = self.slowness - along * normal
        # errors may make a front along the plane slower than sound: the root must be
        # real, and the slope along the normal finite
        across = np.sqrt(max(1.0 - inside @ inside, 1e-4))
        toward = inside + np.copysign(across, along) * normal
        return toward / np.linalg.norm(toward)

    def mirrored(self, front: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
        """Return a front from the other side of the plane of the microphones."""
        normal = self.axes()[:, 0]
        return front - 2 * (front @ normal) * normal

    def residuals(self, front: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4"]:
        """Return differences to the measurements and the speed, over their errors."""
        sizes, axes = np.linalg.eigh(self.information)
        root = (axes * np.sqrt(np.maximum(sizes, 0.0))).T
        log_slowness = np.log(np.linalg.norm(front))
        return np.append(root @ (front - self.slowness), log_slowness / self.log_sd)

    def misfit(self, front: Float[np.ndarray, "3"]) -> float:
        """Return chi-squared of a front."""
        return float(np.sum(self.residuals(front) ** 2))

    def nearest(self, front: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
        """Return the front of least chi-squared near one."""
        # SciPy's optimisers take 0.3 s to import, and most searches have no array
        from scipy.optimize import least_squares

        # Levenberg and Marquardt's method accepts unknowns that are not identified
        return least_squares(
            self.residuals, front, method="lm", ftol=1e-15, xtol=1e-12
        ).x

    def covariance(self, front: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2 2"]:
        """Return the covariance of bearing and elevation [rad^2].

        The variance of a direction without information is very large.
        """
        east, north, up = front
        level, length = np.hypot(east, north), np.linalg.norm(front)
        of_bearing = np.array([north, -east, 0.0]) / level**2
        of_elevation = np.array([-east * up, -north * up, level**2])
        slope = np.stack([of_bearing, of_elevation / (level * length**2)])
        by_speed = front / (length**2 * self.log_sd)
        hessian = self.information + np.outer(by_speed, by_speed)
        # a line or a plane of microphones has no information in one direction: a very
        # large variance there instead of a singular matrix
        least = 1e-12 * np.trace(hessian) * np.eye(3)
        return slope @ np.linalg.inv(hessian + least) @ slope.T


def _resolved_angles(
    fit: PlaneWaveFit, covariance: Float[np.ndarray, "2 2"], span: int
) -> tuple[np.ndarray, np.ndarray, tuple[float, float] | None]:
    """Return the identified angles (True), their covariance, the mirror direction."""
    wave, found, other = fit.wave, fit.found, fit.other
    # a line of microphones identifies a cone about it: an elevation if it is vertical
    if span == 1:
        upright = abs(float(wave.axes()[2, -1])) > 1 - FLAT_SHARE
        covariance = np.diag([np.inf, covariance[1, 1]])
        resolved = np.array(
            [False, upright and covariance[1, 1] < IDENTIFIED_SD_RAD**2]
        )
        return resolved, covariance, None
    sd = np.sqrt(np.diag(covariance))
    mirrored = angles_of(other)
    turned = (mirrored - angles_of(found) + np.pi) % (2 * np.pi) - np.pi
    as_good = wave.misfit(other) - wave.misfit(found) < MIRROR_CHI2
    # coplanar microphones never distinguish the two sides, however close they are
    differ = as_good & (
        np.abs(turned) > (FLAT_SHARE if span == 2 else SAME_DIRECTION_SD * sd)
    )
    mirror = (float(mirrored[0]), float(mirrored[1])) if differ.any() else None
    return (sd < IDENTIFIED_SD_RAD) & ~differ, covariance, mirror


def angles_of(toward: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2"]:
    """Return bearing, clockwise from north, and elevation of a vector [rad]."""
    level = np.hypot(toward[0], toward[1])
    bearing = np.arctan2(toward[0], toward[1]) % (2 * np.pi)
    return np.array([bearing, np.arctan2(toward[2], level)])


class Bangs(NamedTuple):
    """Arrivals by event.

    Attributes:
        heard: For each event, in order of time, the arrival at each sensor.
        left_out: Weaker arrivals at a sensor within one event: echoes, or another event
            before the first had reached all sensors.
    """

    heard: tuple[dict[str, Detection], ...]
    left_out: tuple[tuple[str, Detection], ...]


def bangs(
    detections: Mapping[str, Sequence[Detection]],
    positions: Mapping[str, Sequence[float]],
    *,
    one: bool = False,
) -> Bangs:
    """Return arrivals grouped by event.

    A front needs at most the travel time of sound from the first microphone to the
    last, so arrivals within that time belong to one event. Of several at one sensor the
    loudest does.

    Args:
        detections: Arrivals by sensor.
        positions: East, north, up of each [m].
        one: True if all belong to one event, as for recorders with different clocks.
    """
    where = np.array([positions[name] for name in detections]).reshape(-1, 3)
    apart = np.linalg.norm(where[:, None] - where[None], axis=-1).max(initial=0.0)
    longest = np.inf if one else apart / SLOWEST_FRONT + TRAVEL_MARGIN_S
    every = [(name, found) for name, of in detections.items() for found in of]
    # in order of time, so that an event ends one travel time after its first arrival
    every.sort(key=lambda heard: heard[1].time_s)
    heard: list[dict[str, Detection]] = []
    left_out: list[tuple[str, Detection]] = []
    first = -np.inf
    for name, found in every:
        if not heard or found.time_s - first > longest:
            heard.append({})
            first = found.time_s
        other = heard[-1].get(name)
        if other is None or found.statistic > other.statistic:
            heard[-1][name] = found
            found = other
        if found is not None:
            left_out.append((name, found))
    return Bangs(tuple(heard), tuple(left_out))
