r"""The forward model: readings of a scene, row by row, and the errors that rows share.

Every comparison of a scene with data uses `record`. A reading is in the unit of its
quantity. Its errors are in that unit for `quantities.ADDITIVE` (times and directions),
in ln for all other quantities. The scatter of each row's law has three parts: one of
the row, one shared by the rows of a shot, and one shared along a path.

The jolt of the scene's vehicle is $\Delta v = \tfrac1m \int F\,dt$ over the whole wave.
The load $F$ is that of simulated flights (`vehicle.loads.blast`), on a vehicle that
hovers at the sensor's position in the scene's wind, tilted against it, with the scene's
heading. If a row states only a range, the charge is level with the vehicle.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.quantities import (
    ADDITIVE,
    ARRIVALS,
    BY_VEHICLE,
    CIRCULAR,
    CLOCK_TIMES,
    TIMES,
    components,
)
from jblast.registry import (
    Law,
    call,
    declared_scatter,
    law_for,
    mark_packaged,
    register,
)
from jblast.scene import Charge, Scene
from jblast.scene.charge import BURSTS, Burst
from jblast.sensors.layout import (
    Layout,
    check_laws,
    check_layout,
    check_scene,
    joined,
    opaque_constant,
    picked,
)
from jblast.sensors.path_scatter import embedded
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.paths import Path, path_between
from jblast.waves.propagation import ambient, sound_speed_of
from jblast.waves.scaling import scaled_distance

FAR_EFFECT = " far away"
"""Suffix of the effect that far rows of a shot share (`registry.Law.far_scatter`)."""


class Recording(eqx.Module):
    """Error-free reading of every row, and the scatter of the laws about nature.

    Attributes:
        value: Reading without error, in the unit of the row's quantity. For a charge
            that never detonates, a clock time is infinite, a size is zero, a direction
            or a difference of arrivals is NaN.
        slant_range: Distance from the charge [m].
        valid: True if the row's laws hold there; also for a charge that never
            detonates.
        record_sd: Law scatter of this row alone; seconds for times, else ln.
        shot_loading: By quantity (and charge, if several): contribution to each row of
            one standard deviation of the effect shared by the whole shot, same unit.
            Under the name with `FAR_EFFECT`: that of the effect shared by far rows.
        path_loading: Likewise for the effect shared by the rows of one path.
        arrival_sd: Part of `record_sd` that is due to the travel time of each path: the
            scatter of arrivals, by quantity (and charge), same unit.
        place: Log-polar coordinates of each path (`path_scatter.embedded`).
        placed: True if the direction of each path is given.
        fields: Name, quantity and charge of each entry of `path_loading` and
            `arrival_sd`, whose scatter is correlated between neighbouring paths.
    """

    value: Float[Array, " row"]
    slant_range: Float[Array, " row"]
    valid: Bool[Array, " row"]
    record_sd: Float[Array, " row"]
    shot_loading: dict[str, Float[Array, " row"]]
    path_loading: dict[str, Float[Array, " row"]]
    arrival_sd: dict[str, Float[Array, " row"]]
    place: Float[Array, "row 4"]
    placed: Bool[Array, " row"]
    fields: tuple[tuple[str, str, int], ...] = eqx.field(static=True)


def to_error_scale(
    value: Float[ArrayLike, " row"], quantity: Sequence[str]
) -> Float[Array, " row"]:
    """Return readings on their error scale: ln, unless `ADDITIVE`."""
    plain = np.isin(quantity, ADDITIVE)
    if plain.all():
        return jnp.asarray(value)
    plain = opaque_constant(plain)
    # the inner `where` keeps ln of a negative time, and its NaN slope, out of the graph
    return jnp.where(plain, value, jnp.log(jnp.where(plain, 1.0, value)))


def residuals_of(
    measured: Float[ArrayLike, " row"],
    predicted: Float[ArrayLike, " row"],
    quantity: Sequence[str],
) -> Float[Array, " row"]:
    """Return measured minus predicted on the error scale; bearings are wrapped."""
    residual = jnp.asarray(measured) - jnp.asarray(predicted)
    circular = np.isin(quantity, CIRCULAR)
    if not circular.any():
        return residual
    # 359 and 1 degrees differ by 2, not by 358
    short = jnp.mod(residual + math.pi, 2 * math.pi) - math.pi
    return jnp.where(opaque_constant(circular), short, residual)


@kept
def path_to(scene: Scene, layout: Layout, charge: Charge | None = None) -> Path:
    """Return the path from a charge (default: the first) to the sensor of each row."""
    charge = charge or scene.charge
    detonation = charge.as_if_at_zero().time_s
    since = layout.time - clock_offsets(scene, layout) - detonation
    path = path_between(scene, charge, layout.position, layout.slant_range, since)
    # settled beforehand, so that a search does not switch curve sets
    if charge.burst is None and layout.free_air:
        path = replace(path, free_air=jnp.asarray(layout.free_air))
    return with_jolts(path, scene, charge, layout.quantity)


def clock_offsets(scene: Scene, layout: Layout) -> Float[Array, " row"]:
    """Return the offset of each row's clock from the common clock [s]."""
    offsets_by_name = scene.clock_offsets()
    if not offsets_by_name:
        return jnp.zeros(len(layout.clock))
    place = {name: i for i, name in enumerate(offsets_by_name, start=1)}
    offsets = jnp.stack([jnp.zeros(()), *offsets_by_name.values()])
    # 0 is the common clock, for names without an offset
    of_row = np.array([place.get(name, 0) for name in layout.clock])
    return offsets[opaque_constant(of_row)]


