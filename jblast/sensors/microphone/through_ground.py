r"""What a microphone hears of the wave in the ground: the ground as a piston below it.

$p = \rho c\,v$ with the velocity $v$ of the ground. A place that moves meets the wave
at the root of $a(\mathbf x(t)) = t$, and hears the ground that is below it there.
"""

from collections.abc import Mapping
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.scene import Scene
from jblast.sensors.arrivals.ground_wave import (
    ground_laws,
    ground_waves,
    pressure_of_velocity,
)
from jblast.sensors.arrivals.meeting import meeting_time
from jblast.sensors.arrivals.track import Track
from jblast.waves.waveform.ground_pulse import GroundPulse


def through_ground(
    scene: Scene,
    place: Float[Array, "3"] | Track,
    laws: Mapping[str, str] | None = None,
) -> tuple[GroundPulse, ...]:
    """Return the wave of every charge, its velocity as pressure: Pa for m/s.

    Args:
        scene: What is there.
        place: East, north, up [m], or where that is over time.
        laws: By quantity; absent ones as `ground_laws` says.
    """
    return _pressed(scene, place, ground_laws(scene, laws))


@eqx.filter_jit
def _pressed(scene, place, laws):
    """Return the waves; compiled, for laws that are known."""
    impedance = pressure_of_velocity(scene.air)
    if isinstance(place, Track):
        waves = _met(scene, place, laws)
    else:
        waves = ground_waves(scene, place, laws)
    return tuple(wave._replace(amplitude=impedance * wave.amplitude) for wave in waves)


def _met(
    scene: Scene, track: Track, laws: Mapping[str, str]
) -> tuple[GroundPulse, ...]:
    """Return the waves as a moving place meets them; their length stays as it is."""
    found = []
    for charge in scene.charges:
        only = replace(scene, charge=charge.as_if_at_zero(), others=())

        def wave(time, only=only):
            return ground_waves(only, track.at(time), laws)[0]

        def arrival(time, wave=wave):
            return wave(time).arrival_time

        met = wave(meeting_time(arrival, arrival(track.time[0])))
        found.append(
            met._replace(
                arrival_time=jnp.where(charge.never, jnp.inf, met.arrival_time),
                amplitude=jnp.where(charge.never, 0.0, met.amplitude),
            )
        )
    return tuple(found)
