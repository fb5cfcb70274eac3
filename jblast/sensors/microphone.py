r"""Sound recorded by a microphone: blasts, ambient sound, wind and rotors.

Blasts are the waves of `arrivals.heard`. A sample is the mean pressure over its time,
so that a front between two samples has its exact time. Absorption by air is a filter
over the path of each wave, applied sample by sample to the blocks so far.

Ambient sound is coloured noise or a looped recording. At height $h$ it is $e^{-h/H}$
times as loud as on the ground. The thesis uses this form and prints no scale; $H$ =
30 m is declared. A recording loops without a seam: its end fades out while its start
fades in, with powers that add up to one, as for uncorrelated sounds. It is resampled to
the microphone's rate by its Fourier series, which is exact for a periodic signal.

Wind on the membrane is noise whose spectrum falls as $f^{-5/3}$, as turbulence does
above 20 Hz, with an rms proportional to $\rho U^2$.

The rotors of the sensor's own vehicle are tones. A rotor of $B$ blades at speed
$\Omega(t)$ radiates the harmonics $m$ of its blade passage,

$$p(t) = (\Omega/\Omega_0)^2 \sum_m A_m \sin(m B \varphi(t) + \alpha_m), \quad
  \dot\varphi = \Omega$$

with an amplitude proportional to its thrust. The speed is linear between knots, so the
phase is a parabola. It is integrated exactly, in turns without whole turns, so that its
error does not grow over hours. Samples are means over their duration. Harmonics above
half the sampling rate, which would alias, are left out.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Complex, Float, Int, Key

from jblast.errors import InputError, shown
from jblast.scene import Ambient, Instrument, Scene, Sensor
from jblast.sensors.arrivals import Track, counted_from, heard, wave_mean
from jblast.sensors.gauge import check_kind, edges_of, rate_of
from jblast.sensors.instrument import Chain, chain_block, chain_start, instrument_chain
from jblast.sensors.samples import (
    BLOCK,
    DB_OF_OCTAVE,
    ColouredNoise,
    Packet,
    block_start,
    blocks,
    coloured_noise,
    first_samples,
    noise_block,
    noise_start,
    packets,
    sample_count,
)
from jblast.sensors.wave_paths import Heard
from jblast.types import as_float_array
from jblast.waves.propagation import (
    TAIL_S,
    absorption_transfer,
    air_density,
    ambient,
)
from jblast.waves.pulse import GroundPulse, Pulse

WIND_SLOPE = -5.0 / 3.0 * DB_OF_OCTAVE
"""Spectral slope of wind noise [dB/octave]: Kolmogorov's inertial range."""
CROSS_FADE_S = 0.05
"""Cross-fade of a loop's end and start [s], at most a quarter of the loop. It is the
period of 20 Hz, the lowest audible tone; a longer one only shortens the loop."""
UNDERFLOW = 760.0
"""Time constants after which a ground pulse is exactly zero in double precision."""


class WavePaths(NamedTuple):
    """Paths by which a blast reaches the microphone.

    Attributes:
        ground: True to include the wave in the ground.
        absorption: True to apply absorption by air where the laws do not include it
            (`Heard.absorbed`).
    """

    ground: bool = True
    absorption: bool = True


EVERY_PATH = WavePaths()


class Rotors(eqx.Module):
    """Rotors whose tones a microphone on board records.

    Attributes:
        time: Knots of the speeds, rising [s]; speeds are constant outside them.
        speed: Speed of each rotor [rad/s].
        amplitude: Amplitude of each blade-passage harmonic at the microphone [Pa].
        reference_speed: Rotor speed of these amplitudes [rad/s].
        blades: Blades per rotor.
    """

    time: Float[Array, " knot"] = eqx.field(converter=as_float_array)
    speed: Float[Array, "knot rotor"] = eqx.field(converter=as_float_array)
    amplitude: Float[Array, " harmonic"] = eqx.field(converter=as_float_array)
    reference_speed: Float[Array, ""] = eqx.field(converter=as_float_array)
    blades: int = eqx.field(static=True, default=2)

    def __check_init__(self):
        if self.speed.ndim != 2 or self.time.shape != self.speed.shape[:1]:
            raise InputError(
                "rotors: expected times [knot] and speeds [knot, rotor], got shapes "
                f"{self.time.shape} and {self.speed.shape}"
            )


