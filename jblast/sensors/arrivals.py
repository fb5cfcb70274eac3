r"""Every wave that arrives at a sensor, at rest or moving, with its pulse.

With $a(\mathbf x)$ the arrival at a place and $\mathbf x(t)$ the track of a moving
sensor, they meet at the root of $a(\mathbf x(t)) = t$, and the phase of the wave at the
sensor is

$$\varphi(t) = t - a(\mathbf x(t))$$

the time since the arrival at the sensor's place at $t$. It is exact along any track,
its bends included. The Doppler shift needs no formula: near the meeting the phase runs
$1 - \mathrm da/\mathrm dt$ times as fast as the clock. Peak, duration and impulse are
those of the place of meeting. Their change over the length of a pulse is neglected (a
wave 30 m long passes in 0.1 s).

Waves are found and checked outside jit. A sensor must be slower than sound, so that it
meets each wave once.

The overpressure at a place over time is the sum of these waves. Each is the pulse of
its laws, or a recorded sound of the user's with the arrival and peak of the laws. A
sample is the mean over its time, so that the samples sum to the impulse and a front
between two of them is not lost. `even_overpressure` returns even samples at a place at
rest, three times as fast. Absorption by air is not included.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.scene import Scene
from jblast.sensors.wave_paths import (
    Heard,
    Way,
    alone,
    arrival_time,
    low_charges_settled,
    peak_at,
    record_laws,
    wave_at,
    waves_at,
    ways,
)
from jblast.types import as_float_array
from jblast.waves.propagation import sound_speed_of
from jblast.waves.pulse import (
    GroundPulse,
    Pulse,
    ground_pulse_velocity_mean,
    pulse_mean,
    pulse_samples,
)

STEPS = 30
r"""Of the iteration $t \leftarrow a(\mathbf x(t))$: its error falls each time by
the Mach number, to rounding below 0.3. Newton's last step squares it."""
AnyPulse = TypeVar("AnyPulse", bound=Pulse | GroundPulse)


class Track(eqx.Module):
    """Positions over time: straight between knots, at rest before and after.

    Attributes:
        time: Of the knots, on the common clock [s], rising.
        position: East, north, up at each [m].

    Raises:
        InputError: The knots do not fit together, or times do not rise. Values inside
            jit are not looked at.
    """

    time: Float[Array, " knot"] = eqx.field(converter=as_float_array)
    position: Float[Array, "knot 3"] = eqx.field(converter=as_float_array)

    def __check_init__(self):
        knots = self.time.shape[0] if self.time.ndim == 1 else 0
        if not knots or self.position.shape != (knots, 3):
            raise InputError(
                "track: expected times [knot] and positions [knot, 3], got shapes "
                f"{self.time.shape} and {self.position.shape}"
            )
        if isinstance(self.time, Tracer) or isinstance(self.position, Tracer):
            return
        time, position = np.asarray(self.time), np.asarray(self.position)
        if not (np.isfinite(time).all() and np.isfinite(position).all()):
            raise InputError("track: expected finite times and positions, got others")
        if (np.diff(time) <= 0).any():
            raise InputError(f"track: expected rising times, got {time.tolist()}")

    def at(self, time: Float[Array, "..."]) -> Float[Array, "... 3"]:
        """Return where the place is.

        Args:
            time: On the common clock [s].
        """
        if self.time.size == 1:
            return jnp.broadcast_to(self.position[0], (*time.shape, 3))
        return jnp.stack(
            [jnp.interp(time, self.time, x) for x in self.position.T], axis=-1
        )

    def fastest(self) -> float:
        """Return the greatest speed between knots [m/s]."""
        steps = np.diff(np.asarray(self.position), axis=0)
        if not len(steps):
            return 0.0
        return float((np.linalg.norm(steps, axis=1) / np.diff(self.time)).max())


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
    there: shorter if it moves towards the charge.

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or a `Track`.
        laws: By quantity, of arrival, peak, duration and impulse; absent ones as in
            `record_laws`.
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
    shape = np.shape(place)
    if shape != (3,):
        raise InputError(f"place: expected east, north and up [m], got shape {shape}")
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


def meeting_time(
    arrival: Callable[[Float[Array, ""]], Float[Array, ""]], first: Float[Array, ""]
) -> Float[Array, ""]:
    """Return the root of arrival(t) = t, differentiable as an implicit function.

    Args:
        arrival: When the wave comes to where the place is at a time [s].
        first: Where to start [s].
    """
    near = lax.stop_gradient(
        lax.fori_loop(0, STEPS, lambda _, t: lax.stop_gradient(arrival(t)), first)
    )
    late, rate = jax.jvp(arrival, (near,), (jnp.ones_like(near),))
    # Newton's step: the derivative of its value is that of the root
    return near + (late - near) / lax.stop_gradient(1.0 - rate)


def phase(
    scene: Scene,
    track: Track,
    laws: Mapping[str, str],
    wave: Heard,
    time: Float[Array, " edge"],
) -> Float[Array, " edge"]:
    """Return the time since a wave's arrival where the place is, at each time [s].

    Args:
        scene: Charges, air, ground and sensors.
        track: Where the place is.
        laws: By quantity.
        wave: One of `meeting_waves`.
        time: On the common clock [s].
    """
    arrives = jax.vmap(
        lambda place: arrival_time(scene, place, laws, wave.shot, wave.kind)
    )
    return time - arrives(track.at(time))


