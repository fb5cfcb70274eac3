"""Registries: laws by quantity and name, and a class for all other records.

`Registry` has the records of one kind of extension (sensor kinds, controllers, file
formats) by name. A record from outside the package is registered by the same call as
the package's own.

Laws have a range of validity, a source and a scatter, and register themselves where
they are defined. The names of a law's arguments are attributes of `waves.paths.Path`,
so a law is called with the attributes of a path.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from jblast.errors import InputError, nearest, shown
from jblast.types import is_traced, namespace


@runtime_checkable
class Named(Protocol):
    """A record of a registry."""

    @property
    def name(self) -> str:
        """Name of the record, as users write it."""
        ...


R = TypeVar("R", bound=Named)


class Registry(Mapping[str, R], Generic[R]):
    """Records of one kind by name, in the order of registration.

    Example:
        `sensor_kinds.register(SensorKind("thermometer", ...))`
    """

    def __init__(self, what: str, *records: R):
        """Create a registry.

        Args:
            what: Kind of record, for messages: "controller".
            records: Records of the package itself.
        """
        self._what = what
        self._records = {record.name: record for record in records}

    def register(self, record: R) -> R:
        """Add and return a record; a record of the same name is replaced."""
        self._records[record.name] = record
        return record

    def named(self, name: str) -> R:
        """Return a record.

        Raises:
            InputError: The name is unknown; the message names the nearest.
        """
        if name not in self._records:
            raise InputError(
                f"{self._what} {shown(name)}: expected one of "
                f"{', '.join(self._records)}{nearest(name, self._records)}"
            )
        return self._records[name]

    def __getitem__(self, name: str) -> R:
        return self._records[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)


@dataclass(frozen=True)
class Law:
    """One law for one quantity.

    Attributes:
        quantity: Predicted quantity, by its name in observation files.
        name: Name of the law, as in `--law NAME`.
        function: The law; its arguments are attributes of `waves.paths.Path`.
        range: Range of validity, in words.
        source: Reference.
        valid: Function with such arguments, True within the range of validity.
        scatter: Scatter of real blasts about the law, in ln of the quantity (of the
            travel time for arrivals): standard deviations between shots, between paths
            of a shot and between records of a path. Normal where it is drawn; in a fit
            the last is the scale of a Student-t. A function with such arguments.
        scatter_source: Source of the scatter: the script that measured it, or
            "declared".
        far_scatter: Additional scatter at large distances, in ln: standard deviations
            of an effect common to the far rows of a shot, independent of the shot's
            own, and of each record. None: no addition.
        title: Name in sentences; "" for `name` without underscores.
    """

    quantity: str
    name: str
    function: Callable[..., Any]
    range: str
    source: str
    valid: Callable[..., Any]
    scatter: Callable[..., tuple[Any, Any, Any]]
    scatter_source: str
    far_scatter: Callable[..., tuple[Any, Any]] | None = None
    title: str = ""

    def arguments(self) -> tuple[str, ...]:
        """Return the names of its arguments, attributes of `waves.paths.Path`."""
        return _argument_names(self.function)

    def scatter_words(self) -> str:
        """Return the scatter about the law and its source, in words."""
        if self.is_exact():
            return "exact"
        if inspect.signature(self.scatter).parameters:
            return f"scatter {self.scatter_source}"
        angle = self.quantity.endswith("_rad")
        parts = ", ".join(
            f"{sd:g} rad {what}" if angle else f"{100 * sd:g} % {what}"
            for what, sd in zip(
                ("a shot", "a path", "a record"), self.scatter(), strict=True
            )
            if sd
        )
        if self.far_scatter is not None:
            parts += "; more past Z = 200, measured by calibration/far_pressure.py"
        return f"scatter {self.scatter_source}: {parts}"

    def is_exact(self) -> bool:
        """Return whether the law has no scatter."""
        # A scatter with arguments depends on the path, and is never zero everywhere.
        return not inspect.signature(self.scatter).parameters and not any(
            self.scatter()
        )


LAWS: dict[tuple[str, str], Law] = {}
PACKAGED: dict[tuple[str, str], Law] = {}
"""Laws of the package itself."""


def register(law: Law) -> Law:
    """Add a law to the table; a law of the same quantity and name is replaced."""
    LAWS[law.quantity, law.name] = law
    return law


def mark_packaged(*laws: Law) -> None:
    """Mark laws, or all registered so far, as those of the package itself."""
    PACKAGED.update({(law.quantity, law.name): law for law in laws or LAWS.values()})


def others() -> tuple[Law, ...]:
    """Return the laws that were registered from outside the package."""
    return tuple(law for key, law in LAWS.items() if PACKAGED.get(key) is not law)


def law_for(quantity: str, name: str) -> Law:
    """Return a law.

    Raises:
        InputError: The law is unknown; the message lists the laws of the quantity.
    """
    if (quantity, name) not in LAWS:
        known = names_for(quantity)
        raise InputError(
            f"law of {quantity}: expected one of {', '.join(known) or '(none yet)'}, "
            f"got {shown(name)}{nearest(name, known)}"
        )
    return LAWS[quantity, name]


def names_for(quantity: str) -> tuple[str, ...]:
    """Return the names of all laws of a quantity."""
    return tuple(name for q, name in LAWS if q == quantity)


def law_words(name: str) -> str:
    """Return the name of a law in sentences."""
    titles = (law.title for law in LAWS.values() if law.name == name and law.title)
    return next(titles, name.replace("_", " "))


def names() -> tuple[str, ...]:
    """Return the names of all laws, each once, in order of registration."""
    return tuple(dict.fromkeys(name for _, name in LAWS))


def call(function: Callable[..., Any], path: Any) -> Any:
    """Call a law (or its `valid` or `scatter`) with the attributes of a path.

    Without a burst a law that depends on it is the mean of its curves for free air and
    for the surface with the weight `path.free_air`, and valid where that is 0 or 1.
    """
    # Laws are called by the names of their arguments, as each has another set.
    names = _argument_names(function)
    if not any(map(is_traced, vars(path).values())):
        # The numbers of a path are checked where they enter a scene. Traced ones become
        # NaN where a search leaves the bounds.
        function = getattr(function, "unchecked", function)

    def by_curves(burst: str | None) -> Any:
        given = {name: getattr(path, name) for name in names}
        return function(**(given | {"burst": burst} if "burst" in given else given))

    if "burst" not in names or path.burst is not None:
        return by_curves(path.burst)
    weight = path.free_air
    if namespace(weight) is np:  # half of the work where all positions have one set
        for burst, only in (("surface", 0.0), ("free-air", 1.0)):
            if np.all(weight == only):
                return by_curves(burst)
    return _between(by_curves("surface"), by_curves("free-air"), weight)


@cache
def _argument_names(function: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(inspect.signature(function).parameters)


def _between(low: Any, free: Any, weight: Any) -> Any:
    if isinstance(low, tuple):
        return tuple(_between(*both, weight) for both in zip(low, free, strict=True))
    if isinstance(low, bool) or getattr(low, "dtype", None) == "bool":
        return ((weight >= 1.0) & free) | ((weight <= 0.0) & low)
    return weight * free + (1.0 - weight) * low


def total_scatter(law: Law, path: Any) -> Any:
    """Return the standard deviation of real blasts about a law: all parts together."""
    parts = call(law.scatter, path)
    if law.far_scatter is not None:
        parts = (*parts, *call(law.far_scatter, path))
    # The parts are independent, so their variances add.
    return sum(part**2 for part in parts) ** 0.5


def declared_scatter(
    shot: float, record: float
) -> Callable[[], tuple[float, float, float]]:
    """Return a declared scatter: the standard deviations of a shot and of a record."""
    return lambda: (shot, 0.0, record)
