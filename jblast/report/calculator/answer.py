"""The answer of `jblast calc`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.kept_programs import kept
from jblast.report.words import System, printed_number, quantity_words, unit_for
from jblast.results import ABSENT, AMONG, Document
from jblast.sensors.calculator import (
    Calculated,
    Calculation,
    Disagreement,
    Question,
    Recommended,
    Roots,
    charge_radius,
    free_air_rows,
    scene_path,
)
from jblast.waves.height_of_burst import burst_notes
from jblast.waves.laws.kingery_bulmash import ground_factor
from jblast.waves.propagation import ambient
from jblast.waves.scaling import sachs_distance_factor, scaled_distance

Numbers = float | tuple[float, ...]
"""One, or one a row."""
if TYPE_CHECKING:
    from jblast.fidelity import Choice


def header(question: Question) -> list[tuple[str, str]]:
    """Return the inputs as pairs of label and text, for the terminal."""
    given = inputs(question)
    charge, defaults = question.scene.charge, question.defaults
    system = question.units
    lines = []
    # both factors of TNT are 1: the line would only repeat the mass
    if charge.explosive != "TNT":
        factors = given.tnt_factor
        text = f"{factors.pressure:g} for pressure and time, "
        text += f"{factors.impulse:g} for impulse and duration, times the mass"
        lines.append(("as TNT", text))
    if given.scaled:
        z = np.atleast_1d(given.scaled.scaled_distance_m_kg13)
        radius = np.atleast_1d(given.scaled.charge_radius_m)
        text = f"{_span(z)} m/kg^(1/3)"
        if system == "us":
            foot, pound = (unit_for(name, 1.0, system=system) for name in ("_m", "_kg"))
            # Z is a length over the cube root of a mass, so both units convert it
            text = f"{_span(z * pound.size ** (1 / 3) / foot.size)} ft/lb^(1/3)"
        lines.append(("scaled distance", text))
        unit = unit_for("_m", 1.0, system=system)
        text = f"{_span(radius / unit.size)} {unit.symbol} (TNT at 1630 kg/m3)"
        lines.append(("charge radius", text))
        if charge.burst == "surface":
            factor = np.atleast_1d(given.scaled.ground_factor)
            text = (
                f"{_span(factor)} times this mass in free air gives the same pressure"
            )
            lines.append(("ground factor", text))
    height = given.height_m
    at_height = ""
    if height:
        at_height = f", {printed_number('_m', abs(height), system=system)} "
        at_height += "above ground" if height > 0 else "deep"
    burst = charge.burst or "by the height of burst, for each range"
    lines.append(("burst", f"{burst}{_default('burst', defaults)}{at_height}"))
    lines.append(
        ("air", _air(given, system) + _default("air", defaults, "at sea level"))
    )
    rock = f"P wave {_speed(given.p_speed_m_s, system, 'g')}"
    lines.append(("ground", rock + _default("ground", defaults, "granite")))
    return lines


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


@dataclass(frozen=True)
class Scaled:
    """Scaled distances, charge radii and ground factors, by row.

    Attributes:
        scaled_distance_m_kg13: Sachs-scaled distance, for pressures.
        charge_radius_m: Radius of the charge as a sphere of TNT.
        ground_factor: Mass in free air over mass on the ground, for the same pressure.
    """

    scaled_distance_m_kg13: Numbers
    charge_radius_m: Numbers
    ground_factor: Numbers


@dataclass(frozen=True)
class TntFactor:
    """TNT-equivalent mass of an explosive over its mass.

    Attributes:
        pressure: Factor for pressures and times.
        impulse: Factor for impulses and durations.
    """

    pressure: float
    impulse: float


def notes(question: Question, *, has_other_set: bool = True) -> list[str]:
    """Return limitations of the answer that its numbers do not show, as sentences.

    Args:
        question: The question.
        has_other_set: Whether the answer prints values by the other curve set.
    """
    charge = question.scene.charge
    low, high = _scaled_heights(question)
    # neither curve set has a depth: a buried charge gets those of its burst, with this
    # note
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
    if between_limits(question):
        found[-1] += (
            "; compare with the other --burst"
            if not has_other_set or len(question.rows()[0]) > 1
            else "; values by the other curve set are printed below the laws that have "
            "two"
        )
    return found


@dataclass(frozen=True)
class Inputs:
    """Inputs and defaults of a calculation.

    Attributes:
        mass_kg: Mass of the explosive, by row; absent if it is the unknown.
        range_m: Slant range, by row; absent if it is the unknown.
        unknown: The unknown, range or mass; absent if there is none.
        scaled: Scaled distances; None if range or mass is the unknown.
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
    scaled: Scaled | None = field(metadata=AMONG)
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