def meeting_waves(
    scene: Scene,
    track: Track,
    laws: Mapping[str, str],
    reflection: float | Float[Array, ""],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return the waves that a moving place meets, as they are at the place of meeting.

    Args:
        scene: Charges, air, ground and sensors.
        track: Where the place is.
        laws: By quantity.
        reflection: Coefficient of the ground.
        ground: Whether the moving ground is heard, too.
    """
    found = []
    for shot, way in ways(scene, reflection, ground):

        def arrival(time: Array, shot: int = shot, way: Way = way) -> Array:
            return arrival_time(scene, track.at(time), laws, shot, way)

        time = meeting_time(arrival, arrival(track.time[0]))
        found.append(wave_at(scene, track.at(time), laws, shot, way, reflection))
    return tuple(found)


def passing(scene: Scene, track: Track, laws: Mapping[str, str], wave: Heard) -> Heard:
    """Return a wave with its times as they pass a moving place.

    Args:
        scene: Charges, air, ground and sensors.
        track: Where the place is.
        laws: By quantity.
        wave: One of `meeting_waves`.
    """

    def since(time):
        return phase(scene, track, laws, wave, time[None])[0]

    pulse, time = wave.pulse, wave.pulse.arrival_time
    some = jnp.where(jnp.isposinf(time), 0.0, time)
    speed = jax.jvp(since, (some,), (jnp.ones_like(some),))[1]
    if isinstance(pulse, GroundPulse):
        slower = {"amplitude": pulse.amplitude, "time_constant": pulse.time_constant}
    else:
        slower = {
            "rise_time": pulse.rise_time,
            "hold_time": pulse.hold_time,
            "duration": pulse.duration,
            "suction_duration": pulse.suction_duration,
        }
    slower = {name: length / speed for name, length in slower.items()}
    return wave._replace(pulse=pulse._replace(**slower))


class PlacesMet(NamedTuple):
    """Positions of a moving place as a blast comes to it; a row for each charge.

    For one that never happens, where it is at time 0 or meets it as if it did.

    Attributes:
        light: As it sees the flash: where it was at the detonation, for on its way of a
            kilometre light gives it 3 us, in which 30 m/s are 0.1 mm [m].
        air: As the air shock comes [m].
        ground: As the ground wave comes [m].
    """

    light: Float[np.ndarray, "shot 3"]
    air: Float[np.ndarray, "shot 3"]
    ground: Float[np.ndarray, "shot 3"]

    def of(self, quantity: str) -> Float[np.ndarray, "shot 3"]:
        """Return the places that a quantity is of."""
        if quantity == "flash_time_s":
            return self.light
        return self.ground if quantity.startswith("ground_") else self.air


def places_met(scene: Scene, track: Track, laws: Mapping[str, str]) -> PlacesMet:
    """Return where a place on a track is as the blasts of a scene come to it.

    Each wave is met at the root of a(x(t)) = t, with a the law's arrival at a place, so
    that `sensors.record` at the place returned gives the time at which it is there.

    Args:
        scene: Charges, air, ground and sensors.
        track: Where the place is over time.
        laws: Of air_arrival_s and ground_arrival_s.

    Raises:
        InputError: The track is as fast as sound.
    """
    check_speed(scene, track)
    scene = low_charges_settled(scene)
    arrivals = {name: laws[name] for name in ("air_arrival_s", "ground_arrival_s")}
    shots = range(len(scene.charges))
    rows = [_met(alone(scene, shot), track, arrivals) for shot in shots]
    return PlacesMet(*(np.stack(places) for places in zip(*rows, strict=True)))


@eqx.filter_jit
def _met(
    scene: Scene, track: Track, laws: dict[str, str]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    origin = scene.charge.as_if_at_zero().time_s

    def place(way: Way) -> Float[Array, "3"]:
        def arrival(time: Array) -> Array:
            return arrival_time(scene, track.at(time), laws, 0, way)

        return track.at(meeting_time(arrival, arrival(jnp.asarray(origin))))

    return track.at(origin), place("air"), place("ground")


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
        # A mean is a difference of the running integral: two look-ups, however long the
        # interval is.
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
    if edges.ndim != 1 or edges.size < 2:
        raise InputError(
            f"edges: expected a row of two or more [s], got shape {edges.shape}"
        )
    if not isinstance(edges, Tracer) and not (np.diff(np.asarray(edges)) > 0).all():
        raise InputError("edges: expected rising times [s], got others")
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
            # The pulse begins at 0, as the phase counts from the arrival.
            now = jnp.zeros((), time.dtype)
            total = total + wave_mean(
                wave.pulse._replace(arrival_time=now), time[:-1], time[1:]
            )
        else:
            scale = wave.pulse.peak / peak_at(scene, sound.distance, laws, wave)
            total = total + scale * sound.mean(time[:-1], time[1:])
    return total


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
