"""The forward model: what sensors record of a scene, and how far laws are from truth.

Everything that compares a scene with data goes through `record`. A reading is in the
unit of its quantity; its errors are in that unit for `quantities.ADDITIVE` (times and
directions), in ln for all else.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.kept_programs import kept
from jblast.quantities import ADDITIVE, ARRIVALS, CIRCULAR, CLOCK_TIMES, TIMES
from jblast.registry import call, law_for
from jblast.scene import Charge, Scene
from jblast.sensors.even_rows import joined, opaque_constant, picked
from jblast.sensors.jolt import with_jolts
from jblast.sensors.layout import Layout
from jblast.sensors.path_scatter import embedded
from jblast.sensors.shapes import check_laws, check_layout, check_scene
from jblast.waves.paths import Path, path_between

FAR = " far away"
"""Marks the effect that the far rows of a shot share (`registry.Law.far_scatter`)."""


class Recording(eqx.Module):
    """What every row would read, and how the laws scatter about nature there.

    Attributes:
        value: The reading without error, in the unit of the row's quantity. Of a charge
            that never happens there is nothing: a time on a clock is infinite, what has
            a size is zero, a direction or a difference of arrivals NaN.
        slant_range: Distance from the charge [m].
        valid: Whether the row's laws hold there; so too where nothing happens.
        record_sd: Law scatter of this row alone; seconds for times, else ln.
        shot_loading: By quantity (and charge, if several), what one standard deviation
            of the effect shared by the whole shot adds to each row, same unit; under
            the name with `FAR`, that of the effect shared by its far rows.
        path_loading: Likewise for the effect shared by the rows of one path.
        arrival_sd: Of `record_sd`, what is of each path's travel time: the scatter of
            arrivals, by quantity (and charge), same unit.
        place: Log-polar coordinates of each path (`path_scatter.embedded`).
        placed: Whether the direction of each path is given.
        fields: Name, quantity and charge of each entry of `path_loading` and
            `arrival_sd`, whose scatter neighbouring paths share.
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
    """Return readings in the space their errors live in: ln, unless `ADDITIVE`."""
    plain = np.isin(quantity, ADDITIVE)
    if plain.all():
        return jnp.asarray(value)
    plain = opaque_constant(plain)
    return jnp.where(plain, value, jnp.log(jnp.where(plain, 1.0, value)))


def residuals_of(
    measured: Float[ArrayLike, " row"],
    predicted: Float[ArrayLike, " row"],
    quantity: Sequence[str],
) -> Float[Array, " row"]:
    """Return measured minus predicted on the error scale; of bearings the short way."""
    residual = jnp.asarray(measured) - jnp.asarray(predicted)
    circular = np.isin(quantity, CIRCULAR)
    if not circular.any():
        return residual
    short = jnp.mod(residual + math.pi, 2 * math.pi) - math.pi
    return jnp.where(opaque_constant(circular), short, residual)


@kept
def path_to(scene: Scene, layout: Layout, charge: Charge | None = None) -> Path:
    """Return what lies between a charge (the first) and the sensor of each row."""
    charge = charge or scene.charge
    detonation = charge.as_if_at_zero().time_s
    since = layout.time - clock_offsets(scene, layout) - detonation
    path = path_between(scene, charge, layout.position, layout.slant_range, since)
    if charge.burst is None and layout.free_air:
        path = replace(path, free_air=jnp.asarray(layout.free_air))
    return with_jolts(path, scene, charge, layout.quantity)


def clock_offsets(scene: Scene, layout: Layout) -> Float[Array, " row"]:
    """Return what each row's clock shows more than the common one [s]."""
    offsets_by_name = scene.clock_offsets()
    if not offsets_by_name:
        return jnp.zeros(len(layout.clock))
    place = {name: i for i, name in enumerate(offsets_by_name, start=1)}
    offsets = jnp.stack([jnp.zeros(()), *offsets_by_name.values()])
    of_row = np.array([place.get(name, 0) for name in layout.clock])
    return offsets[opaque_constant(of_row)]