def _air(given: Inputs, system: System) -> str:
    pressure = f"{given.pressure_pa / 1e3:.3f} kPa"
    temperature = f"{given.temperature_k:.2f} K"
    if system == "us":
        # Fahrenheit has an offset, so it is no entry of the units with a size
        temperature = f"{given.temperature_k * 1.8 - 459.67:.2f} °F"
        pressure = printed_number("_pa", given.pressure_pa, system=system)
    words = [
        temperature,
        pressure,
        f"humidity {given.relative_humidity:g}" if given.relative_humidity else "dry",
        f"sound {_speed(given.sound_speed_m_s, system, '.2f')}",
    ]
    # temperature and pressure follow from the altitude, which is therefore first
    if given.altitude_m is not None:
        altitude = given.altitude_m
        shown = f"{altitude:g} m"
        if system == "us":
            shown = printed_number("_m", altitude, system=system)
        words.insert(0, f"standard atmosphere at {shown}")
    return ", ".join(words)


def _speed(value: float, system: System, digits: str) -> str:
    if system == "us":
        return printed_number("_m_s", value, system=system)
    return f"{value:{digits}} m/s"


def _values(name: str, values: tuple[float, ...], system: System) -> str:
    # three values fit a title of one line; more are a span with their number
    if len(values) < 4:
        return ", ".join(printed_number(name, v, system=system) for v in values)
    first, last = (
        printed_number(name, v, system=system) for v in (min(values), max(values))
    )
    return f"{first} to {last} ({len(values)} values)"


def _span(values: np.ndarray) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    # rows that agree to four digits are printed as one number
    return low if low == high else f"{low} to {high}"


def _default(field: str, defaults: frozenset[str], what: str = "") -> str:
    if field not in defaults:
        return ""
    return f" (default{': ' if what else ''}{what})"


@dataclass(frozen=True)
class LawValue:
    """Value of a law; a list by row if there are several rows.

    Attributes:
        value: Value in the unit of the quantity.
        valid: Whether the law is valid there.
    """

    value: Numbers
    valid: bool | tuple[bool, ...]


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
    valid: bool | tuple[bool, ...]
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


