"""The numbers to tune, each in a coordinate of its own.

`TUNABLES` is the table of the numbers of sensors and media that a record can constrain,
with unit, bounds and step. The numbers of `PARAMETERS` (charge, air, ground, clocks)
are tuned as well, under the names that they have there. A number with two bounds has a
logistic coordinate, a free positive one its logarithm.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, argument, nearest
from jblast.parameters import CLOCK_OFFSET, Key
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

TIME_STEP = 1e-3
"""A large change of a time [s]: sound travels a third of a metre."""
SOUND, FRAMES, EVENTS = "sound", "frames", "events"
SIGHT = (FRAMES, EVENTS)


class Between(eqx.Module):
    """A number with bounds and no other prior, flat in a logistic coordinate.

    Attributes:
        low: Lower bound.
        high: Upper bound.
        in_ln: Use the logistic coordinate of the logarithm.
    """

    low: float = eqx.field(static=True)
    high: float = eqx.field(static=True)
    in_ln: bool = eqx.field(static=True, default=False)

    def constrain(self, z):
        """Return the number at a fitted coordinate."""
        low, high = self._bounds()
        part = low + (high - low) * jax.nn.sigmoid(jnp.asarray(z))
        return jnp.exp(part) if self.in_ln else part

    def unconstrain(self, value):
        """Return the fitted coordinate of a number."""
        low, high = self._bounds()
        part = jnp.log(value) if self.in_ln else jnp.asarray(value)
        # a start at a bound would be at infinity, where the logistic has no slope
        part = jnp.clip((part - low) / (high - low), 1e-3, 1.0 - 1e-3)
        return jnp.log(part) - jnp.log1p(-part)

    def log_density(self, z):
        """Return zero: the density is improper."""
        return jnp.zeros_like(z)

    def _bounds(self) -> tuple[float, float]:
        if self.in_ln:
            return math.log(self.low), math.log(self.high)
        return self.low, self.high


class Unknown(eqx.Module):
    """A number to tune.

    Attributes:
        name: Name as for `--free`.
        belief: Coordinate and prior.
        step: A large change of its coordinate.
        is_tunable: True for a number of `TUNABLES`, False for one of `PARAMETERS`.
    """

    name: str = eqx.field(static=True)
    belief: Belief
    step: Float[Array, ""]
    is_tunable: bool = eqx.field(static=True)

    @property
    def has_prior(self) -> bool:
        """True if it has a prior besides bounds."""
        return not isinstance(self.belief, Free | Between)


def unknowns_of(
    uncertain: UncertainScene, names: Sequence[str], kind: str, rate: float | None
) -> tuple[UncertainScene, tuple[Unknown, ...]]:
    """Return the scene with the named numbers free, and all numbers to tune.

    Numbers that the scene leaves free or gives a prior are tuned as well.

    Args:
        uncertain: The scene.
        names: Names of `TUNABLES` or of `PARAMETERS`.
        kind: Kind of the record: "sound", "frames" or "events".
        rate: Sampling rate, which bounds corners of filters [Hz].

    Raises:
        InputError: A name is unknown or repeated, or a record of this kind cannot
            identify it.
    """
    known = names_known(uncertain.scene, kind)
    for name in names:
        if name in TUNABLES and kind not in TUNABLES[name].identified_by:
            needed = " or ".join(TUNABLES[name].identified_by)
            raise InputError(
                f"{argument('freed')} {name}: expected a record of {needed}, got "
                f"{kind}; {kind} can identify {', '.join(known)}"
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
    own = [name for name in names if name in TUNABLES]
    uncertain = freed(uncertain, [name for name in names if name not in TUNABLES])
    found = [
        Unknown(name, belief, jnp.asarray(_step(name, belief)), False)
        for name, belief in _bounded(uncertain.beliefs).items()
    ]
    for name in own:
        belief = _belief(TUNABLES[name], rate)
        step = TUNABLES[name].step
        if isinstance(belief, Between):
            low, high = belief._bounds()
            step *= 4.0 / (high - low)  # slope of the logistic in its middle
        found.append(Unknown(name, belief, jnp.asarray(step), True))
    return uncertain, tuple(found)


def names_known(scene: Scene, kind: str | None = None) -> tuple[str, ...]:
    """Return the names that can be tuned in a scene by a kind of record, or by any.

    A range without a position is excluded: it gives no path of sound or light.
    """
    own = [
        name
        for name, row in TUNABLES.items()
        if kind is None or kind in row.identified_by
    ]
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
        sensor = replace(scene.sensors[index], instrument=Instrument())
        others = scene.sensors
        sensors = (*others[:index], sensor, *others[index + 1 :])
        scene = replace(scene, sensors=sensors)
    values = {}
    for name in names:
        if name not in TUNABLES or name in ("ambient_slope_db_octave",):
            continue
        held = tuned_value(scene, index, name)
        # a noise of zero has no logarithm, so it counts as missing; an absorption of
        # zero is a valid value
        if held is not None and (float(held) > 0.0 or name == "absorption_scale"):
            continue
        start = TUNABLES[name].start
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
    leaf = _leaf(scene, index, row)
    if leaf is None or not row.attribute.startswith("camera"):
        return leaf
    return leaf if row.key.index is None else leaf[row.key.index]


def with_tuned(
    scene: Scene, index: int, values: Mapping[str, Float[Array, ""] | float]
) -> Scene:
    """Return a scene with replaced numbers of `TUNABLES` and `PARAMETERS`."""
    own = {name: value for name, value in values.items() if name in TUNABLES}
    rest = {name: value for name, value in values.items() if name not in own}
    scene = with_values(scene, rest) if rest else scene
    for name, value in own.items():
        row = TUNABLES[name]
        new = jnp.asarray(value, float)
        if row.attribute.startswith("camera") and row.key.index is not None:
            new = _leaf(scene, index, row).at[row.key.index].set(new)
        scene = eqx.tree_at(
            lambda s, row=row: _leaf(s, index, row),
            scene,
            new,
            # a leaf without a value is None, which is no leaf by default
            is_leaf=lambda leaf: leaf is None,
        )
    return scene


@dataclass(frozen=True, kw_only=True)
class Tunable:
    """A number of a sensor or a medium.

    Attributes:
        name: Name for `--free` and in results.
        unit: SI unit, "1" without one.
        words: Description in a sentence.
        attribute: Path in a scene; `sensor` is the one that recorded.
        key: Key in a scene file.
        identified_by: Kinds of records that can identify it: "sound", "frames",
            "events".
        above: Lower bound of the search.
        below: Upper bound of the search; infinite for none.
        in_ln: Search in its logarithm.
        step: A large change of it, of its logarithm with `in_ln`. If two such steps do
            not change a record, it is not identified.
        start: Start of a search if the scene has no value; NaN for one from the record.
    """

    name: str
    unit: str
    words: str
    attribute: str
    key: Key
    identified_by: tuple[str, ...]
    above: float = 0.0
    below: float = math.inf
    in_ln: bool = True
    step: float = math.log(2.0)
    start: float = math.nan


def _leaf(scene: Any, index: int, row: Tunable) -> Any:
    """Return the leaf of a scene with a number; None if the scene has no such part."""
    held = scene
    for part in row.attribute.split("."):
        if held is None:
            return None
        held = held.sensors[index] if part == "sensor" else getattr(held, part)
    return held


def _belief(row: Tunable, rate: float | None) -> Belief:
    """Return the coordinate of a tunable number, logistic if it has two bounds."""
    low, high = row.above, row.below
    if row.name in ("high_pass_hz", "low_pass_hz") and rate is not None:
        # just below half the rate, where the bilinear transform is infinite
        low, high = 1e-5 * rate, 0.499 * rate
    if math.isfinite(high):
        return Between(low, high, row.in_ln)
    return Free(positive=row.in_ln)


def _bounded(beliefs: Mapping[str, Belief]) -> dict[str, Belief]:
    """Return beliefs; free numbers with two bounds get a logistic coordinate."""
    found = dict(beliefs)
    for name, belief in beliefs.items():
        bounds = parameter_named(name).bounds
        ends = bounds.at_least, bounds.at_most
        if isinstance(belief, Free) and np.isfinite(ends).all():
            found[name] = Between(*ends)
    return found


def _step(name: str, belief: Belief) -> float:
    """Return a large change of the coordinate of a number of `PARAMETERS`."""
    if not isinstance(belief, Free):
        return 1.0
    spread = parameter_named(name).spread
    if spread.of == "factor":
        return math.log(2.0)
    return {"unit": spread.amount, "layout": 1.0, "travel": TIME_STEP}[spread.of]


_ROWS = (
    Tunable(
        name="absorption_scale",
        unit="1",
        words="absorption of the air over that of ISO 9613-1",
        attribute="air.absorption_scale",
        key=Key("air", "absorption_scale"),
        identified_by=(SOUND,),
        start=1.0,
    ),
    Tunable(
        name="ambient_level_pa",
        unit="Pa",
        words="level of the ambient sound on the ground",
        attribute="ambient.level",
        key=Key("ambient", "level_pa"),
        identified_by=(SOUND,),
    ),
    Tunable(
        name="ambient_slope_db_octave",
        unit="dB/octave",
        words="slope of the ambient sound",
        attribute="ambient.slope",
        key=Key("ambient", "slope_db_octave"),
        identified_by=(SOUND,),
        above=-12.0,
        below=12.0,
        in_ln=False,
        step=3.0,
        start=0.0,
    ),
    Tunable(
        name="ambient_height_m",
        unit="m",
        words="height over which the ambient sound falls",
        attribute="ambient.height",
        key=Key("ambient", "height_m"),
        identified_by=(SOUND,),
    ),
    Tunable(
        name="high_pass_hz",
        unit="Hz",
        words="high-pass corner of the sensor",
        attribute="sensor.instrument.high_pass",
        key=Key("sensor", "filter_hz", 0),
        identified_by=(SOUND,),
        start=20.0,
    ),
    Tunable(
        name="low_pass_hz",
        unit="Hz",
        words="low-pass corner of the sensor",
        attribute="sensor.instrument.low_pass",
        key=Key("sensor", "filter_hz", 1),
        identified_by=(SOUND,),
    ),
    Tunable(
        name="noise_pa",
        unit="Pa",
        words="noise of the sensor",
        attribute="sensor.instrument.noise",
        key=Key("sensor", "noise_pa"),
        identified_by=(SOUND,),
    ),
    Tunable(
        name="full_scale_pa",
        unit="Pa",
        words="full scale of the sensor",
        attribute="sensor.instrument.full_scale",
        key=Key("sensor", "full_scale_pa"),
        identified_by=(SOUND,),
    ),
    Tunable(
        name="camera_threshold_brighter",
        unit="1",
        words="threshold of brighter events",
        attribute="camera.threshold",
        key=Key("camera", "threshold", 0),
        identified_by=(EVENTS,),
        start=0.2,
    ),
    Tunable(
        name="camera_threshold_darker",
        unit="1",
        words="threshold of darker events",
        attribute="camera.threshold",
        key=Key("camera", "threshold", 1),
        identified_by=(EVENTS,),
        start=0.2,
    ),
    Tunable(
        name="camera_daylight_lux",
        unit="lx",
        words="light of day that the picture is exposed for",
        attribute="camera.daylight",
        key=Key("camera", "daylight_lux"),
        identified_by=SIGHT,
        start=math.pi * 3e4,
    ),
    Tunable(
        name="camera_focal_x_px",
        unit="px",
        words="focal length along rows",
        attribute="camera.focal",
        key=Key("camera", "focal_px", 0),
        identified_by=SIGHT,
    ),
    Tunable(
        name="camera_focal_y_px",
        unit="px",
        words="focal length along columns",
        attribute="camera.focal",
        key=Key("camera", "focal_px", 1),
        identified_by=SIGHT,
    ),
)
TUNABLES: dict[str, Tunable] = {row.name: row for row in _ROWS}
"""Tunable numbers by name."""
