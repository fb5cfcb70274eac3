"""The answer of `jblast calc`: rows of laws as text, CSV, document and figure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from jblast.files import table_text
from jblast.report.choice import choice_reason
from jblast.report.colours import COLOURS, INK, MUTED
from jblast.report.messages import sentence
from jblast.report.numbers import (
    System,
    Unit,
    capitalised,
    joined,
    printed_number,
    quantity_words,
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
)
from jblast.results import ABSENT, AMONG, Document, filled
from jblast.sensors.calculator import (
    Calculated,
    Calculation,
    Disagreement,
    Question,
    Recommended,
    Roots,
    Rows,
    calculate,
    calculated,
    charge_radius,
    disagreements,
    only,
    recommended_by_row,
    recommended_root,
    roots,
)
from jblast.types import in_numpy
from jblast.waves.height_of_burst import burst_notes
from jblast.waves.laws.kingery_bulmash import ground_factor
from jblast.waves.propagation import ambient, sound_speed_of
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
MAIN_HEADS = {
    "air_arrival_s": "arrival",
    MAIN: "peak",
    "positive_impulse_pa_s": "impulse",
    "positive_duration_s": "duration",
    "reflected_pressure_pa": "reflected",
    "reflected_impulse_pa_s": "refl. impulse",
}
"""Quantities of a table of several ranges and of a figure, and the titles of their
columns."""
MOST = 100
"""Rows of recommended values: the choice of laws takes about 1 ms a row."""
HEARING_PA = 20e-6
"""Reference of sound levels."""
POINTS, AROUND = 512, 3.0
"""Points of a curve, about one a pixel of a panel, and its extent on either side of
the answers, as a factor."""
LEGEND = (
    "*: extrapolated, outside the law's range of validity. scatter: standard deviation "
    "of real blasts about the law. dB: peak level re 20 µPa. All laws with their "
    "ranges: --all-laws."
)
NOWHERE = "No law is valid here: all values are extrapolated."
NEAREST = "nearest to the median of the laws that give this value and are valid"
UNDECIDED = "no measurement shows which of them is nearer to real blasts"
APART = (
    "{quantity:quantity}: valid laws disagree at {rows:row}: {high} is {ratio:.2f} "
    "times {low}; their scatter explains a factor of {expected:.2f}; {taken}"
)


class CalcRow(NamedTuple):
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
    """

    quantity: str
    law: str
    value: float
    valid: bool
    range: str = ""
    range_m: float = math.nan
    mass_kg: float = math.nan
    scatter: float = math.nan


def columns(system: System) -> dict[str, Column]:
    """Return the columns of a table of rows."""

    def printed(name: str, value: float) -> str:
        return printed_number(name, value, system=system)

    def value(row: CalcRow) -> str:
        if math.isnan(row.value):
            return "none"
        return printed(row.quantity, row.value) + "*" * (not row.valid)

    return {
        "range": Column("range", lambda row: printed("_m", row.range_m), right=True),
        "mass": Column("mass", lambda row: printed("_kg", row.mass_kg), right=True),
        "quantity": Column("quantity", lambda row: quantity_words(row.quantity)),
        "value": Column("value", value, right=True),
        "level": Column("dB", lambda row: level(row.quantity, row.value), right=True),
        "law": Column("law", lambda row: row.law),
        "scatter": Column("scatter", lambda row: scatter(row.scatter), right=True),
        "validity": Column("range of validity", lambda row: row.range),
    }


def across(quantity: str, head: str, column: Column) -> Column:
    """Return a column of a table whose rows have several quantities."""
    return Column(head, lambda by_name: column.cell(by_name[quantity]), right=True)


def level(quantity: str, value: float) -> str:
    """Return the peak level of a pressure in air [dB re 20 uPa]; "" for others."""
    is_sound = quantity.endswith("pressure_pa") and quantity != "dynamic_pressure_pa"
    if not (is_sound and value > 0.0):
        return ""
    return f"{20.0 * math.log10(value / HEARING_PA):.1f}"