def record(
    scene: Scene,
    microphone: Sensor,
    duration_s: float,
    key: Key[Array, ""],
    *,
    start_s: Float[ArrayLike, ""] = 0.0,
    laws: Mapping[str, str] | None = None,
    track: Track | None = None,
    rotors: Rotors | None = None,
    wave_paths: WavePaths = EVERY_PATH,
) -> Float[Array, " sample"]:
    """Return the record of a microphone [Pa].

    Pure, for jit, vmap and grad in every number of the scene, the microphone and the
    rotors; only the duration is static.

    Args:
        scene: Charges, air and ambient sound.
        microphone: Sensor with position, clock and instrument.
        duration_s: Length of the record [s].
        key: Random key of all noise.
        start_s: Start of the first sample on the microphone's clock [s].
        laws: By quantity; absent ones as for `arrivals.heard`.
        track: Positions over time on the common clock, instead of its position.
        rotors: Rotors of the vehicle that carries it.
        wave_paths: Paths by which blasts reach it.

    Returns:
        Samples [Pa] at the rate of its instrument.

    Raises:
        InputError: The sensor is no microphone, is underground, or is at a charge.

    Example:
        `microphone.record(scene, scene.sensors[0], 1.0, jax.random.key(0))`
    """
    # the only static number: everything else may be traced
    n = sample_count(duration_s, rate_of(microphone))
    sound, state = _start(
        scene, microphone, key, start_s, laws, track, rotors, wave_paths
    )
    return first_samples(sound_block, sound, state, n)


def stream(
    scene: Scene,
    microphone: Sensor,
    key: Key[Array, ""],
    *,
    packet_s: float | None = None,
    packets_hz: float | None = None,
    start_s: float = 0.0,
    laws: Mapping[str, str] | None = None,
    track: Track | None = None,
    rotors: Rotors | None = None,
    wave_paths: WavePaths = EVERY_PATH,
) -> Iterator[Packet]:
    """Yield the record of a microphone in packets, without end, in constant memory.

    The samples are those of `record`, whatever the packet size.

    Args:
        scene: Charges, air, ground and sensors.
        microphone: Sensor with position, clock and instrument.
        key: Random key of all noise.
        packet_s: Duration of a packet [s]; or
        packets_hz: packets per second [Hz].
        start_s: Start of the first sample on the microphone's clock [s].
        laws: By quantity; absent ones as for `arrivals.heard`.
        track: Positions over time on the common clock, instead of its position.
        rotors: Rotors of the vehicle that carries it.
        wave_paths: Paths by which blasts reach it.

    Raises:
        InputError: As in `record`.
        ValueError: As in `packets`.

    Example:
        `for packet in microphone.stream(scene, sensor, key, packets_hz=100.0): ...`
    """
    sound, state = _start(
        scene, microphone, key, start_s, laws, track, rotors, wave_paths
    )
    timing = {"packet_s": packet_s, "packets_hz": packets_hz, "start_s": start_s}
    rate = rate_of(microphone)
    spans = [_span(wave, rate) for wave in sound.waves]

    def block_of(sound: Sound, state: Any, index: Int[np.ndarray, " block"]) -> Any:
        """Return a block of the waves that sound in it: the others add zeros."""
        start = int(index[0]) * BLOCK / rate
        stop = start + BLOCK / rate
        some = [
            n for n, (begin, end) in enumerate(spans) if begin < stop and end > start
        ]
        own = sound._replace(waves=tuple(sound.waves[n] for n in some))
        parts = tuple(state[0][n] for n in some)
        (parts, *rest), samples = blocks(sound_block, own, (parts, *state[1:]), index)
        now = dict(enumerate(state[0])) | dict(zip(some, parts, strict=True))
        return (tuple(now.values()), *rest), samples

    # Of a minute with eight blasts, a wave sounds in a hundredth. With all waves in
    # each block a microphone takes eight times as long.
    return packets(sound_block, sound, state, rate, run_blocks=block_of, **timing)


