"""Names, units and bounds of the arguments of laws, and their checks.

A law's arguments have one name, unit and meaning wherever they occur, so one table
(`ARGUMENTS`) checks them all. Outside `jit` a law raises for values that no scene can
have. Inside `jit` it cannot raise: a negative number in place of a positive one becomes
NaN, and so does the result. Zero remains zero there and gives the limit. Outside `jit`
a law is compiled as a whole, once for each shape, which is many times as fast as
separate operations, both in compilation and in each call.
"""

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jblast.parameters import POSITIVE, UNBOUNDED, Bounds

NOT_NEGATIVE = Bounds(at_least=0.0)

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Argument:
    """One argument.

    Attributes:
        unit: SI unit.
        usual: Range in most scenes, swept by the tests.
        bounds: Range of permitted values.
        open: Whether NaN (not given) and infinity (never) are passed to the law.
    """

    unit: str
    usual: tuple[float, float]
    bounds: Bounds = UNBOUNDED
    open: bool = False

    def fault(self, values: Float[np.ndarray, "..."]) -> str:
        """Return the fault of values, in words; empty if there is none."""
        for bad, expected in (
            (~(self.bounds.allows(values) | np.isnan(values)), self.bounds.words()),
            (np.isnan(values) & (not self.open), "a number"),
            (np.isinf(values) & (not self.open), "finite"),
        ):
            if bad.any():
                unit = "" if self.unit == "1" else f" {self.unit}"
                return f"must be {expected}, got {values[bad][0]:g}{unit}"
        return ""

    def or_nan(self, values: Any) -> Any:
        """Return traced values; NaN for negative ones that must be positive.

        Open arguments keep theirs, since NaN there means that no value is given.
        """
        if self.bounds.above != 0.0 or self.open:
            return values
        # On the input, not on the result: its slope is then 1 where values are good.
        return jnp.where(values < 0.0, jnp.nan, values)


def _positive(unit: str, low: float, high: float, *, open: bool = False) -> Argument:
    return Argument(unit, (low, high), POSITIVE, open=open)


ARGUMENTS: dict[str, Argument] = {
    # path from charge to sensor (waves.paths.Path)
    "slant_range": _positive("m", 0.1, 1e4),
    "ground_range": Argument("m", (0.1, 1e4), NOT_NEGATIVE),
    "sensor_height": Argument("m", (0.0, 10.0)),
    "charge_mass": _positive("kg", 1e-2, 1e6),
    "height_of_burst": Argument("m", (-1.0, 5.0)),
    "time_since_detonation": Argument("s", (1e-4, 1.0), open=True),
    "shock_radius": _positive("m", 0.1, 1e4),
    "toward_east": Argument("m", (0.1, 1e4), open=True),
    "toward_north": Argument("m", (0.1, 1e4), open=True),
    "toward_up": Argument("m", (0.1, 1e3), open=True),
    # fireball and camera
    "fireball_growth": _positive("s", 1e-4, 1e-1, open=True),
    "camera_focal": _positive("px", 1e2, 1e4, open=True),
    # air and ground
    "ambient_pressure": _positive("Pa", 5e4, 1.05e5),
    "pressure": _positive("Pa", 5e4, 1.05e5),
    "temperature": _positive("K", 255.0, 320.0),
    "relative_humidity": Argument("1", (0.05, 0.95), Bounds(at_least=0.0, at_most=1.0)),
    "altitude": Argument("m", (0.0, 1e4)),
    "sound_speed": _positive("m/s", 300.0, 360.0),
    "air_density": _positive("kg/m3", 0.7, 1.3),
    "p_speed": _positive("m/s", 2e3, 6e3),
    "wind_along": Argument("m/s", (-20.0, 20.0)),
    "sedov_gamma": Argument("1", (1.15, 1.65), Bounds(above=1.0)),
    # the shape of a wave
    "time": Argument("s", (-0.005, 0.02), open=True),
    "peak_overpressure": _positive("Pa", 1e2, 1e6),
    "duration": _positive("s", 1e-3, 1e-2),
    "impulse": _positive("Pa s", 10.0, 1e3),
    "decay": Argument("1", (0.1, 5.0)),
    "negative_pressure": _positive("Pa", 1e2, 5e4),
    "negative_duration": _positive("s", 5e-3, 5e-2),
    # propagation of sound
    "frequency": Argument("Hz", (1.0, 1e4), NOT_NEGATIVE),
}
"""By name. `burst` is "surface" or "free-air"."""


WORDS = ("burst", "ground_path", "quantity")
"""Arguments that are not numbers."""


def checked(law: Callable[P, R]) -> Callable[P, R]:
    """Make a law raise for arguments that no scene can have, and compile it.

    Raises:
        ValueError: An argument lies outside the bounds of `ARGUMENTS`, the burst is
            unknown, or shapes do not broadcast; the message names the argument, what
            was expected and what was found.
    """
    signature = inspect.signature(law)
    words = [name for name in signature.parameters if name in WORDS]
    compiled = jax.jit(law, static_argnames=words)

    @functools.wraps(law)
    def checking(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = signature.bind(*args, **kwargs)
        given = bound.arguments
        for name, value in list(given.items()):
            if name == "burst":
                if value not in ("surface", "free-air"):
                    raise ValueError(
                        f"burst must be 'surface' or 'free-air', got {value!r}"
                    )
            elif name in ARGUMENTS and isinstance(value, Tracer):
                given[name] = ARGUMENTS[name].or_nan(value)
            elif name in ARGUMENTS:
                _check(name, np.atleast_1d(np.asarray(value, float)))
        traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(given))
        try:
            if traced:
                return law(*bound.args, **bound.kwargs)
            return compiled(*args, **kwargs)
        except (TypeError, ValueError) as error:
            if fault := _shape_fault(given):
                raise ValueError(f"{law.__name__}: {fault}") from error
            raise

    return checking


def _shape_fault(given: Mapping[str, Any]) -> str:
    """Return the shapes that do not broadcast, in words; empty if all do."""
    shapes = {name: np.shape(x) for name, x in given.items() if name in ARGUMENTS}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        shaped = [f"{name} {shape}" for name, shape in shapes.items() if shape]
        return f"expected one shape, or single numbers, got {', '.join(shaped)}"
    return ""


def _check(name: str, values: Float[np.ndarray, "..."]) -> None:
    fault = ARGUMENTS[name].fault(values)
    if fault:
        raise ValueError(f"{name} {fault}")
