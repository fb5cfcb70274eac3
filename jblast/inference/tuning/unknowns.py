"""The numbers to tune, each in a coordinate of its own.

`TUNABLES` is the table of the numbers of sensors and media that a record can constrain,
with unit, bounds and step. The numbers of `PARAMETERS` (charge, air, ground, clocks)
are tuned as well, under the names that they have there. A number with two bounds has a
logistic coordinate, a free positive one its logarithm.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, argument, nearest
from jblast.parameters import (
    CLOCK_OFFSET,
    POSITIVE,
    Bounds,
    Key,
    Parameter,
    Spread,
)
from jblast.scene import (
    Ambient,
    Free,
    Instrument,
    Scene,
    UncertainScene,
    freed,
    parameter_named,
    value_of,
)
from jblast.scene.uncertain import Belief, names_in, with_values
from jblast.types import field

TIME_STEP = 1e-3
"""A large change of a time [s]: sound travels a third of a metre."""
SOUND, FRAMES, EVENTS = "sound", "frames", "events"
SIGHT = (FRAMES, EVENTS)


class Between(Belief):
    """A number with bounds and no other prior, flat in a logistic coordinate.

    Attributes:
        low: Lower bound.
        high: Upper bound.
        logarithmic: Use the logistic coordinate of the logarithm.
    """

    low: float = field(static=True)
    high: float = field(static=True)
    logarithmic: bool = field(static=True, default=False)

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        low, high = self.limits
        part = low + (high - low) * jax.nn.sigmoid(jnp.asarray(z))
        return jnp.exp(part) if self.logarithmic else part

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        low, high = self.limits
        part = jnp.log(value) if self.logarithmic else jnp.asarray(value)
        # a start at a bound would be at infinity, where the logistic has no slope
        part = jnp.clip((part - low) / (high - low), 1e-3, 1.0 - 1e-3)
        return jnp.log(part) - jnp.log1p(-part)

    def log_density(self, z):
        """Return zero: the density is improper."""
        return jnp.zeros_like(z)

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds, of the logarithm with `logarithmic`."""
        if self.logarithmic:
            return math.log(self.low), math.log(self.high)
        return self.low, self.high


class Unknown(eqx.Module):
    """A number to tune.

    Attributes:
        name: Name as for `--free`.
        belief: Coordinate and prior.
        step: A large change of its coordinate.
    """

    name: str = eqx.field(static=True)
    belief: Belief
    step: Float[Array, ""]

    @property
    def has_prior(self) -> bool:
        """True if it has a prior besides bounds."""
        return not isinstance(self.belief, Free | Between)


def unknowns_of(
    uncertain: UncertainScene, names: Sequence[str], kind: str, rate: float
) -> tuple[Scene, tuple[Unknown, ...]]:
    """Return the scene with the named numbers free, and all numbers to tune.

    Numbers that the scene leaves free or gives a prior are tuned as well.

    Args:
        uncertain: The scene.
        names: Names of `TUNABLES` or of `PARAMETERS`.
        kind: Kind of the record: "sound", "frames" or "events".
        rate: Sampling rate, which bounds corners of filters [Hz].

    Raises:
        InputError: There is no blast or nothing to tune; a name is unknown or repeated,
            or a record of this kind cannot identify it.
    """
    source, charges = uncertain.source or "scene", uncertain.scene.charges
    if all(bool(np.asarray(charge.never)) for charge in charges):
        raise InputError(
            f"{source}: [charge] time_s: expected a blast, got one that never happens"
        )
    if any(charge.range_m is not None for charge in charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, the source of sound and "
            "light, got a range only"
        )
    known = names_known(uncertain.scene, kind)
    for name in names:
        if kind not in IDENTIFIED_BY.get(name, (kind,)):
            raise InputError(
                f"{argument('freed')} {name}: expected a record of "
                f"{' or '.join(IDENTIFIED_BY[name])}, got {kind}; {kind} can identify "
                f"{', '.join(known)}"
            )
        if name not in known and not name.startswith(f"{CLOCK_OFFSET}."):
            raise InputError(
                f"{argument('freed')} {name}: expected one of {', '.join(known)}; got "
                f"{name!r}{nearest(name, known)}"
            )
        if list(names).count(name) > 1:
            raise InputError(
                f"{argument('freed')} {name}: expected each name once, got it twice"
            )
    uncertain = freed(uncertain, [name for name in names if name not in TUNABLES])
    beliefs = dict(uncertain.beliefs) | {
        name: Free(positive=TUNABLES[name].positive)
        for name in names
        if name in TUNABLES
    }
    if not beliefs:
        raise InputError(f"{source}: expected something to tune, got nothing free")
    return uncertain.scene, tuple(
        _unknown(name, belief, rate) for name, belief in beliefs.items()
    )


def _unknown(name: str, belief: Belief, rate: float) -> Unknown:
    """Return a number to tune; a free one with two bounds has a logistic coordinate."""
    row = row_named(name)
    ends = row.bounds.at_least, row.bounds.at_most
    if name in FILTER:
        # just below half the rate, where the bilinear transform is infinite
        belief = Between(1e-5 * rate, 0.499 * rate, logarithmic=True)
    elif isinstance(belief, Free) and np.isfinite(ends).all():
        belief = Between(*ends)
    own = {"layout": 1.0, "travel": TIME_STEP, "factor": math.log(2.0)}
    step = own.get(row.spread.of, row.spread.amount)
    if isinstance(belief, Between) and name in TUNABLES:
        low, high = belief.limits
        step *= 4.0 / (high - low)  # slope of the logistic in its middle
    elif not isinstance(belief, Free):
        step = 1.0
    return Unknown(name, belief, jnp.asarray(step))


