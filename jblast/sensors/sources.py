r"""Sources of recorded signals: waves, ground motion, wind, ambient sound and rotors.

A source is one summand of a signal (`recorder.Source`). The functions `pressure`,
`microphone`, `anemometer` and `geophone` return the sources of their kind
(`scene.sensor_kinds`), and `sampled_by` those of a user's function of times.

Pressure. A gauge does not disturb the wave. A sample is the mean pressure over its
time, so that a front between two samples has its exact time. For a microphone
absorption by air is a filter over the path of each wave, applied sample by sample to
the blocks so far. The ground is a piston to the air above it, $p = \rho c\,v$: a plane
wave that goes up without attenuation.

Ground velocity. The laws predict one component and do not specify which
(`waves/laws/ground_motion.py`). A geophone records it as the vertical one, with a first
motion upwards. Ground motion caused by the passing air blast is not included.

Wind. Behind a front the air moves as in `vehicle/loads/blast_wave.py`: with $x = p/P_0$
at each moment, away from the charge (or its image below the ground),

$$u = \frac{5 c_0}{7}\frac{x}{\sqrt{1 + 6x/7}} + \frac{1}{\rho_0 R} \int_0^t p\,dt$$

The first term is Rankine's and Hugoniot's, so the peak is the law `blast_wind_m_s` for
the record's peak overpressure. The second is the afterflow of a spherical wave. The
suction lasts here until the impulse of the whole wave is zero, as for spherical sound,
so that the wind ends. A moving anemometer measures the velocity of the air relative to
itself, towards east, north and up as a fixed one. The wind of a wave has the direction
and the strength at the position where the sensor meets it; the integral over the
sensor's clock is multiplied by `Wave.pace`. The downwash of a vehicle's rotors is not
included.

Ambient sound is coloured noise or a looped recording. At height $h$ it is $e^{-h/H}$
times as loud as on the ground. The thesis uses this form and prints no scale; $H$ =
30 m is declared. A recording loops without a seam: its end fades out while its start
fades in, with powers that add up to one, as for uncorrelated sounds. It is resampled to
the microphone's rate by its Fourier series, which is exact for a periodic signal. Wind
on the membrane is noise whose spectrum falls as $f^{-5/3}$, as turbulence does above
20 Hz, with an rms proportional to $\rho U^2$.

The rotors of the sensor's own vehicle are tones. A rotor of $B$ blades at speed
$\Omega(t)$ radiates the harmonics $m$ of its blade passage,

$$p(t) = (\Omega/\Omega_0)^2 \sum_m A_m \sin(m B \varphi(t) + \alpha_m), \quad
  \dot\varphi = \Omega$$

with an amplitude proportional to its thrust. The speed is linear between knots, so the
phase is a parabola. It is integrated exactly, in turns without whole turns, so that its
error does not grow over hours. Harmonics above half the sampling rate, which would
alias, are left out.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Complex, Float, Int, Key, PRNGKeyArray

from jblast.errors import require, shown
from jblast.scene import Air, Ambient, Instrument, Scene, Sensor
from jblast.sensors.noise import BLOCK, DB_OF_OCTAVE, ColouredNoise, coloured_noise
from jblast.sensors.recorder import Block, Source
from jblast.sensors.waves_met import IN_AIR, IN_GROUND, Track, Wave, waves
from jblast.types import as_numbers
from jblast.waves.propagation import (
    TAIL_S,
    absorption_transfer,
    air_density,
    ambient as ambient_of,
    sound_speed_of,
)
from jblast.waves.pulse import GroundPulse, Pulse
from jblast.waves.shock import plane_wave_wind

Laws = Mapping[str, str] | None
Place = Float[Array, "3"] | Track
Signal = Callable[[Scene, Sensor, Float[Array, " time"]], Float[Array, "time ..."]]
"""(scene, sensor, times on the common clock [s]) -> signal without errors, a row per
time and a column per component if there are several; pure."""
WIND_SLOPE = -5.0 / 3.0 * DB_OF_OCTAVE
"""Spectral slope of wind noise [dB/octave]: Kolmogorov's inertial range."""
CROSS_FADE_S = 0.05
"""Cross-fade of a loop's end and start [s], at most a quarter of the loop. It is the
period of 20 Hz, the lowest audible tone; a longer one only shortens the loop."""


