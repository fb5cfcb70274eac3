r"""Every wave that arrives at a sensor, at rest or moving, with its pulse.

With $a(\mathbf x)$ the arrival time at a position and $\mathbf x(t)$ the track of a
moving sensor, wave and sensor meet at the root of $a(\mathbf x(t)) = t$. The phase of
the wave at the sensor is

$$\varphi(t) = t - a(\mathbf x(t))$$

the time since the arrival at the sensor's position at $t$. It is exact along any track,
bends included. The Doppler shift needs no formula: near the meeting the phase advances
$1 - \mathrm da/\mathrm dt$ times as fast as the clock. Peak, duration and impulse are
those of the meeting position. Their change over the length of a pulse is neglected (a
wave 30 m long passes in 0.1 s).

Waves are listed and checked outside jit. A sensor must be slower than sound, so that it
meets each wave once.

The overpressure at a position over time is the sum of these waves. A sample is the mean
over its time, so that the samples sum to the impulse and no front between two of
them is lost. `even_overpressure` returns evenly spaced samples at a fixed position,
three times as fast. Absorption by air is not included.
"""

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
    record_laws,
    wave_at,
    waves_at,
    ways,
)
from jblast.types import as_float_array
from jblast.waves.height_of_burst import grounded
from jblast.waves.propagation import sound_speed_of
from jblast.waves.pulse import (
    GroundPulse,
    Pulse,
    ground_pulse_velocity_mean,
    pulse_mean,
    pulse_samples,
)

STEPS = 30
r"""Iterations $t \leftarrow a(\mathbf x(t))$: each multiplies the error by the Mach
number, so up to Mach 0.3 it reaches rounding. Faster sensors keep more (at Mach 0.9 4 %
of the first error), which the last Newton step squares."""
AnyPulse = TypeVar("AnyPulse", bound=Pulse | GroundPulse)


class Track(eqx.Module):
    """Positions over time: linear between knots, constant before and after.

    Attributes:
        time: Times of the knots on the common clock [s], rising.
        position: East, north, up at each knot [m].

    Raises:
        InputError: The shapes do not match, or times do not rise. Values inside jit
            are not checked.
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
        for name, values in (("times", time), ("positions", position)):
            infinite = np.argwhere(~np.isfinite(values))
            if len(infinite):
                first = tuple(infinite[0])
                raise InputError(
                    f"track: expected finite {name}, got {values[first]:g} at knot "
                    f"{first[0] + 1}"
                )
        if (np.diff(time) <= 0).any():
            raise InputError(f"track: expected rising times, got {time.tolist()}")

    def at(self, time: Float[Array, "..."]) -> Float[Array, "... 3"]:
        """Return the position, shape (..., 3) [m].

        Args:
            time: Time on the common clock [s].
        """
        # `interp` needs two knots: a single one is a fixed position
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
"""East, north, up [m], or a track of positions over time."""


def heard(
    scene: Scene,
    place: Standpoint,
    laws: Mapping[str, str] | None = None,
    *,
    ground: bool = False,
) -> tuple[Heard, ...]:
    """Return every wave that arrives at a position, charge by charge.

    At a moving position each wave is that of the meeting point. Its times are those
    that the sensor measures: shorter if it moves towards the charge.

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or a `Track`.
        laws: Laws of arrival, peak, duration and impulse by quantity; absent ones as in
            `record_laws`.
        ground: True to include the air wave above the moving ground.

    Raises:
        InputError: A law is unknown, the position has not three coordinates or is at
            the charge, or the laws' impulse exceeds peak times duration.

    Example:
        `jblast.sensors.heard(jblast.Scene(), [20.0, 0.0, 1.5])[0].pulse.peak`
    """
    named = record_laws(scene, laws, ground=ground)
    if isinstance(place, Track):
        check_speed(scene, place)
    else:
        place = place_of(place)
    # each charge alone, so that one compiled program serves all of them
    scene, found = grounded(scene), []
    for shot in range(len(scene.charges)):
        waves = _waves_of_charge(alone(scene, shot), place, named, ground)
        found += [wave._replace(shot=shot) for wave in waves]
    for wave in found:
        _check_wave(scene, wave)
    return tuple(found)


@kept
def _waves_of_charge(
    scene: Scene,
    place: Float[Array, "3"] | Track,
    laws: Mapping[str, str],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return the waves of one charge, with the times that the sensor measures."""
    found = waves_for(scene, place, laws, ground)
    if isinstance(place, Track):
        found = tuple(passing(scene, place, laws, wave) for wave in found)
    return found


