"""Keys of a scene file and the kinds of their values: form, bounds and reading.

Each kind of value has `form`, which messages and the manual print, and `read`, which
checks a value of a TOML file. A value has one unit only, so that the value read is
the value written; a key in another unit is rejected with the conversion factor. Logs,
in contrast, are written by instruments and are converted.
"""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

from jblast.errors import nearest, require, shown
from jblast.parameters import NUMBER_SIZES, POSITIVE, UNBOUNDED, Bounds, Parameter
from jblast.scene.uncertain import PRIORS, Belief, Free, Prior
from jblast.units import in_other_unit

MIN_MEAN_SDS = 3.0
"""Minimum mean of a normal prior of a positive number, in standard deviations.

At most 0.13 % of the probability is then below zero; a wider prior should be lognormal.
"""
SHARE = re.compile(r"\s*(\d+\.?\d*(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?)\s*%\s*", re.I)
"""A sigma as a share of the value: "5%"."""
POSITION = "[east, north, up]"


@runtime_checkable
class Value(Protocol):
    """A kind of value of a key."""

    @property
    def form(self) -> str:
        """Form of a value, for messages and the manual."""
        ...

    def read(self, value: Any, where: str) -> Any:
        """Return a checked value.

        Raises:
            InputError: The value has another form, or is out of bounds.
        """


@dataclass(frozen=True)
class SceneKey:
    """A key of a table of a scene file.

    Attributes:
        name: Name of the key, with its unit.
        value: Kind of its value.
        field: Field of the scene's classes that contains it, as "rate" or as
            "instrument.rate"; "": the name of the key.
        default: Value of a missing key; None: the default is that of the class.
        needed: The key is required, or one of `instead`.
        instead: Keys that exclude it, each with further words: "mount with offset_m".
        needs: Keys that are required with it, each with further words.
        make: Function of the value that returns the field; None: the value itself.
        rows: Rows of the table of numbers, which it places; (): none.
    """

    name: str
    value: Value
    field: str = ""
    default: Any = None
    needed: bool = False
    instead: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    make: Callable[[Any], Any] | None = None
    rows: tuple[Parameter, ...] = ()


def finite(value: Any, where: str, expected: str = "a finite number") -> float:
    """Return a TOML value as a float.

    Raises:
        InputError: It is not a finite number of a size within `NUMBER_SIZES`, or 0.
    """
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    require(plain, where, expected, shown(value))
    low, high = NUMBER_SIZES
    size = f"a finite number between {low:g} and {high:g} in size, or 0"
    require(value == 0 or low <= abs(value) <= high, where, size, shown(value))
    return float(value)


@dataclass(frozen=True)
class Number:
    """A fixed number, or one that may have a prior or be free.

    Attributes:
        bounds: Bounds of the number.
        sampled: It may have a prior to sample from; a pair is a uniform prior.
        free: Value of "free", in place of which it may have a prior; None: no value.
    """

    bounds: Bounds = UNBOUNDED
    sampled: bool = False
    free: Free | None = None

    @property
    def form(self) -> str:
        """Form of a value."""
        number = f"number{self.bounds.that_is()}"
        if self.free:
            return f'a {number}, "free" or a prior'
        if self.sampled:
            return f"a {number}, [lo, hi] or a prior to sample from"
        return f"a fixed {number}"

    def read(self, value: Any, where: str) -> float | Belief:
        """Return the number, or the belief about it."""
        if self.free and value == "free":
            return self.free
        if self.sampled and isinstance(value, list):
            value = {"uniform": value}
        if isinstance(value, dict) and (self.free or self.sampled):
            positive = self.free is not None and self.free.positive
            return read_prior(value, self.bounds, positive, where)
        return self.bounds.checked(finite(value, where, self.form), where, got=value)


@dataclass(frozen=True)
class Numbers:
    """A list of numbers, or of lists of them.

    Attributes:
        form: Form of the list, such as "[east, north]"; in words: of any length.
        of: Kind of each item.
        not_zero: One number at least differs from zero.
        rising: Each number is larger than the one before it.
        word: Word in place of a number, which is read as None; "": no word.
        repeated: A single number stands for all of the list.
    """

    form: str
    of: Value = Number()
    not_zero: bool = False
    rising: bool = False
    word: str = ""
    repeated: bool = False

    def read(self, value: Any, where: str) -> list[Any]:
        """Return the items."""
        if self.repeated and not isinstance(value, list):
            return [self.of.read(value, where)] * (self.form.count(",") + 1)
        items = [
            None
            if self.word and item == self.word
            else self.of.read(item, f"{where}[{i}]")
            for i, item in enumerate(listed(value, self.form, where))
        ]
        zero = self.not_zero and not any(items)
        require(not zero, where, f"{self.form} that is not zero", shown(value))
        pairs = pairwise(item for item in items if item is not None)
        falls = self.rising and not all(low < high for low, high in pairs)
        require(not falls, where, f"{self.form} in increasing order", shown(value))
        return items


@dataclass(frozen=True)
class Whole:
    """A whole number from `low` to `high`; a word is read as None."""

    low: int
    high: int
    word: str = ""

    @property
    def form(self) -> str:
        """Form of a value."""
        word = f', or "{self.word}"' if self.word else ""
        return f"a whole number, {self.low} to {self.high}{word}"

    def read(self, value: Any, where: str) -> int | None:
        """Return the number, or None for the word."""
        # 1e6 is a float in TOML
        exact = isinstance(value, float) and value.is_integer()
        number: Any = int(value) if exact else value
        # `type`, not `isinstance`: True is an int, too.
        whole = type(number) is int and self.low <= number <= self.high
        word = bool(self.word) and value == self.word
        require(whole or word, where, self.form, shown(value))
        return None if word else number


