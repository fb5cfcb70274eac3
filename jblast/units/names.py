"""Which of our columns and quantities a name means, in which unit."""

from functools import cache
from typing import NamedTuple

from jblast.errors import nearest
from jblast.quantity_table import QUANTITIES
from jblast.units.factors import si_factor
from jblast.units.spelling import LONGEST, Unit, spelt, unit_spelt, words_of
from jblast.units.vocabulary import ABSOLUTE, LEVEL, SI, SUFFIXES, WEIGHTED
from jblast.units.words import CALLED, COLUMNS, NEAR

ANY = ("value", "sigma")
"""Columns that take the unit of whatever was measured."""
MOST = 12
"""Units that a message names."""


class OurName(NamedTuple):
    """What a foreign name is to us.

    Attributes:
        name: Our column or quantity; `value` and `sigma` are columns of any dimension.
        factor: What values are multiplied by to be ours; NaN of a level in dB.
        dimension: Of the unit, a key of `units.SUFFIXES`.
        unit: As our names would end in it: "psi_ms".
    """

    name: str
    factor: float
    dimension: str
    unit: str


def our_name(foreign: str) -> OurName | None:
    """Return our column or quantity that a name means, and its unit.

    Blanks, case, brackets and signs do not count: "Peak Overpressure (kPa)" is
    `peak_overpressure_kpa`. A name that could mean more than one thing means none.

    Args:
        foreign: A name that ends in a unit.
    """
    for word, unit in _taken_apart(foreign):
        name = _names(unit.dimension).get(word)
        if name is not None:
            level = unit.dimension == LEVEL
            factor = float("nan") if level else si_factor(unit.suffix)
            return OurName(name, factor, unit.dimension, unit.suffix)
    return None


def dimension_of(name: str) -> str | None:
    """Return the dimension of one of our columns or quantities; None of names."""
    for dimension, suffix in SI.items():
        if name in _names(dimension).values() and name.endswith(f"_{suffix}"):
            return dimension
    return None


def what_to_write(foreign: str) -> str:
    """Return "; ..." with what to write in place of a name that means nothing to us.

    Names a unit that case must tell apart, the nearest unit, or ours with the factor.
    """
    words, whole = words_of(foreign), spelt(foreign)
    if weighted := _level_of_another_kind(whole):
        return weighted
    for length in range(min(LONGEST, len(words) - 1), 0, -1):
        word = "_".join(words[:-length]).lower()
        meant = unit_spelt("_".join(words[-length:]))
        if len(meant) > 1:
            either = [f"{word}_{unit.suffix}" for unit in meant]
            return (
                "; its unit may be MPa or mPa, which case tells apart: write "
                f"{' or '.join(either)}"
            )
        ours = any(word in _names(of) for of in SUFFIXES)
        if meant and not ours and (near := _near(word, meant[0])):
            return near
    if words and words[-1].lower() in ABSOLUTE:
        return "; it is absolute: subtract the ambient pressure, and write gauge units"
    for dimension, suffixes in SUFFIXES.items():
        for word, ours in _names(dimension).items():
            if whole == word and ours not in ANY:
                some = ", ".join(list(suffixes)[:6])
                return f"; it has no unit: expected {ours}, or another ending ({some})"
            if whole.startswith(f"{word}_"):
                return _no_unit(whole.removeprefix(f"{word}_"), ours, dimension)
    return ""


def _level_of_another_kind(whole: str) -> str:
    """Say of a level that is weighted, or re another pressure, what is expected."""
    expected = "expected peak_level_db, of the unweighted peak, re 20 uPa"
    if whole.endswith(tuple(f"_{ending}" for ending in WEIGHTED)):
        return f"; it is a weighted or an equivalent level, not a peak: {expected}"
    return f"; it is re another pressure: {expected}" if "_db_re_" in whole else ""


def _no_unit(ending: str, ours: str, dimension: str) -> str:
    """Say that an ending is no unit of one of ours, and which is near, or would be."""
    if ours in ANY:
        known = [suffix for of in SUFFIXES.values() for suffix in of]
        return f"; {ending!r} is no unit{nearest(ending, known)}"
    suffixes = SUFFIXES[dimension]
    some = f"; expected one of {', '.join(list(suffixes)[:MOST])}"
    return f"; {ending!r} is no unit of {dimension}{nearest(ending, suffixes) or some}"


def _near(word: str, unit: Unit) -> str:
    """Say which of ours a word beside a unit may mean."""
    for contained, ours in NEAR.get(unit.dimension, ()):
        if contained in word:
            if unit.dimension == LEVEL:
                return f"; ours is {ours}, of the unweighted peak, re 20 uPa"
            if not ours.endswith(SI[unit.dimension]):
                return f"; did you mean {ours}?"
            factor = si_factor(unit.suffix)
            stem = ours.removesuffix(f"_{SI[unit.dimension]}")
            times = f" (times {factor:.9g})"
            return f"; if {ours} is meant, write {stem}_{unit.suffix}{times}"
    return ""


def _taken_apart(foreign: str) -> list[tuple[str, Unit]]:
    """Return a name as word and unit, in every way that it can be, longest unit first.

    Of an ending that case must tell apart there is none.
    """
    words = words_of(foreign)
    found = []
    for length in range(min(LONGEST, len(words) - 1), 0, -1):
        meant = unit_spelt("_".join(words[-length:]))
        if len(meant) > 1:
            return []
        found += [("_".join(words[:-length]).lower(), unit) for unit in meant]
    return found


@cache
def _names(dimension: str) -> dict[str, str]:
    """Return what names of a dimension mean, by the words before the unit."""
    names = {name: name for name in ANY}
    suffix = SI.get(dimension)
    if suffix is not None:
        ours = (*QUANTITIES, *COLUMNS.get(dimension, ()))
        known = [
            name
            for name in ours
            if name.endswith(f"_{suffix}") and _dimension(name) == dimension
        ]
        names |= {name.removesuffix(f"_{suffix}"): name for name in known}
    return names | CALLED.get(dimension, {})


def _dimension(name: str) -> str:
    """Return the dimension whose ending one of our names has, the longest first."""
    endings = sorted(SI.items(), key=lambda item: -len(item[1]))
    return next(of for of, suffix in endings if name.endswith(f"_{suffix}"))