def pressure(
    scene: Scene, sensor: Sensor, place: Place, laws: Laws, keys: Sequence[PRNGKeyArray]
) -> tuple[Source, ...]:
    """Return the waves in the air at a pressure gauge."""
    return tuple(Passing(wave.pulse) for wave in waves(scene, place, laws))


def geophone(
    scene: Scene, sensor: Sensor, place: Place, laws: Laws, keys: Sequence[PRNGKeyArray]
) -> tuple[Source, ...]:
    """Return the waves in the ground at a geophone; the ground is linear."""
    return tuple(Passing(wave.pulse) for wave in waves(scene, place, laws, IN_GROUND))


def microphone(
    scene: Scene, sensor: Sensor, place: Place, laws: Laws, keys: Sequence[PRNGKeyArray]
) -> tuple[Source, ...]:
    """Return the waves at a microphone, ambient sound, and wind on its membrane.

    Raises:
        InputError: The samples of the scene's ambient recording have not been read.
    """
    instrument, air = sensor.instrument or Instrument(), scene.air
    piston = air_density(*ambient_of(air), air.relative_humidity) * sound_speed_of(air)
    found: list[Source] = []
    for wave in waves(scene, place, laws, (*IN_AIR, *IN_GROUND)):
        pulse, transfer = wave.pulse, None
        if isinstance(pulse, GroundPulse):
            pulse = pulse._replace(amplitude=piston * pulse.amplitude)
        # inside jit the length is unknown, so every wave in the air gets the filter
        elif isinstance(wave.absorbed_m, Tracer) or float(wave.absorbed_m) > 0.0:
            transfer = _transfer(air, wave.absorbed_m, instrument.rate)
        found.append(Passing(pulse, transfer))
    if (ambient := scene.ambient) is not None:
        sound = ambient_sound(ambient, instrument.rate, keys[0])
        found.append(Sound(sound, ambient.height, place))
    if instrument.wind_noise is not None:
        level = instrument.wind_noise * wind_pressure(air)
        found.append(Sound(coloured_noise(keys[1], instrument.rate, level, WIND_SLOPE)))
    return tuple(found)


def anemometer(
    scene: Scene, sensor: Sensor, place: Place, laws: Laws, keys: Sequence[PRNGKeyArray]
) -> tuple[Source, ...]:
    """Return the scene's wind at an anemometer, and the gust of every wave.

    Raises:
        InputError: A charge has a range instead of a position.
    """
    require(
        all(charge.range_m is None for charge in scene.charges),
        f"sensor {shown(sensor.name)}",
        "charges with a position, which defines the direction of the wind",
        "one with a range only",
    )
    air, found = scene.air, []
    # the scene's wind is horizontal
    wind = jnp.stack([air.wind_east, air.wind_north, jnp.zeros_like(air.wind_east)])
    for wave in waves(scene, place, laws):
        charge = scene.charges[wave.shot]
        # the reflected wave comes from the image below the ground
        up = charge.up if wave.kind == "air" else -charge.up
        source = jnp.stack([charge.east, charge.north, up])
        found.append(_gust(air, place, source, wave._replace(kind="air", shot=0)))
    return (Wind(wind, place if isinstance(place, Track) else None), *found)


def sampled_by(signal: Signal) -> Callable[..., tuple[Source, ...]]:
    """Return the `sources` of a kind of sensor whose signal is a function of times.

    The sensor is fixed: its kind states why it is `unmounted`. A sample is the signal
    in the middle of its interval. Times are single numbers: in single precision those
    of a record of many seconds do not resolve microseconds.

    Args:
        signal: Function of scene, sensor and times.

    Example:
        `SensorKind(name="lamp", sources=sampled_by(brightness), ...)`
    """

    def sources(scene: Scene, sensor: Sensor, place, laws: Laws, keys):
        # the signal reads the names of all laws from the scene
        law = tuple((dict(scene.law) | dict(laws or {})).items())
        return (Sampled(replace(scene, law=law), sensor, signal),)

    return sources


class Sampled(Source):
    """A user's signal."""

    scene: Scene
    sensor: Sensor
    signal: Signal = eqx.field(static=True)

    def block(self, state: Any, block: Block) -> tuple[Any, Array]:
        """Return the state and the signal in the middle of each sample."""
        return state, self.signal(self.scene, self.sensor, block.times)


