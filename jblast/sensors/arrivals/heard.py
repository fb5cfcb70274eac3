"""Every wave that comes to a place, found and checked outside jit."""

from collections.abc import Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.scene import Scene
from jblast.sensors.arrivals.laws import record_laws
from jblast.sensors.arrivals.meeting import meeting_waves, passing
from jblast.sensors.arrivals.track import Track
from jblast.sensors.arrivals.waves_at import waves_at
from jblast.sensors.arrivals.way import Heard, alone, low_charges_settled
from jblast.types import as_float_array
from jblast.waves.propagation import sound_speed_of
from jblast.waves.pulse import Pulse

Standpoint = Float[ArrayLike, "3"] | Sequence[float] | Track
"""East, north, up [m], or where that is over time."""


def heard(
    scene: Scene,
    place: Standpoint,
    laws: Mapping[str, str] | None = None,
    *,
    reflection: float | Float[Array, ""] = 1.0,
    ground: bool = False,
) -> tuple[Heard, ...]:
    """Return every wave that comes to a place, of each charge in turn.

    At a place that moves each wave is that of where they meet, its times as they pass
    there: shorter for who flies towards the charge.

    Args:
        scene: What is there.
        place: East, north, up [m], or a `Track`.
        laws: By quantity, of arrival, peak, duration and impulse; absent ones as
            `record_laws` says.
        reflection: Coefficient of the ground under an elevated place; 0 leaves its
            reflections out.
        ground: Whether the air above the moving ground is heard, too.

    Raises:
        InputError: A law is not known, the place is no place or at the charge, or the
            laws' impulse is more than their peak could make in their duration.

    Example:
        `jblast.sensors.heard(jblast.Scene(), [20.0, 0.0, 1.5])[0].pulse.peak`
    """
    named = record_laws(scene, laws, ground=ground)
    if isinstance(place, Track):
        check_speed(scene, place)
    else:
        place = place_of(place)
    scene, found = low_charges_settled(scene), []
    for shot in range(len(scene.charges)):
        waves = _of_one(alone(scene, shot), place, named, reflection, ground)
        found += [wave._replace(shot=shot) for wave in waves]
    for wave in found:
        _check(scene, wave)
    return tuple(found)


@kept
def _of_one(
    scene: Scene,
    place: Float[Array, "3"] | Track,
    laws: Mapping[str, str],
    reflection: float | Float[Array, ""],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return the waves of the one charge, their times as they pass the place."""
    found = waves_for(scene, place, laws, reflection, ground)
    if isinstance(place, Track):
        found = tuple(passing(scene, place, laws, wave) for wave in found)
    return found


def place_of(place: Float[ArrayLike, "..."] | Sequence[float]) -> Float[Array, "3"]:
    """Return a place at rest as an array.

    Raises:
        InputError: It has not three numbers.
    """
    position = np.shape(place)
    if position != (3,):
        raise InputError(
            f"place: expected east, north and up [m], got shape {position}"
        )
    return as_float_array(jnp.asarray(place))


def waves_for(
    scene: Scene,
    place: Standpoint,
    laws: Mapping[str, str],
    reflection: float | Float[Array, ""],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return the waves at a place, or where it meets them; nothing is checked."""
    if isinstance(place, Track):
        return meeting_waves(scene, place, laws, reflection, ground)
    return waves_at(scene, jnp.asarray(place), laws, reflection, ground)


def check_speed(scene: Scene, track: Track) -> None:
    """Raise for a track as fast as a front can be: who meets what is then open.

    Raises:
        InputError: It is. Inside jit nothing is looked at.
    """
    speed = sound_speed_of(scene.air)
    if any(isinstance(x, Tracer) for x in (track.time, track.position, speed)):
        return
    if not track.fastest() < float(speed):
        raise InputError(
            f"track: expected less than the {float(speed):.4g} m/s of sound, got "
            f"{track.fastest():.4g}"
        )


def _check(scene: Scene, wave: Heard) -> None:
    """Raise for a wave that is no number."""
    numbers = [wave.distance, *wave.pulse]
    if any(isinstance(x, Tracer) for x in numbers):
        return
    who = f"charge {wave.shot + 1} of {len(scene.charges)}"
    distance = float(np.asarray(wave.distance))
    if not (np.isfinite(distance) and distance > 0.0):
        raise InputError(
            f"{who}: expected a place away from it, got a distance of {distance:g} m"
        )
    if not isinstance(wave.pulse, Pulse):
        return
    finite = [x for x in wave.pulse if not bool(jnp.isposinf(x))]
    if not all(bool(jnp.isfinite(x)) for x in finite):
        raise InputError(
            f"{who}: expected laws whose impulse is between nothing and peak times "
            f"duration at {distance:g} m, got peak {float(wave.pulse.peak):.4g} Pa and "
            f"duration {float(wave.pulse.duration):.4g} s, with more"
        )
