"""What blasts do to a vehicle beside moving it: pressure, acceleration, fire."""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Charge, Scene
from jblast.sensors.camera.fireball import cloud
from jblast.study.flights.encounter import Encounter, FlightLoad
from jblast.vehicle import CustomProfile, State, Vehicle
from jblast.vehicle.loads.blast import over_alike
from jblast.waves.fireball import fireball_duration

WINDOW_S = 5e-5
"""An acceleration is a mean over so long: a tenth of what a front takes to cross."""
WINDOWS = np.arange(-20.0, 80.0)
"""About an arrival."""


class Exposure(NamedTuple):
    """What a flight's blasts expose its vehicle to.

    Attributes:
        peak_overpressure_pa: Incident, of the strongest; NaN by a custom profile.
        peak_acceleration_m_s2: By the blasts alone.
        fireball_time_s: Within a fireball while it glows, to the distance of the
            stored rows; NaN by a custom profile.
    """

    peak_overpressure_pa: Float[Array, "*batch"]
    peak_acceleration_m_s2: Float[Array, "*batch"]
    fireball_time_s: Float[Array, "*batch"]


def exposed(
    scene: Scene,
    load: FlightLoad,
    vehicle: Vehicle,
    encounter: Encounter,
    time_s: Float[Array, " time"],
    states: State,
) -> Exposure:
    """Return the exposure of one flight.

    A blast that comes after its end, or never, does nothing to it.

    Args:
        scene: Whose fireballs these are, as its camera sees them.
        load: Of the blasts.
        vehicle: The vehicle.
        encounter: As `encounter_of` returns it.
        time_s: Of the stored rows.
        states: At these times.
    """
    felt = encounter.arrival_s <= time_s[-1]
    arrival = jnp.where(felt, encounter.arrival_s, 0.0)

    def accelerations(came: Float[Array, ""]) -> Float[Array, " window"]:
        last = jnp.maximum(jnp.sum(time_s < came) - 1, 0)
        state = jax.tree.map(lambda x: x[last], states)

        def one(start: Float[Array, ""]) -> Float[Array, ""]:
            push, _ = load.impulse(start, start + WINDOW_S, state, vehicle)
            return jnp.linalg.norm(push) / (WINDOW_S * vehicle.mass_kg)

        return jax.vmap(one)(came + WINDOW_S * WINDOWS)

    greatest = jnp.max(jax.vmap(accelerations)(arrival), axis=-1)
    return Exposure(
        jnp.max(jnp.where(felt, encounter.overpressure_pa, 0.0)),
        jnp.max(jnp.where(felt, greatest, 0.0)),
        _in_fire(scene, load, time_s, states.position_m),
    )


def _in_fire(
    scene: Scene,
    load: FlightLoad,
    time_s: Float[Array, " time"],
    position_m: Float[Array, "time 3"],
) -> Float[Array, ""]:
    """Return how long a vehicle is within the fireball of any charge [s]."""
    if isinstance(load, CustomProfile):
        return jnp.full((), jnp.nan)

    def burns_about(charge: Charge) -> Bool[Array, " time"]:
        ball = jax.vmap(cloud, (None, None, 0))(scene, charge, time_s)
        away = jnp.sum(jnp.square(position_m - ball.centre), axis=-1)
        since = charge.since(time_s)
        life = fireball_duration(charge.tnt_mass("fireball_radius_m"))
        return (since > 0) & (since < life) & (away < jnp.square(ball.radius))

    unnamed = [replace(charge, name="") for charge in scene.charges]
    inside = jnp.stack(over_alike(burns_about, unnamed)).any(axis=0)
    return jnp.sum(jnp.where(inside[:-1], jnp.diff(time_s), 0.0))