class Passing(Source):
    """One wave: the mean over each sample of pressure or ground velocity.

    Attributes:
        pulse: The wave on the common clock.
        transfer: Transfer function of absorption by air, or None.
    """

    pulse: Pulse | GroundPulse
    transfer: Complex[Array, " frequency"] | None = None

    @property
    def held(self) -> int:
        """Length of the filter beyond a block, in samples."""
        return 0 if self.transfer is None else 2 * (self.transfer.size - 1)

    def start(self) -> Float[Array, " past"] | None:
        """Return silence as long as the absorption filter."""
        return None if self.transfer is None else jnp.zeros(self.held - BLOCK)

    def span(self, rate: float) -> tuple[float, float]:
        """Return the beginning of the wave and the end of its filtered sound [s]."""
        begin = float(self.pulse.arrival_time)
        return begin, begin + float(self.pulse.lasts) + self.held / rate

    def block(self, state: Any, block: Block) -> tuple[Any, Array]:
        """Return the next state and the mean over each sample."""
        mean = block.here(self.pulse).mean(block.edges[:-1], block.edges[1:])
        if self.transfer is None:
            return state, mean
        # Overlap-save: the block is convolved together with the samples before it, and
        # only its own output, free of circular wrap-around, is used.
        known = jnp.concatenate([state, mean])
        spectrum = jnp.fft.rfft(known) * self.transfer
        return known[BLOCK:], jnp.fft.irfft(spectrum, known.size)[-BLOCK:]


@eqx.filter_jit
def _transfer(
    air: Air, path_m: Float[Array, ""], rate: float
) -> Complex[Array, " frequency"]:
    """Return the absorption filter of a path; 1 for none."""
    # a power of two that holds a block and the filter's tail without wrap-around
    count = 2 ** math.ceil(math.log2(BLOCK + TAIL_S * rate))
    humidity = air.relative_humidity
    return absorption_transfer(count, rate, path_m, *ambient_of(air), humidity)


class Wind(Source):
    """Steady wind, relative to a moving sensor [m/s]."""

    wind: Float[Array, "3"]
    track: Track | None

    def block(self, state: Any, block: Block) -> tuple[Any, Array]:
        """Return the state and the mean velocity over each sample."""
        wind = jnp.broadcast_to(self.wind, (BLOCK, 3))
        if self.track is not None:
            # counted from the block, so that float32 resolves times within it
            own = eqx.tree_at(lambda one: one.time, self.track, block.since(self.track))
            wind = wind - block.rate * jnp.diff(own.at(block.edges), axis=0)
        return state, wind


class Gust(Source):
    """Wind of one wave.

    Attributes:
        pulse: Its pressure, on the common clock; its whole impulse is zero.
        away: Direction from the charge or its image.
        afterflow: Pace over density and distance [m2/kg].
        sound_speed: $c_0$ [m/s].
        ambient_pressure: $P_0$ [Pa].
    """

    pulse: Pulse
    away: Float[Array, "3"]
    afterflow: Float[Array, ""]
    sound_speed: Float[Array, ""]
    ambient_pressure: Float[Array, ""]

    def span(self, rate: float) -> tuple[float, float]:
        """Return beginning and end [s]."""
        begin = float(self.pulse.arrival_time)
        return begin, begin + float(self.pulse.lasts) + 1.0 / rate

    def block(self, state: Any, block: Block) -> tuple[Any, Array]:
        """Return the state and the wind, from a sample's mean pressure.

        The mean of the wind itself differs from it at fronts only.
        """
        pulse, edges = block.here(self.pulse), block.edges
        x = pulse.mean(edges[:-1], edges[1:]) / self.ambient_pressure
        since = block.middle - pulse.arrival_time
        passing = (since > 0) & (since < pulse.lasts)
        # the mean over an empty interval would be 0 / 0 before the arrival
        passed = jnp.where(passing, since, 1.0)
        still = pulse._replace(arrival_time=jnp.zeros_like(pulse.arrival_time))
        impulse = passed * still.mean(jnp.zeros_like(passed), passed)
        wind = plane_wave_wind(x, self.sound_speed)
        wind = wind + self.afterflow * jnp.where(passing, impulse, 0.0)
        return state, wind[:, None] * self.away[None, :]