def _span(wave: "BlastWave", rate: float) -> tuple[float, float]:
    """Return the beginning of a wave and the end of its filtered sound [s]."""
    pulse = wave.pulse
    if isinstance(pulse, GroundPulse):
        lasts = UNDERFLOW * float(pulse.time_constant)
    else:
        lasts = float(pulse.duration + pulse.suction_duration)
    begin = float(pulse.arrival_time)
    # the filter holds its input for its length
    held = 0 if wave.transfer is None else 2 * (wave.transfer.size - 1)
    return begin, begin + lasts + held / rate


class BlastWave(NamedTuple):
    """One wave, prepared for sampling.

    Attributes:
        pulse: Pressure over time.
        transfer: Transfer function of absorption by air, or None.
    """

    pulse: Pulse | GroundPulse
    transfer: Complex[Array, " frequency"] | None = None

    def later(self, *times: Float[Array, ""]) -> "BlastWave":
        """Return the wave with its arrival on a later clock."""
        return self._replace(pulse=counted_from(self.pulse, *times))


class Loop(NamedTuple):
    """Sound that repeats.

    Attributes:
        samples: One turn, then the first block of the next turn [Pa].
    """

    samples: Float[Array, " sample"]


class RotorPhase(NamedTuple):
    """Rotors, prepared for sampling.

    Attributes:
        rotors: The rotors.
        time: Knots, since the start of the record [s].
        turns: Phase of each rotor at the knots, in turns without whole turns.
        offset: Phase of each harmonic of each rotor [rad].
    """

    rotors: Rotors
    time: Float[Array, " knot"]
    turns: Float[Array, "knot rotor"]
    offset: Float[Array, "rotor harmonic"]


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
        turn = at_rate(
            seamless(ambient.loop, ambient.loop_rate), ambient.loop_rate, rate
        )
        # one block past the turn: `ambient_block` reads across the seam with no modulo
        return Loop(jnp.resize(turn, (turn.size + BLOCK,)))
    # files are read by the caller (`listening.with_ambient`): this function is traced
    if ambient.file:
        raise InputError(
            f"ambient: expected the samples of {ambient.file} in its loop, got none"
        )
    return coloured_noise(key, rate, ambient.level, ambient.slope)


class Sound(NamedTuple):
    """A microphone in a scene, prepared for sampling.

    Attributes:
        waves: All waves, with arrivals counted from the first sample.
        ambient: Ambient sound of the scene, or None.
        ambient_sound: The same as noise or a loop, or None.
        place: East, north, up [m], or a track of positions over time.
        begin: Common clock at the first sample [s].
        wind: Wind noise on the membrane, or None.
        rotors: Rotors on board, or None.
        chain: Signal chain of the instrument.
    """

    waves: tuple[BlastWave, ...]
    ambient: Ambient | None
    ambient_sound: ColouredNoise | Loop | None
    place: Float[Array, "3"] | Track
    begin: Float[Array, ""]
    wind: ColouredNoise | None
    rotors: RotorPhase | None
    chain: Chain


def _start(
    scene: Scene,
    microphone: Sensor,
    key: Key[Array, ""],
    start_s: Float[ArrayLike, ""],
    laws: Mapping[str, str] | None,
    track: Track | None,
    rotors: Rotors | None,
    wave_paths: WavePaths,
) -> tuple[Sound, Any]:
    """Prepare a microphone; reject a sensor of another kind or below the ground."""
    check_kind(microphone, "microphone", track=track)
    start = as_float_array(start_s)
    if not isinstance(start, Tracer) and not np.isfinite(np.asarray(start)):
        raise InputError(
            f"sensor {shown(microphone.name)}: expected a finite start_s, got "
            f"{float(start):g} s"
        )
    place = microphone.position_m if track is None else track
    # Outside jit the waves compile one by one, absent ones are left out, and errors in
    # the remaining ones are reported.
    waves = blast_waves(scene, place, rate_of(microphone), laws, wave_paths)
    return set_up(scene, microphone, key, start, waves, track, rotors)


