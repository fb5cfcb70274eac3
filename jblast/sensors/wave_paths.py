r"""Waves at a position: their paths through air and ground, arrivals and pulses.

Air. Arrival, peak, duration and impulse are those of `sensors.record` for the same
scene and laws. Two numbers do not depend on the choice of laws. The suction is that of
`waves.waveform.blast_pulse`, reduced by the same factor where a law predicts less
pressure than `shock_kinematics`. The rise time is that of a weak shock
(`waves/waveform.py`).

The reflection comes from the image of the charge below a flat, rigid ground. It exists
for charges with free-air curves (the curves of a surface burst contain the ground) and
for positions above the ground. It is a separate wave by the same laws at the longer
distance. This is the regular reflection of sound. Where the direct wave is strong the
true reflection is stronger, and past the triple point the two waves merge.

Ground. Arrival, displacement and velocity are those of `sensors.record` for the same
scene and laws. The arrival is that at the position itself, which above the ground
follows the scene's `ground.path`. The motion is that of the ground below the position.
The ground is a piston to the air above it, $p = \rho c\,v$: a plane wave that goes up
without attenuation.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError, nearest
from jblast.registry import call, is_law, law_for, names_for
from jblast.scene import Air, Charge, Scene
from jblast.sensors.forward_model import path_to, record
from jblast.sensors.layout import Layout
from jblast.waves.laws.shock_kinematics import shock_kinematics_pressure
from jblast.waves.paths import Path, slant_range
from jblast.waves.propagation import air_density, ambient, sound_speed_of
from jblast.waves.pulse import GroundPulse, ground_pulse_of, pulse_of
from jblast.waves.waveform import suction_of, weak_shock_rise_time

Way = Literal["air", "reflected", "ground"]
AIR_QUANTITIES = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
)
"""Quantities that define a wave in air."""
DEFAULT_RECORD_LAWS: dict[str, str] = dict.fromkeys(AIR_QUANTITIES, "shock_kinematics")
"""One model from the charge to Z = 1e4, so that no law has to be chosen inside jit."""
DEFAULT_GROUND_LAWS: dict[str, str] = {
    "ground_arrival_s": "wu_hao",
    "ground_displacement_m": "ground_motion",
    "ground_peak_velocity_m_s": "ground_motion",
}
"""Quantities that define a wave in the ground, and their default laws."""


class Heard(NamedTuple):
    """One wave that arrives at a position.

    Attributes:
        pulse: Pressure over time on the common clock: a `Pulse`.
        kind: "air" for the direct wave, "reflected" for that of the ground's image, or
            "ground" for the wave above moving ground, a `GroundPulse` in pascals (its
            displacement is then the integral of the pressure [Pa s]).
        shot: Index of its charge in the scene.
        distance: Length of its path [m].
        absorbed: True if the air's absorption acts on it, because its law does not
            include it: if the law of the peak does not hold, or the scene requests it.
            Never for the ground wave.
        pace: Rate of its phase by the clock of the sensor [-]: 1 for a fixed sensor,
            the Doppler factor for a moving one.
    """

    pulse: Any  # Pulse or GroundPulse: a union would need a check at every use
    kind: Way
    shot: int
    distance: Float[Array, ""]
    absorbed: Bool[Array, ""]
    pace: Float[Array, ""]


def waves_at(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return every wave that arrives at a position.

    The wave of a charge that never detonates has infinite arrival and no pressure.
    Pure, for jit, vmap and grad.

    Args:
        scene: Charges, air, ground and sensors.
        position: East, north, up [m].
        laws: Law names by quantity, for all paths.
        ground: True to include the waves of the moving ground.
    """
    return tuple(
        wave_at(scene, position, laws, shot, way) for shot, way in ways(scene, ground)
    )


def wave_at(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    shot: int,
    way: Way,
) -> Heard:
    """Return one wave at a position; an absent wave has infinite arrival.

    Args:
        scene: Charges, air, ground and sensors.
        position: East, north, up [m].
        laws: Law names by quantity.
        shot: Index of its charge.
        way: Path of the wave.
    """
    # air and reflected waves have the same laws; only the ground wave needs motion
    if way != "ground":
        return air_wave(scene, position, laws, shot, way)
    seen, place = as_seen(scene, position, shot, way)
    (motion,) = ground_waves(seen, place, laws)
    there = is_there(scene, position, shot, way)
    # the ground as a piston: velocity times rho c is pressure
    loudness = jnp.where(there, pressure_of_velocity(scene.air), 0.0)
    pulse = motion._replace(
        arrival_time=jnp.where(there, motion.arrival_time, jnp.inf),
        amplitude=loudness * motion.amplitude,
    )
    charge = seen.charge
    source = jnp.stack(charge.position_m)
    distance = slant_range(source, place)
    if charge.range_m is not None:
        distance = charge.range_m
    return Heard(pulse, way, shot, distance, jnp.zeros((), bool), jnp.ones(()))