def scatter(sd: float) -> str:
    """Return a scatter [sd of ln] in per cent, or as a factor from 1 on."""
    if not sd > 0.0:
        return ""
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
    def places(self) -> Rows:
        """Ranges and masses."""
        return self.question.rows()

    @cached_property
    def values(self) -> Calculation:
        """Values by quantity and law."""
        return only(calculated(self.places), self.quantity, self.law)

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
            values = {name: values[name] for name in MAIN_HEADS if name in values}
        return recommended_by_row(self.places, values or self.values, MOST)

    @cached_property
    def apart(self) -> "tuple[DisagreementEntry, ...]":
        """Quantities whose valid laws disagree."""
        is_inverse = self.question.quantity
        return (
            ()
            if is_inverse
            else tuple(
                DisagreementEntry(one, one.choice.method, choice_reason(one.choice))
                if one.choice
                else DisagreementEntry(one, "", UNDECIDED)
                for one in disagreements(self.places, self.values)
            )
        )

    @property
    def code(self) -> int:
        """4 if no law of the quantity, or of the peak pressure, is valid anywhere."""
        if self.question.quantity:
            return 0  # a value that no valid law takes is an error
        laws = [self.values[MAIN]] if MAIN in self.values else self.values.values()
        valid = [one.valid.any() for by_law in laws for one in by_law.values()]
        return 0 if any(valid) else PROBLEM

    @property
    def single(self) -> "RecommendedEntry | None":
        """The answer to a question with one answer, and its reason."""
        if self._is_table or not (self.question.quantity or self.quantity):
            return None
        (best,) = self.recommended[0].values()
        reason = choice_reason(best.choice) if best.choice else ""
        return RecommendedEntry(best, NEAREST if best.is_nearest else reason)

    @property
    def _is_table(self) -> bool:
        return len(self.places.slant_range) > 1

    def _places(self) -> list[tuple[float, float]]:
        columns = self.places.slant_range, self.places.charge_mass
        return [*zip(*(x.tolist() for x in columns), strict=True)]

    def rows(self) -> list[CalcRow]:
        """Return the values of all laws."""
        if unknown := self.question.unknown:
            return [
                CalcRow(unknown, name, *root, one.law.range)
                for name, one in self.roots.items()
                for root in _pairs(one) or [(math.nan, False)]
            ]
        return [
            CalcRow(quantity, name, *value, one.range, *place)
            for quantity, by_law in self.values.items()
            for name, one in by_law.items()
            for value, place in zip(_pairs(one), self._places(), strict=True)
        ]

    def best(self) -> list[dict[str, CalcRow]]:
        """Return the recommended values by quantity, row by row."""
        places = self._places() or [(math.nan, math.nan)]
        return [
            {
                quantity: filled(CalcRow, one, range_m=distance, mass_kg=mass)
                for quantity, one in found.items()
            }
            for (distance, mass), found in zip(places, self.recommended, strict=False)
        ]

    def csv(self) -> str:
        """Return the values of all laws as CSV, below the inputs as comments."""
        unknown = self.question.unknown
        names = ["range_m", "mass_kg", "quantity", "law", "value", "valid"]
        names = ["value", "law", "valid"] if unknown else names
        heads = [unknown, *names[1:]] if unknown else names
        facts = [f"{name}: {text}" for name, text in header(self.question)]
        apart = map(_apart, self.apart)
        comments = [title(self.question), *facts, *notes(self.question), *apart]
        rows = [
            row._asdict() | {"valid": str(row.valid).lower()}
            for row in self.rows()
            if not math.isnan(row.value)
        ]
        cells = [[row[name] for name in names] for row in rows]
        return table_text([heads, *cells], comments)

    def view(self, *, all_laws: bool) -> View:
        """Return the recommended values as text, or those of all laws."""
        question = self.question
        of, name, entry = columns(question.units), title(question), self.single
        shown = [of["range"]] * (len(question.slant_range) > 1)
        shown += [of["mass"]] * (len(question.charge_mass) > 1)
        by_law = [of[one] for one in ("value", "level", "law", "scatter", "validity")]
        blocks: list[Block] = []
        if all_laws:
            groups: dict[str, list[CalcRow]] = {}
            for row in self.rows():
                groups.setdefault(row.quantity, []).append(row)
            blocks = [
                Table([*shown, *by_law], rows, capitalised(quantity_words(quantity)))
                for quantity, rows in groups.items()
            ]
        elif entry:
            name = self._headline(entry.recommended)
            reason = f"{entry.recommended.law}: {entry.reason}"
            blocks = [Facts([("law", reason.removesuffix(": "))])]
        elif self._is_table and not self.quantity:
            blocks = self._by_range(shown, of)
        else:
            rows = [row for found in self.best() for row in found.values()]
            blocks = [Table([*shown, of["quantity"], *by_law], rows)]
        apart = [_apart(one) for one in self.apart]
        if not (all_laws or self.quantity):
            words = [quantity_words(one.found.quantity) for one in self.apart]
            apart = [f"Valid laws disagree on {joined(words)}."] * bool(words)
        return View(
            name,
            [
                *blocks,
                Facts(header(question), "Assumptions"),
                Lines("", [f"Note: {note}" for note in notes(question)]),
                Lines("", apart),
                Lines("", [LEGEND]),
            ],
            problems=[NOWHERE] if self.code else [],
        )

    def _by_range(self, shown: list[Column], of: Mapping[str, Column]) -> list[Block]:
        """Return a table of recommended values, one row a range and mass."""
        rows = self.best()
        known = list(rows[0])
        table = [across(known[0], column.head, column) for column in shown]
        for name in known:
            head = MAIN_HEADS.get(name, quantity_words(name))
            table += [across(name, head, of["value"]), across(name, "dB", of["level"])]
        laws = [
            (quantity_words(name), joined([*dict.fromkeys(r[name].law for r in rows)]))
            for name in known
        ]
        left = len(self._places()) - len(rows)
        more = f"and {left:,} more rows: --csv" if left else ""
        return [Table(table, rows, caption=more), Facts(laws, "Laws")]

    def _headline(self, best: Recommended) -> str:
        """Return the answer to a single question, with its law and scatter."""
        # a curve that is not monotonic takes the value at several ranges
        value = joined(
            [
                printed_number(best.quantity, one, system=self.question.units)
                for one in best.solutions or (best.value,)
            ]
        )
        decibels = level(best.quantity, best.value)
        holds = ["valid" if best.valid else "extrapolated"]
        # several solutions have different scatters
        if best.scatter > 0.0 and len(best.solutions or ()) < 2:
            holds.append(f"scatter {scatter(best.scatter)}")
        return (
            f"{title(self.question)}: {quantity_words(best.quantity)} {value}"
            f"{f' ({decibels} dB)' if decibels else ''}, {best.law} "
            f"({', '.join(holds)})"
        )

    def document(self) -> "CalculatorAnswer | InverseAnswer":
        """Return the values of all laws as a document."""
        given, entry = inputs(self.question), self.single
        if given.unknown and entry:
            by_law = {
                name: LawEntry(
                    # null in the JSON where a law does not take the value
                    *(one.best() or (math.nan, False)),
                    tuple(LawValue(*root) for root in _pairs(one)),
                    one.law.range,
                )
                for name, one in self.roots.items()
            }
            return InverseAnswer(given, entry, {given.unknown: by_law})
        quantities = {
            quantity: {
                name: LawEntry(*_by_row(one), None, one.range)
                for name, one in by_law.items()
            }
            for quantity, by_law in self.values.items()
        }
        return CalculatorAnswer(given, quantities, entry, self.apart)

    def figure(self) -> "Figure":
        """Draw the laws within their ranges; requested ranges and values are marked."""
        question = self.question
        place = "range_m" if question.charge_mass else "mass_kg"
        answers = [row for found in self.best() for row in found.values()]
        if question.quantity:
            (best,) = self.recommended[0].values()
            marked: dict[str, Any] = {
                "quantity": question.quantity,
                "value": question.target,
            }
            answers = [
                answers[0]._replace(**marked | {place: at})
                for at in best.solutions or (best.value,)
            ]
        seen = [getattr(row, place) for row in answers]
        at = np.geomspace(min(seen) / AROUND, max(seen) * AROUND, POINTS)
        given = {
            "range_m": question.slant_range[:1],
            "mass_kg": question.charge_mass[:1],
        }
        found = calculate(question.scene, *(given | {place: at}).values())
        found = only(found, question.quantity or self.quantity, self.law)
        return _figure(question, place, at, found, answers)


