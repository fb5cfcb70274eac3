"""Keys of a scene file and the kinds of their values: form, bounds and reading.

Each kind of value has `form`, which messages and the manual print, and `read`, which
checks a value of a TOML file. A value has one unit only, so that the value read is
the value written; a key in another unit is rejected with the conversion factor. Logs,
in contrast, are written by instruments and are converted.
"""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np

from jblast.errors import nearest, require, shown
from jblast.parameters import NUMBER_SIZES, POSITIVE, UNBOUNDED, Bounds, Parameter
from jblast.quantities import ADDITIVE, DIRECTIONS, QUANTITIES, Quantity
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
        ...


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
    """

    name: str
    value: Value
    field: str = ""
    default: Any = None
    needed: bool = False
    instead: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    make: Callable[[Any], Any] | None = None


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
    """A fixed number, or one that is sampled.

    Attributes:
        bounds: Bounds of the number.
        sampled: It may have a prior to sample from; a pair is a uniform prior.
    """

    bounds: Bounds = UNBOUNDED
    sampled: bool = False

    @property
    def form(self) -> str:
        """Form of a value."""
        if self.sampled:
            numbers = f"a number{self.bounds.that_is()}"
            return f"{numbers}, [lo, hi] or a prior to sample from"
        return f"a fixed number{self.bounds.that_is()}"

    def read(self, value: Any, where: str) -> float | Prior:
        """Return the number, or its prior."""
        if self.sampled and isinstance(value, list):
            value = {"uniform": value}
        if self.sampled and isinstance(value, dict):
            return read_prior(value, self.bounds, False, where)
        return self.bounds.checked(finite(value, where, self.form), where, got=value)


@dataclass(frozen=True)
class Numbers:
    """A list of fixed numbers.

    Attributes:
        form: Form of the list, such as "[east, north]".
        bounds: Bounds of each number.
        not_zero: One number at least differs from zero.
        rising: Each number is larger than the one before it.
        word: Word in place of a number, which is read as None; "": no word.
        repeated: A single number stands for all of the list.
    """

    form: str
    bounds: Bounds = UNBOUNDED
    not_zero: bool = False
    rising: bool = False
    word: str = ""
    repeated: bool = False

    def read(self, value: Any, where: str) -> Any:
        """Return the numbers, an array unless a word is accepted."""
        one = Number(self.bounds)
        if self.repeated and not isinstance(value, list):
            return np.full(self.form.count(",") + 1, one.read(value, where))
        numbers: list[Any] = [
            None if item == self.word else one.read(item, f"{where}[{i}]")
            for i, item in enumerate(listed(value, self.form, where))
        ]
        zero = self.not_zero and not any(numbers)
        require(not zero, where, f"{self.form} that is not zero", shown(value))
        falls = self.rising and not _rises([x for x in numbers if x is not None])
        require(not falls, where, f"{self.form} in increasing order", shown(value))
        return numbers if self.word else np.array(numbers)


def _rises(numbers: Sequence[float]) -> bool:
    return all(low < high for low, high in pairwise(numbers))


@dataclass(frozen=True)
class Corners:
    """Two opposite corners of a box, with an extent towards east and north."""

    form: str = f"[{POSITION}, {POSITION}]"

    def read(self, value: Any, where: str) -> np.ndarray:
        """Return both corners."""
        pair = enumerate(listed(value, "[low corner, high corner]", where))
        corners = [Numbers(POSITION).read(at, f"{where}[{i}]") for i, at in pair]
        east, north, up = corners[1] - corners[0]
        area = (
            "a box with an area, its first corner south-west of its second, not higher"
        )
        require(east > 0 and north > 0 and up >= 0, where, area, shown(value))
        return np.array(corners)


@dataclass(frozen=True)
class Times:
    """Increasing times."""

    form: str = "a list of increasing times in seconds"

    def read(self, value: Any, where: str) -> tuple[float, ...]:
        """Return the times."""
        require(isinstance(value, list) and value, where, self.form, shown(value))
        times = [finite(time, f"{where}[{i}]") for i, time in enumerate(value)]
        # Rows of one sensor are distinguished by their times.
        require(_rises(times), where, self.form, shown(value))
        return tuple(times)


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
        # `type`, not `isinstance`: True is an int, too.
        whole = type(value) is int and self.low <= value <= self.high
        word = bool(self.word) and value == self.word
        require(whole or word, where, self.form, shown(value))
        return None if word else value


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

    name: str
    form: str

    def read(self, value: Any, where: str) -> dict[str, Any]:
        """Return the unchecked table."""
        require(isinstance(value, dict), where, self.form, shown(value))
        return value


@dataclass(frozen=True)
class Records:
    """Recorded quantities with their sigmas.

    A sigma is a plain number in seconds for times and in radians for directions. For
    other quantities it is a share of the value, "5%". A plain number there could also
    be an error in the unit of the quantity, as in a log, so it is rejected.
    """

    form: str = "{ QUANTITY = sigma }"

    def read(self, value: Any, where: str) -> tuple[tuple[str, float], ...]:
        """Return pairs of quantity and sigma: seconds, radians, or relative."""
        require(isinstance(value, dict), where, self.form, shown(value))
        for quantity in value:
            known(quantity, QUANTITIES, where, "quantity")
        sigmas = ((name, f"{where} {name}", x) for name, x in value.items())
        # Times may be zero or negative, so that they have no relative error.
        return tuple(
            (name, (_additive if name in ADDITIVE else _share)(x, at, QUANTITIES[name]))
            for name, at, x in sigmas
        )


def _additive(sigma: Any, where: str, quantity: Quantity) -> float:
    unit = "radians" if quantity.name in DIRECTIONS else "seconds"
    expected = f"a sigma in {unit}"
    return POSITIVE.checked(finite(sigma, where, expected), where, expected, sigma)


def _share(sigma: Any, where: str, quantity: Quantity) -> float:
    match = SHARE.fullmatch(sigma) if isinstance(sigma, str) else None
    share = float(match.group(1)) / 100 if match else 0.0
    # A share and an error in the unit look the same, hence both readings.
    advice = ""
    if isinstance(sigma, int | float) and sigma > 0:
        advice = (
            f"; if this is a share, multiply by 100 and write {share_text(sigma)}, if "
            f"it is in {quantity.unit}, divide by the value first"
        )
    expected = 'a positive share of the value with its % sign, as "5%"'
    require(0 < share < math.inf, where, expected, f"{shown(sigma)}{advice}")
    return share


def share_text(share: float) -> str:
    """Return a share in the form of a scene file: 0.05 is "5%"."""
    return f'"{100 * share:.3g}%"'


@dataclass(frozen=True)
class Uncertain:
    """A number that is fixed, free or has a prior; several of them in a list.

    Attributes:
        rows: Rows of the table of numbers, in the order of the list.
        list_form: Form of the list; "" for a single number.
    """

    rows: tuple[Parameter, ...]
    list_form: str = ""

    @property
    def form(self) -> str:
        """Form of a value."""
        bounds = self.rows[0].bounds.that_is()
        return self.list_form or f'a number{bounds}, "free" or a prior'

    def read(self, value: Any, where: str) -> list[float | Belief]:
        """Return each number, or the belief about it."""
        if not self.list_form:
            return [_uncertain(value, self.rows[0], where)]
        items = zip(listed(value, self.list_form, where), self.rows, strict=True)
        return [_uncertain(x, row, f"{where}[{i}]") for i, (x, row) in enumerate(items)]


def _uncertain(value: Any, row: Parameter, where: str) -> float | Belief:
    if value == "free":
        return Free(row.positive)
    if isinstance(value, dict):
        return read_prior(value, row.bounds, row.positive, where)
    form = 'a number, "free" or a prior such as { normal = [mean, sd] }'
    return row.bounds.checked(finite(value, where, form), where, got=value)


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
    limits = [(0, bounds), (1, Bounds(above=first if make.of_interval else make.in_ln))]
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
    count = form.count(",") + 1
    require(isinstance(value, list) and len(value) == count, where, form, shown(value))
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
