"""The reader of the thesis's custom profiles: a CSV of impulses, a case a row."""

import csv
import math
import os

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, read_text, shown

COLUMNS = (
    "Time Delay (s)",
    "Distance (m)",
    "View Polar Angle (Deg.)",
    "View Azimuthal Angle (Deg.)",
    "FA (N*s)",
    "FS (N*s)",
    "FN (N*s)",
    "Ml (N*m*s)",
    "Mm (N*m*s)",
    "Mn (N*m*s)",
)
"""In any order; others (the sample has Case Number) are not read."""

LIMITS = {0: (0.0, math.inf), 1: (0.0, math.inf), 2: (0.0, 180.0), 3: (-360.0, 360.0)}
"""Of the columns that have any; the delay and the distance lie above theirs."""


def read_custom_profile(path: str | os.PathLike[str]) -> Float[np.ndarray, "case 10"]:
    """Read the cases of a custom profile.

    Returns:
        Columns: delay [s], distance [m], polar and azimuthal angle [rad], impulses
        along body x, y, z [N s], angular impulses about them [N m s].

    Raises:
        InputError: The file is empty, a column is missing, or a field is no finite
            number within its range; the message names file, line and column.
    """
    lines = read_text(path, "a CSV file of blast impulses").split("\n")
    numbered = [(n, line) for n, line in enumerate(lines, 1) if line.strip()]
    if not numbered:
        raise InputError(
            f"{path}: line 1: the file is empty; expected a header {','.join(COLUMNS)} "
            "and a case a row"
        )
    number, top = numbered[0]
    header = [_plain(name) for name in _fields(top)]
    missing = [name for name in COLUMNS if _plain(name) not in header]
    if missing:
        raise InputError(
            f"{path}: line {number}: missing column {', '.join(missing)}; got "
            f"{', '.join(_fields(top))}"
        )
    if len(numbered) == 1:
        raise InputError(
            f"{path}: line {number}: nothing after the header; expected a case a row"
        )
    place = [header.index(_plain(name)) for name in COLUMNS]
    cases = []
    for number, line in numbered[1:]:
        fields = _fields(line)
        if len(fields) != len(header):
            raise InputError(
                f"{path}: line {number}: expected {len(header)} fields as in the "
                f"header, got {len(fields)}"
            )
        texts = [fields[n] for n in place]
        cases.append([_number(f"{path}: line {number}", n, texts) for n in range(10)])
    found = np.array(cases)
    _refuse_twice(path, found, [number for number, _ in numbered[1:]])
    found[:, 2:4] = np.radians(found[:, 2:4])
    return found


def _fields(line: str) -> list[str]:
    return [field.strip() for field in next(csv.reader([line], skipinitialspace=True))]


def _plain(name: str) -> str:
    return "".join(name.lower().split())


def _number(where: str, column: int, texts: list[str]) -> float:
    """Return a field's number."""
    text = texts[column]
    low, high = LIMITS.get(column, (-math.inf, math.inf))
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    above = value > low if column < 2 else value >= low
    if not (math.isfinite(value) and above and value <= high) or "_" in text:
        what = "a finite number"
        if column < 2:
            what = "a positive number"
        elif math.isfinite(high):
            what = f"a number from {low:g} to {high:g}"
        raise InputError(
            f"{where}, column {COLUMNS[column]}: expected {what}, got "
            f"{shown(text) if text else 'nothing'}"
        )
    return value


def _refuse_twice(
    path: str | os.PathLike[str], cases: np.ndarray, lines: list[int]
) -> None:
    """Refuse two cases of one place: nothing says which holds."""
    first: dict[tuple[float, ...], int] = {}
    for case, line in zip(cases, lines, strict=True):
        at = tuple(case[1:4])
        if first.setdefault(at, line) != line:
            raise InputError(
                f"{path}: line {line}: expected a new distance or direction, got those "
                f"of line {first[at]}"
            )