@eqx.filter_jit
def _gust(air: Air, place: Place, source: Float[Array, "3"], wave: Wave) -> Gust:
    temperature, pressure = ambient_of(air)
    density = air_density(temperature, pressure, air.relative_humidity)
    pulse = wave.pulse
    met = place.at(pulse.arrival_time) if isinstance(place, Track) else place
    still = pulse._replace(arrival_time=jnp.zeros_like(pulse.arrival_time))
    impulse = pulse.duration * still.mean(0.0, pulse.duration)
    # suction until the impulse is zero: the mean of its shape is 9/16 of its peak; an
    # absent wave has no suction to divide by
    silent = pulse.suction == 0.0
    lasting = 16.0 / 9.0 * impulse / jnp.where(silent, 1.0, pulse.suction)
    lasting = jnp.where(silent, pulse.suction_duration, lasting)
    return Gust(
        pulse._replace(suction_duration=lasting),
        (met - source) / wave.distance,
        wave.pace / (density * wave.distance),
        sound_speed_of(air),
        pressure,
    )


class Loop(eqx.Module):
    """Sound that repeats.

    Attributes:
        samples: One turn, then the first block of the next turn [Pa].
    """

    samples: Float[Array, " sample"]

    def start(self) -> Int[Array, ""]:
        """Return the position in the turn."""
        return jnp.zeros((), int)

    def drawn(self, state: Any, index: Int[ArrayLike, ""]) -> tuple[Any, Array]:
        """Return the next state and the samples of a block."""
        turn = self.samples.size - BLOCK
        block = jnp.take(self.samples, state + jnp.arange(BLOCK))
        return (state + BLOCK) % turn, block


class Sound(Source):
    """Noise or a loop, less loud above the ground if it has a height.

    Attributes:
        sound: The sound on the ground.
        height: Height at which it is 1/e times as loud [m]; None: equal everywhere.
        place: East, north, up [m], or a track of positions.
    """

    sound: ColouredNoise | Loop
    height: Float[Array, ""] | None = None
    place: Place | None = None

    def start(self) -> Any:
        """Return the initial state of the sound."""
        return self.sound.start()

    def block(self, state: Any, block: Block) -> tuple[Any, Array]:
        """Return the next state and the samples of a block."""
        state, samples = self.sound.drawn(state, block.number)
        if self.height is None or self.place is None:
            return state, samples
        place = self.place
        up = place.at(block.times)[:, 2] if isinstance(place, Track) else place[2]
        return state, share_at_height(self.height, up) * samples


