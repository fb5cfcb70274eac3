r"""Sound recorded by a microphone: blasts, ambient sound, wind and rotors.

Blasts are the waves of `arrivals.heard`. Pressure is the mean over each sample, so that
a front between two samples has its exact time. Absorption by air is a filter over the
path of each wave, applied sample by sample to the blocks so far.

Ambient sound is coloured noise, or a recording in a loop. At height $h$ it is
$e^{-h/H}$ times as loud as on the ground. In the thesis ambient sound falls in this
form, with no scale printed; $H$ = 30 m is declared. A recording loops without a seam:
its end fades out while its start fades in, with powers that add up to one, as for
uncorrelated sounds. It is resampled to the microphone's rate by its Fourier series,
which is exact for a periodic signal.

Wind on the membrane is noise whose spectrum falls as $f^{-5/3}$, as turbulence does
above 20 Hz, with an rms proportional to $\rho U^2$.

Rotors of the sensor's own vehicle are tones. A rotor of $B$ blades at speed $\Omega(t)$
sounds at the harmonics $m$ of its blade passage,

$$p(t) = (\Omega/\Omega_0)^2 \sum_m A_m \sin(m B \varphi(t) + \alpha_m), \quad
  \dot\varphi = \Omega$$

with the amplitude of its thrust. Between knots the speed is linear, so the phase is a
parabola and is integrated exactly, in turns less whole turns, so that its error does
not grow over hours. Samples are means over their duration. Harmonics above half the
rate, which would alias, are left out.

The thesis sends packets of a loop from a ring buffer of fixed size (section 3.3.2):
a packet at the head of the background's loop is sent, clipped, and appended at the end,
as long as the whole stays below three loops. A blast is added to the waiting samples
(case 1); one that ends after the last loop first extends it, to a loop past the blast's
end (case 2). Here the background of the packet alone is appended: recycled as printed,
a blast would sound again in every loop.
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
from jblast.sensors.arrivals import RecordedSound, Track, counted_from, heard, wave_mean
from jblast.sensors.gauge import edges_of, rate_of
from jblast.sensors.instrument import Chain, chain_block, chain_start, instrument_chain
from jblast.sensors.samples import (
    BLOCK,
    DB_OF_OCTAVE,
    ColouredNoise,
    Packet,
    Ring,
    block_start,
    coloured_noise,
    first_samples,
    noise_block,
    noise_start,
    packets,
    sample_count,
)
from jblast.sensors.wave_paths import Heard, peak_at, record_laws
from jblast.types import as_float_array
from jblast.waves.propagation import (
    TAIL_S,
    absorption_transfer,
    air_density,
    ambient,
)
from jblast.waves.pulse import GroundPulse, Pulse

WIND_SLOPE = -5.0 / 3.0 * DB_OF_OCTAVE
"""Of the noise of wind [dB/octave]: Kolmogorov's inertial range."""
_peak_at = eqx.filter_jit(peak_at)
CROSS_FADE_S = 0.05
"""Of a loop's end and start [s]; of a short one, a quarter."""
MOST_LOOPS = 3


class WavePaths(NamedTuple):
    """By which paths a blast is heard.

    Attributes:
        reflection: Coefficient of the ground under an elevated place; 0 leaves
            reflections out.
        ground: Whether the wave in the ground is heard.
        absorption: Whether air absorbs where the laws do not include it
            (`Heard.absorbed`).
        sound: Recorded, in place of the pulses that the laws make.
    """

    reflection: float | Float[Array, ""] = 1.0
    ground: bool = True
    absorption: bool = True
    sound: RecordedSound | None = None


EVERY_PATH = WavePaths()