def _apart(entry: "DisagreementEntry") -> str:
    taken = f"recommended: {entry.taken}: {entry.reason}"
    taken = taken if entry.taken else entry.reason
    return capitalised(sentence(APART, entry.found, taken=taken))


def _pairs(one: Calculated | Roots) -> list[tuple[float, bool]]:
    return [*zip(one.value.tolist(), one.valid.tolist(), strict=True)]


def title(question: Question) -> str:
    """Return what is given as a title."""
    span = partial(_span, system=question.units)
    given = question.scene.charge.explosive
    if question.charge_mass:
        given = f"{span('_kg', question.charge_mass)} of {given}"
    if question.slant_range:
        given += f" at {span('_m', question.slant_range)}"
    if question.quantity:
        words = quantity_words(question.quantity)
        given += f", {words} {span(question.quantity, [question.target])}"
    return given


def _span(name: str, values: Any, system: System) -> str:
    """Return numbers with their unit; more than three as their range."""
    shown = [printed_number(name, value, system=system) for value in values]
    if len(set(shown)) < 4:
        return ", ".join(dict.fromkeys(shown))
    low, high = int(np.argmin(values)), int(np.argmax(values))
    return f"{shown[low]} to {shown[high]} ({len(shown)} values)"


def header(question: Question) -> list[tuple[str, str]]:
    """Return the inputs as pairs of label and text."""
    given, system = inputs(question), question.units
    printed = partial(printed_number, digits=6, system=system)
    factor, kelvin = given.tnt_factor, given.temperature_k
    distance = given.scaled_distance_m_kg13
    air = [
        # temperature and pressure follow from the altitude, which is therefore first
        f"standard atmosphere at {printed('_m', given.altitude_m)}"
        if given.altitude_m is not None
        else "",
        # Fahrenheit has an offset, so it is no entry of the units with a size
        f"{kelvin * 1.8 - 459.67:.2f} °F" if system == "us" else f"{kelvin:.2f} K",
        printed("_pa", given.pressure_pa),
        f"humidity {given.relative_humidity:g}" if given.relative_humidity else "dry",
        f"sound {printed('_m_s', given.sound_speed_m_s, digits=5)}",
    ]
    facts = {
        "as TNT": f"{factor.pressure:g} for pressure and time, {factor.impulse:g} for "
        "impulse and duration, times the mass",
        "scaled distance": _span("_m_kg13", np.atleast_1d(distance), system)
        if distance is not None
        else "",
        "burst": given.burst,
        "height of burst": printed("_m", given.height_m) if given.height_m else "",
        "air": ", ".join(filter(None, air)),
        "ground": f"P wave {printed('_m_s', given.p_speed_m_s, digits=4)}",
    }
    if given.explosive == "TNT":
        del facts["as TNT"]  # both factors are 1
    return [
        (name, text + " (default)" * (name in given.defaults))
        for name, text in facts.items()
        if text
    ]


