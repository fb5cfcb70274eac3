"""The rows of a layout in parts, each served by one program."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import numpy as np

from jblast.inference.many.residuals.fold import Cell
from jblast.inference.posterior.parameters import Parameters
from jblast.parameters import CLOCK_OFFSET
from jblast.sensors import Layout
from jblast.sensors.record import record


class RowGroup(NamedTuple):
    """Rows that differ by numbers alone, which one program serves.

    Attributes:
        layout: The first of them.
        rows: Which rows they are.
        slots: Of each effect that a row has, which of the log's effects it is.
    """

    layout: Layout
    rows: np.ndarray
    slots: tuple[np.ndarray, ...]

    def of(self, x):
        """Pick these rows of an array, by a slice if one will do."""
        rows, steps = self.rows, np.unique(np.diff(self.rows))
        if rows.size > 1 and steps.size > 1:
            return x[rows]
        step = int(steps[0]) if rows.size > 1 else 1
        return x[int(rows[0]) : int(rows[-1]) + 1 : step]

    def spread(self, slopes: list[Cell], effects: int, dtype) -> list[Cell]:
        """Give the slopes to a row's own effects to the effects of the log.

        Args:
            slopes: To the fitted coordinates, then to each of `slots`.
            effects: How many effects the log has.
            dtype: Of the slopes.
        """
        n = len(slopes) - len(self.slots)
        nothing = np.zeros((1, 1), dtype)
        columns = [*slopes[:n], *[nothing] * effects]
        for slope, of_row in zip(slopes[n:], self.slots, strict=True):
            for effect in np.unique(of_row):
                mask = (of_row == effect).astype(dtype)[:, None]
                columns[n + effect] = columns[n + effect] + mask * slope
        return columns


def grouped_rows(
    parameters: Parameters, layout: Layout, laws: Mapping[str, str]
) -> tuple[tuple[RowGroup, ...], int]:
    """Return the rows in parts, and how many effects they share."""
    free = free_clocks(parameters)
    found: dict[tuple[str, int, str], list[int]] = {}
    kinds = zip(layout.quantity, layout.shot, layout.clock, strict=True)
    for row, (quantity, shot, clock) in enumerate(kinds):
        key = (quantity, shot, clock if clock in free else "")
        found.setdefault(key, []).append(row)
    effects: dict[tuple, int] = {}
    groups = []
    for (quantity, shot, clock), at in found.items():
        rows = np.array(at)
        one = Layout(
            quantity=(quantity,),
            position=layout.position[rows[:1]],
            slant_range=layout.slant_range[rows[:1]],
            time=layout.time[rows[:1]],
            group=(0,),
            shot=(shot,),
            clock=(clock,),
        )
        shape = jax.eval_shape(lambda s, o=one: record(s, o, laws), parameters.scene)
        keys = [[("shot", name)] * len(at) for name in shape.shot_loading]
        keys += [
            [("path", name, layout.group[row]) for row in at]
            for name in shape.path_loading
        ]
        slots = tuple(
            np.array([effects.setdefault(key, len(effects)) for key in of_row])
            for of_row in keys
        )
        groups.append(RowGroup(one, rows, slots))
    return tuple(groups), len(effects)


def free_clocks(parameters: Parameters) -> list[str]:
    """Return the clocks whose offset is fitted."""
    parts = [name.partition(".") for name in parameters.names]
    return [label for base, _, label in parts if base == CLOCK_OFFSET]
