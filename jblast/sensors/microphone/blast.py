"""The waves of blasts at a microphone, block by block.

They come by `sensors.heard`. Pressure is the mean over each sample, so a front between
two samples lands where it should. What air absorbs of a wave it takes sample by sample:
a filter over the way that it came, on the blocks so far.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Complex, Float

from jblast.errors import InputError
from jblast.scene import Scene
from jblast.sensors.arrivals.air_waves import peak_at
from jblast.sensors.arrivals.heard import heard
from jblast.sensors.arrivals.laws import record_laws
from jblast.sensors.arrivals.overpressure import counted_from, wave_mean
from jblast.sensors.arrivals.recorded_sound import RecordedSound
from jblast.sensors.arrivals.track import Track
from jblast.sensors.arrivals.way import Heard
from jblast.sensors.signal.blocks import BLOCK
from jblast.waves.propagation import TAIL_S, absorption_transfer, ambient
from jblast.waves.pulse import GroundPulse, Pulse


class WavePaths(NamedTuple):
    """By which paths a blast is heard.

    Attributes:
        reflection: Coefficient of the ground under an elevated place; 0 leaves
            reflections out.
        ground: Whether the wave in the ground is heard.
        absorption: Whether air absorbs what the laws do not know of (`Heard.absorbed`).
        sound: Recorded, in place of the pulses that the laws make.
    """

    reflection: float | Float[Array, ""] = 1.0
    ground: bool = True
    absorption: bool = True
    sound: RecordedSound | None = None


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


def blast_waves(
    scene: Scene,
    place: Float[Array, "3"] | Track,
    rate: float,
    laws: Mapping[str, str] | None,
    wave_paths: WavePaths,
) -> tuple[BlastWave, ...]:
    """Set up every wave that comes to a place, on the common clock.

    Args:
        scene: What is there.
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
        if wave_paths.absorption and _may_be_absorbed(wave):
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


def _may_be_absorbed(wave: Heard) -> bool:
    """Whether absorption may act on a wave; inside jit it always may."""
    return isinstance(wave.absorbed, Tracer) or bool(np.asarray(wave.absorbed))


_peak_at = eqx.filter_jit(peak_at)


@eqx.filter_jit
def _transfer(scene: Scene, wave: Heard, rate: float) -> Complex[Array, " frequency"]:
    """Return what the air leaves of a wave on its way; all where it absorbs nothing."""
    count = 2 ** math.ceil(math.log2(BLOCK + TAIL_S * rate))
    way = jnp.where(wave.absorbed, scene.air.absorption_scale * wave.distance, 0.0)
    return absorption_transfer(
        count, rate, way, *ambient(scene.air), scene.air.relative_humidity
    )
