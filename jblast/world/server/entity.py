"""Who takes part in a world: what it is called, where it is, what it senses."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, nearest, shown
from jblast.scene.reader.schema import VEHICLE_MODELS
from jblast.vehicle import named

SENSES = ("flash", "ground", "pressure", "sound", "force")
"""What an entity may sense; payloads are made of the last three."""
SAMPLED = {"pressure", "sound"}
SAMPLES_HZ = (100.0, 192_000.0)
"""Least and most samples a second of who senses pressure or sound."""
LONGEST_NAME = 64
MOST_KNOTS = 4096
"""Places of a path, at most."""
Numbers = Sequence[float | int] | Float[np.ndarray, "..."]
"""Some in a row, as callers have them."""


class Motion(NamedTuple):
    """How an entity moves, as it says itself.

    Attributes:
        time_s: When, on the common clock [s].
        position_m: East, north, up [m].
        velocity_m_s: Likewise [m/s].
        quaternion: Body to world, scalar last.
        body_rate_rad_s: Body axes [rad/s].
    """

    time_s: float
    position_m: Float[np.ndarray, "3"]
    velocity_m_s: Float[np.ndarray, "3"]
    quaternion: Float[np.ndarray, "4"]
    body_rate_rad_s: Float[np.ndarray, "3"]


class Entity(NamedTuple):
    """One who takes part.

    Attributes:
        name: What tells it from others.
        senses: Some of `SENSES`.
        position_m: Where it stands, or starts: east, north, up [m].
        path: Times [s] and places [m] that it will be at, straight between and at rest
            before and after; None: it stands, or reports how it moves.
        vehicle: Model that feels the force; "" without one.
        samples_hz: Of pressure and sound [Hz].
    """

    name: str
    senses: tuple[str, ...]
    position_m: Float[np.ndarray, "3"]
    path: tuple[Float[np.ndarray, " knot"], Float[np.ndarray, "knot 3"]] | None = None
    vehicle: str = ""
    samples_hz: float = 8000.0


def checked_entity(
    name: str,
    senses: Sequence[str],
    *,
    position_m: Numbers | None = None,
    path: tuple[Numbers, Sequence[Numbers] | Float[np.ndarray, "knot 3"]] | None = None,
    vehicle: str = "",
    samples_hz: float | int | None = None,
) -> Entity:
    """Return an entity, looked at before it is let in.

    Args:
        name: Printable, at most `LONGEST_NAME` characters.
        senses: Some of `SENSES`, at least one.
        position_m: East, north, up [m]; or
        path: times [s] that rise and the places [m] at them.
        vehicle: Model that feels the force; needed by who senses it.
        samples_hz: Of pressure and sound; None: 8000 Hz.

    Raises:
        InputError: Any of these cannot be used.
    """
    where = f"entity {shown(name)}"
    if not (0 < len(name) <= LONGEST_NAME and name.isprintable()):
        raise InputError(
            f"entity name: expected 1 to {LONGEST_NAME} printable characters, got "
            f"{shown(name)}"
        )
    for sense in senses:
        if sense not in SENSES:
            raise InputError(
                f"{where} senses: expected some of {', '.join(SENSES)}, got "
                f"{shown(sense)}{nearest(sense, SENSES)}"
            )
    if not senses:
        raise InputError(f"{where} senses: expected some of {', '.join(SENSES)}")
    if (position_m is None) == (path is None):
        came = "neither" if path is None else "both"
        raise InputError(f"{where}: expected either a place or a path, got {came}")
    track = None if path is None else _path(where, *path)
    if track is not None:
        position_m = track[1][0]
    rate = 8000.0 if samples_hz is None else float(samples_hz)
    if SAMPLED & set(senses) and not SAMPLES_HZ[0] <= rate <= SAMPLES_HZ[1]:
        raise InputError(
            f"{where} samples_hz: expected {SAMPLES_HZ[0]:g} to {SAMPLES_HZ[1]:,.0f} "
            f"Hz, got {rate:g}"
        )
    if "force" in senses and not vehicle:
        raise InputError(
            f"{where} vehicle: expected the model that feels the force, one of "
            f"{', '.join(VEHICLE_MODELS)}; got none"
        )
    if vehicle:
        named(vehicle)
    return Entity(
        name,
        tuple(sense for sense in SENSES if sense in senses),
        above_ground(f"{where} position_m", () if position_m is None else position_m),
        track,
        vehicle,
        rate,
    )


def checked_motion(
    time_s: float | int,
    position_m: Numbers,
    velocity_m_s: Numbers = (0.0, 0.0, 0.0),
    quaternion: Numbers = (0.0, 0.0, 0.0, 1.0),
    body_rate_rad_s: Numbers = (0.0, 0.0, 0.0),
) -> Motion:
    """Return what an entity reports of its motion, looked at.

    Args:
        time_s: When, on the common clock [s].
        position_m: East, north, up [m].
        velocity_m_s: Likewise [m/s].
        quaternion: Body to world, scalar last, of any length but 0.
        body_rate_rad_s: Body axes [rad/s].

    Raises:
        InputError: One of them is no number, or of another length.
    """
    turn = numbers("motion quaternion", quaternion, 4)
    if not (length := float(np.linalg.norm(turn))) > 0:
        raise InputError("motion quaternion: expected one of a length, got zeros")
    if not math.isfinite(time_s):
        raise InputError(f"motion time_s: expected a finite number, got {time_s}")
    return Motion(
        float(time_s),
        numbers("motion position_m", position_m, 3),
        numbers("motion velocity_m_s", velocity_m_s, 3),
        turn / length,
        numbers("motion body_rate_rad_s", body_rate_rad_s, 3),
    )


def numbers(where: str, values: Numbers, count: int) -> np.ndarray:
    """Return so many finite numbers as an array.

    Raises:
        InputError: They are not.
    """
    found = np.asarray(values, float)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise InputError(
            f"{where}: expected {count} finite numbers, got {shown(list(values))}"
        )
    return found


def above_ground(where: str, values: Numbers) -> np.ndarray:
    """Return a place on the ground or above it, east, north, up [m].

    Raises:
        InputError: It is none.
    """
    place = numbers(where, values, 3)
    if place[2] < 0:
        raise InputError(
            f"{where}: expected a place on the ground or above it, got "
            f"{place[2]:g} m up"
        )
    return place


def _path(
    where: str,
    times: Numbers,
    places: Sequence[Numbers] | Float[np.ndarray, "knot 3"],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the knots of a path."""
    if not 1 <= len(times) == len(places) <= MOST_KNOTS:
        raise InputError(
            f"{where} path: expected 1 to {MOST_KNOTS} times and as many places, got "
            f"{len(times)} and {len(places)}"
        )
    when = numbers(f"{where} path time_s", times, len(times))
    if (np.diff(when) <= 0).any():
        raise InputError(f"{where} path time_s: expected rising times, got others")
    place = [above_ground(f"{where} path position_m", place) for place in places]
    return when, np.stack(place)
