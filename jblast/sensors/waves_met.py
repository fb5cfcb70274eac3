r"""Every wave that arrives at a sensor, at rest or moving, with its pulse.

Air. Arrival, peak, duration and impulse are those of `sensors.record` for the same
scene and laws. Two numbers do not depend on the choice of laws. The suction is that of
`blast_pulse`, reduced by the same factor where a law predicts less pressure than
`shock_kinematics`. The rise time is that of a weak shock (`waves/pulse.py`).

In a weak shock steepening balances the absorption of the front, and its peak and rise
time contain it. Beyond Z = 300, the end of these laws, a wave is sound, and the air
absorbs along the rest of its path. Peak and rise time are continuous there.

The reflection comes from the image of the charge below a flat, rigid ground. It exists
for charges with free-air curves (the curves of a surface burst contain the ground) and
for positions above the ground. It is a separate wave by the same laws at the longer
distance. This is the regular reflection of sound. Where the direct wave is strong the
true reflection is stronger, and past the triple point the two waves merge.

Ground. Arrival, displacement and velocity are those of `sensors.record` for the same
scene and laws. The arrival is that at the position itself, which above the ground
follows the scene's `ground.path`. The motion is that of the ground below the position.

Moving sensors. With $a(\mathbf x)$ the arrival time at a position and $\mathbf x(t)$
the track, wave and sensor meet at the root of $a(\mathbf x(t)) = t$. The wave is that
of the meeting position, and passes the sensor $1 - \mathrm da/\mathrm dt$ times as fast
as a sensor at rest there (the Doppler factor). The change of the pulse and of the
sensor's velocity over its length is neglected (a wave 30 m long passes in 0.1 s). A
sensor must be slower than sound, so that it meets each wave once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import require
from jblast.kept_programs import kept
from jblast.registry import call, law_for
from jblast.scene import Charge, Scene
from jblast.types import as_numbers
from jblast.waves.height_of_burst import grounded
from jblast.waves.laws.shock_kinematics import shock_kinematics_pressure
from jblast.waves.paths import Path, path_between
from jblast.waves.propagation import sound_speed_of
from jblast.waves.pulse import (
    counted_from,
    ground_pulse_of,
    pulse_of,
    suction_of,
    weak_shock_rise_time,
)
from jblast.waves.scaling import sachs_distance_factor
from jblast.waves.shock import FAR_END

Way = Literal["air", "reflected", "ground"]
IN_AIR: tuple[Way, ...] = ("air", "reflected")
IN_GROUND: tuple[Way, ...] = ("ground",)
AIR_QUANTITIES = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
)
"""Quantities that define a wave in air."""
# One model from the charge to Z = 1e4, so that no law has to be chosen inside jit.
DEFAULT_RECORD_LAWS: dict[str, str] = {
    **dict.fromkeys(AIR_QUANTITIES, "shock_kinematics"),
    "ground_arrival_s": "wu_hao",
    "ground_displacement_m": "ground_motion",
    "ground_peak_velocity_m_s": "ground_motion",
}
"""Quantities that define the waves of a record, and their default laws."""
MIRROR = np.array([1.0, 1.0, -1.0])
STEPS = 30
r"""Iterations $t \leftarrow a(\mathbf x(t))$: each multiplies the error by the Mach
number, so up to Mach 0.3 it reaches rounding. Faster sensors keep more (at Mach 0.9 4 %
of the first error), which the last Newton step squares."""


class Track(eqx.Module):
    """Positions over time: linear between knots, constant before and after.

    Attributes:
        time: Times of the knots on the common clock [s], rising.
        position: East, north, up at each knot [m].

    Raises:
        InputError: The shapes do not match, or times do not rise. Values inside jit
            are not checked.
    """

    time: Float[Array, " knot"] = eqx.field(converter=as_numbers)
    position: Float[Array, "knot 3"] = eqx.field(converter=as_numbers)

    def __check_init__(self):
        knots = self.time.shape[0] if self.time.ndim == 1 else 0
        require(
            knots and self.position.shape == (knots, 3),
            "track",
            "times [knot] and positions [knot, 3]",
            f"shapes {self.time.shape} and {self.position.shape}",
        )
        if isinstance(self.time, Tracer) or isinstance(self.position, Tracer):
            return
        time, position = np.asarray(self.time), np.asarray(self.position)
        for name, values in (("times", time), ("positions", position)):
            require(
                np.isfinite(values).all(), "track", f"finite {name}", values.tolist()
            )
        require((np.diff(time) > 0).all(), "track", "rising times", time.tolist())

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


Standpoint = Float[ArrayLike, "3"] | Sequence[float] | Track
"""East, north, up [m], or a track of positions over time."""


class Wave(NamedTuple):
    """One wave that arrives at a position.

    Attributes:
        pulse: On the common clock: a `Pulse` in air, the `GroundPulse` of the ground
            below the position for a wave in the ground.
        kind: "air" for the direct wave, "reflected" for that of the ground's image, or
            "ground".
        shot: Index of its charge in the scene.
        distance: Length of its path [m].
        absorbed_m: Length of the path along which the air absorbs, times the scene's
            `absorption_scale` [m]: the part beyond Z = 300, or all of it if the scene
            requests it. None of the ground wave's.
        pace: Rate of its phase by the clock of the sensor [-]: 1 for a fixed sensor,
            the Doppler factor for a moving one.
    """

    pulse: Any  # Pulse or GroundPulse: a union would need a check at every use
    kind: Way
    shot: int
    distance: Float[Array, ""]
    absorbed_m: Float[Array, ""]
    pace: Float[Array, ""]


def waves(
    scene: Scene,
    place: Standpoint,
    laws: Mapping[str, str] | None = None,
    ways: Sequence[Way] = IN_AIR,
) -> tuple[Wave, ...]:
    """Return every wave that arrives at a position, charge by charge.

    The wave of a charge that never detonates has infinite arrival and no amplitude.
    At a moving position each wave is that of the meeting point. Its times are those
    that the sensor measures: shorter if it moves towards the charge. Pure, for jit,
    vmap and grad; values are checked outside jit only.

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or a `Track`.
        laws: Law names by quantity; absent ones as in `record_laws`.
        ways: Kinds of the waves.

    Raises:
        InputError: A law is unknown, the position has not three coordinates or is at
            the charge, the laws' impulse exceeds peak times duration, or the track is
            as fast as sound.

    Example:
        `jblast.sensors.waves(jblast.Scene(), [20.0, 0.0, 1.5])[0].pulse.peak`
    """
    named, found = record_laws(scene, laws), []
    if isinstance(place, Track):
        check_speed(scene, place)
    else:
        shape = np.shape(place)
        expected = "east, north and up [m]"
        require(shape == (3,), "place", expected, f"shape {shape}")
        place = as_numbers(jnp.asarray(place))
    for shot, charge in enumerate(grounded(scene).charges):
        own: tuple[Way, ...] = tuple(
            way for way in ways if way != "reflected" or _is_reflected(charge)
        )
        # each charge alone, so that one compiled program serves all of them
        for wave in _waves_of(alone(scene, charge), place, named, own):
            found.append(wave._replace(shot=shot))
            _check(found[-1], f"charge {shot + 1} of {len(scene.charges)}")
    return tuple(found)


@kept
def _waves_of(
    scene: Scene,
    place: Float[Array, "3"] | Track,
    laws: Mapping[str, str],
    ways: tuple[Way, ...],
) -> tuple[Wave, ...]:
    """Return the waves of a scene with one charge."""
    if not isinstance(place, Track):
        return tuple(_wave_at(scene, place, laws, way) for way in ways)
    found = []
    for way in ways:
        time, pace = _meeting(scene, place, laws, way)
        wave = _wave_at(scene, place.at(time), laws, way)
        found.append(wave._replace(pulse=wave.pulse.stretched(pace), pace=pace))
    return tuple(found)


def _wave_at(
    scene: Scene, place: Float[Array, "3"], laws: Mapping[str, str], way: Way
) -> Wave:
    """Return one wave of a scene's only charge at a position."""
    charge, path = _path(scene, place, way)
    exists, share = jnp.logical_not(scene.charge.never), jnp.ones(())
    if way == "reflected":
        # a charge or sensor on the ground has no separate reflection
        exists = exists & (scene.charge.up > 0) & (place[2] > 0)
        if scene.charge.burst is None:
            # as far as the direct wave is that of free air
            free = _path(scene, place, "air")[1].free_air
            share = jnp.asarray(free).astype(float)[0]
            exists = exists & (share > 0)
    share = jnp.where(exists, share, 0.0)
    arrival = charge.time_s + _value(_arrival_of(way), laws, charge, path)
    arrival = jnp.where(exists, arrival, jnp.inf)
    distance = path.slant_range[0]
    if way == "ground":
        # motion of the surface below an elevated position; the arrival keeps its height
        _, below = _path(scene, place.at[2].min(0.0), way)
        displacement, velocity = (
            _value(quantity, laws, charge, below)
            for quantity in ("ground_displacement_m", "ground_peak_velocity_m_s")
        )
        motion = ground_pulse_of(arrival, displacement, velocity)
        motion = motion._replace(amplitude=share * motion.amplitude)
        return Wave(motion, way, 0, distance, jnp.zeros(()), jnp.ones(()))
    peak, duration, impulse = (
        _value(quantity, laws, charge, path) for quantity in AIR_QUANTITIES[1:]
    )
    path = replace(path, charge_mass=charge.tnt_mass("peak_overpressure_pa"))
    rise = weak_shock_rise_time(peak, impulse, duration)
    pulse = pulse_of(arrival, peak, impulse, duration, rise, *_suction(path, peak))
    pulse = pulse._replace(peak=share * pulse.peak, suction=share * pulse.suction)
    absorbed, air = distance, scene.air
    if not air.absorption:
        unit = sachs_distance_factor(path.charge_mass, path.ambient_pressure)
        absorbed = jnp.maximum(distance - FAR_END * jnp.broadcast_to(unit, (1,))[0], 0)
    return Wave(pulse, way, 0, distance, air.absorption_scale * absorbed, jnp.ones(()))