def record(scene: Scene, layout: Layout, laws: Mapping[str, str]) -> Recording:
    """Return the readings of a scene for each row of a layout.

    Args:
        scene: Charges, air, ground and sensors. Its `scatter` states whether law
            scatter is included.
        layout: Rows of a log.
        laws: Name of the law for each of `layout.quantities()`.

    Returns:
        Values, scatter and validity of each row, without instrument errors;
        differentiable in all numbers of the scene.

    Raises:
        ValueError: A name in `laws` is no law of its quantity.
        InputError: A number of the scene or a column of the layout has a batch axis, or
            a quantity has no law.

    Example:
        `layout, sigma, names = jblast.sensors.planned_layout(scene)` gives the rows,
        `jblast.record(scene, layout, {"air_arrival_s": "kingery_bulmash"}).value` their
        readings.
    """
    check_scene(scene)
    check_layout(layout)
    check_laws(laws, layout)
    n = len(layout.quantity)
    offsets = clock_offsets(scene, layout)
    is_clock_time = np.isin(layout.quantity, CLOCK_TIMES)
    shots = np.array(layout.shot)
    value, valid, distance = jnp.zeros(n), jnp.ones(n, bool), jnp.zeros(n)
    record_variance = jnp.zeros(n)
    of_shots: dict[str, Array] = {}
    of_paths: dict[str, Array] = {}
    of_arrivals: dict[str, Array] = {}
    fields: list[tuple[str, str, int]] = []
    place, placed = jnp.zeros((n, 4)), jnp.zeros(n, bool)
    for shot, charge in enumerate(scene.charges):
        # finite times for the laws: those of no detonation are put in at the end
        never, charge = charge.never, charge.as_if_at_zero()
        path = path_to(scene, layout, charge)
        here = shots == shot
        distance = jnp.where(opaque_constant(here), path.slant_range, distance)
        toward = (path.toward_east, path.toward_north, path.toward_up)
        there, known = embedded(jnp.stack(toward, axis=1), path.slant_range)
        place = jnp.where(opaque_constant(here)[:, None], there, place)
        placed = jnp.where(opaque_constant(here), known, placed)
        # the origin time is added once; laws contribute travel times
        starts = opaque_constant(here & is_clock_time)
        value = jnp.where(starts, charge.time_s + offsets, value)
        values, holds, variances = [], [], []
        for quantity in layout.quantities():
            rows, sign = layout.rows(quantity, shot)
            if not rows.size:
                continue
            law = law_for(quantity, laws[quantity])
            row_path = replace(
                _rows_of(path, rows), charge_mass=charge.tnt_mass(quantity)
            )
            given = jnp.broadcast_to(call(law.function, row_path), rows.shape)
            # light within a site takes microseconds, below the clocks of most logs
            if quantity == "flash_time_s" and scene.instant_light:
                given = jnp.zeros_like(given)
            if not (sign == 1).all():  # only differences of arrivals have sign -1
                sign = opaque_constant(sign)
                signed = sign * given
            else:
                sign, signed = 1.0, given
            values.append((rows, signed))
            holds.append(
                (rows, jnp.broadcast_to(call(law.valid, row_path), rows.shape))
            )
            unit = given if quantity in TIMES else jnp.ones_like(given)
            sds = call(law.scatter, row_path) if scene.scatter else (0.0, 0.0, 0.0)
            far = (0.0, 0.0)
            if scene.scatter and law.far_scatter is not None:
                far = call(law.far_scatter, row_path)
            of_shot, of_path, of_record, of_weather, of_far_record = (
                jnp.where(never, 0.0, sd * unit * sign) for sd in (*sds, *far)
            )
            name = quantity + scene.label(charge)
            if not _is_zero(sds[0]):
                of_shots[name] = joined([(rows, of_shot)], n)
            if not _is_zero(sds[1]):
                of_paths[name] = joined([(rows, of_path)], n)
            if not _is_zero(far[0]):
                of_shots[name + FAR_EFFECT] = joined([(rows, of_weather)], n)
            if quantity in ARRIVALS and not _is_zero(sds[2]):
                of_arrivals[name] = joined([(rows, of_record)], n)
            if name in of_paths or name in of_arrivals:
                fields.append((name, quantity, shot))
            variances.append((rows, of_record**2 + of_far_record**2))
        if values:
            value = value + joined(values, n)
            valid = valid & joined(holds, n)
            record_variance = record_variance + joined(variances, n)
        lost = opaque_constant(here) & never
        sizeless = np.where(np.isin(layout.quantity, ADDITIVE), np.nan, 0.0)
        # no detonation: sizes are zero, clock times infinite, directions undefined
        absent = np.where(np.isin(layout.quantity, CLOCK_TIMES), np.inf, sizeless)
        value = jnp.where(lost, opaque_constant(absent), value)
        # nothing to predict, so nothing to flag
        valid = valid | lost
    # negated: a NaN variance is not zero and has to stay NaN
    some = ~(record_variance <= 0)
    record_sd = jnp.where(some, jnp.sqrt(jnp.where(some, record_variance, 1.0)), 0.0)
    return Recording(
        value,
        distance,
        valid,
        record_sd,
        of_shots,
        of_paths,
        of_arrivals,
        place,
        placed,
        tuple(fields),
    )


