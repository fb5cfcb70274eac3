r"""What a microphone samples, block by block: blasts, ambient sound, wind, rotors.

Wind on the membrane is noise whose spectrum falls as $f^{-5/3}$, as turbulence
does above 20 Hz, of an rms proportional to $\rho U^2$.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Key

from jblast.scene import Ambient, Instrument, Scene, Sensor
from jblast.sensors.arrivals.track import Track
from jblast.sensors.microphone.ambient import (
    Loop,
    ambient_block,
    ambient_sound,
    ambient_start,
    share_at_height,
)
from jblast.sensors.microphone.blast import BlastWave, wave_block, wave_start
from jblast.sensors.microphone.rotor import (
    RotorPhase,
    Rotors,
    rotor_phase,
    rotor_tones,
)
from jblast.sensors.signal.blocks import BLOCK, block_start
from jblast.sensors.signal.chain import (
    Chain,
    chain_block,
    chain_start,
    instrument_chain,
)
from jblast.sensors.signal.noise import (
    DB_OF_OCTAVE,
    ColouredNoise,
    coloured_noise,
    noise_block,
    noise_start,
)
from jblast.waves.propagation import air_density, ambient as ambient_of

WIND_SLOPE = -5.0 / 3.0 * DB_OF_OCTAVE
"""Of the noise of wind [dB/octave]: Kolmogorov's inertial range."""


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
        scene: What is there.
        microphone: Where it is, its clock and its instrument.
        key: What all noise is drawn from.
        start_s: When the first sample begins, by the microphone's clock [s].
        waves: All that come, on the common clock.
        track: Where it is over time, instead of its position.
        rotors: Those on board.
    """
    instrument = microphone.instrument or Instrument()
    keys = jax.random.split(key, 4)
    begin = start_s - microphone.clock_offset_s
    place = microphone.position_m if track is None else track
    ambient = wind = None
    if scene.ambient is not None:
        ambient = ambient_sound(scene.ambient, instrument.rate, keys[0])
    if instrument.wind_noise is not None:
        air = scene.air
        density = air_density(*ambient_of(air), air.relative_humidity)
        level = density * (air.wind_east**2 + air.wind_north**2)
        level = instrument.wind_noise * level
        wind = coloured_noise(keys[1], instrument.rate, level, WIND_SLOPE)
    sound = Sound(
        waves=tuple(wave.later(begin) for wave in waves),
        ambient=scene.ambient,
        ambient_sound=ambient,
        place=place,
        begin=begin,
        wind=wind,
        rotors=None if rotors is None else rotor_phase(rotors, begin, keys[2]),
        chain=instrument_chain(instrument, keys[3]),
    )
    return sound, (
        tuple(wave_start(wave) for wave in waves),
        None if ambient is None else ambient_start(ambient),
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
    edges = jnp.arange(BLOCK + 1, dtype=float) / rate
    pressure = jnp.zeros(BLOCK)
    after = []
    for wave, of_wave in zip(sound.waves, of_waves, strict=True):
        of_wave, heard = wave_block(wave.later(*shift), of_wave, edges)
        after.append(of_wave)
        pressure = pressure + heard
    middle = edges[:-1] + 0.5 / rate
    if sound.ambient is not None and sound.ambient_sound is not None:
        of_ambient, ambient = ambient_block(sound.ambient_sound, of_ambient, index)
        if isinstance(sound.place, Track):
            up = sound.place.at(middle + (shift[0] + sound.begin) + shift[1])[..., 2]
        else:
            up = sound.place[2]
        pressure = pressure + share_at_height(sound.ambient, up) * ambient
    if sound.wind is not None:
        of_wind, wind = noise_block(sound.wind, of_wind, index)
        pressure = pressure + wind
    if sound.rotors is not None:
        pressure = pressure + rotor_tones(sound.rotors, shift, middle, rate)
    of_chain, samples = chain_block(sound.chain, of_chain, index, pressure)
    return (tuple(after), of_ambient, of_wind, of_chain), samples
