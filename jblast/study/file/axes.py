"""The axes of a study: numbers of the scene, or whatever else its file says.

    [axes]
    charge_mass_kg = [1, 10, 100]
    charge_east_m = { from = 5, to = 50, count = 10 }
    air_temperature_k = { from = 260, to = 300 }
    "vehicle.model" = ["crazyflie", "hummingbird"]

Listed values are crossed with each other, and each combination has its own draws.
Without a count a range is drawn from, evenly, or evenly in ln.
"""

from typing import Any, NamedTuple

import numpy as np

from jblast.errors import InputError, nearest, shown
from jblast.parameters import CLOCK_OFFSET, PARAMETERS
from jblast.scene.reader.tables import finite
from jblast.scene.uncertain import LogUniform, Prior, Uniform, parameter_named
from jblast.study.file.study import Axis

MOST_VALUES = 100_000
RANGE_KEYS = ("from", "to", "count", "scale")
SCALES = ("linear", "log")


class Drawn(NamedTuple):
    """An axis that is drawn from.

    Attributes:
        key: A number of the scene by name.
        prior: What it is drawn from, in place of what the scene says.
    """

    key: str
    prior: Prior


def read_axes(
    table: Any, scene: dict[str, Any], source: str
) -> tuple[tuple[Axis, ...], tuple[Axis, ...], tuple[Drawn, ...]]:
    """Return axes over numbers, over other keys of the scene, and those drawn from.

    Args:
        table: What stands in [axes].
        scene: The scene's file.
        source: The study's file, for messages.

    Raises:
        InputError: There is no such number or key, or its values cannot be used.
    """
    if not isinstance(table, dict):
        raise InputError(f"{source}: [axes]: expected a table, got {shown(table)}")
    numbers, words, drawn = [], [], []
    for key, value in table.items():
        where = f"{source}: [axes] {key}"
        if not _is_number(key):
            words.append(Axis(key, _words(key, value, scene, where)))
        elif isinstance(value, dict) and "count" not in value:
            drawn.append(Drawn(key, _prior(key, value, where)))
        elif isinstance(value, dict):
            numbers.append(Axis(key, _range(key, value, where)))
        else:
            numbers.append(Axis(key, _listed(key, value, where)))
    return tuple(numbers), tuple(words), tuple(drawn)


def _is_number(key: str) -> bool:
    base = key.partition(".")[0]
    return base in PARAMETERS or base == CLOCK_OFFSET


def _listed(key: str, value: Any, where: str) -> tuple[float, ...]:
    if not isinstance(value, list) or not value:
        raise InputError(
            f"{where}: expected a list of values, or a range such as "
            f"{{ from = 1, to = 10, count = 5 }}, got {shown(value)}"
        )
    return tuple(_allowed(key, one, where) for one in value)


def _allowed(key: str, value: Any, where: str) -> float:
    """Return a value that the number may have."""
    number, bounds = finite(value, where), parameter_named(key).bounds
    if not bounds.allows(number):
        raise InputError(
            f"{where}: expected what is {bounds.words()}, got {shown(value)}"
        )
    return number


def _ends(key: str, value: dict[str, Any], where: str) -> tuple[float, float, str]:
    for name in value:
        if name not in RANGE_KEYS:
            raise InputError(
                f"{where} {name}: unknown key{nearest(name, RANGE_KEYS)}; expected "
                f"one of {', '.join(RANGE_KEYS)}"
            )
    low, high = (
        _allowed(key, value.get(name), f"{where} {name}") for name in ("from", "to")
    )
    scale = value.get("scale", "linear")
    if scale not in SCALES:
        raise InputError(
            f"{where} scale: expected one of {', '.join(SCALES)}, got {shown(scale)}"
        )
    if not low < high:
        raise InputError(f"{where}: expected from < to, got {low:g} and {high:g}")
    if scale == "log" and not low > 0:
        raise InputError(f"{where} from: expected above 0 on a log scale, got {low:g}")
    return low, high, scale


def _prior(key: str, value: dict[str, Any], where: str) -> Prior:
    low, high, scale = _ends(key, value, where)
    return LogUniform(low, high) if scale == "log" else Uniform(low, high)


def _range(key: str, value: dict[str, Any], where: str) -> tuple[float, ...]:
    low, high, scale = _ends(key, value, where)
    count = value["count"]
    if isinstance(count, bool) or not isinstance(count, int):
        raise InputError(f"{where} count: expected a whole number, got {shown(count)}")
    if not 2 <= count <= MOST_VALUES:
        raise InputError(
            f"{where} count: expected from 2 to {MOST_VALUES:,}, got {count}"
        )
    spread = np.geomspace if scale == "log" else np.linspace
    return tuple(float(one) for one in spread(low, high, count))


def _words(key: str, value: Any, scene: dict[str, Any], where: str) -> tuple[Any, ...]:
    """Return the values of a key of the scene's file that is no number by name."""
    table, dot, _ = key.partition(".")
    known = [*PARAMETERS, *scene]
    if not dot or table not in scene:
        raise InputError(
            f"{where}: unknown axis{nearest(key, known)}; expected a number of the "
            f"scene, one of {', '.join(PARAMETERS)}, or a key of one of its tables, as "
            '"vehicle.model"'
        )
    if not isinstance(value, list) or not value:
        raise InputError(f"{where}: expected a list of values, got {shown(value)}")
    return tuple(value)


def put(document: dict[str, Any], key: str, value: Any, where: str) -> None:
    """Put a value into the tables of a scene's file.

    Args:
        document: The tables; changed.
        key: As "vehicle.model"; of several tables of a kind the second word is the
            name: "sensor.gate.position_m".
        value: What is put there.
        where: File and key, for messages.

    Raises:
        InputError: There is no such table.
    """
    *way, last = key.split(".")
    at: Any = document
    for step in way:
        if isinstance(at, list):
            named = [one for one in at if isinstance(one, dict)]
            found = next((one for one in named if one.get("name") == step), None)
        else:
            found = at.get(step)
        if not isinstance(found, dict | list):
            names = [str(one.get("name")) for one in at] if isinstance(at, list) else at
            raise InputError(
                f"{where}: the scene has no {step}{nearest(step, names)}; expected one "
                f"of {', '.join(names)}"
            )
        at = found
    if isinstance(at, list):
        for one in at:
            one[last] = value
    else:
        at[last] = value