def notes(question: Question) -> list[str]:
    """Return limitations of the answer that its numbers do not show, as sentences."""
    scene = in_numpy(question.scene)
    charge, height = scene.charge, float(scene.charge.up)
    # neither curve set has a depth: a buried charge gets those of its burst
    if height < 0.0:
        return [
            f"the charge is buried: the {_burst(question)} curves were used; ford_2021 "
            "alone takes the depth into account"
        ]
    # the range of an inverse question is unknown, and with it the scaled height
    if height and question.quantity:
        return [
            "the curves depend on the height of burst: those of a surface burst until "
            "the reflection arrives after the positive phase; sensors are assumed as "
            "low as the range allows"
        ]
    if not height:
        return []
    # the weight of the curves by height, also where a burst was stated
    open_scene = replace(scene, charges=(replace(charge, burst=None),))
    path = replace(question, scene=open_scene).rows().path()
    heights = height / np.asarray(
        sachs_distance_factor(path.charge_mass, path.ambient_pressure)
    )
    span = float(heights.min()), float(heights.max())
    found = burst_notes(charge, span, path.free_air, "range")
    return [f"{note}; sensors are assumed as low as the range allows" for note in found]


def _burst(question: Question) -> str:
    """Return the curve set, or "by height" if it may differ between rows."""
    charge = question.scene.charge
    return charge.burst or ("by height" if float(charge.up) > 0.0 else "surface")


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
    """A value by a law; a list by row if there are several rows.

    Attributes:
        value: Value in the unit of the quantity.
        valid: Whether the law is valid there.
    """

    value: Numbers
    valid: Flags


@dataclass(frozen=True)
class LawEntry:
    """The value of one quantity, or of a range or mass, by one law.

    Attributes:
        value: Value in the unit of the quantity, by row. Of a range or mass the first
            root at which the law is valid, else the first; null if none.
        valid: Whether the law is valid there, by row.
        roots: All ranges or masses, ascending; absent for a quantity.
        range: Range of validity, as text.
    """

    value: Numbers
    valid: Flags
    roots: tuple[LawValue, ...] | None = field(metadata=ABSENT)
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
    quantities: Mapping[str, Mapping[str, LawEntry]]


