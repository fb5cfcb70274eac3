"""The overpressure at a place over time: the sum of all waves that arrive there.

Each wave is the pulse of its laws, or a recorded sound of the user's with the arrival
and peak of the laws. A sample is the mean over its time, so that the samples sum to the
impulse and a front between two of them is not lost. `even_overpressure` returns even
samples at a place at rest, three times as fast. Absorption by air is not included.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.scene import Scene
from jblast.sensors.arrivals import Standpoint, Track, phase, place_of, waves_for
from jblast.sensors.wave_paths import Heard, low_charges_settled, peak_at, record_laws
from jblast.types import as_float_array
from jblast.waves.pulse import (
    GroundPulse,
    Pulse,
    ground_pulse_velocity_mean,
    pulse_mean,
    pulse_samples,
)

AnyPulse = TypeVar("AnyPulse", bound=Pulse | GroundPulse)


class RecordedSound(eqx.Module):
    """Recorded sound of a blast at some distance, from its arrival on.

    Attributes:
        samples: Overpressure [Pa], the first from the arrival on; each a mean over its
            sample.
        rate: Samples a second [Hz].
        distance: From the charge, where it was recorded [m]. Elsewhere it is as much
            weaker or stronger as by the law of the peak, its shape kept.

    Raises:
        InputError: There is no sample, or one is no number; the rate or the distance is
            not positive.
    """

    samples: Float[Array, " sample"] = eqx.field(converter=as_float_array)
    rate: float = eqx.field(static=True, converter=float)
    distance: Float[Array, ""] = eqx.field(converter=as_float_array)

    def __check_init__(self):
        if self.samples.ndim != 1 or not self.samples.size:
            raise InputError(
                "recorded sound: expected a row of samples, got shape "
                f"{self.samples.shape}"
            )
        if not 0 < self.rate < math.inf:
            raise InputError(
                f"recorded sound: expected a positive rate, got {self.rate:g} Hz"
            )
        if isinstance(self.samples, Tracer) or isinstance(self.distance, Tracer):
            return
        if not np.isfinite(np.asarray(self.samples)).all():
            raise InputError("recorded sound: expected numbers, got NaN or infinity")
        distance = float(np.asarray(self.distance))
        if not 0 < distance < math.inf:
            raise InputError(
                f"recorded sound: expected a positive distance, got {distance:g} m"
            )

    def mean(
        self, start: Float[Array, " sample"], stop: Float[Array, " sample"]
    ) -> Float[Array, " sample"]:
        """Return the mean overpressure from start to stop since the arrival [Pa]."""
        dtype = self.samples.dtype
        edges = jnp.asarray(np.arange(self.samples.size + 1) / self.rate, dtype)
        until = jnp.pad(jnp.cumsum(self.samples) / self.rate, (1, 0))
        passed = [jnp.interp(time, edges, until) for time in (start, stop)]
        return (passed[1] - passed[0]) / (stop - start)


def overpressure(
    scene: Scene,
    place: Standpoint,
    edges: Float[ArrayLike, " edge"],
    laws: Mapping[str, str] | None = None,
    *,
    reflection: float | Float[Array, ""] = 1.0,
    ground: bool = False,
    sound: RecordedSound | None = None,
) -> Float[Array, " sample"]:
    """Return the mean overpressure over each sample [Pa].

    Pure, for jit, vmap and grad: in all numbers of the scene, the place and the edges.
    Waves add; absorption by air is not included (`Heard.absorbed` marks the waves on
    which it would act).

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or a `Track`.
        edges: Where samples begin and end, on the common clock [s], rising: one more
            than samples. In single precision count the clock from close by.
        laws: By quantity; absent ones as in `record_laws`.
        reflection: Coefficient of the ground under an elevated place; 0 leaves its
            reflections out.
        ground: Whether the air above the moving ground is heard, too.
        sound: Recorded, in place of the pulse that the laws make; its arrival and peak
            are then theirs. That of the ground stays what it is.

    Raises:
        InputError: A law is not known, the place is none, or edges do not rise.

    Example:
        `jblast.sensors.overpressure(scene, [20.0, 0.0, 1.5], jnp.arange(4801) / 48e3)`
    """
    edges = as_float_array(edges)
    place = place if isinstance(place, Track) else place_of(place)
    _check_edges(edges)
    named = record_laws(scene, laws, ground=ground)
    return _overpressure(
        low_charges_settled(scene), place, edges, named, reflection, ground, sound
    )


def even_overpressure(
    scene: Scene,
    place: Float[ArrayLike, "3"] | Sequence[float],
    start: Float[ArrayLike, ""],
    rate: float,
    count: int,
    laws: Mapping[str, str] | None = None,
    *,
    reflection: float | Float[Array, ""] = 1.0,
    ground: bool = False,
) -> Float[Array, " sample"]:
    """Return the same for even samples at a place at rest, three times as fast [Pa].

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m].
        start: When the first sample begins, on the common clock [s].
        rate: Samples a second [Hz].
        count: How many samples.
        laws: As for `overpressure`; so the others.
        reflection: Coefficient of the ground.
        ground: Whether the air above the moving ground is heard, too.

    Raises:
        InputError: A law is not known, or the place is none.
    """
    place = place_of(place)
    named = record_laws(scene, laws, ground=ground)
    scene, start = low_charges_settled(scene), as_float_array(start)
    return _even(scene, place, start, rate, count, named, reflection, ground)


@eqx.filter_jit
def _even(scene, place, start, rate, count, laws, reflection, ground):
    total = jnp.zeros(count, start.dtype)
    for wave in waves_for(scene, place, laws, reflection, ground):
        if wave.kind == "ground":
            edges = jnp.arange(count + 1, dtype=start.dtype) / rate
            pulse = counted_from(wave.pulse, start)
            total = total + wave_mean(pulse, edges[:-1], edges[1:])
        else:
            total = total + pulse_samples(wave.pulse, start, rate, count)
    return total


@eqx.filter_jit
def _overpressure(scene, place, edges, laws, reflection, ground, sound):
    waves = waves_for(scene, place, laws, reflection, ground)
    if isinstance(place, Track):
        since = [phase(scene, place, laws, wave, edges) for wave in waves]
    else:
        since = [since_arrival(wave, edges) for wave in waves]
    total = jnp.zeros(edges.size - 1, edges.dtype)
    for wave, time in zip(waves, since, strict=True):
        if sound is None or wave.kind == "ground":
            total = total + mean_since(wave.pulse, time)
        else:
            scale = wave.pulse.peak / peak_at(scene, sound.distance, laws, wave)
            total = total + scale * sound.mean(time[:-1], time[1:])
    return total


def _check_edges(edges: Float[Array, "..."]) -> None:
    """Raise for edges between which there are no samples; inside jit by shape alone."""
    if edges.ndim != 1 or edges.size < 2:
        raise InputError(
            f"edges: expected a row of two or more [s], got shape {edges.shape}"
        )
    if not isinstance(edges, Tracer) and not (np.diff(np.asarray(edges)) > 0).all():
        raise InputError("edges: expected rising times [s], got others")


def since_arrival(wave: Heard, edges: Float[Array, " edge"]) -> Float[Array, " edge"]:
    """Return the time since a wave's arrival at a place at rest [s].

    Of one that never comes a time before it.

    Args:
        wave: At that place.
        edges: On the common clock [s].
    """
    never = jnp.isposinf(wave.pulse.arrival_time)
    passed = edges - jnp.where(never, 0.0, wave.pulse.arrival_time)
    return jnp.where(never, passed - edges[-1], passed)


def mean_since(
    pulse: Pulse | GroundPulse, since: Float[Array, " edge"]
) -> Float[Array, " sample"]:
    """Return the mean overpressure of one wave over each sample [Pa].

    Args:
        pulse: Of a wave that is heard; its own arrival is not looked at.
        since: Time since its arrival at the edges of the samples [s].
    """
    now = jnp.zeros((), since.dtype)
    return wave_mean(pulse._replace(arrival_time=now), since[:-1], since[1:])


def counted_from(pulse: AnyPulse, *times: Float[Array, ""]) -> AnyPulse:
    """Return a pulse whose arrival is counted from later.

    Subtracted one by one, so that single precision keeps a sample apart from the next.

    Args:
        pulse: Its arrival infinite: never.
        times: Whose sum is where the new clock begins, on its old one [s].
    """
    arrival = pulse.arrival_time
    for time in times:
        # of what never arrives the slope by time is zero, not NaN
        arrival = jnp.where(jnp.isposinf(arrival), arrival, arrival - time)
    return pulse._replace(arrival_time=arrival)


def wave_mean(
    pulse: Pulse | GroundPulse,
    start: Float[Array, "..."],
    stop: Float[Array, "..."],
) -> Float[Array, "..."]:
    """Return the mean overpressure of a wave that is heard from start to stop [Pa]."""
    if isinstance(pulse, GroundPulse):
        return ground_pulse_velocity_mean(pulse, start, stop)
    return pulse_mean(pulse, start, stop)
