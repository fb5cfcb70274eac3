r"""The forward model: readings of a scene, row by row, and the errors that rows share.

Every comparison of a scene with data uses `record`. A reading is in the unit of its
quantity. Its errors are in that unit for `quantities.ADDITIVE` (times and directions),
in ln for all other quantities. The scatter of each row's law has three parts: one of
the row, one shared by the rows of a shot, and one shared along a path.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.kept_programs import kept
from jblast.quantities import (
    ADDITIVE,
    ARRIVALS,
    BY_VEHICLE,
    CIRCULAR,
    CLOCK_TIMES,
    TIMES,
)
from jblast.registry import call, law_for
from jblast.scene import Charge, Scene
from jblast.sensors.jolt import jolts
from jblast.sensors.layout import (
    Layout,
    check_rows,
    check_scene,
    joined,
    opaque_constant,
    picked,
)
from jblast.sensors.path_scatter import embedded
from jblast.waves.paths import Path, path_between

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
    return path_between(scene, charge, layout.position, layout.slant_range, since)


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
    check_rows(layout, laws)
    n = len(layout.quantity)
    offsets, jolted = clock_offsets(scene, layout), np.isin(layout.quantity, BY_VEHICLE)
    value: list[Any] = []
    outside: list[Any] = []
    variance: list[Any] = []
    shot_loading, path_loading, arrival_sd = {}, {}, {}
    fields: list[tuple[str, str, int]] = []
    distance, place, placed = jnp.zeros(n), jnp.zeros((n, 4)), jnp.zeros(n, bool)
    origin, never = jnp.zeros(n), jnp.zeros(n, bool)
    for shot, charge in enumerate(scene.charges):
        of_shot = np.array(layout.shot) == shot
        here = opaque_constant(of_shot)
        never = jnp.where(here, charge.never, never)
        # finite times for the laws: those of no detonation are put in at the end
        charge = charge.as_if_at_zero()
        origin = jnp.where(here, charge.time_s, origin)
        path = path_to(scene, layout, charge)
        distance = jnp.where(here, path.slant_range, distance)
        toward = (path.toward_east, path.toward_north, path.toward_up)
        there, known = embedded(jnp.stack(toward, axis=1), path.slant_range)
        place = jnp.where(here[:, None], there, place)
        placed = jnp.where(here, known, placed)
        if (rows := np.flatnonzero(jolted & of_shot)).size:
            jolt = jolts(scene, charge, _rows_of(path, rows))
            east, north, up = jnp.zeros((n, 3)).at[rows].set(jolt).T
            path = replace(path, jolt_east=east, jolt_north=north, jolt_up=up)
        for quantity in layout.quantities():
            rows, sign = layout.rows(quantity, shot)
            if not rows.size:
                continue
            law, name = (
                law_for(quantity, laws[quantity]),
                quantity + scene.label(charge),
            )
            mass = charge.tnt_mass(quantity)
            row_path = replace(_rows_of(path, rows), charge_mass=mass)
            given = jnp.broadcast_to(call(law.function, row_path), rows.shape)
            # light within a site takes microseconds, below the clocks of most logs
            if quantity == "flash_time_s" and scene.instant_light:
                given = jnp.zeros_like(given)
            if not (sign == 1).all():  # only differences of arrivals have sign -1
                given = given * opaque_constant(sign)
            holds = jnp.broadcast_to(call(law.valid, row_path), rows.shape)
            scatter, far = (0.0, 0.0, 0.0), (0.0, 0.0)
            if scene.scatter:
                scatter = call(law.scatter, row_path)
                far = (
                    far if law.far_scatter is None else call(law.far_scatter, row_path)
                )
            unit = given if quantity in TIMES else jnp.ones_like(given)
            value.append((rows, given))
            outside.append((rows, jnp.where(holds, 0.0, 1.0)))
            variance.append((rows, (scatter[2] ** 2 + far[1] ** 2) * unit**2))
            of_arrival = scatter[2] if quantity in ARRIVALS else 0.0
            for table, key, sd in (
                (shot_loading, name, scatter[0]),
                (path_loading, name, scatter[1]),
                (arrival_sd, name, of_arrival),
                (shot_loading, name + FAR_EFFECT, far[0]),
            ):
                if not _is_zero(sd):
                    table[key] = joined([(rows, sd * unit)], n)
            if name in path_loading or name in arrival_sd:
                fields.append((name, quantity, shot))
    # the origin time is added once; laws contribute travel times
    is_clock_time = np.isin(layout.quantity, CLOCK_TIMES)
    starts = jnp.where(opaque_constant(is_clock_time), origin + offsets, 0.0)
    # no detonation: sizes are zero, clock times infinite, directions undefined
    sizeless = np.where(np.isin(layout.quantity, ADDITIVE), np.nan, 0.0)
    absent = opaque_constant(np.where(is_clock_time, np.inf, sizeless))
    total = jnp.where(never, 0.0, joined(variance, n))
    # negated: a NaN variance is not zero and has to stay NaN
    some = ~(total <= 0)
    shot_loading, path_loading, arrival_sd = (
        {name: jnp.where(never, 0.0, column) for name, column in table.items()}
        for table in (shot_loading, path_loading, arrival_sd)
    )
    return Recording(
        value=jnp.where(never, absent, starts + joined(value, n)),
        slant_range=distance,
        # nothing to predict, so nothing to flag
        valid=(joined(outside, n) == 0) | never,
        record_sd=jnp.where(some, jnp.sqrt(jnp.where(some, total, 1.0)), 0.0),
        shot_loading=shot_loading,
        path_loading=path_loading,
        arrival_sd=arrival_sd,
        place=place,
        placed=placed,
        fields=tuple(fields),
    )


def _is_zero(sd: object) -> bool:
    """Return True for a plain 0.0: this scatter is absent and needs no effect."""
    return isinstance(sd, int | float) and sd == 0


def effects_of(scene: Scene, layout: Layout, laws: Mapping[str, str]) -> Recording:
    """Return the shapes of a recording of one row for each quantity and charge.

    Which effects rows share follows from them: a law scatters alike in all its rows.

    Args:
        scene: Its `scatter` states whether law scatter is included.
        layout: Rows of a log.
        laws: Name of the law for each of `layout.quantities()`.
    """
    kinds = list(zip(layout.quantity, layout.shot, strict=True))
    first = np.array([kinds.index(kind) for kind in dict.fromkeys(kinds)])
    return eqx.filter_eval_shape(record, scene, layout.only(first), laws)


def _rows_of(path: Path, rows: np.ndarray) -> Path:
    """Return the path at some rows; fields shared by all rows stay scalars."""
    return jax.tree.map(lambda x: picked(x, rows) if x.ndim else x, path)
