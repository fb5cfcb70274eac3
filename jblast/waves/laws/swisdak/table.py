"""Swisdak's table as curves: `data/swisdak_1994.csv`, read in SI units."""

from functools import cache

from jblast.waves.curves.log_polynomial import LogCurve, LogPolynomial
from jblast.waves.curves.printed_table import data_rows
from jblast.waves.laws.kingery_bulmash.table import segment_in_si


@cache
def swisdak_curve(quantity: str) -> LogCurve:
    """Read one curve, as ln of the SI value at standard air and 1 kg against ln Z.

    Args:
        quantity: As the table calls it: "incident_pressure", "arrival_time", ...
    """
    rows = data_rows("swisdak_1994")
    return LogCurve(tuple(_segment(row) for row in rows if row["quantity"] == quantity))


def swisdak_joins(quantity: str) -> tuple[float, ...]:
    """Return where a curve starts, joins and ends [m/kg^(1/3)]."""
    curve = swisdak_curve(quantity)
    return (*(segment.z_min for segment in curve.segments), curve.z_max)


def _segment(row: dict[str, str]) -> LogPolynomial:
    """Turn a row into a polynomial in SI; the table's logarithms are natural."""
    coefficients = [float(row[letter]) for letter in "ABCDEFG"]
    while coefficients[-1] == 0.0:
        coefficients.pop()
    return segment_in_si(row, coefficients)