def air_wave(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    shot: int,
    way: Way,
) -> Heard:
    """Return one wave in air at a position; an absent wave has infinite arrival.

    Args:
        scene: Charges, air, ground and sensors.
        position: East, north, up [m].
        laws: Law names by quantity, all of `AIR_QUANTITIES`.
        shot: Index of its charge.
        way: Path of the wave.
    """
    seen, place = as_seen(scene, position, shot, way)
    layout = rows_of_place(place, AIR_QUANTITIES)
    # one call for the four rows: the path is computed once
    arrival, peak, duration, impulse = record(seen, layout, laws).value
    path = replace(
        path_to(seen, layout.only(np.array([1]))),
        charge_mass=seen.charge.tnt_mass("peak_overpressure_pa"),
    )
    rise = weak_shock_rise_time(peak, impulse, duration)
    suction = _suction(path, peak)
    pulse = pulse_of(arrival, peak, impulse, duration, rise, *suction)
    there = is_there(scene, position, shot, way)
    # an absent wave has no pressure; its arrival is infinite
    factor = jnp.where(there, 1.0, 0.0)
    pulse = pulse._replace(
        arrival_time=jnp.where(there, arrival, jnp.inf),
        peak=factor * pulse.peak,
        suction=factor * pulse.suction,
    )
    # validity of the peak decides about absorption: beyond its range the law
    # extrapolates without it
    law = law_for("peak_overpressure_pa", laws["peak_overpressure_pa"])
    holds = jnp.broadcast_to(call(law.valid, path), (1,))[0]
    absorbed = ~holds | scene.air.absorption
    return Heard(pulse, way, shot, path.slant_range[0], absorbed, jnp.ones(()))


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


def ground_waves(
    scene: Scene, position: Float[Array, "3"], laws: Mapping[str, str]
) -> tuple[GroundPulse, ...]:
    """Return the wave in the ground of every charge, on the common clock.

    That of a charge that never detonates has infinite arrival. Pure, for jit, vmap and
    grad.

    Args:
        scene: Charges, air, ground and sensors.
        position: East, north, up [m]; above the ground, the motion is that below it.
        laws: Law names by quantity, all of `DEFAULT_GROUND_LAWS`.
    """
    # ground motion is that of the surface below an elevated position; the arrival keeps
    # its height
    below = position.at[2].min(0.0)
    shots = len(scene.charges)
    quantities = tuple(DEFAULT_GROUND_LAWS)
    n = shots * len(quantities)
    layout = Layout(
        quantity=quantities * shots,
        position=jnp.stack([position, below, below] * shots),
        slant_range=jnp.full(n, jnp.nan),
        time=jnp.full(n, jnp.nan),
        group=(0,) * n,
        shot=tuple(shot for shot in range(shots) for _ in quantities),
        clock=("",) * n,
    )
    value = record(scene, layout, laws).value.reshape(shots, len(quantities))
    return tuple(ground_pulse_of(*value[shot]) for shot in range(shots))


def pressure_of_velocity(air: Air) -> Float[Array, ""]:
    r"""Return pressure over velocity above moving ground, $\rho c$ [Pa s/m]."""
    density = air_density(*ambient(air), air.relative_humidity)
    return density * sound_speed_of(air)


def ways(scene: Scene, ground: bool) -> tuple[tuple[int, Way], ...]:
    """Return charge index and path of each wave that may arrive at a position.

    Args:
        scene: Charges, air, ground and sensors.
        ground: True to include the waves of the moving ground.
    """
    found: list[tuple[int, Way]] = []
    for shot, charge in enumerate(scene.charges):
        found.append((shot, "air"))
        # no reflection for a range without a position, nor for curves that contain it
        alone_or_low = charge.range_m is not None or charge.burst == "surface"
        if not (alone_or_low or _stands_low(charge)):
            found.append((shot, "reflected"))
        # the ground wave exists for every charge, also for one in free air
        if ground:
            found.append((shot, "ground"))
    return tuple(found)