class Rotors(eqx.Module):
    """Rotors whose tones a microphone on board hears.

    Attributes:
        time: Knots of the speeds, rising [s]; before and after them they are constant.
        speed: Of each rotor [rad/s].
        amplitude: Of each harmonic of the blade passage, at the microphone [Pa].
        reference_speed: At which the amplitudes hold [rad/s].
        blades: Of each rotor.
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
    """Return what a microphone records of a scene.

    Pure: for jit, vmap and grad in every number of the scene, the microphone and what
    is on board; the duration alone is static.

    Args:
        scene: What is there: charges, air, ambient sound.
        microphone: Where it is, its clock and its instrument.
        duration_s: Of the record [s].
        key: Random key of all noise.
        start_s: When the first sample begins, by the microphone's clock [s].
        laws: By quantity; absent ones as for `arrivals.heard`.
        track: Where it is over time, on the common clock, instead of its position.
        rotors: Those that it flies with.
        wave_paths: By which paths blasts are heard.

    Returns:
        Samples [Pa], at the rate of its instrument.

    Raises:
        InputError: The sensor is no microphone, or underground, or at a charge.

    Example:
        `microphone.record(scene, scene.sensors[0], 1.0, jax.random.key(0))`
    """
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
    """Yield what a microphone records in packets, for ever, in constant memory.

    Sample for sample what `record` returns, whatever the packets.

    Args:
        scene: Charges, air, ground and sensors.
        microphone: Where it is, its clock and its instrument.
        key: Random key of all noise.
        packet_s: Duration of a packet [s]; or
        packets_hz: packets a second [Hz].
        start_s: When the first sample begins, by the microphone's clock [s].
        laws: By quantity; absent ones as for `arrivals.heard`.
        track: Where it is over time, on the common clock, instead of its position.
        rotors: Those that it flies with.
        wave_paths: By which paths blasts are heard.

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
    return packets(sound_block, sound, state, rate_of(microphone), **timing)


class BlastWave(NamedTuple):
    """One wave that is set up.

    Attributes:
        pulse: Its pressure over time.
        transfer: What the air absorbs of it, or None.
        sound: Heard in place of the pulse, or None.
        scale: Of that sound [-].
    """

    pulse: Pulse | GroundPulse
    transfer: Complex[Array, " frequency"] | None = None
    sound: RecordedSound | None = None
    scale: Float[Array, ""] | None = None

    def later(self, *times: Float[Array, ""]) -> "BlastWave":
        """Return it with its arrival counted from later."""
        return self._replace(pulse=counted_from(self.pulse, *times))


class Loop(NamedTuple):
    """Sound that repeats.

    Attributes:
        samples: Of one turn and, after it, of a block of the next [Pa].
    """

    samples: Float[Array, " sample"]


class RotorPhase(NamedTuple):
    """Rotors that are set up.

    Attributes:
        rotors: What they are.
        time: Of the knots, since the record began [s].
        turns: Of each rotor at the knots, whole ones left out.
        offset: Of each rotor's harmonics [rad].
    """

    rotors: Rotors
    time: Float[Array, " knot"]
    turns: Float[Array, "knot rotor"]
    offset: Float[Array, "rotor harmonic"]


def ambient_sound(
    ambient: Ambient, rate: float, key: Key[Array, ""]
) -> ColouredNoise | Loop:
    """Set the ambient sound up, as it is on the ground.

    Args:
        ambient: What it is.
        rate: The microphone's samples a second [Hz].
        key: What noise is drawn from.

    Raises:
        InputError: It is a recording that nobody has read.
    """
    if ambient.loop is not None:
        turn = at_rate(
            seamless(ambient.loop, ambient.loop_rate), ambient.loop_rate, rate
        )
        return Loop(jnp.resize(turn, (turn.size + BLOCK,)))
    if ambient.file:
        raise InputError(
            f"ambient: expected the samples of {ambient.file} in its loop, got none"
        )
    return coloured_noise(key, rate, ambient.level, ambient.slope)


