"""The rows of an observation file: what each column must hold."""

import numpy as np
from jaxtyping import Bool, Float

from jblast.observations.dialects.header import Header
from jblast.observations.dialects.table import Table
from jblast.observations.dialects.tidying import NA_SPELT, is_empty
from jblast.observations.faults import Faults
from jblast.observations.grouping import some_rows
from jblast.observations.places.degrees import places_of
from jblast.observations.rows.conversion import measured, told_columns
from jblast.observations.rows.fields import Fields
from jblast.observations.rows.measured import Measured
from jblast.observations.rows.samples import take_samples
from jblast.observations.table import (
    NAMED,
    NUMBERS,
    POSITION,
    SAMPLES,
    Observations,
)
from jblast.observations.times.clock_times import (
    COLUMN as VALUE_UTC,
    take_clock_times,
    told_clock_times,
)
from jblast.observations.understood import EmptySkipped
from jblast.quantities import ADDITIVE, DIRECTIONS, TIMED

AT_LEAST = ">"
"""Before a value: what was measured is no less."""


class Rows(Fields):
    """The body of a file by column, and the checks each column has to pass."""

    def __init__(
        self,
        table: Table,
        header: Header,
        faults: Faults,
        *,
        strict: bool,
        date: str | None = None,
        zone: str | None = None,
    ):
        self.strict = strict
        self.skipped: tuple[int, ...] = ()
        if not strict:
            self.skipped = _drop_empty(table)
        super().__init__(table, header, faults)
        self.date, self.zone = date, zone
        self.comments, self.found = table.comments, table.understood

    def observations(self) -> Observations:
        """Check every column and put the table together, of the rows that are sound."""
        sensor = self.text("sensor")
        self.refuse(
            [not name for name in sensor], "sensor", lambda _: "a name, got nothing"
        )
        held = measured(self, strict=self.strict)
        self.texts["quantity"] = list(held.quantity)
        dated = np.zeros(len(self.lines), bool)
        if VALUE_UTC in self.texts:
            dated = np.array([bool(text) for text in self.texts[VALUE_UTC]], bool)
        self.texts.setdefault("value", [""] * len(dated))
        timing = told_clock_times(self.texts.get(VALUE_UTC, []), self.date, self.zone)
        epoch = take_clock_times(self, self.date, self.zone)
        kind = np.array(held.quantity)
        value, sigma, bound = self.measurements(held, dated)
        slant_range = self.number("range_m")
        position, frame = places_of(self)
        self.places(position, slant_range)
        time = self.number("time_s")
        timed = np.isin(kind, TIMED)
        self.refuse(
            timed & np.isnan(time),
            "time_s",
            lambda row: f"the time at which {held.theirs[row]} was taken, got nothing",
        )
        self.refuse(
            ~timed & ~np.isnan(time),
            "time_s",
            lambda row: (
                f"nothing, as only {', '.join(TIMED)} take a time, got "
                f"{self.texts['time_s'][row]} for {held.theirs[row]}"
            ),
        )
        named = {name: self.text(name) for name in NAMED}
        numbers = np.column_stack([value, sigma, position, slant_range, time, bound])
        self.duplicates(numbers, sensor, held.quantity, *named.values())
        understood = [*self.found, *told_columns(self), *held.understood, *timing]
        if self.skipped:
            understood.append(EmptySkipped(self.skipped))
        whole = Observations(
            sensor=sensor,
            quantity=held.quantity,
            value=value,
            sigma=sigma,
            position=position,
            slant_range=slant_range,
            time=time,
            path=named["path"],
            shot=named["shot"],
            clock=named["clock"],
            record=named["record"] if any(named["record"]) else (),
            line=tuple(self.lines),
            source=self.path,
            comments=self.comments,
            lower_bound=bound if bound.any() else None,
            frame=frame,
            epoch=epoch,
            understood=tuple(understood),
        )
        if self.sound.all():
            return whole
        return some_rows(whole, np.flatnonzero(self.sound))

    def measurements(
        self, held: Measured, dated: Bool[np.ndarray, " row"]
    ) -> tuple[
        Float[np.ndarray, " row"], Float[np.ndarray, " row"], Bool[np.ndarray, " row"]
    ]:
        """Return values, sigmas and which are lower bounds, in our units.

        Args:
            held: What each row measured.
            dated: Rows whose value is seconds already, from a date and time.
        """
        kind = np.array(held.quantity)
        in_ln = ~np.isin(kind, ADDITIVE)
        sampled = take_samples(self, kind)
        bound = self.bounds(in_ln)
        raw = self.number("value", optional=False)
        value, sigma = held.converted(self.texts, raw, self.number("sigma"))
        value = np.where(dated, raw, value)
        texts = self.texts["value"]
        self.refuse(
            np.isinf(value) & np.isfinite(raw),
            "value",
            lambda row: f"a number that is finite in our unit, got {texts[row]}",
        )
        self.refuse(
            in_ln & (value <= 0),
            "value",
            lambda row: f"a positive {held.theirs[row]}, got {texts[row]}",
        )
        factor = held.factors()
        for name, most in DIRECTIONS.items():
            self.refuse(
                (kind == name) & (np.abs(value) > most),
                "value",
                lambda row, most=most: (
                    f"{held.theirs[row]} within {most / factor[row]:.6g} "
                    f"{'rad ' if factor[row] == 1 else ''}either way, got {texts[row]}"
                    + ("; are these degrees?" if factor[row] == 1 else "")
                ),
            )
        self.refuse(
            sigma <= 0,
            "sigma",
            lambda row: (
                "a positive number, or nothing for the law's scatter alone, got "
                + self.texts["sigma"][row]
            ),
        )
        return np.where(sampled, np.nan, value), sigma, bound

    def bounds(self, in_ln: Bool[np.ndarray, " row"]) -> Bool[np.ndarray, " row"]:
        """Take the marks of lower bounds off the values, and return which had one."""
        texts = self.texts["value"]
        written = "".join(texts)
        if AT_LEAST not in written and "<" not in written:
            return np.zeros(len(texts), bool)
        bound = np.array([text.startswith(AT_LEAST) for text in texts], bool)
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

    def places(self, position: np.ndarray, slant_range: np.ndarray) -> None:
        """Refuse half a position, a position beside a range, and a range below zero."""
        given = (~np.isnan(position)).sum(axis=1)
        for index, name in enumerate(POSITION):
            empty = np.array([not text for text in self.text(name)], bool)
            self.refuse(
                (given > 0) & np.isnan(position[:, index]) & empty,
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


def _drop_empty(table: Table) -> tuple[int, ...]:
    """Take out rows in which nothing was measured, and return where they stood.

    A time in `value_utc` is a value, too. Elsewhere a word for nothing is no field.
    """
    for index, name in enumerate(table.header):
        if name in NUMBERS or name == VALUE_UTC:
            column = table.columns[index]
            if not NA_SPELT.isdisjoint(column):
                table.columns[index] = ["" if is_empty(t) else t for t in column]
    values = [
        table.columns[table.header.index(name)]
        for name in ("value", VALUE_UTC)
        if name in table.header
    ]
    if "" not in values[0]:
        return ()
    empty = {row for row, at in enumerate(zip(*values, strict=True)) if not any(at)}
    if "quantity" in table.header:
        kinds = table.columns[table.header.index("quantity")]
        empty = {row for row in empty if kinds[row] != SAMPLES}
    lines = tuple(table.lines[row] for row in sorted(empty))
    table.drop_rows(empty)
    return lines
