"""The Kingery-Bulmash table as curves: `data/kingery_bulmash.csv`, read in SI units.

Where it comes from, which misprints were found and which digit is unresolved stands in
the head of that file.
"""

import math
from functools import cache

from jblast.waves.curves.log_polynomial import LogCurve, LogPolynomial
from jblast.waves.curves.printed_table import data_rows

TABLE_NAMES = {"surface": "hemispherical", "free-air": "spherical"}
SI_UNITS = {
    "kPa": 1e3,
    "kPa-ms/kg^(1/3)": 1.0,
    "ms/kg^(1/3)": 1e-3,
    "m/ms": 1e3,
}


@cache
def kingery_bulmash_curve(quantity: str, burst: str) -> LogCurve:
    """Read one curve, as ln of the SI value at standard air and 1 kg against ln Z.

    Args:
        quantity: As the table calls it: "incident_pressure", "arrival_time", ...
        burst: "surface" or "free-air".

    Raises:
        ValueError: There is no such burst.
    """
    if burst not in TABLE_NAMES:
        raise ValueError(f"burst must be 'surface' or 'free-air', got {burst!r}")
    return LogCurve(
        tuple(
            _segment(row)
            for row in data_rows("kingery_bulmash")
            if row["burst"] == TABLE_NAMES[burst]
            and row["quantity"] == quantity
            and row["variant"] == "brl1984"
        )
    )


@cache
def kingery_bulmash_joins() -> tuple[float, ...]:
    """Return where any curve starts, joins or ends [m/kg^(1/3)]."""
    rows = data_rows("kingery_bulmash")
    return tuple(
        sorted({float(row[end]) for row in rows for end in ("z_min", "z_max")})
    )


def _segment(row: dict[str, str]) -> LogPolynomial:
    """Turn a row of decimal logarithms in the table's unit into natural ones in SI."""
    coefficients = [
        float(row[f"C{i}"]) * math.log(10) for i in range(int(row["degree"]) + 1)
    ]
    scale = float(row["K1"]) / math.log(10)
    return segment_in_si(row, coefficients, float(row["K0"]), scale)


def segment_in_si(
    row: dict[str, str],
    coefficients: list[float],
    offset: float = 0.0,
    scale: float = 1.0,
) -> LogPolynomial:
    """Return a row's polynomial, its values in SI.

    Args:
        row: It names the unit of the values, and where the segment starts and ends.
        coefficients: Of the natural logarithm of the values in that unit.
        offset: $k_0$ of `LogPolynomial`.
        scale: $k_1$.
    """
    first, *others = coefficients
    return LogPolynomial(
        z_min=float(row["z_min"]),
        z_max=float(row["z_max"]),
        offset=offset,
        scale=scale,
        coefficients=(first + math.log(SI_UNITS[row["y_unit"]]), *others),
    )
