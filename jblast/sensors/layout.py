"""Rows of a log before anything is recorded: sensor, charge and quantity of each.

A layout comes from a log (`layout_of`) or from the sensors of a scene
(`planned_layout`). The checks compare the shapes of its arrays and of the scene's
with those of one scene and one log; an unmapped batch is rejected.

Laws are evaluated for some of the rows. On a CPU, gather and scatter go row by row, at
several times the cost of a law. Evenly spaced rows are therefore sliced and
concatenated, which XLA fuses with the operations around them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jblast.errors import require
from jblast.observations import Observations
from jblast.observations.placement import camera_place
from jblast.quantities import BY_CAMERA, DIRECTIONS, PLACELESS, TIMED, components
from jblast.scene import Charge, Scene, Sensor, parameter_named
from jblast.scene.uncertain import names_in, value_of

VMAP = "; for a batch of scenes use jax.vmap"
CONSTANT_ROWS = 1000
"""Known arrays with more rows are not passed to XLA as constants: folding them at
compile time is slow. Shorter ones stay constants, so that slices of them fold away."""


class Layout(eqx.Module):
    """Rows of a log: quantity, position, time and clock of each.

    Attributes:
        quantity: Quantity of each row.
        position: East, north, up [m]; not used if `slant_range` is finite.
        slant_range: Distance from the charge [m]; NaN if it follows from positions.
        time: Clock time of the row [s]; NaN except for `quantities.TIMED`.
        group: Rows with the same number share the effects of their path.
        shot: Index of each row's charge in the scene.
        clock: Name of the clock of each row; a clock that is not in the scene has no
            offset.
    """

    quantity: tuple[str, ...] = eqx.field(static=True)
    position: Float[Array, "row 3"]
    slant_range: Float[Array, " row"]
    time: Float[Array, " row"]
    group: tuple[int, ...] = eqx.field(static=True)
    shot: tuple[int, ...] = eqx.field(static=True)
    clock: tuple[str, ...] = eqx.field(static=True)

    def quantities(self) -> tuple[str, ...]:
        """Return the quantities that need a law, each once."""
        return tuple(
            dict.fromkeys(name for q in self.quantity for name, _ in components(q))
        )

    def beside(self, more: "Layout") -> "Layout":
        """Return these rows followed by those of another layout."""
        both: Any = zip(self._columns(), more._columns(), strict=True)
        columns: list[Any] = [
            a + b if isinstance(a, tuple) else jnp.concatenate([a, b]) for a, b in both
        ]
        return Layout(*columns)

    def only(self, rows: Int[np.ndarray, " kept"]) -> "Layout":
        """Return some of the rows."""
        return Layout(*(_column_rows(column, rows) for column in self._columns()))

    def _columns(self) -> tuple[Any, ...]:
        return tuple(getattr(self, one.name) for one in fields(self))

    def rows(self, quantity: str, shot: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows and signs with which a quantity of a charge enters."""
        signs = {
            q: sign
            for q in dict.fromkeys(self.quantity)
            for name, sign in components(q)
            if name == quantity
        }
        # 0 marks rows in which the quantity has no part
        given = np.array([signs.get(q, 0.0) for q in self.quantity])
        rows = np.flatnonzero((given != 0) & (np.array(self.shot) == shot))
        return rows, given[rows]

    def places(self) -> Float[np.ndarray, "place 3"]:
        """Return the distinct positions of sensors without a given range."""
        placed = ~(np.asarray(self.slant_range) > 0)
        return np.unique(np.asarray(self.position)[placed], axis=0)


def _column_rows(column: Any, rows: Int[np.ndarray, " kept"]) -> Any:
    """Return rows of a column; by NumPy if it is concrete, so that nothing compiles."""
    if isinstance(column, tuple):
        return tuple(column[row] for row in rows if column)
    # a gather in the program; concrete columns are indexed by NumPy instead
    if isinstance(column, Tracer):
        return column[rows]
    return jax.device_put(np.asarray(column)[rows])


def layout_of(observations: Observations, scene: Scene) -> Layout:
    """Return the rows of a log whose positions are known (see `resolve_positions`)."""
    shots = [charge.name for charge in scene.charges]
    # a scene with one charge accepts any shot name
    shot = tuple(
        shots.index(s) if len(scene.charges) > 1 else 0 for s in observations.shot
    )
    # paths from different charges are different, even to one sensor
    ways = list(zip(shot, observations.groups(), strict=True))
    groups = {way: i for i, way in enumerate(dict.fromkeys(ways))}
    return Layout(
        quantity=observations.quantity,
        position=jax.device_put(np.nan_to_num(observations.position)),
        slant_range=jax.device_put(observations.slant_range),
        time=jax.device_put(observations.time),
        group=tuple(groups[way] for way in ways),
        shot=shot,
        clock=observations.clocks(),
    )


def planned_layout(scene: Scene) -> tuple[Layout, Float[Array, " row"], Sequence[str]]:
    """Return the rows that a scene's sensors record, for each charge that detonates.

    Returns:
        The layout, the sigma of each row (in its unit for `ADDITIVE`, else relative),
        and the sensor's name of each row. A timed quantity has one row for each of the
        sensor's times.

    Raises:
        InputError: No sensor records anything, or a sensor cannot record its quantity.
    """
    plan = [
        (shot, i, sensor, quantity, sigma, time)
        for shot, charge in enumerate(scene.charges)
        if not charge.never
        for i, sensor in enumerate(scene.sensors)
        for quantity, sigma in sensor.records
        for time in _times(charge, sensor, quantity)
    ]
    never = all(bool(charge.never) for charge in scene.charges)
    require(
        plan,
        "no sensor records anything",
        "at least one [[sensor]] with records = { QUANTITY = SIGMA }",
        "charges that never happen" if never else "",
    )
    layout = Layout(
        quantity=tuple(quantity for *_, quantity, _, _ in plan),
        position=jnp.stack(
            [_position(scene, shot, s, quantity) for shot, _, s, quantity, *_ in plan]
        ),
        slant_range=jnp.full(len(plan), jnp.nan),
        time=jnp.asarray([time for *_, time in plan]),
        group=tuple(shot * len(scene.sensors) + i for shot, i, *_ in plan),
        shot=tuple(shot for shot, *_ in plan),
        clock=tuple(sensor.name for _, _, sensor, *_ in plan),
    )
    sigma = jnp.asarray([sigma for *_, sigma, _ in plan])
    return layout, sigma, [sensor.name for _, _, sensor, *_ in plan]


