r"""The waves in air at a place: direct, and by way of the ground.

Arrival, peak, duration and impulse are those of `sensors.record` for the same scene and
laws. The rest is not a law's to choose: the suction is that of `waves.blast_pulse`,
where a law says less pressure than `shock_kinematics` as much less; the rise time that
of a weak shock (`rise_time.py`).

The reflection comes from the image of the charge below a flat ground, for charges that
are taken by the free-air curves alone (those of a surface burst hold the ground
already) and places above the ground: a wave of its own, by the same laws at the longer
distance, its pressure times the coefficient of the ground, 1 for a rigid one. Regular
reflection of sound: where the direct wave is strong the true one is stronger, and past
the triple point the two are one.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jblast.registry import call, law_for
from jblast.scene import Charge, Scene
from jblast.sensors.arrivals.laws import AIR_QUANTITIES
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to, record
from jblast.waves.laws.shock_kinematics.laws import shock_kinematics_pressure
from jblast.waves.paths import Path
from jblast.waves.waveform.blast_pressure import suction_of
from jblast.waves.waveform.pulse import Pulse, pulse_of
from jblast.waves.waveform.rise_time import weak_shock_rise_time

Way = Literal["air", "reflected"]


class Heard(NamedTuple):
    """One wave that comes to a place.

    Attributes:
        pulse: Its pressure over time, on the common clock.
        kind: "air" from the charge itself, "reflected" by the ground.
        shot: Which of the scene's charges it is of.
        distance: That it came [m].
        absorbed: Whether the air's absorption acts on it, which its law does not know:
            where the law of the peak does not hold, or the scene says so.
    """

    pulse: Pulse
    kind: Way
    shot: int
    distance: Float[Array, ""]
    absorbed: Bool[Array, ""]


def air_waves(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    reflection: float | Float[Array, ""] = 1.0,
) -> tuple[Heard, ...]:
    """Return every wave in air that comes to a place.

    Of a charge that never happens it arrives never, with no pressure. Pure: for jit,
    vmap and grad.

    Args:
        scene: What is there.
        position: East, north, up [m].
        laws: By quantity, all of `AIR_QUANTITIES`.
        reflection: Coefficient of the ground; a plain 0 leaves reflections out.
    """
    return tuple(
        air_wave(scene, position, laws, shot, way, reflection)
        for shot, way in ways(scene, reflection)
    )


def ways(
    scene: Scene, reflection: float | Float[Array, ""]
) -> tuple[tuple[int, Way], ...]:
    """Return by which ways waves of which charge may come to a place."""
    off = not isinstance(reflection, Tracer) and not np.any(reflection)
    found: list[tuple[int, Way]] = []
    for shot, charge in enumerate(scene.charges):
        found.append((shot, "air"))
        if not off and _may_be_high(charge):
            found.append((shot, "reflected"))
    return tuple(found)


def arrival_time(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    shot: int,
    way: Way,
) -> Float[Array, ""]:
    """Return when one wave comes to a place, on the common clock [s].

    Of a charge that never happens, as if it did at time 0.
    """
    seen, place = _as_seen(scene, position, shot, way)
    layout = _layout(place, ("air_arrival_s",))
    return record(seen, layout, {"air_arrival_s": laws["air_arrival_s"]}).value[0]


def air_wave(
    scene: Scene,
    position: Float[Array, "3"],
    laws: Mapping[str, str],
    shot: int,
    way: Way,
    reflection: float | Float[Array, ""] = 1.0,
) -> Heard:
    """Return one wave at a place; what is not there arrives never.

    Args:
        scene: What is there.
        position: East, north, up [m].
        laws: By quantity, all of `AIR_QUANTITIES`.
        shot: Which of the scene's charges it is of.
        way: How it comes.
        reflection: Coefficient of the ground.
    """
    seen, place = _as_seen(scene, position, shot, way)
    layout = _layout(place, AIR_QUANTITIES)
    arrival, peak, duration, impulse = record(seen, layout, laws).value
    path = replace(
        path_to(seen, layout.only(np.array([1]))),
        charge_mass=seen.charge.tnt_mass("peak_overpressure_pa"),
    )
    rise = weak_shock_rise_time(peak, impulse, duration)
    suction = _suction(path, peak)
    pulse = pulse_of(arrival, peak, impulse, duration, rise, *suction)
    there = _is_there(scene, position, shot, way)
    factor = jnp.where(there, 1.0 if way == "air" else reflection, 0.0)
    pulse = pulse._replace(
        arrival_time=jnp.where(there, arrival, jnp.inf),
        peak=factor * pulse.peak,
        suction=factor * pulse.suction,
    )
    law = law_for("peak_overpressure_pa", laws["peak_overpressure_pa"])
    holds = jnp.broadcast_to(call(law.valid, path), (1,))[0]
    absorbed = ~holds | scene.air.absorption
    return Heard(pulse, way, shot, path.slant_range[0], absorbed)


def peak_at(
    scene: Scene, distance: Float[Array, ""], laws: Mapping[str, str], wave: Heard
) -> Float[Array, ""]:
    """Return the peak of a wave's charge at another distance, by the same law [Pa]."""
    nowhere = jnp.zeros(3, jnp.result_type(distance))
    seen, place = _as_seen(scene, nowhere, wave.shot, wave.kind)
    layout = _layout(place, ("peak_overpressure_pa",))
    layout = replace(layout, slant_range=jnp.reshape(distance, (1,)))
    return record(seen, layout, laws).value[0]


