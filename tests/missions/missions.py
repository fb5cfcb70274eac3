"""Missions made by hand: short ones."""

import numpy as np

from jblast.missions import Item, Plan, mission_of
from jblast.missions.route import geodetic
from jblast.observations.places import Frame
from jblast.scene import Place

HOME = Place(35.3075, -80.7353, 200.0)


def item(
    number: int,
    command: int,
    place: tuple[float, float, float] | None = None,
    params: dict[str, float] | None = None,
) -> Item:
    """An item at a place east, north, up of home; p1 to p4 by name."""
    said = {name: float(value) for name, value in (params or {}).items()}
    first = (said.get("p1"), said.get("p2"), said.get("p3"), said.get("p4"))
    if place is None:
        return Item(number, command, 2, (*first, None, None, None))
    lat, lon, _ = geodetic(Frame(*HOME), np.array(place, float)).tolist()
    return Item(number, command, 3, (*first, lat, lon, float(place[2])))


def plan(*rows: tuple) -> Plan:
    """A plan of (command, place, parameters)."""
    return Plan(tuple(item(n, *row) for n, row in enumerate(rows, start=1)), HOME)


def mission(*rows, **options):
    return mission_of(plan(*rows), **options)


UP, LAND = (22, (0, 0, 6), {}), (21, (0, 0, 0), {})