@eqx.filter_jit
def set_up(
    scene: Scene,
    microphone: Sensor,
    key: Key[Array, ""],
    start_s: Float[Array, ""],
    waves: tuple[BlastWave, ...],
    track: Track | None,
    rotors: Rotors | None,
) -> tuple[Sound, Any]:
    """Return a prepared microphone and its initial state.

    Args:
        scene: Charges, air, ground and sensors.
        microphone: Sensor with position, clock and instrument.
        key: Random key of all noise.
        start_s: Start of the first sample on the microphone's clock [s].
        waves: All waves on the common clock.
        track: Positions over time, instead of its position.
        rotors: Rotors on board.
    """
    instrument = microphone.instrument or Instrument()
    # one key per source: adding one does not change the others
    keys = jax.random.split(key, 4)
    begin = start_s - microphone.clock_offset_s
    place = microphone.position_m if track is None else track
    background = wind = None
    if scene.ambient is not None:
        background = ambient_sound(scene.ambient, instrument.rate, keys[0])
    if instrument.wind_noise is not None:
        air = scene.air
        density = air_density(*ambient(air), air.relative_humidity)
        # dynamic pressure, to which the membrane's noise is proportional
        level = density * (air.wind_east**2 + air.wind_north**2)
        level = instrument.wind_noise * level
        wind = coloured_noise(keys[1], instrument.rate, level, WIND_SLOPE)
    sound = Sound(
        waves=tuple(wave.later(begin) for wave in waves),
        ambient=scene.ambient,
        ambient_sound=background,
        place=place,
        begin=begin,
        wind=wind,
        rotors=None if rotors is None else rotor_phase(rotors, begin, keys[2]),
        chain=instrument_chain(instrument, keys[3]),
    )
    return sound, (
        tuple(wave_start(wave) for wave in waves),
        None if background is None else ambient_start(background),
        None if wind is None else noise_start(wind),
        chain_start(sound.chain),
    )