@dataclass(frozen=True)
class Word:
    """One of some words; `spelt` returns a word as its table has it."""

    words: Iterable[str]
    spelt: Callable[[str, str], str] | None = None

    @property
    def form(self) -> str:
        """Form of a value."""
        return f"one of {', '.join(self.words)}"

    def read(self, value: Any, where: str) -> str:
        """Return the word."""
        text = isinstance(value, str)
        if text and self.spelt is not None:
            return self.spelt(value, where)
        advice = nearest(value, self.words) if text else ""
        known = text and value in self.words
        require(known, where, self.form, f"{shown(value)}{advice}")
        return value


@dataclass(frozen=True)
class Text:
    """A name."""

    form: str = "a name in quotes"

    def read(self, value: Any, where: str) -> str:
        """Return the text without blanks around it."""
        text = isinstance(value, str) and value.strip()
        require(text, where, self.form, shown(value))
        return value.strip()


@dataclass(frozen=True)
class File(Text):
    """The path of a file, relative to that of the scene."""

    form: str = "the path of a file in quotes"


@dataclass(frozen=True)
class Truth:
    """True or false."""

    form: str = "true or false"

    def read(self, value: Any, where: str) -> bool:
        """Return the boolean."""
        require(isinstance(value, bool), where, self.form, shown(value))
        return value


@dataclass(frozen=True)
class Table:
    """A table within a table, whose keys have fields of the outer one."""

    form: str
    keys: tuple[SceneKey, ...] = ()

    def read(self, value: Any, where: str) -> dict[str, Any]:
        """Return the unchecked table."""
        require(isinstance(value, dict), where, self.form, shown(value))
        return value


@dataclass(frozen=True)
class Share:
    """An error as a share of the value, "5%".

    A plain number could also be an error in the unit of the quantity, as in a log, so
    it is rejected.

    Attributes:
        unit: Unit of the quantity.
        form: Form of a value.
    """

    unit: str
    form: str = 'a positive share of the value with its % sign, as "5%"'

    def read(self, value: Any, where: str) -> float:
        """Return the share, 0.05."""
        match = SHARE.fullmatch(value) if isinstance(value, str) else None
        share = float(match.group(1)) / 100 if match else 0.0
        advice = ""
        if isinstance(value, int | float) and value > 0:
            advice = (
                f"; if this is a share, multiply by 100 and write {share_text(value)}, "
                f"if it is in {self.unit}, divide by the value first"
            )
        valid = 0 < share < math.inf
        require(valid, where, self.form, f"{shown(value)}{advice}")
        return share


def share_text(share: float) -> str:
    """Return a share in the form of a scene file: 0.05 is "5%"."""
    return f'"{100 * share:.3g}%"'


def read_prior(
    value: dict[str, Any], bounds: Bounds, positive: bool, where: str
) -> Prior:
    """Return the prior of a number.

    Args:
        value: Kind of prior with its two numbers: { normal = [mean, sd] }.
        bounds: Bounds of the number, which also those of the prior satisfy.
        positive: True if the number is positive.
        where: File, table and key, for messages.

    Raises:
        InputError: The kind is unknown, or a number is out of bounds.
    """
    for kind in value:
        known(kind, PRIORS, where, "prior")
    got = " and ".join(value) or "an empty table"
    require(len(value) == 1, where, f"one of {', '.join(PRIORS)}", got)
    ((kind, pair),) = value.items()
    make = PRIORS[kind]
    words = [one.name for one in fields(make)]
    form = f"{kind} = [{', '.join(words)}]"
    both = f"two finite numbers in {form}"
    numbers = [finite(one, where, both) for one in listed(pair, form, where)]
    first, second = numbers
    least = first if make.of_interval else float(make.in_ln)
    limits = [(0, bounds), (1, Bounds(above=least))]
    if make.of_interval:
        # With bounds of the prior within those of the number every sample is.
        limits.append((1, bounds))
    if make.in_ln:
        limits.append((0, POSITIVE))
    if kind == "normal" and positive:
        advice = f"{MIN_MEAN_SDS:g} sd above zero, or a lognormal"
        limits.append((0, Bounds(at_least=MIN_MEAN_SDS * second, advice=advice)))
    for i, limit in limits:
        limit.checked(numbers[i], where, f"{words[i]} of {form}")
    return make(first, second)


def listed(value: Any, form: str, where: str) -> list[Any]:
    """Return a list with the length of its form, such as "[east, north]"."""
    items = value if isinstance(value, list) else []
    count = form.count(",") + 1 if "[" in form else len(items)
    require(items and len(items) == count, where, form, shown(value))
    return value


def known(name: str, names: Iterable[str], where: str, what: str) -> None:
    """Reject an unknown name, with a known unit of it or the nearest name."""
    names = tuple(names)
    if name in names:
        return
    # TOML accepts any text as a quoted key, which would garble a message.
    word = name if name.isidentifier() and len(name) <= 60 else shown(name)
    advice = in_other_unit(name, names) or nearest(name, names)
    expected = f"one of {', '.join(names)}"
    require(False, f"{where} {word}", expected, f"an unknown {what}{advice}")
