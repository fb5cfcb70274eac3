"""The objective over lanes: how many logs of one layout are missed, and the slopes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.fisher import information_of_row
from jblast.inference.likelihood import _noise_slopes, log_noise
from jblast.inference.many.fold import Cell, over_cells
from jblast.inference.parameters import Parameters
from jblast.observations import CLOCK_TIMES
from jblast.scene import Free, with_values
from jblast.scene.parameters import CLOCK_OFFSET
from jblast.sensors import Layout
from jblast.sensors.observe import Noise, loadings
from jblast.sensors.record import clock_offsets, comparable, record

LEAST_CURVATURE = 0.1
"""A wild reading's cost bends downwards; a step counts it as this much of its weight,
which bends upwards."""


class Miss(NamedTuple):
    """Residuals and their slopes over lanes.

    Rows are first those of the log, then the shared effects and the numbers with a
    prior (standard normal all), then ln of the rows' scales where they vary.

    Attributes:
        residual: In standard deviations.
        columns: Its derivative to each unknown.
    """

    residual: Float[Array, "term lane"]
    columns: tuple[Float[Array, "term lane"], ...]


class _Alike(NamedTuple):
    """Rows that differ by numbers alone, which one program serves."""

    layout: Layout
    rows: np.ndarray
    slots: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Rows:
    """Logs of one layout.

    The unknowns are the coordinates of `parameters`, then the shared effects.

    Attributes:
        parameters: What is fitted.
        layout: Who recorded what.
        laws: Pairs of quantity and law name.
        noise: Distribution of the independent errors.
        alike: The rows in parts.
        effects: How many effects the rows share.
        offsets: What clocks that are known show too much, by row.
    """

    parameters: Parameters
    layout: Layout
    laws: tuple[tuple[str, str], ...]
    noise: Noise
    alike: tuple[_Alike, ...]
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
    def scored(self) -> int:
        """How many terms miss something: rows, effects, numbers with a prior."""
        return len(self.layout.quantity) + self.effects + len(self.with_prior)

    def miss(
        self,
        y: Float[Array, "unknown lane"],
        measured: Float[Array, "row lane"],
        sigma: Float[Array, "row lane"] | np.ndarray,
        *,
        told: bool = False,
    ) -> Miss:
        """Return residuals and slopes.

        Args:
            y: Unknowns.
            measured: Readings; in ln unless they are times.
            sigma: Their instrument error, same unit; best a NumPy array (row, 1) if
                all logs have the same.
            told: Take the size of the errors as known, as Fisher information does.
        """
        lanes, known = y.shape[1], np.zeros((1, 1), y.dtype)
        terms: list[tuple[int, Cell, list[Cell]]] = []
        scales: list[tuple[int, Cell, list[Cell]]] = []
        for part in self.alike:
            u, columns, ln_sd, ln_sd_columns = self._part(
                part, y, measured, sigma, told=told
            )
            terms.append((part.rows.size, u, columns))
            if not isinstance(ln_sd, np.ndarray) and not told:
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

    def comparable(self, readings: Float[Array, "log row"]) -> Float[Array, "row log"]:
        """Return readings as `miss` wants them, by clocks that are right."""
        timed = np.isin(self.layout.quantity, CLOCK_TIMES)
        late = np.where(timed, self.offsets, 0.0).astype(readings.dtype)
        value = jax.vmap(lambda r: comparable(r, self.layout.quantity))(readings)
        return (value - late[None, :]).T

    def loss(self, residual: Float[Array, "term lane"]) -> tuple[Array, Array, Array]:
        """Return minus ln density, up to a constant, its slope and its curvature."""
        return self._loss(residual, LEAST_CURVATURE)

    def true_loss(
        self, residual: Float[Array, "term lane"]
    ) -> tuple[Array, Array, Array]:
        """Return the same, with the curvature that wild readings really have."""
        return self._loss(residual, None)

    def information(self, residual: Float[Array, "term lane"]) -> np.ndarray:
        """Return the expected curvature of each term."""
        n = len(self.layout.quantity)
        of_rows = np.full(n, information_of_row(self.noise))
        rest = np.ones(residual.shape[0] - n)
        return np.concatenate([of_rows, rest]).astype(residual.dtype)[:, None]

    def _loss(self, residual, least):
        n, m = len(self.layout.quantity), self.scored
        u, normal, scale = residual[:n], residual[n:m], residual[m:]
        slope, curvature = _noise_slopes(u, self.noise)
        if self.noise == "student" and least is not None:
            weight = slope / jnp.where(u == 0, 1.0, u)
            curvature = jnp.maximum(curvature, least * weight)
        value = log_noise(jnp.zeros((), u.dtype), self.noise) - log_noise(u, self.noise)
        one, zero = jnp.ones_like(normal), jnp.zeros_like(scale)
        return (
            jnp.concatenate([value, 0.5 * jnp.square(normal), scale]),
            jnp.concatenate([slope, normal, zero + 1]),
            jnp.concatenate([curvature, one, zero]),
        )

    def _part(self, part: _Alike, y, measured, sigma, *, told):
        """Run the program of some rows over lanes."""
        n, rows, layout = len(self.parameters.names), part.rows, self.layout
        slots = len(part.slots)

        def one(*numbers):
            z, v = list(numbers[:n]), list(numbers[n : n + slots])
            east, north, up, slant, time, reading, error = numbers[n + slots :]
            here = Layout(
                quantity=part.layout.quantity,
                position=jnp.stack([east, north, up])[None],
                slant_range=slant[None],
                time=time[None],
                group=(0,),
                shot=part.layout.shot,
                clock=part.layout.clock,
            )

            def miss(*unknowns):
                beliefs = zip(
                    self.parameters.names, self.parameters.beliefs, strict=True
                )
                scene = with_values(
                    self.parameters.scene,
                    {
                        name: belief.constrain(at)
                        for (name, belief), at in zip(beliefs, unknowns, strict=False)
                    },
                )
                recording = record(scene, here, dict(self.laws))
                sd = jnp.hypot(error, recording.record_sd[0])
                shared = loadings(recording, here)[0]
                if told:
                    sd, shared = jax.lax.stop_gradient((sd, shared))
                rest = reading - comparable(recording.value, here.quantity)[0]
                for j in range(slots):
                    rest = rest - shared[j] * unknowns[n + j]
                return rest / sd, jnp.log(sd)

            out, slopes = miss(*z, *v), []
            unknowns = [*z, *v]
            for k, at in enumerate(unknowns):
                # one at a time: what does not depend on it drops out
                def along(x, k=k):
                    return miss(*unknowns[:k], x, *unknowns[k + 1 :])

                slopes.append(jax.jvp(along, (at,), (jnp.ones_like(at),))[1])
            return [*out, *(s[0] for s in slopes), *(s[1] for s in slopes)]

        def column(x):
            return np.asarray(x, y.dtype)[rows][:, None]

        shared = [y[n + of_row] for of_row in part.slots]
        shared = [
            x[:1] if np.ptp(i) == 0 else x
            for x, i in zip(shared, part.slots, strict=True)
        ]
        cells = over_cells(
            one,
            [
                *(y[k : k + 1] for k in range(n)),
                *shared,
                *(column(np.asarray(layout.position)[:, i]) for i in range(3)),
                column(layout.slant_range),
                column(np.asarray(layout.time) - self.offsets),
                _picked(measured, rows),
                _picked(sigma, rows),
            ],
        )
        u, ln_sd, slopes = cells[0], cells[1], cells[2:]
        return (
            u,
            self._spread(part, slopes[: n + slots], y.dtype),
            ln_sd,
            self._spread(part, slopes[n + slots :], y.dtype),
        )

    def _spread(self, part: _Alike, slopes: list[Cell], dtype) -> list[Cell]:
        """Give the slopes to a row's own effects to the effects of the log."""
        n = len(self.parameters.names)
        nothing = np.zeros((1, 1), dtype)
        columns = [*slopes[:n], *[nothing] * self.effects]
        for slope, of_row in zip(slopes[n:], part.slots, strict=True):
            for effect in np.unique(of_row):
                mask = (of_row == effect).astype(dtype)[:, None]
                columns[n + effect] = columns[n + effect] + mask * slope
        return columns


