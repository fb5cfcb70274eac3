"""The table of laws: which law gives which quantity, and how to call it.

Each law registers itself where it is defined. The names of its arguments are the
attributes of `waves.paths.Path`, so the table needs no knowledge of any law, and this
file imports nothing of ours.
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Law:
    """One law for one quantity.

    Attributes:
        quantity: What it gives, by the name used in observation files.
        name: The law's name, as in `--law NAME`.
        function: The law. Its arguments are named as in `waves.paths.Path`.
        range: Where it holds, in words.
        source: Where it comes from.
        valid: True where it holds; its arguments are named likewise.
        scatter: How far nature departs from it, in ln of the quantity (of the travel
            time for arrivals): standard deviations of what a whole shot shares, of
            what one path shares, and of each record. Arguments named likewise.
        scatter_source: Where the scatter comes from: measured by which script, or
            declared.
        joins: Scaled distances [m/kg^(1/3)] where slope or curvature is not continuous
            (scaled times [s/kg^(1/3)] for what is taken at a time).
        far_scatter: Scatter added far away, likewise in ln: standard deviations of an
            effect that the far rows of a shot share, independent of the shot's own,
            and of each record. None: nothing is added.
    """

    quantity: str
    name: str
    function: Callable[..., Any]
    range: str
    source: str
    valid: Callable[..., Any]
    scatter: Callable[..., tuple[Any, Any, Any]]
    scatter_source: str
    joins: tuple[float, ...] = ()
    far_scatter: Callable[..., tuple[Any, Any]] | None = None

    def arguments(self) -> tuple[str, ...]:
        """Names of what the law depends on, as `waves.paths.Path` calls them."""
        return tuple(inspect.signature(self.function).parameters)

    def scatter_words(self) -> str:
        """Say how far nature departs from the law, and how that is known."""
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
        """Whether nature does not depart from it at all."""
        return not inspect.signature(self.scatter).parameters and not any(
            self.scatter()
        )


LAWS: dict[tuple[str, str], Law] = {}
RESERVED: dict[tuple[str, str], Law] = {}
"""Laws that are found by name, and never offered: wrong, and kept to repeat a source.
"""
PACKAGED: dict[tuple[str, str], Law] = {}
"""Those that the package comes with."""


def register(law: Law) -> Law:
    """Enter a law into the table; a law of the same quantity and name is replaced."""
    LAWS[law.quantity, law.name] = law
    return law


def reserve(law: Law) -> Law:
    """Enter a law that only who names it gets: no list, choice or chart has it."""
    RESERVED[law.quantity, law.name] = law
    return law


def mark_packaged(*laws: Law) -> None:
    """Take laws, or all registered so far, for those that the package comes with."""
    PACKAGED.update({(law.quantity, law.name): law for law in laws or LAWS.values()})


def are_packaged() -> bool:
    """Return whether all laws are those that the package comes with."""
    return all(PACKAGED.get(key) is law for key, law in LAWS.items())


def law_for(quantity: str, name: str) -> Law:
    """Look a law up.

    Raises:
        ValueError: No such law gives that quantity; the message lists those that do.
    """
    if not is_law(quantity, name):
        raise ValueError(
            f"no law named {name!r} gives {quantity}; "
            f"expected one of {', '.join(names_for(quantity)) or '(none yet)'}"
        )
    return LAWS.get((quantity, name)) or RESERVED[quantity, name]


def is_law(quantity: str, name: str) -> bool:
    """Return whether a law of that name gives a quantity, offered or not."""
    return (quantity, name) in LAWS or (quantity, name) in RESERVED


def names_for(quantity: str) -> tuple[str, ...]:
    """Names of all laws that give a quantity."""
    return tuple(name for q, name in LAWS if q == quantity)


def names() -> tuple[str, ...]:
    """Names of all laws, each once, in order of registration."""
    return tuple(dict.fromkeys(name for _, name in LAWS))


def call(function: Callable[..., Any], path: Any) -> Any:
    """Call a law (or its `valid` or `scatter`) with what it asks for of a path.

    Where the path leaves the curve set to the height, by the one it leaves.
    """
    names = inspect.signature(function).parameters
    if "burst" in names and path.burst is None:
        return path.by_height(lambda way: call(function, way))
    return function(*(getattr(path, name) for name in names))


def total_scatter(law: Law, path: Any) -> Any:
    """Return one standard deviation of nature about a law: all parts together."""
    parts = call(law.scatter, path)
    if law.far_scatter is not None:
        parts = (*parts, *call(law.far_scatter, path))
    return sum(part**2 for part in parts) ** 0.5


def declared_scatter(
    shot: float, record: float
) -> Callable[[], tuple[float, float, float]]:
    """Scatter that nobody measured: one standard deviation a shot, one a record."""
    return lambda: (shot, 0.0, record)