def sound_block(
    sound: Sound, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    """Return the next state and a block of the microphone's samples [Pa]."""
    of_waves, of_ambient, of_wind, of_chain = state
    rate = sound.chain.instrument.rate
    shift = block_start(index, rate)
    edges = edges_of(rate)
    pressure = jnp.zeros(BLOCK)
    # arrivals are shifted to the block's clock, whose small numbers suit float32
    after = []
    for wave, of_wave in zip(sound.waves, of_waves, strict=True):
        of_wave, heard = wave_block(wave.later(*shift), of_wave, edges)
        after.append(of_wave)
        pressure = pressure + heard
    middle = edges[:-1] + 0.5 / rate
    if sound.ambient is not None and sound.ambient_sound is not None:
        of_ambient, background = ambient_block(sound.ambient_sound, of_ambient, index)
        # the track is on the common clock, the block on the record's own
        if isinstance(sound.place, Track):
            up = sound.place.at(middle + (shift[0] + sound.begin) + shift[1])[..., 2]
        else:
            up = sound.place[2]
        pressure = pressure + share_at_height(sound.ambient, up) * background
    if sound.wind is not None:
        of_wind, wind = noise_block(sound.wind, of_wind, index)
        pressure = pressure + wind
    if sound.rotors is not None:
        pressure = pressure + rotor_tones(sound.rotors, shift, middle, rate)
    # the instrument is last: filter, noise and limits act on the total pressure
    of_chain, samples = chain_block(sound.chain, of_chain, index, pressure)
    return (tuple(after), of_ambient, of_wind, of_chain), samples


def blast_waves(
    scene: Scene,
    place: Float[Array, "3"] | Track,
    rate: float,
    laws: Mapping[str, str] | None,
    wave_paths: WavePaths,
) -> tuple[BlastWave, ...]:
    """Prepare every wave that arrives at a position, on the common clock.

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or a track of positions over time.
        rate: Sampling rate [Hz].
        laws: By quantity; absent ones as for `heard`.
        wave_paths: Paths of the waves.

    Raises:
        InputError: As in `heard`.
    """
    found = []
    for wave in heard(scene, place, laws, ground=wave_paths.ground):
        if wave.kind == "ground":
            found.append(BlastWave(wave.pulse))
            continue
        transfer = None
        # inside jit the flag is unknown, so every wave gets the filter
        absorbed = isinstance(wave.absorbed, Tracer) or bool(np.asarray(wave.absorbed))
        if wave_paths.absorption and absorbed:
            transfer = _transfer(scene, wave, rate)
        found.append(BlastWave(wave.pulse, transfer))
    return tuple(found)


def wave_start(wave: BlastWave) -> Float[Array, " past"] | None:
    """Return the initial state of a wave: silence as long as the absorption filter."""
    if wave.transfer is None:
        return None
    return jnp.zeros(2 * (wave.transfer.size - 1) - BLOCK)


def wave_block(
    wave: BlastWave,
    state: Float[Array, " past"] | None,
    edges: Float[Array, " edge"],
) -> tuple[Float[Array, " past"] | None, Float[Array, " sample"]]:
    """Return the next state and the mean pressure of a wave in each sample [Pa].

    Args:
        wave: On the clock of the edges.
        state: State after the last block, or `wave_start`.
        edges: Bounds of the samples [s].
    """
    pressure = _mean_pressure(wave, edges)
    if wave.transfer is None or state is None:
        return state, pressure
    # Overlap-save: the block is convolved together with the samples before it, and only
    # its own output, free of circular wrap-around, is used.
    known = jnp.concatenate([state, pressure])
    spectrum = jnp.fft.rfft(known) * wave.transfer
    return known[BLOCK:], jnp.fft.irfft(spectrum, known.size)[-BLOCK:]


def _mean_pressure(
    wave: BlastWave, edges: Float[Array, " edge"]
) -> Float[Array, " sample"]:
    """Return the mean pressure over each sample before absorption [Pa]."""
    pulse = wave.pulse
    never = jnp.isposinf(pulse.arrival_time)
    # a finite arrival past the block: an infinite one would give NaN in the pulse
    arrival = jnp.where(never, 2.0 * edges[-1], pulse.arrival_time)
    start, stop = edges[:-1], edges[1:]
    return wave_mean(pulse._replace(arrival_time=arrival), start, stop)


@eqx.filter_jit
def _transfer(scene: Scene, wave: Heard, rate: float) -> Complex[Array, " frequency"]:
    """Return the absorption filter of a wave's path; 1 if nothing is absorbed."""
    # a power of two that holds a block and the filter's tail without wrap-around
    count = 2 ** math.ceil(math.log2(BLOCK + TAIL_S * rate))
    length = jnp.where(wave.absorbed, scene.air.absorption_scale * wave.distance, 0.0)
    return absorption_transfer(
        count, rate, length, *ambient(scene.air), scene.air.relative_humidity
    )


def ambient_start(sound: ColouredNoise | Loop) -> Any:
    """Return the initial state of the ambient sound."""
    if isinstance(sound, Loop):
        return jnp.zeros((), int)
    return noise_start(sound)


def ambient_block(
    sound: ColouredNoise | Loop, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    """Return the next state and a block of the sound on the ground [Pa]."""
    if not isinstance(sound, Loop):
        return noise_block(sound, state, index)
    turn = sound.samples.size - BLOCK
    block = jnp.take(sound.samples, state + jnp.arange(BLOCK))
    return (state + BLOCK) % turn, block


def share_at_height(ambient: Ambient, up: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the loudness at a height over that on the ground [-]."""
    return jnp.exp(-jnp.maximum(up, 0.0) / ambient.height)


def seamless(samples: Float[Array, " sample"], rate: float) -> Float[Array, " turn"]:
    """Return one turn of a loop, shorter by the cross-fade of its end and start."""
    fade = max(1, min(round(CROSS_FADE_S * rate), samples.size // 4))
    # sine and cosine: their squares add up to one, so the power is constant
    angle = np.arange(fade) / fade * (np.pi / 2)
    # the mixed part replaces both, so the turn is shorter by one fade
    head, tail = samples[:fade], samples[samples.size - fade :]
    mixed = head * np.sin(angle) + tail * np.cos(angle)
    return jnp.concatenate([mixed, samples[fade : samples.size - fade]])


def at_rate(
    turn: Float[Array, " turn"], loop_rate: float, rate: float
) -> Float[Array, " sample"]:
    """Return a turn at another rate, to the nearest whole number of samples."""
    # whole samples per turn, so that the loop stays periodic
    n = max(1, round(turn.size * rate / loop_rate))
    if n == turn.size:
        return turn
    spectrum = jnp.fft.rfft(turn)[: n // 2 + 1]
    return jnp.fft.irfft(spectrum, n) * (n / turn.size)


def rotor_phase(
    rotors: Rotors, start_s: Float[Array, ""], key: Key[Array, ""]
) -> RotorPhase:
    """Prepare rotors: their phase at each knot and the random phase of each harmonic.

    Args:
        rotors: The rotors.
        start_s: Start of the record on the clock of the knots [s].
        key: Random key of the initial phases.
    """
    step = jnp.diff(rotors.time)[:, None]
    mean = 0.5 * (rotors.speed[1:] + rotors.speed[:-1])
    turned = step * mean / (2 * math.pi)
    none = jnp.zeros_like(rotors.speed[:1])
    # Whole turns are dropped before the sum: after thousands of turns float32 would
    # have lost the phase.
    turns = jnp.concatenate([none, jnp.cumsum(turned - jnp.floor(turned), axis=0)])
    shape = (rotors.speed.shape[1], rotors.amplitude.size)
    offset = 2 * math.pi * jax.random.uniform(key, shape)
    return RotorPhase(rotors, rotors.time - start_s, turns - jnp.floor(turns), offset)


def rotor_tones(
    phase: RotorPhase,
    shift: tuple[Float[Array, ""], Float[Array, ""]],
    time: Float[Array, " sample"],
    rate: float,
) -> Float[Array, " sample"]:
    """Return the sound of the rotors [Pa].

    Args:
        phase: Prepared rotors.
        shift: Origin of `time` since the start of the record, as from `block_start`.
        time: Middle of each sample [s].
        rate: Sampling rate [Hz].
    """
    rotors = phase.rotors
    knots = phase.time - shift[0] - shift[1]
    # before the first and after the last knot the speed is constant
    last = knots.size - 1
    knot = jnp.clip(jnp.searchsorted(knots, time, side="right") - 1, 0, last)
    since = (time - knots[knot])[:, None]
    first = rotors.speed[knot]
    gap = (knots[jnp.minimum(knot + 1, last)] - knots[knot])[:, None]
    rise = rotors.speed[jnp.minimum(knot + 1, last)] - first
    slope = jnp.where((gap > 0) & (since > 0), rise / jnp.where(gap > 0, gap, 1.0), 0.0)
    speed = first + slope * since
    turns = phase.turns[knot] + since * (first + 0.5 * slope * since) / (2 * math.pi)
    turns = turns - jnp.floor(turns)
    harmonic = jnp.arange(1.0, rotors.amplitude.size + 1.0) * rotors.blades
    harmonic = harmonic[None, None, :]  # axes: sample, rotor, harmonic
    frequency = speed[:, :, None] * harmonic / (2 * math.pi)
    # sinc: the mean of a tone over a sample of length 1 / rate
    mean = jnp.where(frequency < rate / 2, jnp.sinc(frequency / rate), 0.0)
    tone = jnp.sin(2 * math.pi * turns[:, :, None] * harmonic + phase.offset[None])
    loudness = (speed / rotors.reference_speed) ** 2
    return jnp.einsum("sr,h,srh->s", loudness, rotors.amplitude, mean * tone)