def rows_of(
    parameters: Parameters, layout: Layout, laws: Mapping[str, str], noise: Noise
) -> Rows:
    """Sort the rows of a layout into parts that are alike."""
    free = [name.partition(".")[2] for name in parameters.names if _is_clock(name)]
    offsets = np.asarray(clock_offsets(parameters.scene, layout))
    fixed = ~np.isin(layout.clock, free)
    found: dict[tuple[str, int, str], list[int]] = {}
    kinds = zip(layout.quantity, layout.shot, layout.clock, strict=True)
    for row, (quantity, shot, clock) in enumerate(kinds):
        key = (quantity, shot, clock if clock in free else "")
        found.setdefault(key, []).append(row)
    effects: dict[tuple, int] = {}
    alike = []
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
        alike.append(_Alike(one, rows, slots))
    return Rows(
        parameters=parameters,
        layout=layout,
        laws=tuple(sorted(laws.items())),
        noise=noise,
        alike=tuple(alike),
        effects=len(effects),
        offsets=np.where(fixed, offsets, 0.0),
    )


def _picked(x, rows: np.ndarray):
    """Pick rows, by a slice if one will do."""
    steps = np.unique(np.diff(rows))
    if rows.size > 1 and steps.size > 1:
        return x[rows]
    step = int(steps[0]) if rows.size > 1 else 1
    return x[int(rows[0]) : int(rows[-1]) + 1 : step]


def _is_clock(name: str) -> bool:
    return name.partition(".")[0] == CLOCK_OFFSET