def inputs(question: Question) -> Inputs:
    """Return inputs and defaults by name, in SI units."""
    scene = in_numpy(question.scene)
    charge, air = scene.charge, scene.air
    temperature, pressure = ambient(air)
    # one factor only: scaled distances are printed for pressures, and impulses have a
    # factor of their own
    rows = question.rows()
    path = rows.path(MAIN)
    # an inverse question has one given number, and its unknown depends on the law
    ranges, masses = question.slant_range, question.charge_mass
    if not question.quantity:
        ranges, masses = rows.slant_range, rows.charge_mass
    z = scaled_distance(path.slant_range, path.charge_mass, path.ambient_pressure)
    return Inputs(
        mass_kg=_one_or_all(masses),
        range_m=_one_or_all(ranges),
        unknown=question.unknown or None,
        scaled_distance_m_kg13=_one_or_all(z),
        charge_radius_m=_one_or_all(charge_radius(rows.charge_mass)),
        ground_factor=_one_or_all(ground_factor(z, 1.0)),
        measured={question.quantity: question.target} if question.quantity else {},
        explosive=charge.explosive,
        tnt_factor=TntFactor(
            pressure=float(charge.tnt_factor_for(MAIN)),
            impulse=float(charge.tnt_factor_for("positive_impulse_pa_s")),
        ),
        burst=_burst(question),
        height_m=float(charge.up),
        temperature_k=float(temperature),
        pressure_pa=float(pressure),
        relative_humidity=float(air.relative_humidity),
        altitude_m=None if air.altitude is None else float(air.altitude),
        sound_speed_m_s=float(sound_speed_of(air)),
        p_speed_m_s=float(scene.ground.p_speed),
        defaults=tuple(sorted(question.defaults)),
        notes=tuple(notes(question)),
    )


def _one_or_all(of_rows: Any) -> Any:
    """Return the value of one row, several as a list, and None for no row."""
    values = np.asarray(of_rows).tolist()
    return tuple(values) if len(values) > 1 else next(iter(values), None)


def _by_row(of_law: Calculated) -> tuple[Numbers, Flags]:
    return _one_or_all(of_law.value), _one_or_all(of_law.valid)


def _figure(
    question: Question,
    place: str,
    x: np.ndarray,
    found: Calculation,
    answers: list[CalcRow],
) -> "Figure":
    """Draw laws within their ranges, one panel a quantity, and mark the answers.

    Args:
        question: The question.
        place: Abscissa: "range_m" or "mass_kg".
        x: Its values.
        found: Values of the laws there.
        answers: The answers.
    """
    from jblast.report.figures import new_figure, titled

    shown = [name for name in found if len(found) == 1 or name in MAIN_HEADS]
    laws = dict.fromkeys(law for name in shown for law in found[name])
    # the styles of lines distinguish the laws of one colour
    styles = [(colour, line) for line in ("-", "--", ":") for colour in COLOURS]
    looks = {law: styles[i % len(styles)] for i, law in enumerate(laws)}
    width = 1 if len(shown) == 1 else 2
    height = -(-len(shown) // width)
    figure = new_figure(2.0 + 6.0 * width, 1.2 + 3.7 * height)
    grid = figure.subplots(height, width, squeeze=False).flat
    unit = unit_for(place, 1.0, system=question.units)
    words = "slant range" if place == "range_m" else "charge mass"
    for axes, name in zip(grid, shown, strict=False):
        own = [row for row in answers if row.quantity == name]
        size = unit_for(name, *(row.value for row in own), system=question.units)
        marks = [(getattr(row, place) / unit.size, row) for row in own]
        _panel(axes, x / unit.size, size, found[name], marks, looks)
        axes.set(xlabel=f"{words} ({unit.symbol})", ylabel=size.symbol)
        titled(axes, capitalised(quantity_words(name)))
    burst = _burst(question)
    figure.suptitle(
        f"{title(question)}, burst: {burst}", x=0.01, ha="left", fontsize=13
    )
    return figure


def _panel(
    axes: "Axes",
    x: np.ndarray,
    unit: Unit,
    by_law: Mapping[str, Calculated],
    marks: list[tuple[float, CalcRow]],
    looks: Mapping[str, tuple[str, str]],
) -> None:
    from jblast.report.figures import log_ticks, quiet

    quiet(axes)
    axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]))
    chosen = {row.law for _, row in marks}
    for law, one in by_law.items():
        if not one.valid.any():
            continue
        colour, style = looks[law]
        look: dict[str, Any] = {"color": colour, "ls": style, "lw": 1.2, "label": law}
        if law in chosen:
            look |= {"color": INK, "lw": 3.0, "label": f"{law} (recommended)"}
        # NaN ends the line at the limit of validity
        value = np.where(one.valid, one.value / unit.size, np.nan)
        axes.plot(x, value, zorder=2 + (law not in chosen), **look)
    for at, row in marks:
        axes.axvline(at, color=MUTED, linewidth=0.8, zorder=1)
        face = INK if row.valid else "white"  # open: extrapolated
        axes.plot([at], [row.value / unit.size], "o", c=INK, mfc=face, zorder=5)
    log_ticks(axes.xaxis, axes.get_xlim())
    log_ticks(axes.yaxis, axes.get_ylim())
    axes.legend(fontsize=8, frameon=False, loc="best")
