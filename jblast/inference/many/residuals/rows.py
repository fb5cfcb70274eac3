"""The objective over lanes: how many logs of one layout are missed, and the slopes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.many.residuals.fold import Cell, over_cells
from jblast.inference.many.residuals.row_groups import (
    RowGroup,
    free_clocks,
    grouped_rows,
)
from jblast.inference.many.residuals.row_program import row_program
from jblast.inference.many.solver.robust_loss import TermLoss
from jblast.inference.posterior.parameters import Parameters
from jblast.observations import CLOCK_TIMES
from jblast.scene import Free
from jblast.sensors import Layout
from jblast.sensors.record import clock_offsets, to_error_scale
from jblast.sensors.simulate import Noise


class Miss(NamedTuple):
    """Residuals and their slopes over lanes.

    Rows are first those of the log, then the shared effects and the numbers with a
    prior (standard normal all), then ln of the rows' scales where they vary with what
    is fitted (not where logs merely have errors of their own).

    Attributes:
        residual: In standard deviations.
        columns: Its derivative to each unknown.
    """

    residual: Float[Array, "term lane"]
    columns: tuple[Float[Array, "term lane"], ...]


@dataclass(frozen=True)
class LaneRows:
    """Logs of one layout.

    The unknowns are the coordinates of `parameters`, then the shared effects.

    Attributes:
        parameters: What is fitted.
        layout: Who recorded what.
        laws: Pairs of quantity and law name.
        noise: Distribution of the independent errors.
        groups: The rows in parts.
        effects: How many effects the rows share.
        offsets: What clocks that are known show too much, by row.
    """

    parameters: Parameters
    layout: Layout
    laws: tuple[tuple[str, str], ...]
    noise: Noise
    groups: tuple[RowGroup, ...]
    effects: int
    offsets: np.ndarray

    @property
    def unknowns(self) -> int:
        """How many numbers are sought in each lane."""
        return len(self.parameters.names) + self.effects

    @property
    def with_prior(self) -> list[int]:
        """Which numbers have a prior."""
        return [
            k for k, b in enumerate(self.parameters.beliefs) if not isinstance(b, Free)
        ]

    @property
    def varies(self) -> bool:
        """Whether the size of the errors may depend on what is fitted."""
        return self.parameters.scene.scatter

    @property
    def loss(self) -> TermLoss:
        """What each term costs."""
        return TermLoss(self.noise, len(self.layout.quantity), self.scored)

    @property
    def scored(self) -> int:
        """How many terms miss something: rows, effects, numbers with a prior."""
        return len(self.layout.quantity) + self.effects + len(self.with_prior)

    def miss(
        self,
        y: Float[Array, "unknown lane"],
        measured: Float[Array, "row lane"],
        sigma: Float[Array, "row lane"] | np.ndarray,
        *,
        sd_known: bool = False,
    ) -> Miss:
        """Return residuals and slopes.

        Args:
            y: Unknowns.
            measured: Readings; in ln unless they are `ADDITIVE`.
            sigma: Their instrument error, same unit; best a NumPy array (row, 1) if
                all logs have the same.
            sd_known: Take the size of the errors as known, as Fisher information does.
        """
        lanes, known = y.shape[1], np.zeros((1, 1), y.dtype)
        terms: list[tuple[int, Cell, list[Cell]]] = []
        scales: list[tuple[int, Cell, list[Cell]]] = []
        for part in self.groups:
            u, columns, ln_sd, ln_sd_columns = self._part(
                part, y, measured, sigma, sd_known=sd_known
            )
            terms.append((part.rows.size, u, columns))
            if self.varies and not sd_known and not all(map(_is_zero, ln_sd_columns)):
                scales.append((part.rows.size, ln_sd, ln_sd_columns))
        for k in [*range(len(self.parameters.names), self.unknowns), *self.with_prior]:
            unit = [known + (j == k) for j in range(self.unknowns)]
            terms.append((1, y[k : k + 1], unit))
        terms += scales

        def stack(cells):
            return jnp.concatenate(
                [
                    jnp.broadcast_to(cell, (count, lanes))
                    for (count, *_), cell in zip(terms, cells, strict=True)
                ]
            )

        return Miss(
            stack([u for _, u, _ in terms]),
            tuple(
                stack([columns[k] for *_, columns in terms])
                for k in range(self.unknowns)
            ),
        )

    def to_error_scale(
        self, readings: Float[Array, "log row"]
    ) -> Float[Array, "row log"]:
        """Return readings as `miss` wants them, by clocks that are right."""
        timed = np.isin(self.layout.quantity, CLOCK_TIMES)
        late = np.where(timed, self.offsets, 0.0).astype(readings.dtype)
        value = jax.vmap(lambda r: to_error_scale(r, self.layout.quantity))(readings)
        return (value - late[None, :]).T

    def _part(self, part: RowGroup, y, measured, sigma, *, sd_known):
        """Run the program of some rows over lanes."""
        n, rows, layout = len(self.parameters.names), part.rows, self.layout
        slots = len(part.slots)
        programs = row_program(self.parameters, self.laws, part, sd_known=sd_known)

        def column(x):
            return np.asarray(x, y.dtype)[rows][:, None]

        shared = [y[n + of_row] for of_row in part.slots]
        shared = [
            x[:1] if np.ptp(i) == 0 else x
            for x, i in zip(shared, part.slots, strict=True)
        ]
        cells = over_cells(
            programs.each,
            [
                *(y[k : k + 1] for k in range(n)),
                *shared,
                *(column(np.asarray(layout.position)[:, i]) for i in range(3)),
                column(layout.slant_range),
                column(np.asarray(layout.time) - self.offsets),
                part.of(measured),
                part.of(sigma),
            ],
            programs.together,
        )
        u, ln_sd, slopes = cells[0], cells[1], cells[2:]
        return (
            u,
            part.spread(slopes[: n + slots], self.effects, y.dtype),
            ln_sd,
            part.spread(slopes[n + slots :], self.effects, y.dtype),
        )


def _is_zero(cell: Cell) -> bool:
    """Return whether a slope is known to be none, before any lane is."""
    return isinstance(cell, np.ndarray) and not cell.any()


def rows_of(
    parameters: Parameters, layout: Layout, laws: Mapping[str, str], noise: Noise
) -> LaneRows:
    """Sort the rows of a layout into parts that are alike."""
    groups, effects = grouped_rows(parameters, layout, laws)
    offsets = np.asarray(clock_offsets(parameters.scene, layout))
    fixed = ~np.isin(layout.clock, free_clocks(parameters))
    return LaneRows(
        parameters=parameters,
        layout=layout,
        laws=tuple(sorted(laws.items())),
        noise=noise,
        groups=groups,
        effects=effects,
        offsets=np.where(fixed, offsets, 0.0),
    )