def share_at_height(
    height: Float[Array, ""], up: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return the loudness of ambient sound over that on the ground [-]."""
    return jnp.exp(-jnp.maximum(up, 0.0) / height)


def wind_pressure(air: Air) -> Float[Array, ""]:
    r"""Return $\rho U^2$ of the wind, to which its noise is proportional [Pa]."""
    density = air_density(*ambient_of(air), air.relative_humidity)
    return density * (air.wind_east**2 + air.wind_north**2)


def ambient_sound(
    ambient: Ambient, rate: float, key: Key[Array, ""]
) -> ColouredNoise | Loop:
    """Return the ambient sound on the ground, prepared for sampling.

    Args:
        ambient: Level and slope of noise, or a recording.
        rate: Sampling rate of the microphone [Hz].
        key: Random key of the noise.

    Raises:
        InputError: The samples of its recording have not been read.
    """
    if ambient.loop is not None:
        return _loop(ambient.loop, ambient.loop_rate, rate)
    # files are read by the caller (`listening.with_ambient`): this function is traced
    expected = f"the samples of {ambient.file} in its loop"
    require(not ambient.file, "ambient", expected, "none")
    return coloured_noise(key, rate, ambient.level, ambient.slope)


@eqx.filter_jit
def _loop(samples: Float[Array, " sample"], loop_rate: float, rate: float) -> Loop:
    """Return a recording as a loop, to the nearest whole number of samples.

    A turn is shorter than the recording by the cross-fade of its end and start.
    """
    fade = max(1, min(round(CROSS_FADE_S * loop_rate), samples.size // 4))
    # sine and cosine: their squares add up to one, so the power is constant
    angle = np.arange(fade) / fade * (np.pi / 2)
    # the mixed part replaces both, so the turn is shorter by one fade
    head, tail = samples[:fade], samples[samples.size - fade :]
    mixed = head * np.sin(angle) + tail * np.cos(angle)
    turn = jnp.concatenate([mixed, samples[fade : samples.size - fade]])
    # whole samples per turn, so that the loop stays periodic
    n = max(1, round(turn.size * rate / loop_rate))
    if n != turn.size:
        spectrum = jnp.fft.rfft(turn)[: n // 2 + 1]
        turn = jnp.fft.irfft(spectrum, n) * (n / turn.size)
    # one block past the turn: `drawn` reads across the seam with no modulo
    return Loop(jnp.resize(turn, (n + BLOCK,)))


class Rotors(Source):
    """Tones of the rotors that carry a microphone.

    Attributes:
        time: Knots of the speeds on the common clock, rising [s]; speeds are constant
            outside them.
        speed: Speed of each rotor [rad/s].
        amplitude: Amplitude of each blade-passage harmonic at the microphone [Pa].
        reference_speed: Rotor speed of these amplitudes [rad/s].
        offset: Phase of each harmonic of each rotor at the first knot [rad].
        blades: Blades per rotor.
    """

    time: Float[Array, " knot"] = eqx.field(converter=as_numbers)
    speed: Float[Array, "knot rotor"] = eqx.field(converter=as_numbers)
    amplitude: Float[Array, " harmonic"] = eqx.field(converter=as_numbers)
    reference_speed: Float[Array, ""] = eqx.field(converter=as_numbers)
    offset: Float[Array, "..."] = eqx.field(converter=as_numbers, default=0.0)
    blades: int = eqx.field(static=True, default=2)

    def __check_init__(self):
        require(
            self.speed.ndim == 2 and self.time.shape == self.speed.shape[:1],
            "rotors",
            "times [knot] and speeds [knot, rotor]",
            f"shapes {self.time.shape} and {self.speed.shape}",
        )

    def block(self, state: Any, block: Block) -> tuple[Any, Array]:
        """Return the state and the sound of the rotors [Pa]."""
        knots, time, last = block.since(self), block.middle, self.time.size - 1
        # before the first and after the last knot the speed is constant
        knot = jnp.clip(jnp.searchsorted(knots, time, side="right") - 1, 0, last)
        after = jnp.minimum(knot + 1, last)
        since = (time - knots[knot])[:, None]
        first = self.speed[knot]
        gap = (knots[after] - knots[knot])[:, None]
        rise = self.speed[after] - first
        rising = (gap > 0) & (since > 0)
        slope = jnp.where(rising, rise / jnp.where(gap > 0, gap, 1.0), 0.0)
        speed = first + slope * since
        turned = since * (first + 0.5 * slope * since) / (2 * math.pi)
        turns = self._turns()[knot] + turned
        turns = turns - jnp.floor(turns)
        harmonic = jnp.arange(1.0, self.amplitude.size + 1.0) * self.blades
        harmonic = harmonic[None, None, :]  # axes: sample, rotor, harmonic
        frequency = speed[:, :, None] * harmonic / (2 * math.pi)
        # sinc: the mean of a tone over a sample
        mean = jnp.sinc(frequency / block.rate)
        mean = jnp.where(frequency < block.rate / 2, mean, 0.0)
        offset = jnp.broadcast_to(self.offset, mean.shape[1:])[None, :, :]
        tone = jnp.sin(2 * math.pi * turns[:, :, None] * harmonic + offset)
        loudness = (speed / self.reference_speed) ** 2
        return state, jnp.einsum("sr,h,srh->s", loudness, self.amplitude, mean * tone)

    def _turns(self) -> Float[Array, "knot rotor"]:
        """Return the phase at the knots, in turns without whole turns."""
        mean = 0.5 * (self.speed[1:] + self.speed[:-1])
        turned = jnp.diff(self.time)[:, None] * mean / (2 * math.pi)
        # Whole turns are dropped before the sum: after thousands of turns float32 would
        # have lost the phase.
        turns = jnp.cumsum(turned - jnp.floor(turned), axis=0)
        turns = jnp.concatenate([jnp.zeros_like(self.speed[:1]), turns])
        return turns - jnp.floor(turns)
