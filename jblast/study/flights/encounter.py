"""Where and when the blasts of a scene come to a flight."""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Scene
from jblast.vehicle import BlastLoad, CustomProfile, blast_load, vehicle_of
from jblast.vehicle.loads.impulse_table.table import custom_profile
from jblast.waves.paths import slant_range
from jblast.waves.scaling import scaled_distance

FlightLoad = BlastLoad | CustomProfile


class Profile(NamedTuple):
    """A custom profile, which takes the place of the laws.

    Attributes:
        cases: As `vehicle.read_custom_profile` returns them.
        moment_point_m: From the point its moments are about to the centre of mass;
            None: they are about that.
    """

    cases: Float[np.ndarray, "case 10"]
    moment_point_m: Sequence[float] | None = None


class Encounter(NamedTuple):
    """Blasts as they come to a vehicle; one in each place of the last axis.

    Attributes:
        arrival_s: On the scene's clock; infinite: it never happens.
        distance_m: From the charge to the vehicle then.
        scaled_distance: Sachs's [m/kg^(1/3)]; NaN by a custom profile.
        overpressure_pa: At its peak, incident; NaN by a custom profile.
        in_range: Whether the load is known there.
    """

    arrival_s: Float[Array, "*batch blast"]
    distance_m: Float[Array, "*batch blast"]
    scaled_distance: Float[Array, "*batch blast"]
    overpressure_pa: Float[Array, "*batch blast"]
    in_range: Bool[Array, "*batch blast"]


def load_of(scene: Scene, profile: Profile | None) -> FlightLoad:
    """Return the load of a scene's blasts, or of a profile in place of its one charge.

    Raises:
        InputError: As in `vehicle.blast_load` and `vehicle.custom_profile`.
    """
    if profile is None:
        return blast_load(scene)
    charge = scene.charge
    load = custom_profile(
        profile.cases,
        (0.0, 0.0, 0.0),
        moment_point_m=profile.moment_point_m,
        vehicle=None if scene.vehicle is None else vehicle_of(scene.vehicle),
    )
    place = jnp.stack(charge.position_m)
    return eqx.tree_at(
        lambda p: (p.charge_m, p.time_s), load, (place, charge.time_s + 0 * load.time_s)
    )


def encounter_at(
    load: FlightLoad, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
) -> Encounter:
    """Return how the blasts come to a place."""
    if isinstance(load, CustomProfile):
        delay = load.impulse_at(position_m, quaternion)[2]
        never = jnp.isposinf(load.time_s)
        distance = slant_range(load.charge_m, position_m)
        unknown = jnp.full((1,), jnp.nan)
        return Encounter(
            (load.time_s + delay)[None],
            distance[None],
            unknown,
            unknown,
            (load.in_range(position_m, quaternion) | never)[None],
        )
    distances = jnp.stack(
        [slant_range(blast.position_m, position_m) for blast in load.blasts]
    )
    # a vehicle on the charge itself has a scaled distance too
    scaled = [
        scaled_distance(jnp.maximum(distance, 1e-9), blast.mass_kg, load.pressure_pa)
        for distance, blast in zip(distances, load.blasts, strict=True)
    ]
    peaks = [load.wave(n, position_m).peak for n in range(len(load.blasts))]
    return Encounter(
        load.arrival_time_s(position_m),
        distances,
        jnp.stack(scaled),
        jnp.stack(peaks) * load.pressure_pa,
        # of one that never happens it is known that there is none
        load.in_range(position_m) | jnp.stack([b.never for b in load.blasts]),
    )


def encounter_of(
    load: FlightLoad,
    time_s: Float[Array, " time"],
    position_m: Float[Array, "time 3"],
    quaternion: Float[Array, "time 4"],
) -> Encounter:
    """Return how the blasts come to a flight: to its last row before each.

    A blast after the end of the flight is evaluated at its last row.
    """
    rows = jax.vmap(encounter_at, (None, 0, 0))(load, position_m, quaternion)
    ahead = jnp.cumprod(time_s[:, None] < rows.arrival_s, axis=0)
    last = jnp.maximum(jnp.sum(ahead, axis=0) - 1, 0)
    blasts = jnp.arange(last.size)
    return Encounter(*(values[last, blasts] for values in rows))
