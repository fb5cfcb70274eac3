"""Pressure records made in NumPy and SciPy alone: pulse, sensor, drift, coloured noise.

Nothing here is the fit's: the pulse is its formulas again, summed over 32 instants a
sample; the sensor is SciPy's bilinear filter run over these; drift is half a wave of a
cosine, which is no parabola; noise is an autoregression of first order. Only what a
charge gives at a range (peak, duration, impulse, suction) is asked of jblast's laws.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.signal import bilinear, lfilter

from jblast.scene import Charge, Scene
from jblast.sensors import waves
from jblast.signals.picks import NAMES, pick

SAMPLES = 4096
FINE = 32
SHORTEST, LONGEST = 6.0, 700.0
"""Samples of a positive phase that a record may have."""


class Made(NamedTuple):
    """What is in a record: times in samples, pressures in pascals."""

    scaled_distance: float
    rate: float
    snr: float
    arrival: float
    peak: float
    duration: float
    decay: float
    rise: float
    suction: float
    suction_duration: float
    drift: float
    period: float
    phase: float
    colour: float
    resonance: float
    damping: float

    @property
    def impulse(self) -> float:
        """Of the positive phase [Pa samples]."""
        b = self.decay
        behind = (b - 1.0 + np.exp(-b)) / b**2
        return self.peak * (0.5 * self.rise + (self.duration - self.rise) * behind)


def drawn(many: int, rng: np.random.Generator) -> list[Made]:
    """Draw what records hold: Z of 2 to 300, 10 to 500 kHz, SNR of 5 to 1000."""
    z = np.exp(rng.uniform(np.log(2.0), np.log(300.0), 4 * many))
    mass = np.exp(rng.uniform(np.log(0.05), np.log(100.0), 4 * many))
    rate = np.exp(rng.uniform(np.log(1e4), np.log(5e5), 4 * many))
    pulse = _pulses(mass, z)
    found: list[Made] = []
    for k in range(4 * many):
        length = pulse.duration[k] * rate[k]
        if len(found) == many or not SHORTEST <= length <= LONGEST:
            continue
        rise = pulse.rise_time[k] * rate[k] + np.exp(
            rng.uniform(np.log(0.3), np.log(8.0))
        )
        if rise > 0.3 * length:
            continue
        found.append(
            Made(
                scaled_distance=z[k],
                rate=rate[k],
                snr=np.exp(rng.uniform(np.log(5.0), np.log(1000.0))),
                arrival=rng.uniform(200.0, 900.0),
                peak=pulse.peak[k],
                duration=length,
                decay=pulse.decay[k],
                rise=rise,
                suction=pulse.suction[k],
                suction_duration=pulse.suction_duration[k] * rate[k],
                drift=pulse.peak[k] * rng.uniform(0.02, 0.3) * (rng.random() < 0.5),
                period=rng.uniform(2.0, 5.0) * SAMPLES,
                phase=rng.uniform(0.0, 2.0 * np.pi),
                colour=rng.uniform(0.3, 0.9) * (rng.random() < 0.5),
                resonance=rng.uniform(0.06, 0.3) * (rng.random() < 0.25),
                damping=rng.uniform(0.02, 0.08),
            )
        )
    return found


def _pulses(mass, z):
    """Return the pulses that the laws give."""

    def one(mass, z):
        place = jnp.stack([z * mass ** (1 / 3), jnp.zeros(()), jnp.zeros(())])
        return waves(Scene(Charge(mass_kg=mass)), place)[0].pulse

    made = jax.jit(jax.vmap(one))(jnp.asarray(mass), jnp.asarray(z))
    return jax.tree.map(np.asarray, made)


def signal_of(made: Made, first: int = 0, count: int = SAMPLES):
    """Return samples without noise, of some in a row."""
    t = first + (np.arange(count * FINE) + 0.5) / FINE - 0.5
    pressure = _pulse_at(made, t)
    if made.resonance:
        omega = 2.0 * np.pi * made.resonance
        poles = [1.0, 2.0 * made.damping * omega, omega**2]
        through = lfilter(*bilinear([omega**2], poles, fs=FINE), pressure)
        pressure = np.asarray(through)
    samples = pressure.reshape(count, FINE).mean(axis=1)
    index = first + np.arange(count)
    drift = made.drift * np.cos(2.0 * np.pi * index / made.period + made.phase)
    return samples + drift


def noise_of(made: Made, rng: np.random.Generator, count: int = SAMPLES):
    """Return noise, its standard deviation the peak over the SNR."""
    white = rng.standard_normal(count + 400)
    coloured = lfilter([np.sqrt(1.0 - made.colour**2)], [1.0, -made.colour], white)
    return made.peak / made.snr * np.asarray(coloured)[400:]


def _pulse_at(made: Made, t):
    """Return the overpressure at instants."""
    since = t - made.arrival
    x = np.clip(since / made.rise, 0.0, 1.0)
    s = np.clip((since - made.rise) / (made.duration - made.rise), 0.0, 1.0)
    q = np.clip((since - made.duration) / made.suction_duration, 0.0, 1.0)
    shape = np.where(x < 1.0, 3 * x**2 - 2 * x**3, (1 - s) * np.exp(-made.decay * s))
    return made.peak * shape - 6.75 * made.suction * q * (1 - q) ** 2


UNKNOWNS = (
    "arrival",
    "peak",
    "duration",
    "decay",
    "rise",
    "suction",
    "suction_duration",
)


def arrival_bound(made: Made) -> float:
    """Return the Cramer-Rao bound of the arrival [samples]; a cubic drift is free.

    By central differences of the signal, whitened by the noise that is in it. Frequency
    and damping of a sensor that rings are free, too.
    """
    first = max(0, int(made.arrival - max(64, 1.5 * made.duration)))
    count = min(SAMPLES - first, int(made.arrival - first + 4.5 * made.duration) + 1)
    names = [*UNKNOWNS, *(("resonance", "damping") if made.resonance else ())]
    columns = []
    for name in names:
        size = 0.02 if name == "arrival" else 1e-3 * getattr(made, name)
        up = made._replace(**{name: getattr(made, name) + size})
        down = made._replace(**{name: getattr(made, name) - size})
        columns.append(
            (signal_of(up, first, count) - signal_of(down, first, count)) / (2 * size)
        )
    x = np.linspace(-1.0, 1.0, count)
    columns += [made.peak * x**k for k in range(4)]
    white = lfilter([1.0, -made.colour], [1.0], np.array(columns), axis=1)
    jacobian = np.asarray(white)[:, 1:]
    sigma = made.peak / made.snr * np.sqrt(1.0 - made.colour**2)
    information = jacobian @ jacobian.T / sigma**2
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.pinv(information * np.outer(scale, scale), rcond=1e-13)
    return float(scale[0] * np.sqrt(inverse[0, 0]))


class Picked(NamedTuple):
    """Picks of records, the record along the last axis.

    Attributes:
        value: Arrival in samples, the logarithms of the others.
        sd: Their standard deviations.
        quality: Of each pick.
        notes: Of each pick, joined by commas.
    """

    value: np.ndarray
    sd: np.ndarray
    quality: np.ndarray
    notes: np.ndarray


def picked(samples) -> Picked:
    """Return the picks of records."""
    # in samples, whatever the rate: nothing in a pick depends on the unit of time
    time = np.arange(samples.shape[1], dtype=float)
    found = [pick(time, x) for x in samples]
    value = np.array([[getattr(one, name) for name in NAMES[:4]] for one in found]).T
    value[1:] = np.log(value[1:])
    return Picked(
        value,
        np.array([np.sqrt(np.diag(one.covariance)) for one in found]).T,
        np.array([one.quality for one in found]),
        np.array([",".join(one.notes) for one in found]),
    )