class Sound(NamedTuple):
    """A microphone in a scene, set up to be sampled.

    Attributes:
        waves: All that come, their arrivals counted from the first sample.
        ambient: The scene's, or None.
        ambient_sound: The same as noise or a loop, or None.
        place: East, north, up [m], or where that is over time.
        begin: Common clock at the first sample [s].
        wind: Its noise on the membrane, or None.
        rotors: Those on board, or None.
        chain: The instrument.
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
    """Set a microphone up; refuse a sensor of another kind or below the ground."""
    where = f"microphone {shown(microphone.name)}"
    if microphone.kind not in ("", "microphone"):
        raise InputError(
            f"{where}: expected a sensor of kind microphone, "
            f"got {shown(microphone.kind)}"
        )
    places = microphone.position_m if track is None else track.position
    if not isinstance(places, Tracer):
        up = np.asarray(places)[..., 2].min()
        if not up >= 0:
            raise InputError(
                f"{where}: expected a place on the ground or above it, got {up:g} m up"
            )
    start = as_float_array(start_s)
    if not isinstance(start, Tracer) and not np.isfinite(np.asarray(start)):
        raise InputError(f"{where}: expected a finite start_s, got {float(start):g} s")
    place = microphone.position_m if track is None else track
    # outside jit, where it compiles in parts, leaves out waves that nothing can make,
    # and reports errors of the rest
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
    """Return a microphone that is set up, and the state that it starts with.

    Args:
        scene: Charges, air, ground and sensors.
        microphone: Where it is, its clock and its instrument.
        key: Random key of all noise.
        start_s: When the first sample begins, by the microphone's clock [s].
        waves: All that come, on the common clock.
        track: Where it is over time, instead of its position.
        rotors: Those on board.
    """
    instrument = microphone.instrument or Instrument()
    keys = jax.random.split(key, 4)
    begin = start_s - microphone.clock_offset_s
    place = microphone.position_m if track is None else track
    background = wind = None
    if scene.ambient is not None:
        background = ambient_sound(scene.ambient, instrument.rate, keys[0])
    if instrument.wind_noise is not None:
        air = scene.air
        density = air_density(*ambient(air), air.relative_humidity)
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
    """Return the next state, and what the microphone writes down of a block [Pa]."""
    of_waves, of_ambient, of_wind, of_chain = state
    rate = sound.chain.instrument.rate
    shift = block_start(index, rate)
    edges = edges_of(rate)
    pressure = jnp.zeros(BLOCK)
    after = []
    for wave, of_wave in zip(sound.waves, of_waves, strict=True):
        of_wave, heard = wave_block(wave.later(*shift), of_wave, edges)
        after.append(of_wave)
        pressure = pressure + heard
    middle = edges[:-1] + 0.5 / rate
    if sound.ambient is not None and sound.ambient_sound is not None:
        of_ambient, background = ambient_block(sound.ambient_sound, of_ambient, index)
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
    of_chain, samples = chain_block(sound.chain, of_chain, index, pressure)
    return (tuple(after), of_ambient, of_wind, of_chain), samples


def blast_waves(
    scene: Scene,
    place: Float[Array, "3"] | Track,
    rate: float,
    laws: Mapping[str, str] | None,
    wave_paths: WavePaths,
) -> tuple[BlastWave, ...]:
    """Set up every wave that comes to a place, on the common clock.

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or where that is over time.
        rate: Samples a second [Hz].
        laws: By quantity; absent ones as for `heard`.
        wave_paths: By which paths they come.

    Raises:
        InputError: As in `heard`, or a recorded sound is to be heard in motion.
    """
    sound = wave_paths.sound
    if sound is not None and isinstance(place, Track):
        raise InputError(
            "sound: expected a place at rest for a recorded one, got a track"
        )
    found = []
    for wave in heard(
        scene, place, laws, reflection=wave_paths.reflection, ground=wave_paths.ground
    ):
        if wave.kind == "ground":
            found.append(BlastWave(wave.pulse))
            continue
        transfer = scale = None
        # inside jit any wave may be absorbed
        absorbed = isinstance(wave.absorbed, Tracer) or bool(np.asarray(wave.absorbed))
        if wave_paths.absorption and absorbed:
            transfer = _transfer(scene, wave, rate)
        if sound is not None:
            named = record_laws(scene, laws)
            scale = wave.pulse.peak / _peak_at(scene, sound.distance, named, wave)
        found.append(BlastWave(wave.pulse, transfer, sound, scale))
    return tuple(found)


def wave_start(wave: BlastWave) -> Float[Array, " past"] | None:
    """Return what a wave starts with: silence, as long as the air remembers."""
    if wave.transfer is None:
        return None
    return jnp.zeros(2 * (wave.transfer.size - 1) - BLOCK)


def wave_block(
    wave: BlastWave,
    state: Float[Array, " past"] | None,
    edges: Float[Array, " edge"],
) -> tuple[Float[Array, " past"] | None, Float[Array, " sample"]]:
    """Return the next state, and a wave's pressure in each sample of a block [Pa].

    Args:
        wave: On the clock of the edges.
        state: What the last block left, or `wave_start`.
        edges: Where samples begin and end [s].
    """
    pressure = _mean(wave, edges)
    if wave.transfer is None or state is None:
        return state, pressure
    known = jnp.concatenate([state, pressure])
    spectrum = jnp.fft.rfft(known) * wave.transfer
    return known[BLOCK:], jnp.fft.irfft(spectrum, known.size)[-BLOCK:]


def _mean(wave: BlastWave, edges: Float[Array, " edge"]) -> Float[Array, " sample"]:
    """Return the mean pressure over each sample, nothing absorbed [Pa]."""
    pulse = wave.pulse
    never = jnp.isposinf(pulse.arrival_time)
    arrival = jnp.where(never, 2.0 * edges[-1], pulse.arrival_time)
    start, stop = edges[:-1], edges[1:]
    if wave.sound is not None and wave.scale is not None:
        return wave.scale * wave.sound.mean(start - arrival, stop - arrival)
    return wave_mean(pulse._replace(arrival_time=arrival), start, stop)


@eqx.filter_jit
def _transfer(scene: Scene, wave: Heard, rate: float) -> Complex[Array, " frequency"]:
    """Return what the air leaves of a wave on its way; all where it absorbs nothing."""
    count = 2 ** math.ceil(math.log2(BLOCK + TAIL_S * rate))
    way = jnp.where(wave.absorbed, scene.air.absorption_scale * wave.distance, 0.0)
    return absorption_transfer(
        count, rate, way, *ambient(scene.air), scene.air.relative_humidity
    )


def ambient_start(sound: ColouredNoise | Loop) -> Any:
    """Return the state that the ambient sound starts with."""
    if isinstance(sound, Loop):
        return jnp.zeros((), int)
    return noise_start(sound)


def ambient_block(
    sound: ColouredNoise | Loop, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    """Return the next state, and a block of the sound on the ground [Pa]."""
    if not isinstance(sound, Loop):
        return noise_block(sound, state, index)
    turn = sound.samples.size - BLOCK
    block = jnp.take(sound.samples, state + jnp.arange(BLOCK))
    return (state + BLOCK) % turn, block


def share_at_height(ambient: Ambient, up: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return how loud it is at a height above ground, over how loud on it."""
    return jnp.exp(-jnp.maximum(up, 0.0) / ambient.height)


