"""What parameters, quantities and laws are called in a sentence."""

from collections.abc import Sequence

from jblast.parameter_table import described
from jblast.quantity_table import quantity_named

SUFFIXES = (
    "_pa_s",
    "_m_s2",
    "_m_s",
    "_rad",
    "_deg",
    "_kg",
    "_pa",
    "_px",
    "_m",
    "_s",
    "_j",
    "_k",
)
"""Unit suffixes of names, longest first: `_m_s` must be tried before `_s`."""

LAW_WORDS = {
    "wu_hao": "Wu-Hao",
    "kingery_bulmash": "Kingery-Bulmash",
    "kinney_graham": "Kinney-Graham",
    "swisdak": "Swisdak",
    "sadovsky": "Sadovsky",
    "dna_1kt": "DNA 1 kt standard",
    "point_source": "point-source",
    "sedov_taylor": "Sedov-Taylor",
    "shock_kinematics": "shock kinematics",
    "weak_shock_iso": "weak shock with ISO 9613-1",
    "acoustic": "acoustic",
    "ford_2021": "Ford 2021",
    "ground_motion": "ground motion",
}


def split_name(name: str) -> tuple[str, str, str]:
    """Split a parameter's name: `clock_offset_s.B` is ("clock_offset", "_s", "B")."""
    stem, _, label = name.partition(".")
    for suffix in SUFFIXES:
        if stem.endswith(suffix):
            return stem.removesuffix(suffix), suffix, label
    return stem, "", label


def parameter_words(name: str) -> str:
    """Return a parameter's name in words; an unknown one loses unit and underscores."""
    known, (stem, _, label) = described(name), split_name(name)
    words = known.words if known else stem.replace("_", " ")
    return f"{words} of {label}" if label else words


def quantity_words(quantity: str) -> str:
    """Return a quantity's name in words."""
    known = quantity_named(quantity)
    return known.words if known else split_name(quantity)[0].replace("_", " ")


def law_words(law: str) -> str:
    """Return a law's name as its authors are named in a sentence."""
    return LAW_WORDS.get(law, law.replace("_", " "))


def joined(parts: Sequence[str]) -> str:
    """Join words as a sentence does: "a, b and c"."""
    if len(parts) < 2:
        return "".join(parts)
    return ", ".join(parts[:-1]) + " and " + parts[-1]


def capitalised(sentence: str) -> str:
    """Return a sentence with its first letter large and the rest untouched."""
    return sentence[:1].upper() + sentence[1:]
