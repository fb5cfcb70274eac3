"""The rows of an observation file: what each column must hold."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from jblast.errors import InputError, nearest, shown
from jblast.observations.aliases import our_name
from jblast.observations.faults import Faults
from jblast.observations.grouping import some_rows
from jblast.observations.places.degrees import places_of
from jblast.observations.table import NAMED, POSITION, QUANTITIES, Observations
from jblast.observations.times.clock_times import take_clock_times
from jblast.quantities import ADDITIVE, DIRECTIONS, TIMED

AT_LEAST = ">"
"""Before a value: what was measured is no less."""


class Rows:
    """The body of a file by column, and the checks each column has to pass."""

    def __init__(
        self,
        path: str,
        lines: Sequence[int],
        header: Sequence[str],
        records: Sequence[Sequence[str]],
        faults: Faults,
        date: str | None = None,
        zone: str | None = None,
    ):
        self.path = path
        self.lines = lines
        self.faults = faults
        self.date, self.zone = date, zone
        self.sound = np.ones(len(records), bool)
        columns = [[field.strip() for field in column] for column in zip(*records)]  # noqa: B905 (checked widths)
        self.texts = dict(zip(header, columns, strict=True))

    def observations(self, comments: tuple[str, ...]) -> Observations:
        """Check every column and put the table together, of the rows that are sound."""
        sensor, quantity = self.text("sensor"), self.text("quantity")
        self.refuse(
            [not name for name in sensor], "sensor", lambda _: "a name, got nothing"
        )
        self.quantities(quantity)
        epoch = take_clock_times(self, self.date, self.zone)
        kind = np.array(quantity)
        in_ln = ~np.isin(kind, ADDITIVE)
        bound = self.bounds(in_ln)
        value = self.number("value", optional=False)
        self.refuse(
            in_ln & (value <= 0),
            "value",
            lambda row: f"a positive {quantity[row]}, got {self.texts['value'][row]}",
        )
        for name, most in DIRECTIONS.items():
            self.refuse(
                (kind == name) & (np.abs(value) > most),
                "value",
                lambda row, name=name, most=most: (
                    f"{name} within {most:.6g} rad either way, got "
                    f"{self.texts['value'][row]}; are these degrees?"
                ),
            )
        sigma = self.number("sigma")
        self.refuse(
            sigma <= 0,
            "sigma",
            lambda row: (
                "a positive number, or nothing for the law's scatter alone, got "
                + self.texts["sigma"][row]
            ),
        )
        slant_range = self.number("range_m")
        position, frame = places_of(self)
        self.places(position, slant_range)
        time = self.number("time_s")
        timed = np.isin(kind, TIMED)
        self.refuse(
            timed & np.isnan(time),
            "time_s",
            lambda row: f"the time at which {quantity[row]} was taken, got nothing",
        )
        self.refuse(
            ~timed & ~np.isnan(time),
            "time_s",
            lambda row: (
                f"nothing, as only {', '.join(TIMED)} take a time, got "
                f"{self.texts['time_s'][row]} for {quantity[row]}"
            ),
        )
        named = {name: self.text(name) for name in NAMED}
        numbers = np.column_stack([value, sigma, position, slant_range, time, bound])
        self.duplicates(numbers, sensor, quantity, *named.values())
        if not any(named["record"]):
            named["record"] = ()
        whole = Observations(
            sensor=sensor,
            quantity=quantity,
            value=value,
            sigma=sigma,
            position=position,
            slant_range=slant_range,
            time=time,
            path=named["path"],
            shot=named["shot"],
            clock=named["clock"],
            record=named["record"],
            line=tuple(self.lines),
            source=self.path,
            comments=comments,
            lower_bound=bound if bound.any() else None,
            frame=frame,
            epoch=epoch,
        )
        return (
            whole if self.sound.all() else some_rows(whole, np.flatnonzero(self.sound))
        )

    def bounds(self, in_ln: np.ndarray) -> np.ndarray:
        """Take the marks of lower bounds off the values, and return which had one."""
        texts = self.texts["value"]
        bound = np.array([text.startswith(AT_LEAST) for text in texts])
        self.refuse(
            bound & ~in_ln,
            "value",
            lambda row: (
                f"a number, as {self.texts['quantity'][row]} takes no lower bound, "
                f"got {texts[row]}"
            ),
        )
        self.refuse(
            [text.startswith(("<", ">=")) for text in texts],
            "value",
            lambda row: f"a number, or a lower bound as >0.12, got {texts[row]}",
        )
        self.texts["value"] = [text.removeprefix(AT_LEAST).strip() for text in texts]
        return bound

    def text(self, column: str) -> tuple[str, ...]:
        """Return a column of names; "" where the file has no such column."""
        return tuple(self.texts.get(column) or [""] * len(self.lines))

    def number(self, column: str, *, optional: bool = True) -> np.ndarray:
        """Return a column of finite numbers; NaN where an optional one is empty."""
        if column not in self.texts:
            return np.full(len(self.lines), np.nan)
        texts = self.texts[column]
        try:
            numbers = np.array([float(text) if text else np.nan for text in texts])
        except ValueError:
            numbers = np.array([_number(text) for text in texts])
        empty = np.array([not text for text in texts])
        odd = np.array(["_" in text for text in texts])  # 1_000 is Python, not CSV
        self.refuse(
            odd | (~np.isfinite(numbers) & ~(empty & optional)),
            column,
            lambda row: (
                f"a finite number, got {shown(texts[row]) if texts[row] else 'nothing'}"
                + ("; write a decimal point" if "," in texts[row] else "")
            ),
        )
        return numbers

    def quantities(self, quantity: tuple[str, ...]) -> None:
        """Refuse a quantity we do not know."""
        unknown = {name for name in set(quantity) if name not in QUANTITIES}
        if unknown:
            self.tell(
                [name in unknown for name in quantity],
                "quantity",
                lambda row: _unknown(quantity[row]),
            )

    def places(self, position: np.ndarray, slant_range: np.ndarray) -> None:
        """Refuse half a position, a position beside a range, and a range below zero."""
        given = (~np.isnan(position)).sum(axis=1)
        for index, name in enumerate(POSITION):
            self.refuse(
                (given > 0) & np.isnan(position[:, index]),
                name,
                lambda _: f"all of {', '.join(POSITION)} or none of them, got nothing",
            )
        self.refuse(
            slant_range <= 0,
            "range_m",
            lambda row: (
                f"a positive slant range in m, got {self.texts['range_m'][row]}"
            ),
        )
        self.refuse(
            (given > 0) & ~np.isnan(slant_range),
            "range_m",
            lambda _: f"either range_m or {', '.join(POSITION)}, got both",
        )

    def duplicates(self, numbers: np.ndarray, *names: tuple[str, ...]) -> None:
        """Refuse two rows equal in every field."""
        # NaN is unequal to itself, so its bytes are compared instead (and -0 is 0).
        packed = [row.tobytes() for row in numbers + 0.0]
        first: dict[tuple[object, ...], int] = {}
        of = np.array(
            [
                first.setdefault(key, row)
                for row, key in enumerate(zip(packed, *names, strict=True))
            ]
        )
        self.refuse(
            self.sound & (of != np.arange(len(of))),
            "",
            lambda row: (
                "a new measurement, got a duplicate of line "
                f"{self.lines[of[row]]} in every column"
            ),
        )

    def refuse(
        self, bad: np.ndarray | list[bool], column: str, expected: Callable[[int], str]
    ) -> None:
        """Tell each bad row, with what its column should hold: it is left out."""
        self.tell(bad, column, lambda row: f"expected {expected(row)}")

    def tell(
        self, bad: np.ndarray | list[bool], column: str, said: Callable[[int], str]
    ) -> None:
        """Tell each bad row, in words of their own."""
        if not np.any(bad):
            return
        at = f", column {column}" if column else ""
        for row in map(int, np.flatnonzero(bad)):
            self.sound[row] = False
            where = f"{self.path}: line {self.lines[row]}{at}"
            self.faults.tell(InputError(f"{where}: {said(row)}"))


def _number(text: str) -> float:
    """Return what a field says; NaN for what is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _unknown(quantity: str) -> str:
    """Say what to write in place of an unknown quantity."""
    ours = our_name(quantity)
    advice = (
        f"; ours is {ours[0]}: multiply by {ours[1]:g}"
        if ours
        else nearest(quantity, QUANTITIES)
    )
    return (
        f"unknown quantity {shown(quantity)}{advice}; expected one of "
        f"{', '.join(QUANTITIES)}"
    )
