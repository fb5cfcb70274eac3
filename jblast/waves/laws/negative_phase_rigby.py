"""Rigby et al. (2014): negative phase on a rigid wall facing the charge.

The only source is the code of AnaWaldila/dynablast2.0 @598f47a, Class_Blast.m. The
paper was not available, so a mistake in that one transcription could be found by two
checks only. Neighbouring pieces meet within 1 %. For Z = 1 to 10 the free-air fits lie
below the table of `negative_phase_ufc.py`, by 8 to 23 % in pressure (most at Z = 1.5),
4 to 14 % in impulse and 0 to 2 % in duration.

Each curve is made of constants, parabolas and powers of $Z$. They are blended in ln y
over 5 % of Z where they meet. Pressures stay below 101 kPa, so below the ambient
pressure.

Range: the transcription states none; taken as that of the tables of Kingery and
Bulmash, Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3). Outside it is a power law with
the end slope, finite and not valid.
"""

import math

from jblast.waves.scaling import scaled_law
from jblast.waves.tables import Curve, Form, polynomial, power_sum, segmented

Printed = tuple[tuple[float, tuple[float, ...]], ...]
"""First Z of each segment, and its numbers: (a, n) of y = a Z^n, or (a, b, c) of
y = a Z^2 + b Z + c."""
LAST = 40.0
"""Last scaled distance [m/kg^(1/3)]: assumed, as the first."""

# kPa
PRESSURE: dict[str, Printed] = {
    "surface": (
        (0.0674, (100.0, 0.0)),
        (0.669, (-32.91, 13.0, 106.0)),
        (1.27, (93.0, -1.215)),
        (2.78, (72.99, -0.978)),
    ),
    "free-air": (
        (0.0531, (100.0, 0.0)),
        (0.7, (-29.078, 0.0352, 114.0)),
        (1.469, (84.132, -1.286)),
        (2.754, (59.559, -0.945)),
    ),
}
# kPa-ms/kg^(1/3)
IMPULSE: dict[str, Printed] = {
    "surface": (
        (0.0674, (-724.37, 445.34, 553.0)),
        (0.58, (11.356, -314.76, 752.0)),
        (1.19, (461.8, -0.88)),
        (5.25, (433.6, -0.842)),
    ),
    "free-air": (
        (0.0531, (496.0, 0.0)),
        (0.304, (36.919, -298.72, 583.0)),
        (1.44, (316.36, -0.879)),
    ),
}
# ms/kg^(1/3)
DURATION: dict[str, Printed] = {
    "surface": (
        (0.0674, (10.57, 0.0)),
        (0.267, (-0.474, 2.745, 9.87)),
        (2.9, (13.9, 0.0)),
    ),
    "free-air": (
        (0.0531, (0.382, 2.952, 7.917)),
        (0.537, (-0.309, 1.6443, 8.818)),
        (2.83, (11.0, 0.0)),
    ),
}


def _segment(printed: tuple[float, ...], unit: float) -> Form:
    """Return ln of the SI value of a segment, which is positive on its interval."""
    if len(printed) == 2:
        factor, exponent = printed
        return polynomial([math.log(unit * factor), exponent])
    return power_sum(*zip((unit * x for x in printed), (2.0, 1.0, 0.0), strict=True))


def _curve(printed: Printed, unit: float) -> Curve:
    segments = [_segment(numbers, unit) for _, numbers in printed]
    return segmented(segments, [*(first for first, _ in printed), LAST])


def _law(quantity: str, printed: dict[str, Printed], unit: float):
    return scaled_law(
        quantity,
        {burst: _curve(each, unit) for burst, each in printed.items()},
        name="rigby_2014",
        source="Rigby et al. 2014, over one transcription",
        note=", assumed; one transcription",
        sd=(0.15, 0.10),
    )


rigby_reflected_negative_pressure = _law(
    "reflected_negative_pressure_pa", PRESSURE, 1e3
)
# 1 kPa ms is 1 Pa s
rigby_reflected_negative_impulse = _law("reflected_negative_impulse_pa_s", IMPULSE, 1.0)
rigby_negative_duration = _law("negative_duration_s", DURATION, 1e-3)
