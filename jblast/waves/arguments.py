"""Names, units and bounds of the arguments of laws, and their checks.

A law's arguments have one name, unit and meaning wherever they occur, so one table
(`ARGUMENTS`) checks them all. Outside `jit` a law raises for values that no scene can
have. Inside `jit` it cannot raise: a negative number in place of a positive one becomes
NaN, and so does the result. Zero remains zero there and gives the limit.

Numbers and NumPy arrays are evaluated by NumPy. For arrays of JAX outside `jit` a law
is compiled as a whole, once for each shape, which is many times as fast as separate
operations, both in compilation and in each call.
"""

import functools
import inspect
from collections.abc import Callable, Collection
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from jblast.errors import require
from jblast.parameters import NOT_NEGATIVE, POSITIVE, UNBOUNDED, Bounds
from jblast.types import Float, is_traced, namespace

if TYPE_CHECKING:
    Number = Any
else:
    Number = Float[Any, "..."] | float | int
"""A number, or an array of NumPy or of JAX."""

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

    def fault(self, values: Float[np.ndarray, "..."]) -> tuple[str, str] | None:
        """Return the expected and the first bad value in words, or None."""
        for bad, expected in (
            (~(self.bounds.allows(values) | np.isnan(values)), self.bounds.words()),
            (np.isnan(values) & (not self.open), "a number"),
            (np.isinf(values) & (not self.open), "a finite number"),
        ):
            if bad.any():
                unit = "" if self.unit == "1" else f" {self.unit}"
                return expected, f"{values[bad][0]:g}{unit}"
        return None

    def or_nan(self, values: Any) -> Any:
        """Return traced values; NaN for those beyond a bound.

        Open arguments keep theirs, since NaN there means that no value is given.
        """
        low, high = max(self.bounds.above, self.bounds.at_least), self.bounds.at_most
        if self.open or (low, high) == (-np.inf, np.inf):
            return values
        # On the input, not on the result: its slope is then 1 where values are good.
        beyond = values < low if high == np.inf else (values < low) | (values > high)
        return namespace(values).where(beyond, np.nan, values)


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


_INSIDE = ContextVar("inside", default=False)
"""True inside a law, whose arguments have been checked."""


def checked(law: Callable[P, R], absent: Collection[str] = ()) -> Callable[P, R]:
    """Make a law raise for arguments that no scene can have, and compile it for JAX.

    Args:
        law: Function of numbers; its arguments are named as in `ARGUMENTS` and `WORDS`.
        absent: Arguments with a default on which the law does not depend.

    Raises:
        InputError: An argument lies outside the bounds of `ARGUMENTS`, the burst is
            unknown, or shapes do not broadcast; the message names the argument, what
            was expected and what was found.
    """
    full = inspect.signature(law).parameters.values()
    signature = inspect.Signature([p for p in full if p.name not in absent])
    body: Any = law  # called by the keywords of this signature

    @functools.cache
    def compiled() -> Callable[..., R]:
        import jax

        words = [name for name in signature.parameters if name in WORDS]
        return jax.jit(law, static_argnames=words)

    @functools.wraps(law)
    def checking(*args: P.args, **kwargs: P.kwargs) -> R:
        given = signature.bind(*args, **kwargs).arguments
        if _INSIDE.get():
            return body(**given)
        xp = namespace(*given.values())
        for name, value in given.items():
            if name == "burst":
                known = value in ("surface", "free-air")
                require(known, "burst", "'surface' or 'free-air'", value)
            elif name in ARGUMENTS and is_traced(value):
                given[name] = ARGUMENTS[name].or_nan(value)
            elif name in ARGUMENTS:
                numbers = np.asarray(value, float)
                fault = ARGUMENTS[name].fault(np.atleast_1d(numbers))
                require(not fault, name, *(fault or ("",)))
                given[name] = numbers if xp is np else value
        _check_shapes(checking.__name__, given)
        return unchecked(**given)

    def unchecked(**given: Any) -> R:
        values = given.values()
        plain = namespace(*values) is np or any(map(is_traced, values))
        # also where it is traced: a second guard of one number would be computed again
        token = _INSIDE.set(True)
        try:
            return (body if plain else compiled())(**given)
        finally:
            _INSIDE.reset(token)

    checking.__signature__ = signature  # type: ignore[attr-defined]
    checking.unchecked = unchecked  # type: ignore[attr-defined]  for `registry.call`
    return checking


def _check_shapes(law: str, given: dict[str, Any]) -> None:
    shapes = {name: np.shape(x) for name, x in given.items() if name in ARGUMENTS}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        shaped = [f"{name} {shape}" for name, shape in shapes.items() if shape]
        one = "one shape, or single numbers"
        require(False, law, one, ", ".join(shaped))
