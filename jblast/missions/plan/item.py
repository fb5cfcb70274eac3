"""A plan: where home is, and its items in their order."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from jblast.errors import InputError, nearest, shown
from jblast.missions.plan.commands import (
    COMMANDS,
    FRAMES,
    FRAMES_NOT_FLOWN,
    MISSION,
    command_words,
)
from jblast.parameter_table import PLACE_LIMITS
from jblast.scene import Place

Parameters = tuple[
    float | None,
    float | None,
    float | None,
    float | None,
    float | None,
    float | None,
    float | None,
]


@dataclass(frozen=True)
class Item:
    """One item of a plan.

    Attributes:
        number: By which others, and messages, name it; a ground station shows it.
        command: Of `commands.COMMANDS`.
        frame: Of `commands.FRAMES`: what its height is counted from.
        params: Seven: 1 to 4 by the command, latitude and longitude [degree], height
            [m]; None where nothing is said.
        auto_continue: Whether the next follows by itself.
    """

    number: int
    command: int
    frame: int
    params: Parameters
    auto_continue: bool = True

    @property
    def words(self) -> str:
        """How messages and tables name it: number and command."""
        return f"item {self.number}, {COMMANDS[self.command].name}"

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude [degree]; None: where the vehicle is, or nowhere."""
        lat, lon = self.params[4], self.params[5]
        placed = COMMANDS[self.command].placed
        if placed == "never" or lat is None or lon is None:
            return None
        if placed == "may" and lat == 0 and lon == 0:
            return None
        return lat, lon

    def number_of(self, parameter: int, default: float = 0.0) -> float:
        """Return parameter 1 to 7, or what stands for it where nothing is said."""
        value = self.params[parameter - 1]
        return default if value is None else value


@dataclass(frozen=True)
class Plan:
    """A plan.

    Attributes:
        items: In their order.
        home: Latitude, longitude, height above the sea; None: it does not say.
        hover_speed_m_s: What a multicopter cruises with; None: it does not say.
        firmware: Whose the plan is, 12 PX4, 3 ArduPilot, as MAVLink numbers them.
        source: The file it was read from; "" for one made here.
        not_flown: What it has besides that nobody here goes by, in words.
        rest: Other parts of its file, as they were read, to be written back.
    """

    items: tuple[Item, ...]
    home: Place | None = None
    hover_speed_m_s: float | None = None
    firmware: int = 12
    source: str = ""
    not_flown: tuple[str, ...] = ()
    rest: dict[str, Any] = field(default_factory=dict, compare=False)

    @property
    def where(self) -> str:
        """What messages call it."""
        return self.source or "plan"


def checked_item(
    where: str,
    number: int,
    command: Any,
    frame: Any,
    params: Sequence[Any],
    auto_continue: bool = True,
) -> Item:
    """Return an item whose numbers can be used.

    Args:
        where: The file, and the line if it has lines, for the messages.
        number: Of the item.
        command: As it was read.
        frame: Likewise.
        params: Seven; None and NaN are not said.
        auto_continue: Whether the next follows by itself.

    Raises:
        InputError: The command or its frame is not flown, the place or the height is
            missing, or out of range, or a parameter asks for what nobody here does.
    """
    at = f"{where}: item {number}"
    if type(command) is not int or command not in COMMANDS:
        given = command_words(command) if type(command) is int else shown(command)
        known = ", ".join(command_words(one) for one in COMMANDS)
        raise InputError(f"{at} command: expected one of {known}; got {given}")
    kind = COMMANDS[command]
    at = f"{at}, {kind.name}"
    if type(frame) is not int or frame not in FRAMES:
        frames = ", ".join(f"{one} ({words})" for one, words in FRAMES.items())
        other = FRAMES_NOT_FLOWN.get(frame) if type(frame) is int else None
        got = shown(frame) + (f" ({other})" if other else "")
        raise InputError(f"{at}, frame: expected one of {frames}; got {got}")
    values = [_number(value, f"{at}, parameter {n}") for n, value in _counted(params)]
    for n, value in _counted(values[:4]):
        if value and n not in kind.used:
            raise InputError(
                f"{at}, parameter {n}: expected 0 or nothing, which is all that is "
                f"flown of it, got {value:g}"
            )
    item = Item(number, command, frame, (*values,), auto_continue)  # type: ignore[arg-type]  seven, counted by the reader
    if kind.placed != "never":
        _check_place(item, at)
    return item


def check_numbers(items: Sequence[Item], where: str) -> None:
    """Refuse two items of one number.

    Raises:
        InputError: There are.
    """
    seen: set[int] = set()
    for item in items:
        if item.number in seen:
            raise InputError(
                f"{where}: item {item.number}: expected a number of its own, got that "
                "of another item"
            )
        seen.add(item.number)


def _check_place(item: Item, at: str) -> None:
    """Refuse a place that is none.

    Raises:
        InputError: Latitude, longitude or height are missing or out of range.
    """
    if item.frame == MISSION:
        raise InputError(f"{at}, frame: expected one with a place, 0 or 3, got 2")
    lat, lon, alt = item.params[4:]
    needs = COMMANDS[item.command].placed == "always"
    for name, value in (("latitude", lat), ("longitude", lon)):
        if value is None and needs:
            raise InputError(f"{at}, {name}: expected a number [degree], got nothing")
    if lat is not None and not -90.0 <= lat <= 90.0:
        swapped = ""
        if lon is not None and abs(lon) <= 90.0 and abs(lat) <= 180.0:
            swapped = "; are latitude and longitude swapped?"
        raise InputError(
            f"{at}, latitude: expected -90 to 90 degrees, got {lat:g}{swapped}"
        )
    if lon is not None and not -180.0 <= lon <= 180.0:
        raise InputError(f"{at}, longitude: expected -180 to 180 degrees, got {lon:g}")
    if alt is None:
        if item.command == 21:  # lands at the ground, whatever is said
            return
        raise InputError(f"{at}, height: expected a number [m], got nothing")
    if not PLACE_LIMITS["alt_m"].allows(alt):
        words = PLACE_LIMITS["alt_m"].words()
        raise InputError(f"{at}, height: expected a number {words} m, got {alt:g}")


def _counted(values: Sequence[Any]) -> list[tuple[int, Any]]:
    return list(enumerate(values, start=1))


def _number(value: Any, at: str) -> float | None:
    """Return a number; None where nothing is said, which NaN says too."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        advice = nearest(value, ("null",)) if isinstance(value, str) else ""
        raise InputError(f"{at}: expected a number or null, got {shown(value)}{advice}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if math.isinf(number):
        raise InputError(f"{at}: expected a finite number, got {shown(value)}")
    return None if math.isnan(number) else number