def place_of(place: Float[ArrayLike, "..."] | Sequence[float]) -> Float[Array, "3"]:
    """Return a fixed position as an array, shape (3,).

    Raises:
        InputError: It does not have three numbers.
    """
    shape = np.shape(place)
    if shape != (3,):
        raise InputError(f"place: expected east, north and up [m], got shape {shape}")
    return as_float_array(jnp.asarray(place))


def waves_for(
    scene: Scene,
    place: Standpoint,
    laws: Mapping[str, str],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return the waves at a position or along a track, unchecked."""
    if isinstance(place, Track):
        return meeting_waves(scene, place, laws, ground)
    return waves_at(scene, jnp.asarray(place), laws, ground)


def check_speed(scene: Scene, track: Track) -> None:
    """Raise for a track that is not slower than sound: it may meet a wave twice.

    Raises:
        InputError: The track is too fast. Inside jit nothing is checked.
    """
    speed = sound_speed_of(scene.air)
    if any(isinstance(x, Tracer) for x in (track.time, track.position, speed)):
        return
    if not track.fastest() < float(speed):
        raise InputError(
            f"track: expected less than the {float(speed):.4g} m/s of sound, got "
            f"{track.fastest():.4g}"
        )


def _check_wave(scene: Scene, wave: Heard) -> None:
    """Raise for a wave with undefined distance or pulse."""
    numbers = [wave.distance, *wave.pulse]
    # traced values are unknown; callers inside jit accept NaN instead of an error
    if any(isinstance(x, Tracer) for x in numbers):
        return
    label = f"charge {wave.shot + 1} of {len(scene.charges)}"
    distance = float(np.asarray(wave.distance))
    if not (np.isfinite(distance) and distance > 0.0):
        raise InputError(
            f"{label}: expected a position away from it, got a distance of "
            f"{distance:g} m"
        )
    if not isinstance(wave.pulse, Pulse):
        return
    # infinity is legal: a charge that never detonates arrives at infinite time
    finite = [x for x in wave.pulse if not bool(jnp.isposinf(x))]
    if not all(bool(jnp.isfinite(x)) for x in finite):
        raise InputError(
            f"{label}: expected laws whose impulse is between 0 and peak times "
            f"duration at {distance:g} m, got peak {float(wave.pulse.peak):.4g} Pa and "
            f"duration {float(wave.pulse.duration):.4g} s with a larger impulse"
        )


def meeting_time(
    arrival: Callable[[Float[Array, ""]], Float[Array, ""]], first: Float[Array, ""]
) -> Float[Array, ""]:
    """Return the root of arrival(t) = t, differentiable as an implicit function.

    Args:
        arrival: Arrival time at the sensor's position at a time [s].
        first: Initial guess [s].
    """
    # The iterations carry no gradient; the Newton step below supplies it.
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
    """Return the time since a wave's arrival at the sensor, at each time [s].

    Args:
        scene: Charges, air, ground and sensors.
        track: Positions of the sensor.
        laws: Law names by quantity.
        wave: One of `meeting_waves`.
        time: Time on the common clock [s].
    """
    # one law evaluation per edge: the position changes along the track
    arrives = jax.vmap(
        lambda place: arrival_time(scene, place, laws, wave.shot, wave.kind)
    )
    return time - arrives(track.at(time))


def meeting_waves(
    scene: Scene,
    track: Track,
    laws: Mapping[str, str],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return the waves that a moving sensor meets, with their values at the meeting.

    Args:
        scene: Charges, air, ground and sensors.
        track: Positions of the sensor.
        laws: Law names by quantity.
        ground: True to include the waves of the moving ground.
    """
    found = []
    for shot, way in ways(scene, ground):
        # defaults bind the loop's values: a plain closure would see those of the last
        # turn
        def arrival(time: Array, shot: int = shot, way: Way = way) -> Array:
            return arrival_time(scene, track.at(time), laws, shot, way)

        time = meeting_time(arrival, arrival(track.time[0]))
        found.append(wave_at(scene, track.at(time), laws, shot, way))
    return tuple(found)


def passing(scene: Scene, track: Track, laws: Mapping[str, str], wave: Heard) -> Heard:
    """Return a wave with pace and durations as a moving sensor measures them.

    Args:
        scene: Charges, air, ground and sensors.
        track: Positions of the sensor.
        laws: Law names by quantity.
        wave: One of `meeting_waves`.
    """

    def since(time):
        return phase(scene, track, laws, wave, time[None])[0]

    pulse, time = wave.pulse, wave.pulse.arrival_time
    # any finite time will do for a wave that never arrives, whose phase is undefined
    some = jnp.where(jnp.isposinf(time), 0.0, time)
    # rate of the phase by the clock at the arrival: the Doppler factor
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
    return wave._replace(pulse=pulse._replace(**slower), pace=speed)


class PlacesMet(NamedTuple):
    """Positions of a moving sensor at the arrivals of a blast, one row per charge.

    For a charge that never detonates: the positions as if it detonated at time 0.

    Attributes:
        light: At the flash [m], approximated by the position at the detonation: light
            needs 3 us per kilometre, in which 30 m/s are 0.1 mm.
        air: At the arrival of the air shock [m].
        ground: At the arrival of the ground wave [m].
    """

    light: Float[np.ndarray, "shot 3"]
    air: Float[np.ndarray, "shot 3"]
    ground: Float[np.ndarray, "shot 3"]

    def of(self, quantity: str) -> Float[np.ndarray, "shot 3"]:
        """Return the positions at which a quantity is measured."""
        if quantity == "flash_time_s":
            return self.light
        return self.ground if quantity.startswith("ground_") else self.air


def places_met(scene: Scene, track: Track, laws: Mapping[str, str]) -> PlacesMet:
    """Return the positions of a moving sensor at the arrivals of a scene's blasts.

    Each wave is met at the root of a(x(t)) = t, where a is the arrival time at a
    position. `sensors.record` at the returned position gives the meeting time.

    Args:
        scene: Charges, air, ground and sensors.
        track: Positions of the sensor over time.
        laws: Laws of air_arrival_s and ground_arrival_s.

    Raises:
        InputError: The track is as fast as sound.
    """
    check_speed(scene, track)
    scene = grounded(scene)
    arrivals = {name: laws[name] for name in ("air_arrival_s", "ground_arrival_s")}
    # all charges share one program, because `alone` gives their scenes one structure
    shots = range(len(scene.charges))
    rows = [_meeting_positions(alone(scene, shot), track, arrivals) for shot in shots]
    return PlacesMet(*(np.stack(places) for places in zip(*rows, strict=True)))


@eqx.filter_jit
def _meeting_positions(
    scene: Scene, track: Track, laws: dict[str, str]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    origin = scene.charge.as_if_at_zero().time_s

    def place(way: Way) -> Float[Array, "3"]:
        def arrival(time: Array) -> Array:
            return arrival_time(scene, track.at(time), laws, 0, way)

        return track.at(meeting_time(arrival, arrival(jnp.asarray(origin))))

    return track.at(origin), place("air"), place("ground")


def overpressure(
    scene: Scene,
    place: Standpoint,
    edges: Float[ArrayLike, " edge"],
    laws: Mapping[str, str] | None = None,
    *,
    ground: bool = False,
) -> Float[Array, " sample"]:
    """Return the mean overpressure over each sample [Pa].

    Pure, for jit, vmap and grad in all numbers of scene, position and edges.
    Waves add; absorption by air is not included (`Heard.absorbed` marks the waves on
    which it would act).

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or a `Track`.
        edges: Bounds of the samples on the common clock [s], rising: one more than
            samples. In single precision use a clock that starts near the record.
        laws: By quantity; absent ones as in `record_laws`.
        ground: True to include the air wave above the moving ground.

    Raises:
        InputError: A law is unknown, the position is not one, or edges do not rise.

    Example:
        `jblast.sensors.overpressure(scene, [20.0, 0.0, 1.5], jnp.arange(4801) / 48e3)`
    """
    edges = as_float_array(edges)
    place = place if isinstance(place, Track) else place_of(place)
    if edges.ndim != 1 or edges.size < 2:
        raise InputError(
            f"edges: expected a row of two or more [s], got shape {edges.shape}"
        )
    if not isinstance(edges, Tracer):
        falls = np.flatnonzero(~(np.diff(np.asarray(edges)) > 0))
        if falls.size:
            pair = np.asarray(edges)[falls[0] : falls[0] + 2]
            raise InputError(
                f"edges: expected rising times [s], got {pair[1]:g} after {pair[0]:g}"
            )
    named = record_laws(scene, laws, ground=ground)
    return _overpressure(grounded(scene), place, edges, named, ground)


def even_overpressure(
    scene: Scene,
    place: Float[ArrayLike, "3"] | Sequence[float],
    start: Float[ArrayLike, ""],
    rate: float,
    count: int,
    laws: Mapping[str, str] | None = None,
    *,
    ground: bool = False,
) -> Float[Array, " sample"]:
    """Return evenly spaced samples at a fixed position, three times as fast [Pa].

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m].
        start: Start of the first sample on the common clock [s].
        rate: Sampling rate [Hz].
        count: Number of samples.
        laws: As for `overpressure`.
        ground: True to include the air wave above the moving ground.

    Raises:
        InputError: A law is unknown, or the position is not one.
    """
    place = place_of(place)
    named = record_laws(scene, laws, ground=ground)
    scene, start = grounded(scene), as_float_array(start)
    return _even_overpressure(scene, place, start, rate, count, named, ground)


@eqx.filter_jit
def _even_overpressure(scene, place, start, rate, count, laws, ground):
    total = jnp.zeros(count, start.dtype)
    for wave in waves_for(scene, place, laws, ground):
        if wave.kind == "ground":
            # edges from 0, the arrival shifted: in float32 small times are resolved
            # better
            edges = jnp.arange(count + 1, dtype=start.dtype) / rate
            pulse = counted_from(wave.pulse, start)
            total = total + wave_mean(pulse, edges[:-1], edges[1:])
        else:
            total = total + pulse_samples(wave.pulse, start, rate, count)
    return total


@eqx.filter_jit
def _overpressure(scene, place, edges, laws, ground):
    waves = waves_for(scene, place, laws, ground)
    if isinstance(place, Track):
        since = [phase(scene, place, laws, wave, edges) for wave in waves]
    else:
        since = [since_arrival(wave, edges) for wave in waves]
    # superposition of weak waves
    total = jnp.zeros(edges.size - 1, edges.dtype)
    for wave, time in zip(waves, since, strict=True):
        # The pulse begins at 0, as the phase counts from the arrival.
        pulse = wave.pulse._replace(arrival_time=jnp.zeros((), time.dtype))
        total = total + wave_mean(pulse, time[:-1], time[1:])
    return total


def since_arrival(wave: Heard, edges: Float[Array, " edge"]) -> Float[Array, " edge"]:
    """Return the time since a wave's arrival at a fixed position [s].

    Negative throughout for a wave that never arrives.

    Args:
        wave: Wave at that position.
        edges: On the common clock [s].
    """
    # a time before all edges: an infinite one would give inf - inf in the pulse
    never = jnp.isposinf(wave.pulse.arrival_time)
    passed = edges - jnp.where(never, 0.0, wave.pulse.arrival_time)
    return jnp.where(never, passed - edges[-1], passed)


def counted_from(pulse: AnyPulse, *times: Float[Array, ""]) -> AnyPulse:
    """Return a pulse with its arrival on a later clock.

    The times are subtracted one by one: their sum would lose a sample's length in
    single precision.

    Args:
        pulse: Its arrival is infinite if it never comes.
        times: Their sum is the origin of the new clock on the old one [s].
    """
    arrival = pulse.arrival_time
    for time in times:
        # inf - time would give a NaN slope by time; that of no arrival is zero
        arrival = jnp.where(jnp.isposinf(arrival), arrival, arrival - time)
    return pulse._replace(arrival_time=arrival)


def wave_mean(
    pulse: Pulse | GroundPulse,
    start: Float[Array, "..."],
    stop: Float[Array, "..."],
) -> Float[Array, "..."]:
    """Return the mean overpressure of a wave from start to stop [Pa]."""
    if isinstance(pulse, GroundPulse):
        return ground_pulse_velocity_mean(pulse, start, stop)
    return pulse_mean(pulse, start, stop)