def row_named(name: str) -> Parameter:
    """Return the row of a number of `TUNABLES` or of `PARAMETERS`."""
    return TUNABLES[name] if name in TUNABLES else parameter_named(name)


def names_known(scene: Scene, kind: str) -> tuple[str, ...]:
    """Return the names that can be tuned in a scene by a kind of record.

    A range without a position is excluded: it gives no path of sound or light.
    """
    own = [name for name, kinds in IDENTIFIED_BY.items() if kind in kinds]
    rest = [name for name in names_in(scene) if not name.startswith("charge_range_m")]
    return (*own, *rest)


def filled(scene: Scene, index: int, names: Sequence[str], loudness: float) -> Scene:
    """Return a scene with a value for every number to tune.

    Args:
        scene: The scene.
        index: Index of the sensor that recorded; -1 for a camera.
        names: Names of the numbers to tune.
        loudness: Start of a noise that the scene does not have [Pa].
    """
    # the number needs a place in the scene before it can be replaced
    if any(name.startswith("ambient_") for name in names) and scene.ambient is None:
        scene = replace(scene, ambient=Ambient(level=loudness))
    if index >= 0 and scene.sensors[index].instrument is None:
        sensors = list(scene.sensors)
        sensors[index] = replace(sensors[index], instrument=Instrument())
        scene = replace(scene, sensors=tuple(sensors))
    values = {}
    for name in names:
        held = tuned_value(scene, index, name)
        # a positive number starts above zero, which has no logarithm
        if name in TUNABLES and (
            held is None or (TUNABLES[name].positive and not float(held) > 0.0)
        ):
            start = TUNABLES[name].default
            if name == "low_pass_hz":
                instrument = scene.sensors[index].instrument or Instrument()
                # well below half the rate, where it would have no effect
                start = 0.2 * instrument.rate
            values[name] = loudness if math.isnan(start) else start
    return with_tuned(scene, index, values)


def tuned_value(scene: Scene, index: int, name: str) -> Float[Array, ""] | None:
    """Return a number of a scene by its name after `--free`."""
    if name not in TUNABLES:
        return value_of(scene, name)
    row = TUNABLES[name]
    leaf, at = _leaf(scene, index, row), row.key.index
    # both corners of a filter are leaves; the lists of a camera are arrays
    return leaf if leaf is None or at is None or name in FILTER else leaf[at]


def with_tuned(
    scene: Scene, index: int, values: Mapping[str, Float[Array, ""] | float]
) -> Scene:
    """Return a scene with replaced numbers of `TUNABLES` and `PARAMETERS`."""
    rest = {name: value for name, value in values.items() if name not in TUNABLES}
    scene = with_values(scene, rest) if rest else scene
    for name in values.keys() - rest.keys():
        row = TUNABLES[name]
        new = jnp.asarray(values[name], float)
        if row.key.index is not None and name not in FILTER:
            new = _leaf(scene, index, row).at[row.key.index].set(new)
        scene = eqx.tree_at(
            lambda s, row=row: _leaf(s, index, row),
            scene,
            new,
            # a leaf without a value is None, which is no leaf by default
            is_leaf=lambda leaf: leaf is None,
        )
    return scene


def _leaf(scene: Any, index: int, row: Parameter) -> Any:
    """Return the leaf of a scene with a number; None if the scene has no such part."""
    held = scene
    for part in row.attribute.split("."):
        if held is None:
            return None
        held = held.sensors[index] if part == "sensor" else getattr(held, part)
    return held


def _row(text: str) -> Parameter:
    """Return a row of `_TABLES`: name, field of the scene, key, start."""
    name, field, key, start = text.split()
    table, *rest = key.split(".")
    holder = {"sensor": "sensor.instrument"}.get(table, table)
    is_slope = name == "ambient_slope_db_octave"
    return Parameter(
        name=name,
        words=name.replace("_", " "),
        attribute=f"{holder}.{field}",
        key=Key(table, rest[0], *map(int, rest[1:])),
        spread=Spread(3.0, "unit") if is_slope else Spread(2.0, "factor"),
        default=float(start),
        bounds=Bounds(at_least=-12.0, at_most=12.0) if is_slope else POSITIVE,
    )


FILTER = ("high_pass_hz", "low_pass_hz")
_TABLES = {
    (SOUND,): """
absorption_scale           absorption_scale  air.absorption_scale    1
ambient_level_pa           level             ambient.level_pa        nan
ambient_slope_db_octave    slope             ambient.slope_db_octave  0
ambient_height_m           height            ambient.height_m        nan
high_pass_hz               high_pass         sensor.filter_hz.0      20
low_pass_hz                low_pass          sensor.filter_hz.1      nan
noise_pa                   noise             sensor.noise_pa         nan
full_scale_pa              full_scale        sensor.full_scale_pa    nan
""",
    (EVENTS,): """
camera_threshold_brighter  threshold         camera.threshold.0      0.2
camera_threshold_darker    threshold         camera.threshold.1      0.2
""",
    SIGHT: """
camera_daylight_lux        daylight          camera.daylight_lux     94247.8
camera_focal_x_px          focal             camera.focal_px.0       nan
camera_focal_y_px          focal             camera.focal_px.1       nan
""",
}
_ROWS = [
    (_row(line), kinds)
    for kinds, text in _TABLES.items()
    for line in text.strip().splitlines()
]
TUNABLES = {row.name: row for row, _ in _ROWS}
"""Tunable numbers of sensors and media by name. A default of NaN is a start from the
record; the spread is a large change."""
IDENTIFIED_BY = {row.name: kinds for row, kinds in _ROWS}
"""Kinds of records that can identify each."""