def _is_zero(sd: object) -> bool:
    """Return True for a plain 0.0: this scatter is absent and needs no effect."""
    return isinstance(sd, int | float) and sd == 0


def path_effects(
    scene: Scene, layout: Layout, laws: Mapping[str, str]
) -> frozenset[tuple[str, int]]:
    """Return quantity and charge index of each effect that differs between paths.

    Args:
        scene: Its `scatter` states whether law scatter is included.
        layout: Rows of a log.
        laws: Name of the law for each of `layout.quantities()`.
    """
    if not scene.scatter:
        return frozenset()
    # one row per quantity and charge suffices: a law scatters alike in all of them
    first: dict[tuple[str, int], int] = {}
    for row, key in enumerate(zip(layout.quantity, layout.shot, strict=True)):
        first.setdefault(key, row)
    found = set()
    for (quantity, shot), row in first.items():
        for name, _ in components(quantity):
            of_path = _path_scatter(law_for(name, laws[name]), scene, layout, row)
            if not _is_zero(of_path):
                found.add((name, shot))
    return frozenset(found)


def _rows_of(path: Path, rows: np.ndarray) -> Path:
    """Return the path at some rows; fields shared by all rows stay scalars."""
    return jax.tree.map(lambda x: picked(x, rows) if x.ndim else x, path)