def seamless(samples: Float[Array, " sample"], rate: float) -> Float[Array, " turn"]:
    """Return one turn of a loop, shorter by the cross-fade of its end and start."""
    fade = max(1, min(round(CROSS_FADE_S * rate), samples.size // 4))
    angle = np.arange(fade) / fade * (np.pi / 2)
    head, tail = samples[:fade], samples[samples.size - fade :]
    mixed = head * np.sin(angle) + tail * np.cos(angle)
    return jnp.concatenate([mixed, samples[fade : samples.size - fade]])


def at_rate(
    turn: Float[Array, " turn"], loop_rate: float, rate: float
) -> Float[Array, " sample"]:
    """Return a turn at another rate, to the nearest whole number of samples."""
    n = max(1, round(turn.size * rate / loop_rate))
    if n == turn.size:
        return turn
    spectrum = jnp.fft.rfft(turn)[: n // 2 + 1]
    return jnp.fft.irfft(spectrum, n) * (n / turn.size)


def rotor_phase(
    rotors: Rotors, start_s: Float[Array, ""], key: Key[Array, ""]
) -> RotorPhase:
    """Set rotors up: their turns up to each knot, and where they stood at first.

    Args:
        rotors: What they are.
        start_s: When the record begins, on the clock of the knots [s].
        key: What the first phases are drawn from.
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
    """Return what the rotors sound like [Pa].

    Args:
        phase: Rotors that are set up.
        shift: What `time` counts from, since the record began, as `block_start`.
        time: Middle of each sample [s].
        rate: Samples a second [Hz].
    """
    rotors = phase.rotors
    knots = phase.time - shift[0] - shift[1]
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
    mean = jnp.where(frequency < rate / 2, jnp.sinc(frequency / rate), 0.0)
    tone = jnp.sin(2 * math.pi * turns[:, :, None] * harmonic + phase.offset[None])
    loudness = (speed / rotors.reference_speed) ** 2
    return jnp.einsum("sr,h,srh->s", loudness, rotors.amplitude, mean * tone)


class LoopPackets:
    """A background in a loop, sent in packets, with blasts in it."""

    def __init__(self, loop: Float[np.ndarray, " sample"]):
        """Start with one loop, waiting.

        Args:
            loop: The background.

        Raises:
            ValueError: It has no sample.
        """
        if not loop.size:
            raise ValueError("loop must have a sample or more, got none")
        self._loop = np.array(loop)
        self._ring = Ring(MOST_LOOPS * loop.size, loop.dtype)
        self._ring.write(self._loop)
        self._appended = 0  # samples of the loop that follow the last one waiting

    @property
    def waiting(self) -> int:
        """Number of samples to be sent; never more than three loops."""
        return self._ring.waiting

    @property
    def reach(self) -> int:
        """Greatest distance of a blast's end from the head, in samples."""
        return self._ring.capacity - self._loop.size

    def send(self, size: int) -> Float[np.ndarray, " sample"]:
        """Take a packet from the head, and append as much background if it fits.

        Args:
            size: Samples of the packet, at most a loop.

        Raises:
            ValueError: The packet is longer than the loop.
        """
        if not 0 <= size <= self._loop.size:
            raise ValueError(
                f"expected a packet of 0 to {self._loop.size} samples, a loop, "
                f"got {size}"
            )
        packet = self._ring.read(size)
        if self._ring.waiting + size < self._ring.capacity:
            self._append(size)
        return packet

    def add_blast(self, at: int, samples: Float[np.ndarray, " sample"]) -> None:
        """Add a blast to the background.

        Args:
            at: Its first sample, counted from the head.
            samples: Its sound.

        Raises:
            ValueError: It begins in the past, or ends beyond `reach`.
        """
        end = at + samples.size
        if at < 0 or end > self.reach:
            raise ValueError(
                f"expected a blast within the {self.reach} samples from the head, two "
                f"loops, got {samples.size} samples at {at}"
            )
        if end > self._ring.waiting:
            self._append(end + self._loop.size - self._ring.waiting)
        self._ring.add(at, samples)

    def _append(self, size: int) -> None:
        """Append samples of the loop, from where it was left."""
        if size <= 0:
            return
        places = (self._appended + np.arange(size)) % self._loop.size
        self._ring.write(self._loop[places])
        self._appended = (self._appended + size) % self._loop.size
