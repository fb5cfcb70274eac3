"""The answer of `jblast calc`: rows of laws as text, CSV, document and figure."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from jblast.quantities import BY_VEHICLE, DIRECTIONS, FIREBALL_RADII
from jblast.report.choice import choice_reason
from jblast.report.numbers import (
    System,
    capitalised,
    joined,
    printed_number,
    quantity_words,
    significant,
    unit_for,
)
from jblast.report.output import PROBLEM
from jblast.report.view import (
    Block,
    Column,
    Facts,
    Lines,
    Table,
    View,
    commented,
    csv_text,
)
from jblast.results import ABSENT, AMONG, Document
from jblast.scene import Scene
from jblast.sensors.calculator import (
    Calculated,
    Calculation,
    Disagreement,
    Question,
    Recommended,
    Roots,
    calculate,
    charge_radius,
    disagreements,
    free_air_rows,
    only,
    recommended_by_row,
    recommended_root,
    roots,
    scene_path,
    with_other_burst,
)
from jblast.waves.height_of_burst import burst_notes
from jblast.waves.laws.kingery_bulmash import ground_factor
from jblast.waves.propagation import ambient
from jblast.waves.scaling import sachs_distance_factor, scaled_distance

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Numbers = float | tuple[float, ...]
"""One, or one a row."""
Flags = bool | tuple[bool, ...]
MAIN = "peak_overpressure_pa"
"""Quantity whose laws decide whether an answer with all quantities is valid anywhere:
light and sound in the ground have laws without limits."""
BY_RANGE = {
    "air_arrival_s": "arrival",
    MAIN: "peak",
    "positive_impulse_pa_s": "impulse",
    "positive_duration_s": "duration",
    "reflected_pressure_pa": "reflected",
    "reflected_impulse_pa_s": "refl. impulse",
}
"""Quantities of a table of several ranges, and the titles of their columns."""
MOST = 100
"""Rows of recommended values: the choice of laws takes about 20 ms a row."""
HEARING_PA = 20e-6
"""Reference of sound levels."""
NOT_DRAWN = ("flash_time_s", *FIREBALL_RADII, *DIRECTIONS, *BY_VEHICLE)
"""Quantities that are not of waves in the air or the ground."""
POINTS = 512
"""Points of a curve: about one a pixel of a panel."""
AROUND = 5.0
"""Extent of a panel on either side of nearly equal ranges, as a factor."""
MAIN_FACTS = ("as TNT", "burst", "air")
"""Inputs that are repeated below a single answer."""
OTHERS = "All laws with their ranges: --all-laws."
LEGEND = (
    "scatter: standard deviation of real blasts about the law. extrapolated: outside "
    f"the law's range of validity. dB: peak level re 20 µPa. {OTHERS}"
)
LEGEND_OF_RANGES = (
    "*: outside the law's range of validity. dB: peak level re 20 µPa. Other "
    "quantities: --quantity; all of them by all laws: --csv."
)
NOWHERE = "No law is valid here: all values are extrapolated."
EDGE = 1.15
"""Extent on either side of the outer ones of several ranges."""
STYLES = ("-", (0, (6, 2.5)), (0, (2.5, 1.5)))
"""Line styles in turn: a curve below another one shows through its gaps."""


@dataclass(frozen=True)
class CalcRow:
    """One value by one law.

    Attributes:
        quantity: The quantity; `range_m` or `charge_mass_kg` if that is the unknown.
        law: Name of the law.
        value: Value in SI; NaN if the law does not take the requested value.
        valid: Whether the law is valid there.
        range: Range of validity, as text.
        range_m: Slant range; NaN if it is the unknown.
        mass_kg: Mass of the explosive; NaN if it is the unknown.
        scatter: Standard deviation of real blasts about the value, in ln; NaN if
            unknown.
        disagrees: Whether valid laws disagree about the quantity.
    """

    quantity: str
    law: str
    value: float
    valid: bool
    range: str = ""
    range_m: float = math.nan
    mass_kg: float = math.nan
    scatter: float = math.nan
    disagrees: bool = False


def columns(rows: Sequence[CalcRow], system: System) -> dict[str, Column]:
    """Return all columns of a table of rows, each quantity in one unit."""
    values: dict[str, list[float]] = {}
    for row in rows:
        if not math.isnan(row.value):
            values.setdefault(row.quantity, []).append(abs(row.value))
    # the median: one extrapolated law far off would decide the unit of all
    units = {
        name: unit_for(name, float(np.median(some)), system=system)
        for name, some in values.items()
    }

    def value(row: CalcRow) -> str:
        if math.isnan(row.value):
            return "none"
        return significant(row.value / units[row.quantity].size, 4)

    def unit(row: CalcRow) -> str:
        return "" if math.isnan(row.value) else units[row.quantity].symbol

    def marks(row: CalcRow) -> str:
        outside = not row.valid and not math.isnan(row.value)
        return ", ".join(["extrapolated"] * outside + ["laws disagree"] * row.disagrees)

    return {
        "range": Column("range", lambda r: _shown("_m", r.range_m, system), right=True),
        "mass": Column("mass", lambda r: _shown("_kg", r.mass_kg, system), right=True),
        "quantity": Column("quantity", lambda r: quantity_words(r.quantity)),
        "value": Column("value", value, right=True),
        "unit": Column("", unit),
        "level": Column("dB", lambda r: level(r.quantity, r.value), right=True),
        "law": Column("law", lambda r: r.law),
        "scatter": Column("scatter", lambda r: _scatter(r.scatter), right=True),
        "marks": Column("", marks),
        "validity": Column("range of validity", lambda r: r.range),
    }


def _table(
    of: Mapping[str, Column], names: str, rows: Sequence[Any], title: str = ""
) -> Table:
    return Table([of[name] for name in names.split()], rows, title)


def by_range(rows: Sequence[CalcRow], names: Sequence[str], system: System) -> Table:
    """Return a table of recommended values, one row a range and mass."""
    together: dict[tuple[float, float], dict[str, CalcRow]] = {}
    for row in rows:
        together.setdefault((row.range_m, row.mass_kg), {})[row.quantity] = row

    def cell(of: Mapping[str, CalcRow], name: str) -> str:
        text = printed_number(name, of[name].value, system=system)
        return text + "*" * (not of[name].valid)

    def place(of: Mapping[str, CalcRow], column: Column) -> str:
        return column.cell(next(iter(of.values())))

    def decibels(of: Mapping[str, CalcRow], name: str) -> str:
        return level(name, of[name].value)

    shown = [
        Column(column.head, partial(place, column=column), right=True)
        for name, column in columns(rows, system).items()
        if name in names
    ]
    known = dict.fromkeys(row.quantity for row in rows)
    for name in BY_RANGE if {*known} <= {*BY_RANGE} else known:
        if name in known:
            head = BY_RANGE.get(name, quantity_words(name))
            shown.append(Column(head, partial(cell, name=name), right=True))
            shown.append(Column("dB", partial(decibels, name=name), right=True))
    return Table(shown, [*together.values()])


def level(quantity: str, value: float) -> str:
    """Return the peak level of a pressure in air [dB re 20 uPa]; "" for others."""
    is_sound = quantity.endswith("pressure_pa") and quantity != "dynamic_pressure_pa"
    if not (is_sound and value > 0.0):
        return ""
    return f"{20.0 * math.log10(value / HEARING_PA):.1f}"


def _shown(name: str, value: float, system: System) -> str:
    return "" if math.isnan(value) else printed_number(name, value, system=system)


def _scatter(sd: float) -> str:
    """Return a scatter [sd of ln] in per cent, or as a factor from 1 on; or "-"."""
    if not sd > 0.0:
        return "-"
    # exp(sd) is the factor of one standard deviation; below 1 per cent is read faster
    return f"{100.0 * sd:.2g} %" if sd < 1.0 else f"x {math.exp(sd):.2g}"


@dataclass(frozen=True)
class Calc:
    """Quantities at ranges from masses, or the range or mass that gives a value.

    Attributes:
        question: The question.
        quantity: The only quantity; "" for all.
        law: The only law; "" for all.
    """

    question: Question
    quantity: str = ""
    law: str = ""

    @cached_property
    def values(self) -> Calculation:
        """Values by quantity and law."""
        return self._of(self.question.scene)

    @cached_property
    def other(self) -> Calculation | None:
        """Values by the other curve set, where neither is that of the height."""
        if not _between_limits(self.question):
            return None
        return self._of(with_other_burst(self.question.scene))

    @cached_property
    def roots(self) -> dict[str, Roots]:
        """Ranges or masses that give the value, by law."""
        found = roots(self.question)
        return {name: of for name, of in found.items() if self.law in ("", name)}

    @cached_property
    def recommended(self) -> list[dict[str, Recommended]]:
        """Recommended values by row; in a table the first rows of the main ones."""
        if self.question.quantity:
            best = recommended_root(self.question, self.roots)
            return [{best.quantity: best}]
        values = self.values
        if self._is_table and not self.quantity:
            values = {name: values[name] for name in BY_RANGE if name in values}
        return recommended_by_row(self.question, values or self.values, MOST)

    @cached_property
    def apart(self) -> list[Disagreement]:
        """Quantities whose valid laws disagree."""
        is_inverse = self.question.quantity
        return [] if is_inverse else disagreements(self.question, self.values)

    @property
    def code(self) -> int:
        """4 if no law of the quantity, or of the peak pressure, is valid anywhere."""
        if self.question.quantity:
            return 0  # a value that no valid law takes is an error
        laws = [self.values[MAIN]] if MAIN in self.values else self.values.values()
        valid = [one.valid.any() for by_law in laws for one in by_law.values()]
        return 0 if any(valid) else PROBLEM

    @property
    def single(self) -> Recommended | None:
        """The answer to a question with one answer."""
        if self._is_table or not (self.question.quantity or self.quantity):
            return None
        return next(iter(self.recommended[0].values()))

    @property
    def _is_table(self) -> bool:
        return len(self.question.rows()[0]) > 1

    def _of(self, scene: Scene) -> Calculation:
        found = calculate(scene, *self.question.rows())
        return only(found, self.quantity, self.law)

    def _places(self) -> list[tuple[float, float]]:
        return [*zip(*(x.tolist() for x in self.question.rows()), strict=True)]

    def rows(self, *, both: bool = False) -> list[CalcRow]:
        """Return the values of all laws; `both` adds the other curve set."""
        unknown = inputs(self.question).unknown
        if unknown:
            return [
                CalcRow(unknown, name, root, valid, one.law.range)
                for name, one in self.roots.items()
                for root, valid in _pairs(one) or [(math.nan, False)]
            ]
        is_free = self.question.scene.charge.burst == "free-air"
        found = []
        for quantity, by_law in self.values.items():
            for name, one in by_law.items():
                sets = {name: one}
                # a law with one curve set has the same value for every burst
                if both and self.other is not None and one.two_sets:
                    beside = "surface" if is_free else "free-air"
                    sets[f"{name} ({beside})"] = self.other[quantity][name]
                found += [
                    CalcRow(quantity, law, *value, of.range, *place)
                    for law, of in sets.items()
                    for value, place in zip(_pairs(of), self._places(), strict=True)
                ]
        return found

    def best(self) -> list[CalcRow]:
        """Return the recommended values, row by row."""
        apart = {one.quantity for one in self.apart}
        places = self._places() or [(math.nan, math.nan)]
        return [
            CalcRow(
                quantity, one.law, one.value, one.valid, "", *place,
                one.scatter, quantity in apart,
            )
            for found, place in zip(self.recommended, places, strict=False)
            for quantity, one in found.items()
        ]  # fmt: skip

    def csv(self) -> str:
        """Return the values of all laws as CSV, below the inputs as comments."""
        question, rows = self.question, self.rows()
        names = "range_m mass_kg quantity law value valid"
        heads = {}
        if question.quantity:
            names, heads = "value law valid", {"value": rows[0].quantity}

        def raw(row: CalcRow, name: str) -> Any:
            value = getattr(row, name)
            return str(value).lower() if isinstance(value, bool) else value

        shown = [
            Column(heads.get(name, name), str, raw=partial(raw, name=name))
            for name in names.split()
        ]
        apart = [f"{a.quantity}: {_apart(a, question)}" for a in self.apart]
        facts = [f"{name}: {text}" for name, text in header(question)]
        table = Table(shown, [row for row in rows if not math.isnan(row.value)])
        comments = [title(question), *facts, *notes(question), *apart]
        return commented(comments) + csv_text(table)

    def view(self, *, all_laws: bool) -> View:
        """Return the recommended values as text, or those of all laws."""
        question, system = self.question, self.question.units
        rows = self.rows(both=True) if all_laws else self.best()
        of, name = columns(rows, system), title(question)
        places = "range mass " if len(question.charge_mass) > 1 else "range "
        places *= self._is_table
        apart = {one.quantity: _apart(one, question) for one in self.apart}
        blocks: list[Block] = [
            Facts(header(question), "Assumptions"),
            Lines("", [f"Note: {note}" for note in notes(question)]),
        ]
        if all_laws:
            shown = places + "law value unit level marks validity"
            for quantity in dict.fromkeys(row.quantity for row in rows):
                own = [row for row in rows if row.quantity == quantity]
                heading = capitalised(quantity_words(quantity))
                blocks.append(_table(of, shown, own, heading))
                blocks.append(Lines("", [apart.get(quantity, "")]))
        elif best := self.single:
            name = self._headline(best)
            facts = [fact for fact in header(question) if fact[0] in MAIN_FACTS]
            reason = f"{best.law}: {why_recommended(best)}".removesuffix(": ")
            inverse = [("for", title(question))] * bool(question.quantity)
            remarks = [("note", note) for note in notes(question)]
            blocks = [Facts([("law", reason), *inverse, *facts, *remarks])]
            blocks += [Lines("", [*apart.values(), OTHERS])]
        elif self._is_table and not self.quantity:
            left = len(self._places()) - len(self.recommended)
            more = f"and {left:,} more rows: --csv" if left else ""
            blocks = [
                by_range(rows, places.split(), system),
                Lines("", [more]),
                *blocks,
            ]
            blocks += [_laws(rows), Lines("", [LEGEND_OF_RANGES])]
        else:
            shown = (places or "quantity ") + "value unit level law scatter marks"
            name += f": {quantity_words(self.quantity)}" if self.quantity else ""
            blocks = [_table(of, shown, rows), *blocks]
            blocks += [
                Lines("", [*apart.values()] if places else []),
                Lines("", [LEGEND]),
            ]
        return View(name, blocks, problems=[NOWHERE] if self.code else [])

    def _headline(self, best: Recommended) -> str:
        """Return the answer to a single question, with its law and scatter."""
        question = self.question
        printed = partial(printed_number, system=question.units)
        start = f"{title(question)}: {quantity_words(best.quantity)}"
        if question.quantity:
            start = f"{printed(question.quantity, question.target)}:"
        # a curve that is not monotonic takes the value at several ranges
        solutions = best.solutions or (best.value,)
        value = joined([printed(best.quantity, one) for one in solutions])
        holds = "valid here" if best.valid else "outside its range"
        holds += f", scatter {_scatter(best.scatter)}" if best.scatter > 0.0 else ""
        if len(solutions) > 1:  # of different scatters
            value, holds = f"{len(solutions)} solutions, {value}", "valid at each"
        if decibels := level(best.quantity, best.value):
            value += f" ({decibels} dB)"
        return f"{start} {value}, {best.law} ({holds})"

    def document(self) -> "CalculatorAnswer | InverseAnswer":
        """Return the values of all laws as a document."""
        given = inputs(self.question)
        best = self.single
        entry = best and RecommendedEntry(best, why_recommended(best))
        if given.unknown and entry:
            by_law = {
                name: RootEntry(
                    # null in the JSON where a law does not take the value
                    *(one.best() or (None, False)),
                    tuple(Root(*pair) for pair in _pairs(one)),
                    one.law.range,
                )
                for name, one in self.roots.items()
            }
            return InverseAnswer(given, entry, {given.unknown: by_law})
        quantities = {
            quantity: {name: self._entry(quantity, name) for name in by_law}
            for quantity, by_law in self.values.items()
        }
        apart = tuple(
            DisagreementEntry(one, one.choice.method if one.choice else "", _why(one))
            for one in self.apart
        )
        return CalculatorAnswer(given, quantities, entry, apart)

    def _entry(self, quantity: str, name: str) -> "LawEntry":
        one, beside = self.values[quantity][name], None
        if self.other is not None and one.two_sets:
            beside = LawValue(*_value(self.other[quantity][name]))
        return LawEntry(*_value(one), one.range, beside)

    def figure(self) -> "Figure":
        """Draw the laws within their ranges; requested ranges and values are marked."""
        question, best = self.question, self.best()
        ranges, masses = question.slant_range, question.charge_mass
        place = "range_m" if masses else "mass_kg"
        if question.quantity:
            (one,) = self.recommended[0].values()
            solutions = one.solutions or (one.value,)
            answer = {"quantity": question.quantity, "value": question.target}
            best = [replace(best[0], **answer, **{place: at}) for at in solutions]
            ranges, masses = ranges or solutions, masses or solutions
        if place == "range_m":
            # inside the charge there is no shock in air, and no law applies
            at = _around(ranges, AROUND, 1.01 * float(charge_radius(masses[0])))
            found = calculate(question.scene, at, masses[0])
        else:
            # Z goes with the cube root of the mass: the cube gives the same extent
            at = _around(masses, AROUND**3)
            found = calculate(question.scene, ranges[0], at)
        found = only(found, question.quantity or self.quantity, self.law)
        return _figure(question, place, at, found, best)


def _laws(rows: Sequence[CalcRow]) -> Facts:
    """Return the recommended laws of a table, each with its quantities."""
    laws: dict[str, dict[str, None]] = {}
    for row in rows:
        laws.setdefault(row.quantity, {})[row.law] = None
    found: dict[str, list[str]] = {}
    for quantity, names in laws.items():
        found.setdefault(", ".join(names), []).append(quantity_words(quantity))
    return Facts([(law, ", ".join(words)) for law, words in found.items()], "Laws")


def _pairs(one: Calculated | Roots) -> list[tuple[float, bool]]:
    return [*zip(one.value.tolist(), one.valid.tolist(), strict=True)]


def title(question: Question) -> str:
    """Return the question as a title."""
    ranges, masses = (
        _values(name, x, question.units)
        for name, x in (("_m", question.slant_range), ("_kg", question.charge_mass))
    )
    explosive = question.scene.charge.explosive
    if not question.quantity:
        return f"{masses} of {explosive} at {ranges}"
    target = printed_number(question.quantity, question.target, system=question.units)
    words = quantity_words(question.quantity)
    effect = f"{'an' if words[0] in 'aeiou' else 'a'} {words} of {target}"
    if masses:
        return f"Range at which {masses} of {explosive} produces {effect}"
    return f"Mass of {explosive} that produces {effect} at {ranges}"


def _values(name: str, values: Sequence[float], system: System) -> str:
    # three values fit a title of one line; more are a span with their number
    if len(values) < 4:
        return ", ".join(printed_number(name, v, system=system) for v in values)
    first, last = (_shown(name, v, system) for v in (min(values), max(values)))
    return f"{first} to {last} ({len(values)} values)"


def header(question: Question) -> list[tuple[str, str]]:
    """Return the inputs as pairs of label and text."""
    given, system = inputs(question), question.units

    def default(name: str, text: str = "default") -> str:
        return f" ({text})" * (name in question.defaults)

    metre, kilogram = (unit_for(name, 1.0, system=system) for name in ("_m", "_kg"))
    # Z is a length over the cube root of a mass, so both units convert it
    z = _span(given.scaled_distance_m_kg13, kilogram.size ** (1 / 3) / metre.size)
    radius = _span(given.charge_radius_m, 1.0 / metre.size)
    factor, height = given.tnt_factor, given.height_m
    tnt = f"{factor.pressure:g} for pressure and time, {factor.impulse:g} for impulse "
    tnt += "and duration, times the mass"
    ratio = f"{_span(given.ground_factor)} times this mass in free air gives the same "
    ratio += "pressure"
    burst = question.scene.charge.burst or "by the height of burst, for each range"
    burst += default("burst")
    if height:
        at = printed_number("_m", abs(height), system=system)
        burst += f", {at} {'above ground' if height > 0 else 'deep'}"
    ground = f"P wave {printed_number('_m_s', given.p_speed_m_s, system=system)}"
    facts = {
        # both factors of TNT are 1: the line would only repeat the mass
        "as TNT": tnt if given.explosive != "TNT" else "",
        "scaled distance": z and f"{z} {metre.symbol}/{kilogram.symbol}^(1/3)",
        "charge radius": z and f"{radius} {metre.symbol} (TNT at 1630 kg/m3)",
        "ground factor": z and ratio if given.burst == "surface" else "",
        "burst": burst,
        "air": _air(given, system) + default("air", "default: at sea level"),
        "ground": ground + default("ground", "default: granite"),
    }
    return [(name, text) for name, text in facts.items() if text]


def _air(given: "Inputs", system: System) -> str:
    printed = partial(printed_number, digits=6, system=system)
    kelvin = given.temperature_k
    # Fahrenheit has an offset, so it is no entry of the units with a size
    is_us = system == "us"
    words = [
        f"{kelvin * 1.8 - 459.67:.2f} °F" if is_us else f"{kelvin:.2f} K",
        printed("_pa", given.pressure_pa),
        f"humidity {given.relative_humidity:g}" if given.relative_humidity else "dry",
        f"sound {printed('_m_s', given.sound_speed_m_s, digits=5)}",
    ]
    # temperature and pressure follow from the altitude, which is therefore first
    if given.altitude_m is not None:
        words.insert(0, f"standard atmosphere at {printed('_m', given.altitude_m)}")
    return ", ".join(words)


def _span(numbers: Any, scale: float = 1.0) -> str:
    if numbers is None:
        return ""
    values = scale * np.atleast_1d(numbers)
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    # rows that agree to four digits are printed as one number
    return low if low == high else f"{low} to {high}"


def notes(question: Question) -> list[str]:
    """Return limitations of the answer that its numbers do not show, as sentences."""
    charge = question.scene.charge
    low, high = _scaled_heights(question)
    # neither curve set has a depth: a buried charge gets those of its burst
    if high < 0.0:
        return [
            f"the charge is buried: the {charge.burst} curves were used; ford_2021 "
            "alone takes the depth into account"
        ]
    # the range of an inverse question is unknown, and with it the scaled height that
    # would decide between the curve sets
    if high > 0.0 and question.quantity:
        return [
            f"the {charge.burst} curves were used; a burst above the ground lies "
            "between surface and free-air until its reflection arrives after the "
            "positive phase; compare with the other --burst"
        ]
    if not high > 0.0:
        return []
    found = burst_notes(charge, (low, high), free_air_rows(question), "range")
    found[-1] += "; sensors are assumed as low as the range allows"
    if _between_limits(question):
        found[-1] += "; compare with the other --burst"
    return found


def _between_limits(question: Question) -> bool:
    """Return whether some row is neither a surface burst nor a free-air burst."""
    _, high = _scaled_heights(question)
    # an inverse question has no rows: its root may lie on either side of the limit
    is_inverse = question.quantity
    return not is_inverse and high > 0.0 and not free_air_rows(question).all()


def _scaled_heights(question: Question) -> tuple[float, float]:
    """Return the smallest and the largest scaled height of burst [m/kg^(1/3)]."""
    height = question.scene.charge.up.item()
    # without a mass there is no scaling, and callers use the sign alone
    if not (height and question.charge_mass):
        return height, height
    factor = float(question.scene.charge.tnt_factor_for(MAIN))
    pressure = scene_path(question.scene).ambient_pressure.item()
    masses = factor * np.asarray(question.charge_mass)
    heights = height / np.asarray(sachs_distance_factor(masses, pressure))
    return float(heights.min()), float(heights.max())


def _apart(found: Disagreement, question: Question) -> str:
    """Return a sentence on valid laws that disagree, with the recommended one."""
    where, rows = "", len(question.rows()[0])
    # the laws may disagree at many rows: one sentence has their number and the worst
    if rows > 1:
        place = printed_number("_m", found.range_m, system=question.units)
        where = f" at {found.rows} of {rows} rows, most at {place}"
    taken = _why(found)
    if found.choice:
        taken = f"recommended: {found.choice.method}: {taken}"
    return (
        f"valid laws disagree{where}: {found.high} is {found.ratio:.2f} times "
        f"{found.low}; their scatter explains a factor of {found.expected:.2f}; "
        f"{taken}"
    )


def why_recommended(recommended: Recommended) -> str:
    """Return the reason for the law of an answer; "" if there is no other."""
    if recommended.is_nearest:
        return "nearest to the median of the laws that give this value and are valid"
    return choice_reason(recommended.choice) if recommended.choice else ""


def _why(found: Disagreement) -> str:
    """Return the reason for one of two laws that disagree, or for neither."""
    if found.choice is None:
        return "no measurement shows which of them is nearer to real blasts"
    return choice_reason(found.choice)


@dataclass(frozen=True)
class TntFactor:
    """TNT-equivalent mass of an explosive over its mass.

    Attributes:
        pressure: Factor for pressures and times.
        impulse: Factor for impulses and durations.
    """

    pressure: float
    impulse: float


@dataclass(frozen=True)
class Inputs:
    """Inputs and defaults of a calculation.

    Attributes:
        mass_kg: Mass of the explosive, by row; absent if it is the unknown.
        range_m: Slant range, by row; absent if it is the unknown.
        unknown: The unknown, range or mass; absent if there is none.
        scaled_distance_m_kg13: Sachs-scaled distance, for pressures, by row.
        charge_radius_m: Radius of the charge as a sphere of TNT, by row.
        ground_factor: Mass in free air over mass on the ground, for the same pressure,
            by row.
        measured: The measured value, by quantity.
        explosive: Name of the explosive.
        tnt_factor: TNT-equivalent mass over the mass.
        burst: The curve set, or "by height" if it differs between rows.
        height_m: Height of burst; negative is buried.
        temperature_k: Temperature of the air at the charge.
        pressure_pa: Pressure of the air at the charge.
        relative_humidity: Relative humidity of the air, 0 to 1.
        altitude_m: Altitude of the standard atmosphere; null if none was requested.
        sound_speed_m_s: Sound speed in the air at the charge.
        p_speed_m_s: P-wave speed of the ground.
        defaults: Inputs left at their defaults: air, burst, explosive, ground.
        notes: Limitations that the numbers do not show, as sentences.
    """

    mass_kg: Numbers | None = field(metadata=ABSENT)
    range_m: Numbers | None = field(metadata=ABSENT)
    unknown: Literal["range_m", "charge_mass_kg"] | None = field(
        metadata={"key": "asked"} | ABSENT  # a JSON key
    )
    scaled_distance_m_kg13: Numbers | None = field(metadata=ABSENT)
    charge_radius_m: Numbers | None = field(metadata=ABSENT)
    ground_factor: Numbers | None = field(metadata=ABSENT)
    measured: Mapping[str, float] = field(metadata=AMONG)
    explosive: str
    tnt_factor: TntFactor
    burst: str
    height_m: float
    temperature_k: float
    pressure_pa: float
    relative_humidity: float
    altitude_m: float | None
    sound_speed_m_s: float
    p_speed_m_s: float
    defaults: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class LawValue:
    """Value of a law; a list by row if there are several rows.

    Attributes:
        value: Value in the unit of the quantity.
        valid: Whether the law is valid there.
    """

    value: Numbers
    valid: Flags


@dataclass(frozen=True)
class LawEntry:
    """The value of one quantity by one law.

    Attributes:
        value: Value in the unit of the quantity, by row.
        valid: Whether the law is valid there, by row.
        range: Range of validity, as text.
        other_burst: Value by the other curve set; absent if not relevant.
    """

    value: Numbers
    valid: Flags
    range: str
    other_burst: LawValue | None = field(default=None, metadata=ABSENT)


@dataclass(frozen=True)
class Root:
    """A range or a mass at which a law takes the value.

    Attributes:
        value: Range or mass in SI units.
        valid: Whether the law is valid there, outside the charge.
    """

    value: float
    valid: bool


@dataclass(frozen=True)
class RootEntry:
    """Ranges or masses at which a law takes the value.

    Attributes:
        value: The first root at which the law is valid, else the first; null if none.
        valid: Whether the law is valid there.
        roots: All roots, ascending.
        range: Range of validity, as text.
    """

    value: float | None
    valid: bool
    roots: tuple[Root, ...]
    range: str


@dataclass(frozen=True)
class RecommendedEntry:
    """The recommended answer to one question.

    Attributes:
        recommended: Value and law.
        reason: Reason for this law; "" if there is no other.
    """

    recommended: Recommended = field(metadata=AMONG)
    reason: str


@dataclass(frozen=True)
class DisagreementEntry:
    """Two laws of one quantity that are both valid at a range and disagree there.

    Attributes:
        found: The two laws and the size of the disagreement.
        taken: The recommended law; "" if none can be recommended.
        reason: Reason for the recommendation.
    """

    found: Disagreement = field(metadata=AMONG)
    taken: str
    reason: str


@dataclass(frozen=True)
class CalculatorAnswer(Document):
    """Every requested quantity by every law.

    Attributes:
        inputs: Inputs and defaults.
        quantities: Values by quantity and law.
        recommended: The recommended answer for one quantity at one range; else absent.
        disagreements: Quantities whose valid laws disagree.
    """

    inputs: Inputs
    quantities: Mapping[str, Mapping[str, LawEntry]]
    recommended: RecommendedEntry | None = field(metadata=ABSENT)
    disagreements: tuple[DisagreementEntry, ...]


@dataclass(frozen=True)
class InverseAnswer(Document):
    """The range or the mass at which a quantity takes a value.

    Attributes:
        inputs: Inputs and defaults.
        recommended: The recommended answer.
        quantities: The unknown, a range or a mass, by law.
    """

    inputs: Inputs
    recommended: RecommendedEntry
    quantities: Mapping[str, Mapping[str, RootEntry]]


def inputs(question: Question) -> Inputs:
    """Return inputs and defaults by name, in SI units."""
    scene = question.scene
    charge, air = scene.charge, scene.air
    path = scene_path(scene)
    temperature, _ = ambient(air)
    # one factor only: scaled distances are printed for pressures, and impulses have a
    # factor of their own
    factor = float(charge.tnt_factor_for(MAIN))
    # an inverse question has one given number, and its unknown depends on the law
    mass = distance = unknown = z = radius = ground = None
    if question.quantity and question.charge_mass:
        mass, unknown = question.charge_mass[0], "range_m"
    elif question.quantity:
        distance, unknown = question.slant_range[0], "charge_mass_kg"
    else:
        ranges, masses = question.rows()
        mass, distance = _one_or_all(masses), _one_or_all(ranges)
        of = scaled_distance(ranges, factor * masses, path.ambient_pressure)
        z, ground = _one_or_all(of), _one_or_all(ground_factor(of, 1.0))
        radius = _one_or_all(charge_radius(masses))
    return Inputs(
        mass_kg=mass,
        range_m=distance,
        unknown=unknown,
        scaled_distance_m_kg13=z,
        charge_radius_m=radius,
        ground_factor=ground,
        measured={question.quantity: question.target} if question.quantity else {},
        explosive=charge.explosive,
        tnt_factor=TntFactor(
            pressure=factor,
            impulse=float(charge.tnt_factor_for("positive_impulse_pa_s")),
        ),
        burst=charge.burst or "by height",
        height_m=charge.up.item(),
        temperature_k=temperature.item(),
        pressure_pa=path.ambient_pressure.item(),
        relative_humidity=air.relative_humidity.item(),
        altitude_m=None if air.altitude is None else air.altitude.item(),
        sound_speed_m_s=path.sound_speed.item(),
        p_speed_m_s=path.p_speed.item(),
        defaults=tuple(sorted(question.defaults)),
        notes=tuple(notes(question)),
    )


def _one_or_all(of_rows: Any) -> Any:
    values = np.asarray(of_rows)
    # one row is a plain number in the JSON, several rows are a list
    return values[0].item() if len(values) == 1 else tuple(values.tolist())


def _value(of_law: Calculated) -> tuple[Numbers, Flags]:
    return _one_or_all(of_law.value), _one_or_all(of_law.valid)


def _around(values: Sequence[float], factor: float, least: float = 0.0) -> np.ndarray:
    """Return values about those of a question, by a factor if they are nearly equal."""
    low, high = min(values), max(values)
    factor = factor if high < 1.5 * low else EDGE
    return np.geomspace(max(low / factor, least), high * factor, POINTS)


def _figure(
    question: Question,
    place: str,
    x: np.ndarray,
    found: Calculation,
    best: Sequence[CalcRow],
) -> "Figure":
    """Draw laws within their ranges, one panel a quantity, and mark the answers.

    Args:
        question: The question.
        place: Abscissa: "range_m" or "mass_kg".
        x: Its values.
        found: Values of the laws there.
        best: The answers.
    """
    from jblast.report.figures import COLOURS, INK, MUTED, new_figure

    holding = {
        quantity: {law: one for law, one in by_law.items() if one.valid.any()}
        for quantity, by_law in found.items()
        if len(found) == 1 or quantity not in NOT_DRAWN
    }
    # without a valid law the axes are empty but for the answers
    panels = {q: by_law for q, by_law in holding.items() if by_law} or holding
    laws = list(dict.fromkeys(law for by_law in panels.values() for law in by_law))
    looks = {
        law: {"color": COLOURS[i % len(COLOURS)], "ls": STYLES[i // len(COLOURS) % 3]}
        for i, law in enumerate(laws)
    }
    columns = 1 if len(panels) == 1 else 2 if len(panels) <= 8 else 3
    rows = -(-len(panels) // columns)
    figure = new_figure(8.0 if columns == 1 else 6.0 * columns, 3.7 * rows + 1.2)
    grid = list(figure.subplots(rows, columns, squeeze=False).flat)
    across = unit_for(place, 1.0, system=question.units)
    for axes, (quantity, by_law) in zip(grid, panels.items(), strict=False):
        own = [row for row in best if row.quantity == quantity]
        chosen = list(dict.fromkeys(row.law for row in own))
        values = [one.value[one.valid] for one in by_law.values()]
        seen = np.abs(np.concatenate([*values, [row.value for row in own], [0.0]]))
        unit = unit_for(quantity, float(np.median(seen)), system=question.units)
        for at in {getattr(row, place) for row in best}:
            axes.axvline(at / across.size, color=MUTED, linewidth=0.8, zorder=1)
        for law, one in by_law.items():
            # NaN ends the line at the limit of validity
            value = np.where(one.valid, one.value / unit.size, np.nan)
            look = looks[law] | {"lw": 1.2, "label": law, "zorder": 3}
            if law in chosen:
                look |= {"color": INK, "lw": 3.0, "label": f"{law} (recommended)"}
                look |= {"ls": STYLES[min(chosen.index(law), 2)], "zorder": 2}
            axes.plot(x / across.size, value, **look)
        for row in own:
            at = getattr(row, place) / across.size
            # open: extrapolated
            face = INK if row.valid else "white"
            axes.plot([at], [row.value / unit.size], "o", c=INK, mfc=face, zorder=5)
        _frame(axes, quantity, x / across.size)
        axes.set_ylabel(unit.symbol)
        words = "slant range" if place == "range_m" else "charge mass"
        axes.set_xlabel(f"{words} ({across.symbol})")
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    burst = question.scene.charge.burst or "surface or free-air"
    figure.suptitle(f"{title(question)}, {burst} burst", x=0.01, ha="left", fontsize=13)
    return figure


def _frame(axes: "Axes", quantity: str, x: np.ndarray) -> None:
    from jblast.report.figures import log_ticks, quiet, titled

    quiet(axes)
    axes.set(xscale="log", xlim=(x[0], x[-1]))
    lines = [np.asarray(line.get_ydata(), float) for line in axes.get_lines()]
    drawn = np.concatenate([y for y in lines if y.size != 2] or [np.ones(1)])
    low, high = np.nanmin(drawn), np.nanmax(drawn)
    # a quantity that is 0 or negative somewhere has no logarithm
    if low > 0.0:
        axes.set(yscale="log", ylim=(low / 1.3, high * 1.3))
        log_ticks(axes.yaxis, axes.get_ylim())
    log_ticks(axes.xaxis, axes.get_xlim())
    titled(axes, capitalised(quantity_words(quantity)))
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, frameon=False, loc="best")