def record(scene: Scene, layout: Layout, laws: Mapping[str, str]) -> Recording:
    """Return what each row of a layout would read of a scene.

    Args:
        scene: What is there. Its `scatter` says whether laws scatter about nature.
        layout: Rows of a log.
        laws: Name of the law for each of `layout.quantities()`.

    Returns:
        Values and scatter of each row, and where its law holds; differentiable in all
        numbers of the scene, without errors of instruments.

    Raises:
        ValueError: A name in `laws` is no law of its quantity.
        InputError: A number of the scene, or a column of the layout, has the shape of
            a batch, or a quantity has no law.

    Example:
        `layout, sigma, names = jblast.sensors.planned_layout(scene)` says who records
        what, `jblast.record(scene, layout, {"air_arrival_s": "kingery_bulmash"}).value`
        what is read.
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
        never, charge = charge.never, charge.as_if_at_zero()
        path = path_to(scene, layout, charge)
        here = shots == shot
        distance = jnp.where(opaque_constant(here), path.slant_range, distance)
        toward = (path.toward_east, path.toward_north, path.toward_up)
        there, known = embedded(jnp.stack(toward, axis=1), path.slant_range)
        place = jnp.where(opaque_constant(here)[:, None], there, place)
        placed = jnp.where(opaque_constant(here), known, placed)
        starts = opaque_constant(here & is_clock_time)
        value = jnp.where(starts, charge.time_s + offsets, value)
        values, holds, variances = [], [], []
        for quantity in layout.quantities():
            rows, sign = layout.rows(quantity, shot)
            if not rows.size:
                continue
            law = law_for(quantity, laws[quantity])
            way = replace(_rows_of(path, rows), charge_mass=charge.tnt_mass(quantity))
            given = jnp.broadcast_to(call(law.function, way), rows.shape)
            if quantity == "flash_time_s" and scene.instant_light:
                given = jnp.zeros_like(given)
            if not (sign == 1).all():
                sign = opaque_constant(sign)
                signed = sign * given
            else:
                sign, signed = 1.0, given
            values.append((rows, signed))
            holds.append((rows, jnp.broadcast_to(call(law.valid, way), rows.shape)))
            unit = given if quantity in TIMES else jnp.ones_like(given)
            sds = call(law.scatter, way) if scene.scatter else (0.0, 0.0, 0.0)
            far = (0.0, 0.0)
            if scene.scatter and law.far_scatter is not None:
                far = call(law.far_scatter, way)
            of_shot, of_path, of_record, of_weather, of_far_record = (
                jnp.where(never, 0.0, sd * unit * sign) for sd in (*sds, *far)
            )
            name = quantity + scene.label(charge)
            if not _is_zero(sds[0]):
                of_shots[name] = joined([(rows, of_shot)], n)
            if not _is_zero(sds[1]):
                of_paths[name] = joined([(rows, of_path)], n)
            if not _is_zero(far[0]):
                of_shots[name + FAR] = joined([(rows, of_weather)], n)
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
        value = jnp.where(lost, opaque_constant(_nothing(layout.quantity)), value)
        valid = valid | lost
    some = ~(record_variance <= 0)  # a scatter that is no number is not none
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


def _rows_of(path: Path, rows: np.ndarray) -> Path:
    """Pick the rows of every field that has rows; what all share stays a scalar."""
    return jax.tree.map(lambda x: picked(x, rows) if x.ndim else x, path)


def _nothing(quantity: Sequence[str]) -> np.ndarray:
    """Return what is read of a charge that never happens."""
    sizeless = np.where(np.isin(quantity, ADDITIVE), np.nan, 0.0)
    return np.where(np.isin(quantity, CLOCK_TIMES), np.inf, sizeless)


def _is_zero(sd: object) -> bool:
    """Whether a scatter is left out altogether (a plain 0.0), so needs no effect."""
    return isinstance(sd, int | float) and sd == 0
