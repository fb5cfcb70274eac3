r"""The waves in air at a place: direct, and by way of the ground.

Arrival, peak, duration and impulse are those of `sensors.record` for the same scene and
laws. The rest is not a law's to choose: the suction is that of `waves.blast_pulse`,
where a law says less pressure than `shock_kinematics` as much less; the rise time that
of a weak shock (`waves/waveform.py`).

The reflection comes from the image of the charge below a flat ground, for charges that
are taken by the free-air curves alone (those of a surface burst hold the ground
already) and places above the ground: a wave of its own, by the same laws at the longer
distance, its pressure times the coefficient of the ground, 1 for a rigid one. Regular
reflection of sound: where the direct wave is strong the true one is stronger, and past
the triple point the two are one.
"""

from collections.abc import Mapping
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.registry import call, law_for
from jblast.scene import Scene
from jblast.sensors.arrivals.laws import AIR_QUANTITIES
from jblast.sensors.arrivals.way import Heard, Way, as_seen, is_there, rows_of_place
from jblast.sensors.record import path_to, record
from jblast.waves.laws.shock_kinematics import shock_kinematics_pressure
from jblast.waves.paths import Path
from jblast.waves.pulse import pulse_of
from jblast.waves.waveform import suction_of, weak_shock_rise_time


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
    seen, place = as_seen(scene, position, shot, way)
    layout = rows_of_place(place, AIR_QUANTITIES)
    arrival, peak, duration, impulse = record(seen, layout, laws).value
    path = replace(
        path_to(seen, layout.only(np.array([1]))),
        charge_mass=seen.charge.tnt_mass("peak_overpressure_pa"),
    )
    rise = weak_shock_rise_time(peak, impulse, duration)
    suction = _suction(path, peak)
    pulse = pulse_of(arrival, peak, impulse, duration, rise, *suction)
    there = is_there(scene, position, shot, way)
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
    seen, place = as_seen(scene, nowhere, wave.shot, wave.kind)
    layout = rows_of_place(place, ("peak_overpressure_pa",))
    layout = replace(layout, slant_range=jnp.reshape(distance, (1,)))
    return record(seen, layout, laws).value[0]


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
