"""The pieces of Rigby's fits as curves; `rigby.py` says of what.

As coded in AnaWaldila/dynablast2.0 @598f47a, Class_Blast.m, our only source.
"""

import math
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp

from jblast.waves.curves.log_polynomial import LogCurve, LogPolynomial

ENDS = {"surface": (0.0674, 40.0), "free-air": (0.0531, 40.0)}
"""First and last scaled distance [m/kg^(1/3)]: assumed."""


@dataclass(frozen=True)
class _Parabola:
    """y = a Z^2 + b Z + c."""

    z_min: float
    z_max: float
    a: float
    b: float
    c: float

    def log_value(self, log_z):
        """Return ln y."""
        z = jnp.exp(log_z)
        return jnp.log((self.a * z + self.b) * z + self.c)

    def log_slope(self, log_z: float) -> float:
        """Return d ln y/d ln Z."""
        z = math.exp(log_z)
        return (2 * self.a * z + self.b) * z / ((self.a * z + self.b) * z + self.c)


# Pieces as y = a Z^n, (a, n), or y = a Z^2 + b Z + c, (a, b, c), and the Z between.
# kPa; kPa-ms/kg^(1/3); ms/kg^(1/3)
PRINTED: dict[tuple[str, str], tuple[Any, ...]] = {
    ("pressure", "surface"): (
        (100.0, 0.0),
        0.669,
        (-32.91, 13.0, 106.0),
        1.27,
        (93.0, -1.215),
        2.78,
        (72.99, -0.978),
    ),
    ("impulse", "surface"): (
        (-724.37, 445.34, 553.0),
        0.58,
        (11.356, -314.76, 752.0),
        1.19,
        (461.8, -0.88),
        5.25,
        (433.6, -0.842),
    ),
    ("duration", "surface"): (
        (10.57, 0.0),
        0.267,
        (-0.474, 2.745, 9.87),
        2.9,
        (13.9, 0.0),
    ),
    ("pressure", "free-air"): (
        (100.0, 0.0),
        0.7,
        (-29.078, 0.0352, 114.0),
        1.469,
        (84.132, -1.286),
        2.754,
        (59.559, -0.945),
    ),
    ("impulse", "free-air"): (
        (496.0, 0.0),
        0.304,
        (36.919, -298.72, 583.0),
        1.44,
        (316.36, -0.879),
    ),
    ("duration", "free-air"): (
        (0.382, 2.952, 7.917),
        0.537,
        (-0.309, 1.6443, 8.818),
        2.83,
        (11.0, 0.0),
    ),
}
SI_UNITS = {"pressure": 1e3, "impulse": 1.0, "duration": 1e-3}


def _curve(burst: str, printed: tuple[Any, ...]) -> LogCurve:
    """Return the pieces, each from the one before to the next."""
    first, last = ENDS[burst]
    ends = (first, *printed[1::2], last)
    segments = []
    for numbers, z_min, z_max in zip(printed[::2], ends, ends[1:], strict=False):
        if len(numbers) == 3:
            segments.append(_Parabola(z_min, z_max, *numbers))
        else:
            terms = (math.log(numbers[0]), numbers[1])
            segments.append(LogPolynomial(z_min, z_max, 0.0, 1.0, terms))
    return LogCurve(tuple(segments))


CURVES = {(what, burst): _curve(burst, PRINTED[what, burst]) for what, burst in PRINTED}
"""By quantity and burst: ln of the value in the units above against ln Z."""