def _times(charge: Charge, sensor: Sensor, quantity: str) -> tuple[float, ...]:
    """Return the clock times at which a sensor records a quantity; NaN if untimed."""
    if quantity not in TIMED:
        return (math.nan,)
    where = f"sensor {sensor.name!r} records {quantity}"
    require(sensor.times_s, where, "times_s = [...] in its [[sensor]]", "none")
    start, first = float(charge.time_s + sensor.clock_offset_s), sensor.times_s[0]
    after = f"times_s after the origin time, {start:g} s on its clock"
    require(first > start, where, after, f"{first:g}")
    return sensor.times_s


def _position(scene: Scene, shot: int, sensor: Sensor, quantity: str) -> Array:
    """Return the position of a sensor, or of the camera for a fireball in an image."""
    is_placed = bool(np.isfinite(sensor.position_m).all())
    if quantity in BY_CAMERA:
        label = f"sensor {sensor.name!r}"
        return jnp.asarray(camera_place(scene, sensor.position_m, label))
    where = f"sensor {sensor.name!r} records {quantity}"
    if scene.charges[shot].range_m is not None:
        has_direction = quantity not in DIRECTIONS
        lacks = "range_m, which has no direction"
        require(has_direction, where, "[charge] position_m", lacks)
    elif quantity not in PLACELESS:
        place = (
            f"a flight of the {sensor.mount} that carries it (jblast world)"
            if sensor.mount
            else "position_m = [east, north, up] in its [[sensor]]"
        )
        require(is_placed, where, place, "none")
    return sensor.position_m if is_placed else jnp.zeros(3)


def check_scene(scene: Scene) -> None:
    """Reject a scene with arrays in place of numbers: an unmapped batch.

    Raises:
        InputError: A number has a shape; the message states its name and both shapes.
    """
    for name in names_in(scene):
        value = value_of(scene, name)
        if value is not None:
            label = name.partition(".")[2]
            of = f" of {label}" if label else ""
            _check(f"scene.{parameter_named(name).attribute}{of}", value, ())
    for sensor in scene.sensors:
        _check(f"sensor {sensor.name}: position_m", sensor.position_m, (3,))


def check_rows(layout: Layout, laws: Mapping[str, str]) -> None:
    """Reject a layout whose columns differ in length, and laws that omit a quantity.

    Raises:
        InputError: A column has another shape than its quantities require, or a
            quantity has no law.
    """
    n = len(layout.quantity)
    _check("layout.position", layout.position, (n, 3))
    for name in ("slant_range", "time"):
        _check(f"layout.{name}", getattr(layout, name), (n,))
    for name in ("group", "shot", "clock"):
        length = len(getattr(layout, name))
        require(length == n, f"layout.{name}", f"{n} entries", length)
    needed = layout.quantities()
    for quantity in needed:
        names = f"a name for each of {', '.join(needed)}"
        require(quantity in laws, "laws", names, f"none for {quantity}")


def _check(name: str, value: Any, expected: tuple[int, ...]) -> None:
    shape = np.shape(value)
    require(shape == expected, name, f"shape {expected}", f"{shape}{VMAP}")


def opaque_constant(rows: np.ndarray) -> np.ndarray | Array:
    """Hide a long constant from XLA's constant folding (`CONSTANT_ROWS`)."""
    return (
        lax.optimization_barrier(jnp.asarray(rows))
        if rows.size > CONSTANT_ROWS
        else rows
    )


def picked(x: Array, rows: Int[np.ndarray, " some"]) -> Array:
    """Return some rows of an array; evenly spaced ones are a slice."""
    steps = np.unique(np.diff(rows))
    if rows.size == 1 or (steps.size == 1 and steps[0] > 0):
        return x[int(rows[0]) : int(rows[-1]) + 1 : int(steps.sum()) or 1]
    return x[opaque_constant(rows)]


def joined(
    parts: Sequence[tuple[Int[np.ndarray, " _"], Array]], count: int
) -> Float[Array, "row ..."]:
    """Return the sums of parts over all rows, 0 for rows that no part has.

    Args:
        parts: Rows (each once per part) and their values, or columns of them.
        count: Number of all rows.
    """
    rows = np.concatenate([np.zeros(0, int), *(own for own, _ in parts)])
    if not np.array_equal(np.sort(rows), np.arange(count)):
        columns = parts[0][1].shape[1:] if parts else ()
        whole = jnp.zeros((count, *columns))
        for own, x in parts:
            whole = whole.at[opaque_constant(own)].add(x)
        return whole
    # parts interleaved row by row, the usual order of a log: a stack, not a gather
    turns = [np.arange(n, count, len(parts)) for n in range(len(parts))]
    if count % len(parts) == 0 and np.array_equal(rows, np.concatenate(turns)):
        whole = jnp.stack([x for _, x in parts], axis=1)
        return whole.reshape(count, *whole.shape[2:])
    # every row in exactly one part: a permutation of the concatenated parts
    return picked(jnp.concatenate([x for _, x in parts]), np.argsort(rows))