def arrival_time(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    shot: int,
    way: Way,
) -> Float[Array, ""]:
    """Return the arrival time of one wave at a position, on the common clock [s].

    A charge that never detonates is treated as if it did at time 0.
    """
    seen, place = as_seen(scene, position, shot, way)
    quantity = "ground_arrival_s" if way == "ground" else "air_arrival_s"
    return record(seen, rows_of_place(place, (quantity,)), laws).value[0]


def _stands_low(charge: Charge) -> bool:
    """Return True if a charge is certainly on the ground or in it."""
    return not isinstance(charge.up, Tracer) and bool(
        np.all(np.asarray(charge.up) <= 0)
    )


def alone(scene: Scene, shot: int) -> Scene:
    """Return a scene with one of its charges and no sensors.

    All charges then share one program: another number, name or order of a scene's parts
    would need another compilation.
    """
    return replace(
        scene,
        charges=(replace(scene.charges[shot], name=""),),
        sensors=(),
        camera=None,
        vehicle=None,
        ambient=None,
        clocks=(),
    )


def as_seen(
    scene: Scene, position: Float[Array, "3"], shot: int, way: Way
) -> tuple[Scene, Float[Array, "3"]]:
    """Return the scene with one charge, and the position on the path of a wave.

    For a reflection the position is mirrored at the ground: it is as far from the
    charge as the position from the image, and as far upwind.
    """
    charge = scene.charges[shot].as_if_at_zero()
    if way != "reflected":
        return replace(scene, charges=(charge,)), position
    # the image replaces the ground, which free-air curves do not contain
    charge = replace(charge, burst="free-air")
    mirror = jnp.array([1.0, 1.0, -1.0], position.dtype)
    return replace(scene, charges=(charge,)), position * mirror


def is_there(
    scene: Scene, position: Float[Array, "3"], shot: int, way: Way
) -> Bool[Array, ""]:
    """Return True if a wave of this path exists at a position."""
    charge = scene.charges[shot]
    if way != "reflected":
        return ~charge.never
    # a charge or sensor on the ground has no separate reflection
    above = (charge.up > 0) & (position[2] > 0)
    if charge.burst is None:
        seen, _ = as_seen(scene, position, shot, "air")
        path = path_to(seen, rows_of_place(position, ("peak_overpressure_pa",)))
        above = above & (jnp.asarray(path.free_air)[0] >= 1.0)
    return above & ~charge.never


def rows_of_place(place: Float[Array, "3"], quantities: tuple[str, ...]) -> Layout:
    """Return one row per quantity for a position, on the common clock."""
    n = len(quantities)
    return Layout(
        quantity=quantities,
        position=jnp.broadcast_to(place, (n, 3)),
        slant_range=jnp.full(n, jnp.nan),
        time=jnp.full(n, jnp.nan),
        group=(0,) * n,
        shot=(0,) * n,
        clock=("",) * n,
    )


def record_laws(
    scene: Scene, laws: Mapping[str, str] | None = None, *, ground: bool = False
) -> dict[str, str]:
    """Return the law of each quantity: given, else the scene's, else the default.

    Args:
        scene: Its `law`; "auto" there leaves a quantity to `DEFAULT_RECORD_LAWS`.
        laws: Law names by quantity; quantities that no record needs are ignored.
        ground: True to add the laws of waves in the ground (`ground_laws`).

    Raises:
        InputError: A law does not exist, or predicts another quantity.
    """
    named = _named(scene, laws, DEFAULT_RECORD_LAWS)
    return named | ground_laws(scene, laws) if ground else named


def ground_laws(scene: Scene, laws: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the laws of waves in the ground, by default `DEFAULT_GROUND_LAWS`."""
    return _named(scene, laws, DEFAULT_GROUND_LAWS)


def _named(
    scene: Scene, laws: Mapping[str, str] | None, defaults: Mapping[str, str]
) -> dict[str, str]:
    """Return the law name of each quantity that has a default."""
    # the caller's names override the scene's
    chosen = {**dict(scene.law), **(laws or {})}
    found = {
        quantity: chosen[quantity]
        if chosen.get(quantity, "auto") != "auto"
        else default
        for quantity, default in defaults.items()
    }
    for quantity, name in found.items():
        if not is_law(quantity, name):
            known = names_for(quantity)
            raise InputError(
                f"law of {quantity}: expected one of {', '.join(known)}, got "
                f"{name!r}{nearest(name, known)}"
            )
    return found
