"""How units are written at the end of a name: brackets, signs, case."""

import re
from typing import NamedTuple

from jblast.units.vocabulary import MILLI_OR_MEGA, SUFFIXES, WRITTEN_OUT

SIGNS = {"µ": "u", "μ": "u", "°": " deg ", "%": " percent ", "/": " per ", "′": "'"}
REFERENCE = re.compile(r"(?<=db)[^a-z0-9]*re[^a-z0-9]*20[^a-z0-9]*upa", re.IGNORECASE)
"""The one reference of our levels: "dB re 20 uPa" is dB."""
LONGEST = 3
"""Words of the longest ending: m_per_s."""


class Unit(NamedTuple):
    """A unit that a name ends in.

    Attributes:
        dimension: Of which it is, a key of `SUFFIXES`.
        suffix: As it ends our names: "kpa_ms".
        pint: As pint calls it.
    """

    dimension: str
    suffix: str
    pint: str


def words_of(name: str) -> list[str]:
    """Return the words of a name, their case kept: "Peak (kPa·ms)", Peak kPa ms."""
    for sign, spelt in SIGNS.items():
        name = name.replace(sign, spelt)
    name = REFERENCE.sub(" ", name)
    return [word for word in re.split(r"[^A-Za-z0-9]+", name) if word]


def spelt(name: str) -> str:
    """Return a name as ours are written: lower case, words between low lines."""
    return "_".join(words_of(name)).lower()


def unit_spelt(suffix: str) -> tuple[Unit, ...]:
    """Return the units an ending may mean: none, one, or several that case tells apart.

    Args:
        suffix: "kPa", "psi-ms", "mm/s", "m_s", "feet", "degrees".
    """
    words = words_of(suffix)
    if not words:
        return ()
    lower = [_short(word.lower()) for word in words]
    readings = [lower]
    if lower[0] in MILLI_OR_MEGA:
        both = MILLI_OR_MEGA[lower[0]]
        kept = (words[0],) if words[0] in both else both
        readings = [[first, *lower[1:]] for first in kept]
    return tuple(
        Unit(dimension, "_".join(reading), suffixes["_".join(reading)])
        for reading in readings
        for dimension, suffixes in SUFFIXES.items()
        if "_".join(reading) in suffixes
    )


def _short(word: str) -> str:
    """Return a unit's short name where a word is its full one, else the word."""
    singular = word.removesuffix("s")
    return WRITTEN_OUT.get(word) or WRITTEN_OUT.get(singular) or word
