"""What a microphone records: samples of some duration, or packets for ever."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Key

from jblast.errors import InputError, shown
from jblast.scene import Instrument, Scene, Sensor
from jblast.sensors.arrivals.track import Track
from jblast.sensors.microphone.blast import WavePaths, blast_waves
from jblast.sensors.microphone.rotor import Rotors
from jblast.sensors.microphone.sound import Sound, set_up, sound_block
from jblast.sensors.signal.blocks import Packet, first_samples, packets, sample_count
from jblast.types import as_float_array

EVERY_PATH = WavePaths()


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
        key: What all noise is drawn from.
        start_s: When the first sample begins, by the microphone's clock [s].
        laws: By quantity; absent ones as for `sensors.heard`.
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
    instrument = microphone.instrument or Instrument()
    n = sample_count(duration_s, instrument.rate)
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
        scene: What is there.
        microphone: Where it is, its clock and its instrument.
        key: What all noise is drawn from.
        packet_s: Duration of a packet [s]; or
        packets_hz: packets a second [Hz].
        start_s: When the first sample begins, by the microphone's clock [s].
        laws: By quantity; absent ones as for `sensors.heard`.
        track: Where it is over time, on the common clock, instead of its position.
        rotors: Those that it flies with.
        wave_paths: By which paths blasts are heard.

    Raises:
        InputError: As in `record`.
        ValueError: As in `packets`.

    Example:
        `for packet in microphone.stream(scene, sensor, key, packets_hz=100.0): ...`
    """
    rate = (microphone.instrument or Instrument()).rate
    sound, state = _start(
        scene, microphone, key, start_s, laws, track, rotors, wave_paths
    )
    timing = {"packet_s": packet_s, "packets_hz": packets_hz, "start_s": start_s}
    return packets(sound_block, sound, state, rate, **timing)


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
    """Set a microphone up, and refuse what can be seen to be none."""
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
    rate = (microphone.instrument or Instrument()).rate
    # outside jit, where it compiles in parts, leaves out waves that nothing can make,
    # and says what is wrong with the rest
    waves = blast_waves(scene, place, rate, laws, wave_paths)
    return set_up(scene, microphone, key, start, waves, track, rotors)