def _path_scatter(law: Law, scene: Scene, layout: Layout, row: int):
    """Return a law's scatter between paths: its shape, or a plain number."""

    def scatter():
        charge = scene.charges[layout.shot[row]]
        path = path_to(scene, layout.only(np.array([row])), charge)
        return call(law.scatter, path)[1]

    return eqx.filter_eval_shape(scatter)


def count_effects(scene: Scene, layout: Layout, laws: Mapping[str, str]) -> int:
    """Return the maximum number of effects that rows share.

    One for each quantity and charge, one more where the law has a far scatter, and one
    for each path in `path_effects`.
    """
    if not scene.scatter:
        return 0
    kinds = {
        (name, shot)
        for quantity, shot in set(zip(layout.quantity, layout.shot, strict=True))
        for name, _ in components(quantity)
    }
    far = sum(law_for(name, laws[name]).far_scatter is not None for name, _ in kinds)
    paths = len(set(layout.group))
    return len(kinds) + far + paths * len(path_effects(scene, layout, laws))


def with_jolts(
    path: Path, scene: Scene, charge: Charge, quantity: Sequence[str]
) -> Path:
    """Return the path with the jolt at each row that needs one; NaN elsewhere.

    Args:
        path: From a charge to every row.
        scene: Its vehicle and air are used.
        charge: Origin of the path.
        quantity: Of each row.

    Raises:
        InputError: A row needs a jolt, and the scene has no vehicle.
    """
    rows = np.flatnonzero(np.isin(quantity, BY_VEHICLE))
    if not rows.size:
        return path
    if scene.vehicle is None:
        raise InputError(
            f"{quantity[rows[0]]}: expected a [vehicle] in the scene, whose velocity "
            "changes; got none"
        )
    spec = scene.vehicle

    def jolts(row_path: Path) -> Float[Array, "row 3"]:
        toward = jnp.stack(
            [row_path.toward_east, row_path.toward_north, row_path.toward_up], axis=-1
        )
        # a range without direction: the vehicle is placed east of the charge, at its
        # height
        range_alone = ~jnp.any(toward != 0, axis=-1)
        east = jnp.zeros_like(toward).at[:, 0].set(row_path.slant_range)
        place = jnp.where(range_alone[:, None], east, -toward)[rows]
        return jax.vmap(
            lambda at: _jolt(
                at, scene, charge, spec.model, spec.yaw, row_path.one_burst()
            )
        )(place)

    if path.burst is not None:
        found = jolts(path)
    else:
        # both sets are evaluated, as the height decides row by row
        surface, in_free_air = (jolts(path.at_burst(burst)) for burst in BURSTS)
        high = False if path.free_air is None else path.free_air[rows][:, None]
        found = jnp.where(high, in_free_air, surface)
    blank = jnp.full(len(quantity), jnp.nan)
    east, north, up = (blank.at[rows].set(column) for column in found.T)
    return replace(path, jolt_east=east, jolt_north=north, jolt_up=up)


def _jolt(
    place: Float[Array, "3"],
    scene: Scene,
    charge: Charge,
    model: str,
    yaw: Float[Array, ""],
    burst: Burst,
) -> Float[Array, "3"]:
    """Return the jolt of a vehicle at a position relative to the charge, shape (3,)."""
    # imported here: most logs have no jolts, and the vehicle is slow to import
    from jblast.vehicle import named
    from jblast.vehicle.control.allocation import hover_in_wind
    from jblast.vehicle.loads.blast import jolt_velocity
    from jblast.vehicle.loads.blast_wave import Blast, Surroundings

    blast = Blast(
        position_m=jnp.zeros(3),
        time_s=jnp.zeros(()),
        mass_kg=charge.tnt_mass("peak_overpressure_pa"),
        impulse_mass_kg=charge.tnt_mass("positive_impulse_pa_s"),
        burst=burst,
    )
    air = scene.air
    wind = jnp.stack([air.wind_east, air.wind_north, 0 * air.wind_east])
    around = Surroundings(ambient(air)[1], sound_speed_of(air), wind)
    # the model is a constant: evaluated at once, not traced into the program
    with jax.ensure_compile_time_eval():
        vehicle = named(model)
    state = hover_in_wind(vehicle, place, yaw, wind)
    return jolt_velocity(blast, around, vehicle, state)