def _may_be_high(charge: Charge) -> bool:
    """Whether a charge may stand above the ground and be taken by free-air curves."""
    if charge.range is not None or charge.burst == "surface":
        return False
    return not _stands_low(charge)


def _stands_low(charge: Charge) -> bool:
    """Whether a charge is known to stand on the ground or in it."""
    return not isinstance(charge.up, Tracer) and bool(
        np.all(np.asarray(charge.up) <= 0)
    )


def low_charges_settled(scene: Scene) -> Scene:
    """Return the scene with surface curves where a height on the ground leaves them.

    Outside jit, where heights are known: half of the program.
    """
    charges = [
        replace(charge, burst="surface", by_height=True)
        if charge.burst is None and _stands_low(charge)
        else charge
        for charge in scene.charges
    ]
    return replace(scene, charge=charges[0], others=tuple(charges[1:]))


def _as_seen(
    scene: Scene, position: Float[Array, "3"], shot: int, way: Way
) -> tuple[Scene, Float[Array, "3"]]:
    """Return the scene with one charge, and the place as the wave of a way sees it.

    Mirrored at the ground it is as far from the charge as the place from the image, and
    as far upwind.
    """
    charge = scene.charges[shot].as_if_at_zero()
    if way == "air":
        return replace(scene, charge=charge, others=()), position
    charge = replace(charge, burst="free-air")
    mirror = jnp.array([1.0, 1.0, -1.0], position.dtype)
    return replace(scene, charge=charge, others=()), position * mirror


def _is_there(
    scene: Scene, position: Float[Array, "3"], shot: int, way: Way
) -> Bool[Array, ""]:
    """Return whether there is a wave of a way at a place."""
    charge = scene.charges[shot]
    if way == "air":
        return ~charge.never
    above = (charge.up > 0) & (position[2] > 0)
    if charge.burst is None:
        seen, _ = _as_seen(scene, position, shot, "air")
        path = path_to(seen, _layout(position, ("peak_overpressure_pa",)))
        above = above & jnp.asarray(path.free_air)[0]
    return above & ~charge.never


def _suction(
    path: Path, peak: Float[Array, ""]
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return greatest underpressure and its impulse, less where a law says less."""

    def by_burst(way: Path):
        burst = way.one_burst()
        air = (way.slant_range, way.charge_mass, way.ambient_pressure)
        known = shock_kinematics_pressure(*air, burst)
        low, impulse = suction_of(*air, way.sound_speed, burst)
        share = jnp.minimum(peak / known, 1.0)
        return share * low, share * impulse

    low, impulse = path.by_height(by_burst) if path.burst is None else by_burst(path)
    return low[0], impulse[0]


def _layout(place: Float[Array, "3"], quantities: tuple[str, ...]) -> Layout:
    """Return the rows of a place, one a quantity, on the common clock."""
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