def inputs(question: Question) -> Inputs:
    """Return inputs and defaults by name, in SI units."""
    scene = question.scene
    charge, air = scene.charge, scene.air
    path = scene_path(scene)
    temperature, _ = ambient(air)
    # one factor only: scaled distances are printed for pressures, and impulses have a
    # factor of their own
    pressure_factor = float(charge.tnt_factor_for("peak_overpressure_pa"))
    # an inverse question has one given number, and its unknown depends on the law
    mass = distance = unknown = scaled = None
    if question.quantity and question.charge_mass:
        mass, unknown = question.charge_mass[0], "range_m"
    elif question.quantity:
        distance, unknown = question.slant_range[0], "charge_mass_kg"
    else:
        ranges, masses = question.rows()
        mass, distance = _one_or_all(masses), _one_or_all(ranges)
        tnt_masses = pressure_factor * masses
        rows = _scaled(ranges, tnt_masses, path.ambient_pressure)
        distances, factors = map(np.asarray, rows)
        scaled = Scaled(
            scaled_distance_m_kg13=_one_or_all(distances),
            charge_radius_m=_one_or_all(charge_radius(masses)),
            ground_factor=_one_or_all(factors),
        )
    return Inputs(
        mass_kg=mass,
        range_m=distance,
        unknown=unknown,
        scaled=scaled,
        measured={question.quantity: question.target} if question.quantity else {},
        explosive=charge.explosive,
        tnt_factor=TntFactor(
            pressure=pressure_factor,
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


def calculator_answer(
    question: Question,
    answer: Calculation,
    other: Calculation | None = None,
    apart: Sequence[Disagreement] = (),
    recommended: Recommended | None = None,
) -> CalculatorAnswer:
    """Combine the values of laws for some rows.

    Args:
        question: The question.
        answer: Values of the laws.
        other: Values by the other curve set, for laws with two sets, if relevant.
        apart: Quantities whose valid laws disagree.
        recommended: The recommended answer for one quantity at one range.
    """

    def entry(quantity: str, name: str, of_law: Calculated) -> LawEntry:
        here, beside = _value(of_law), None
        # a law with one curve set has the same value for every burst
        if other is not None and of_law.two_sets:
            beside = _value(other[quantity][name])
        return LawEntry(here.value, here.valid, of_law.range, beside)

    quantities = {
        quantity: {name: entry(quantity, name, one) for name, one in by_law.items()}
        for quantity, by_law in answer.items()
    }
    return CalculatorAnswer(
        inputs=inputs(question),
        quantities=quantities,
        recommended=_recommended(recommended) if recommended else None,
        disagreements=tuple(
            DisagreementEntry(
                found, found.choice.method if found.choice else "", why_taken(found)
            )
            for found in apart
        ),
    )


def inverse_answer(
    question: Question, answer: Mapping[str, Roots], recommended: Recommended
) -> InverseAnswer:
    """Combine the ranges or masses at which laws take a value."""
    given, by_law = inputs(question), {}
    for name, found in answer.items():
        # a law may reach the value nowhere: it is null in the JSON, not left out
        value, valid = found.best() or (None, False)
        pairs = zip(found.value, found.valid, strict=True)
        roots = tuple(Root(float(v), bool(ok)) for v, ok in pairs)
        by_law[name] = RootEntry(value, valid, roots, found.law.range)
    return InverseAnswer(
        given, _recommended(recommended), {given.unknown or "": by_law}
    )


def _recommended(recommended: Recommended) -> RecommendedEntry:
    return RecommendedEntry(recommended, why_recommended(recommended))


def _value(of_law: Calculated) -> LawValue:
    # one row is a plain number in the JSON, several rows are a list
    if len(of_law.value) == 1:
        return LawValue(float(of_law.value[0]), bool(of_law.valid[0]))
    return LawValue(
        tuple(map(float, of_law.value)), tuple(bool(ok) for ok in of_law.valid)
    )


@kept
def _scaled(
    slant_range: Float[ArrayLike, " row"],
    charge_mass: Float[ArrayLike, " row"],
    ambient_pressure: Float[ArrayLike, ""],
) -> tuple[Float[Array, " row"], Float[Array, " row"]]:
    """Return scaled distances and ground factors.

    The ground factor is the mass in free air that gives the same pressure, over the
    mass on the ground.
    """
    distance = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return distance, ground_factor(distance, 1.0)


def _one_or_all(values: np.ndarray) -> Numbers:
    return float(values[0]) if len(values) == 1 else tuple(float(v) for v in values)


def between_limits(question: Question) -> bool:
    """Return whether some row is neither a surface burst nor a free-air burst."""
    _, high = _scaled_heights(question)
    # an inverse question has no rows: its root may lie on either side of the limit
    is_inverse = question.quantity
    return not is_inverse and high > 0.0 and not free_air_rows(question).all()


def disagreement_words(found: Disagreement, question: Question) -> str:
    """Return a sentence on valid laws that disagree, with the recommended one."""
    where, rows = "", len(question.rows()[0])
    # the laws may disagree at many rows: one sentence has their number and the worst
    if rows > 1:
        place = printed_number("_m", found.range_m, system=question.units)
        where = f" at {found.rows} of {rows} rows, most at {place}"
    taken = why_taken(found)
    if found.choice:
        taken = f"recommended: {found.choice.method}: {taken}"
    return (
        f"valid laws disagree{where}: {found.high} is {found.ratio:.2f} times "
        f"{found.low}; their scatter explains a factor of {found.expected:.2f}; "
        f"{taken}"
    )


def _scaled_heights(question: Question) -> tuple[float, float]:
    """Return the smallest and the largest scaled height of burst [m/kg^(1/3)]."""
    height = question.scene.charge.up.item()
    # without a mass there is no scaling, and callers use the sign alone
    if not (height and question.charge_mass):
        return height, height
    factor = float(question.scene.charge.tnt_factor_for("peak_overpressure_pa"))
    pressure = scene_path(question.scene).ambient_pressure.item()
    masses = factor * np.asarray(question.charge_mass)
    heights = height / np.asarray(sachs_distance_factor(masses, pressure))
    return float(heights.min()), float(heights.max())


def why_recommended(recommended: Recommended) -> str:
    """Return the reason for the law of an answer; "" if there is no other."""
    if recommended.is_nearest:
        return "nearest to the median of the laws that give this value and are valid"
    return _of_choice(recommended.choice) if recommended.choice else ""


def why_taken(found: Disagreement) -> str:
    """Return the reason for one of two laws that disagree, or for neither."""
    if found.choice is None:
        return "no measurement shows which of them is nearer to real blasts"
    return _of_choice(found.choice)


def _of_choice(choice: "Choice") -> str:
    # imported here: it loads jblast.fidelity, which most answers do without
    from jblast.report.choice import choice_reason

    return choice_reason(choice)