def jolt_speed(
    jolt_east: Float[ArrayLike, "..."],
    jolt_north: Float[ArrayLike, "..."],
    jolt_up: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    """Return the magnitude of a jolt [m/s].

    Args:
        jolt_east: Change of velocity [m/s].
        jolt_north: Likewise [m/s].
        jolt_up: Likewise [m/s].
    """
    return _length(*as_float_arrays(jolt_east, jolt_north, jolt_up))


def jolt_bearing(
    jolt_east: Float[ArrayLike, "..."], jolt_north: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    r"""Return the direction of a jolt, clockwise from north [rad], 0 to $2\pi$.

    A vertical jolt has no bearing: zero is returned, with zero slope.

    Args:
        jolt_east: Change of velocity [m/s].
        jolt_north: Likewise [m/s].
    """
    east, north = as_float_arrays(jolt_east, jolt_north)
    # atan2(0, 0) has a NaN gradient
    aside = (east != 0) | (north != 0)
    angle = jnp.arctan2(jnp.where(aside, east, 0.0), jnp.where(aside, north, 1.0))
    return jnp.mod(angle, 2 * math.pi)


def jolt_elevation(
    jolt_east: Float[ArrayLike, "..."],
    jolt_north: Float[ArrayLike, "..."],
    jolt_up: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    """Return the elevation of a jolt [rad]: rotors lift in a blast wind.

    Args:
        jolt_east: Change of velocity [m/s].
        jolt_north: Likewise [m/s].
        jolt_up: Likewise [m/s].
    """
    east, north, up = as_float_arrays(jolt_east, jolt_north, jolt_up)
    level = _length(east, north)
    moved = (level > 0) | (up != 0)
    return jnp.arctan2(jnp.where(moved, up, 0.0), jnp.where(moved, level, 1.0))


def jolt_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."],
    burst: Burst,
) -> Bool[Array, "..."]:
    """Return True where all laws of the load hold."""
    from jblast.vehicle.loads.blast_wave import RANGE

    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    first, last = RANGE[burst]
    return (z >= first) & (z <= last)


def _length(*parts: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the length of a vector, with zero slope (not NaN) at zero length."""
    square = as_float_array(sum(part * part for part in parts))
    some = ~(square <= 0)  # negated: NaN stays NaN
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)


SCATTER = {
    "jolt_velocity_m_s": (jolt_speed, 0.15, 0.15),
    "jolt_bearing_rad": (jolt_bearing, 0.0, 0.02),
    "jolt_elevation_rad": (jolt_elevation, 0.05, 0.02),
}
"""Function of each law, and its scatter of a shot and of a record. It has not been
measured. An impulse scatters about as pressure times impulse of the air, 10 % each per
shot and per record. The lift of rotors in a blast wind, which determines the
elevation, is extrapolated far beyond the fit of its coefficient."""
mark_packaged(
    *(
        register(
            Law(
                quantity=quantity,
                name="blast_load",
                function=function,
                range="Z = 0.178 to 40 m/kg^(1/3); in free air 0.147 to 37",
                source="the load that flights go through, on a vehicle that hovers",
                valid=jolt_valid,
                scatter=declared_scatter(shot=of_shot, record=of_record),
                scatter_source="declared",
            )
        )
        for quantity, (function, of_shot, of_record) in SCATTER.items()
    )
)
