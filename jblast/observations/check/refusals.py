"""All that a log and a scene may not say together, where a fit tells the first."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from jblast.errors import InputError
from jblast.observations.default_scene import for_log
from jblast.observations.grouping import by_shot, some_rows
from jblast.observations.located import located
from jblast.observations.placement import resolve_positions
from jblast.observations.table import Observations
from jblast.quantities import components
from jblast.registry import names_for
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

MOST = 200
"""Faults of one log that are told; past them the log is another one altogether."""
ROWS = 400_000
"""Rows that are looked through again for the next fault: fewer faults of a long log."""


def refusals(observations: Observations, uncertain: UncertainScene) -> list[InputError]:
    """Return why a fit would refuse a log beside a scene: a fault a row, in order.

    A log of several shots is as many logs, unless the scene names its charges.
    """
    several = uncertain.scene.others
    logs = [observations] if several else list(by_shot(observations).values())
    found: dict[str, InputError] = {}
    for log in logs:
        for fault in [*_lawless(log), *_of_log(log, uncertain)]:
            found.setdefault(str(fault), fault)
    return list(found.values())


def with_places(observations: Observations, uncertain: UncertainScene) -> Observations:
    """Return a log about the scene's place, with the places that it gives sensors."""
    with suppress(InputError):  # from another continent, which `refusals` tells
        observations = located(observations, uncertain)
    sensors = uncertain.scene.sensors
    known = {sensor.name: np.asarray(sensor.position_m) for sensor in sensors}
    position = observations.position.copy()
    for row in np.flatnonzero(np.isnan(position).any(axis=1)):
        position[row] = known.get(observations.sensor[row], position[row])
    return replace(observations, position=position)


def _lawless(log: Observations) -> list[InputError]:
    """Return a fault for each quantity that no law gives yet."""
    return [
        InputError(
            f"{log.where(log.quantity.index(quantity))}: no law gives {name}: not "
            "supported yet"
        )
        for quantity in dict.fromkeys(log.quantity)
        for name, _ in components(quantity)
        if not names_for(name) and quantity != "overpressure_record"
    ]


def _of_log(log: Observations, uncertain: UncertainScene) -> list[InputError]:
    """Take row after row out of the log that places and times are refused for."""
    found: list[InputError] = []
    most = min(MOST, 1 + ROWS // max(len(log), 1))
    while len(log) and len(found) < most:
        uncertain = for_log(uncertain, log)
        try:
            resolve_positions(
                located(log, uncertain),
                uncertain.scene,
                uncertain.beliefs,
                is_default=uncertain.source == NO_SCENE,
            )
        except InputError as fault:
            row = _row_of(fault, log)
            if row is None:  # of the whole log; less of it says nothing new
                return found or [fault]
            found.append(fault)
            log = some_rows(log, np.delete(np.arange(len(log)), row))
        else:
            break
    return found


def _row_of(fault: InputError, log: Observations) -> int | None:
    """Return which row a fault names: messages begin with its place."""
    message = str(fault)
    for row in range(len(log)):
        where = log.where(row)
        if message.startswith((f"{where}:", f"{where},")):
            return row
    return None