def _path(scene: Scene, place: Float[Array, "3"], way: Way) -> tuple[Charge, Path]:
    """Return the scene's charge as if it detonated, and the path of its wave."""
    charge = scene.charge.as_if_at_zero()
    if way == "reflected":
        # A position mirrored at the ground is as far from the charge as the position
        # from the image, and as far upwind. The image replaces the ground, which
        # free-air curves do not contain.
        charge, place = replace(charge, burst="free-air"), place * MIRROR
    nothing = jnp.full(1, jnp.nan)
    return charge, path_between(scene, charge, place[None], nothing, nothing)


def _value(
    quantity: str, laws: Mapping[str, str], charge: Charge, path: Path
) -> Float[Array, ""]:
    law = law_for(quantity, laws[quantity])
    path = replace(path, charge_mass=charge.tnt_mass(quantity))
    return jnp.broadcast_to(call(law.function, path), (1,))[0]


def _arrival_of(way: Way) -> str:
    return "ground_arrival_s" if way == "ground" else "air_arrival_s"


def _meeting(
    scene: Scene, track: Track, laws: Mapping[str, str], way: Way
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the time at which a sensor meets a wave, and the Doppler factor.

    The time is the root of arrival(t) = t, differentiable as an implicit function. The
    factor is the rate of the phase t - arrival(t) by the clock.
    """

    def arrival(time: Float[Array, ""]) -> Float[Array, ""]:
        charge, path = _path(scene, track.at(time), way)
        return charge.time_s + _value(_arrival_of(way), laws, charge, path)

    first = arrival(track.time[0])
    # The iterations carry no gradient; the Newton step below supplies it.
    near = lax.stop_gradient(
        lax.fori_loop(0, STEPS, lambda _, t: lax.stop_gradient(arrival(t)), first)
    )
    late, rate = jax.jvp(arrival, (near,), (jnp.ones_like(near),))
    # Newton's step: the derivative of its value is that of the root
    time = near + (late - near) / lax.stop_gradient(1.0 - rate)
    return time, 1.0 - jax.jvp(arrival, (time,), (jnp.ones_like(time),))[1]


def _suction(
    path: Path, peak: Float[Array, ""]
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return peak suction and its impulse, scaled to a weaker law's peak."""

    def suction_at(slant_range, charge_mass, ambient_pressure, sound_speed, burst):
        air = (slant_range, charge_mass, ambient_pressure)
        known = shock_kinematics_pressure(*air, burst)
        low, impulse = suction_of(*air, sound_speed, burst)
        # a law with more pressure leaves the suction as it is
        share = jnp.minimum(peak / known, 1.0)
        return share * low, share * impulse

    low, impulse = call(suction_at, path)
    return low[0], impulse[0]


def _is_reflected(charge: Charge) -> bool:
    """Return False if a charge certainly has no reflection of its own.

    That is without a position, with curves that contain it, and on the ground.
    """
    low = not isinstance(charge.up, Tracer) and bool(np.asarray(charge.up) <= 0)
    return not (charge.range_m is not None or charge.burst == "surface" or low)


def alone(scene: Scene, charge: Charge) -> Scene:
    """Return a scene with one of its charges and no sensors.

    All charges then share one program: another number, name or order of a scene's parts
    would need another compilation.
    """
    return replace(
        scene,
        charges=(replace(charge, name=""),),
        sensors=(),
        camera=None,
        vehicle=None,
        ambient=None,
        clocks=(),
    )


def check_speed(scene: Scene, track: Track) -> None:
    """Reject a track that is not slower than sound: it may meet a wave twice.

    Raises:
        InputError: The track is too fast. Inside jit nothing is checked.
    """
    speed = sound_speed_of(scene.air)
    if any(isinstance(x, Tracer) for x in (track.time, track.position, speed)):
        return
    steps = np.diff(np.asarray(track.position), axis=0)
    speeds = np.linalg.norm(steps, axis=1) / np.diff(np.asarray(track.time))
    fastest = speeds.max(initial=0.0)
    expected = f"less than the {float(speed):.4g} m/s of sound"
    require(fastest < float(speed), "track", expected, f"{fastest:.4g}")


def _check(wave: Wave, label: str) -> None:
    """Reject a wave with undefined distance or pulse."""
    # traced values are unknown; callers inside jit accept NaN instead of an error
    if any(isinstance(x, Tracer) for x in (wave.distance, *wave.pulse)):
        return
    distance, pulse = float(wave.distance), wave.pulse
    away = np.isfinite(distance) and distance > 0.0
    expected = "a position away from it"
    require(away, label, expected, f"a distance of {distance:g} m")
    # infinity is legal: a charge that never detonates arrives at infinite time
    known = not any(bool(jnp.isnan(x)) for x in pulse)
    expected = (
        f"laws with a pulse at {distance:g} m, its impulse between 0 and peak times "
        "duration"
    )
    require(known, label, expected, "none")


def places_met(
    scene: Scene, track: Track, laws: Mapping[str, str]
) -> dict[str, Float[np.ndarray, "shot 3"]]:
    """Return the positions of a moving sensor at the arrivals of a scene's blasts.

    `sensors.record` at the returned position gives the meeting time. For a charge that
    never detonates: the positions as if it detonated at time 0. At the flash that is
    the position at the detonation: light needs 3 us per kilometre, in which 30 m/s are
    0.1 mm.

    Args:
        scene: Charges, air, ground and sensors.
        track: Positions of the sensor over time.
        laws: Laws of air_arrival_s and ground_arrival_s.

    Returns:
        East, north, up [m], one row per charge, by the quantity of the arrival.

    Raises:
        InputError: The track is as fast as sound.
    """
    check_speed(scene, track)
    arrivals = {_arrival_of(way): laws[_arrival_of(way)] for way in ("air", "ground")}
    rows = [
        _places_of(alone(scene, charge), track, arrivals)
        for charge in grounded(scene).charges
    ]
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


@eqx.filter_jit
def _places_of(
    scene: Scene, track: Track, laws: dict[str, str]
) -> dict[str, Float[Array, "3"]]:
    times = {"flash_time_s": jnp.asarray(scene.charge.as_if_at_zero().time_s)}
    for way in ("air", "ground"):
        times[_arrival_of(way)], _ = _meeting(scene, track, laws, way)
    return {name: track.at(time) for name, time in times.items()}


def overpressure(
    scene: Scene,
    place: Standpoint,
    edges: Float[ArrayLike, " edge"],
    laws: Mapping[str, str] | None = None,
) -> Float[Array, " sample"]:
    """Return the mean overpressure in the air over each sample [Pa].

    A sample is the mean over its time, so that the samples sum to the impulse and no
    front between two of them is lost. Waves add; absorption by air is not included
    (`Wave.absorbed` marks the waves on which it would act). Pure, for jit, vmap and
    grad in all numbers of scene, position and edges.

    Args:
        scene: Charges, air, ground and sensors.
        place: East, north, up [m], or a `Track`.
        edges: Bounds of the samples on the common clock [s], rising: one more than
            samples. In single precision use a clock that starts near the record.
        laws: By quantity; absent ones as in `record_laws`.

    Raises:
        InputError: As in `waves`, or edges do not rise.

    Example:
        `jblast.sensors.overpressure(scene, [20.0, 0.0, 1.5], jnp.arange(4801) / 48e3)`
    """
    edges, expected = as_numbers(edges), "two or more rising times [s]"
    is_row = edges.ndim == 1 and edges.size > 1
    require(is_row, "edges", expected, f"shape {edges.shape}")
    if not isinstance(edges, Tracer):
        steps = np.diff(np.asarray(edges))
        require((steps > 0).all(), "edges", expected, f"a step of {steps.min():g} s")
    return mean_overpressure(waves(scene, place, laws), jnp.zeros(()), edges)


@eqx.filter_jit
def mean_overpressure(
    found: Sequence[Wave], origin: Float[Array, ""], edges: Float[Array, " edge"]
) -> Float[Array, " sample"]:
    """Return the sum of waves in the air, as a mean over each sample [Pa].

    Args:
        found: Waves on the common clock.
        origin: Time from which the edges count, on the common clock [s].
        edges: Bounds of the samples [s].
    """
    total = jnp.zeros(edges.size - 1, edges.dtype)
    for wave in found:
        total = total + counted_from(wave.pulse, origin).mean(edges[:-1], edges[1:])
    return total


def record_laws(scene: Scene, laws: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the law of each quantity of a record: given, else the scene's, else ours.

    Args:
        scene: Its `law`; "auto" there leaves a quantity to `DEFAULT_RECORD_LAWS`.
        laws: Law names by quantity; quantities that no record needs are ignored.

    Raises:
        InputError: A law does not exist, or predicts another quantity.
    """
    # the caller's names override the scene's
    chosen = {**dict(scene.law), **(laws or {})}
    found = {}
    for quantity, default in DEFAULT_RECORD_LAWS.items():
        name = chosen.get(quantity, "auto")
        found[quantity] = law_for(quantity, default if name == "auto" else name).name
    return found
