"""Where and when the blasts of a scene come to a flight."""

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Scene
from jblast.vehicle import (
    BlastLoad,
    CodedLoad,
    CustomProfile,
    PrintedLoad,
    blast_load,
    coded_load,
    printed_load,
    vehicle_of,
)
from jblast.vehicle.loads.blast import over_alike
from jblast.vehicle.loads.blast_wave import Blast
from jblast.vehicle.loads.impulse_table import custom_profile
from jblast.waves.paths import slant_range
from jblast.waves.scaling import scaled_distance

ThesisLoad = PrintedLoad | CodedLoad
FlightLoad = BlastLoad | CustomProfile | ThesisLoad

LoadLaw = Literal["laws", "thesis-as-printed", "thesis-as-coded"]
LOADS: Mapping[LoadLaw, Callable[[Scene], FlightLoad]] = {
    "laws": blast_load,
    "thesis-as-printed": printed_load,
    "thesis-as-coded": coded_load,
}
"""By what the blasts push: jblast's own laws, or what the thesis makes of it."""


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
        overpressure_pa: At its peak, incident; NaN by all but jblast's own laws.
        in_range: Whether the load is known there.
    """

    arrival_s: Float[Array, "*batch blast"]
    distance_m: Float[Array, "*batch blast"]
    scaled_distance: Float[Array, "*batch blast"]
    overpressure_pa: Float[Array, "*batch blast"]
    in_range: Bool[Array, "*batch blast"]


def load_of(scene: Scene, profile: Profile | None, by: LoadLaw = "laws") -> FlightLoad:
    """Return the load of a scene's blasts, or of a profile in place of its one charge.

    Args:
        scene: What is there.
        profile: In place of the laws; None: by these.
        by: Which laws.

    Raises:
        InputError: As in `vehicle.blast_load` and `vehicle.custom_profile`.
    """
    if profile is None:
        return LOADS[by](scene)
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


def arrival_at(
    load: FlightLoad, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
) -> Float[Array, " blast"]:
    """Return when the blasts come to a place [s]; infinite: never."""
    if isinstance(load, CustomProfile):
        return (load.time_s + load.impulse_at(position_m, quaternion)[2])[None]
    return load.arrival_time_s(position_m)


def encounter_at(
    load: FlightLoad, position_m: Float[Array, "3"], quaternion: Float[Array, "4"]
) -> Encounter:
    """Return how the blasts come to a place."""
    if isinstance(load, CustomProfile):
        never = jnp.isposinf(load.time_s)
        distance = slant_range(load.charge_m, position_m)
        unknown = jnp.full((1,), jnp.nan)
        return Encounter(
            arrival_at(load, position_m, quaternion),
            distance[None],
            unknown,
            unknown,
            (load.in_range(position_m, quaternion) | never)[None],
        )

    if isinstance(load, ThesisLoad):
        blasts = load.blasts
        distance = blasts.distance_m(position_m)
        unknown = jnp.full_like(distance, jnp.nan)
        return Encounter(
            arrival_at(load, position_m, quaternion),
            distance,
            scaled_distance(distance, blasts.mass_kg),
            unknown,
            distance > 0,
        )

    def met(blast: Blast) -> tuple[Array, ...]:
        distance = slant_range(blast.position_m, position_m)
        # a vehicle on the charge itself has a scaled distance too
        positive = jnp.maximum(distance, 1e-9)
        scaled = scaled_distance(positive, blast.mass_kg, load.pressure_pa)
        return distance, scaled, load.wave_of(blast, position_m).peak, blast.never

    found = zip(*over_alike(met, load.blasts), strict=True)
    distances, scaled, peaks, never = map(jnp.stack, found)
    return Encounter(
        arrival_at(load, position_m, quaternion),
        distances,
        scaled,
        peaks * load.pressure_pa,
        # of one that never happens it is known that there is none
        load.in_range(position_m) | never,
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
