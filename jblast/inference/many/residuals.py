"""Residuals of a batch of logs of one layout, and their slopes.

Rows that differ by numbers alone form a group. Each group has one program for the
residual of a row and its derivatives, which `fold` runs over all rows and lanes. The
terms of the objective are the readings, the shared effects and the numbers with a
prior, and ln of the rows' scales where these depend on the parameters. The loss of a
reading is that of normal or Student-t errors.

Readings are checked before a fit: one that is not finite, or not positive where its
logarithm is fitted, makes its log bad and leaves the other logs unaffected.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.inference.many.fold import Cell, over_cells
from jblast.inference.noise import log_noise, noise_slopes, reweighted
from jblast.inference.posterior.fisher_information import information_of_row
from jblast.inference.posterior.parameters import Parameters
from jblast.observations import CLOCK_TIMES
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import ADDITIVE, TIMES
from jblast.scene import Free, with_values
from jblast.sensors import Layout
from jblast.sensors.forward_model import (
    clock_offsets,
    record,
    residuals_of,
    to_error_scale,
)
from jblast.sensors.simulated_readings import Noise, independent_scale, loadings

MAX_NAMED = 20
"""Largest number of bad logs that a message names."""


class Miss(NamedTuple):
    """Residuals and their slopes over lanes.

    The terms are the rows of the log, then the shared effects and the numbers with a
    prior (all standard normal), then ln of the rows' scales if these depend on the
    fitted numbers.

    Attributes:
        residual: Residuals in standard deviations.
        columns: Derivative by each unknown.
    """

    residual: Float[Array, "term lane"]
    columns: tuple[Float[Array, "term lane"], ...]


class RowGroup(NamedTuple):
    """Rows that differ by numbers only and share one program.

    Attributes:
        layout: Layout of the first row.
        rows: Row numbers.
        slots: For each effect of a row, its index among the effects of the log.
    """

    layout: Layout
    rows: np.ndarray
    slots: tuple[np.ndarray, ...]

    def of(self, x):
        """Return these rows of an array, by a slice if possible: it needs no gather."""
        rows, steps = self.rows, np.unique(np.diff(self.rows))
        if rows.size > 1 and steps.size > 1:
            return x[rows]
        step = int(steps[0]) if rows.size > 1 else 1
        return x[int(rows[0]) : int(rows[-1]) + 1 : step]

    def spread(self, slopes: list[Cell], effects: int, dtype) -> list[Cell]:
        """Return derivatives by the effects of the log from those by a row's effects.

        Args:
            slopes: Derivatives by the fitted coordinates, then by each of `slots`.
            effects: Number of effects of the log.
            dtype: Type of the derivatives.
        """
        n = len(slopes) - len(self.slots)
        nothing = np.zeros((1, 1), dtype)
        columns = [*slopes[:n], *[nothing] * effects]
        for slope, of_row in zip(slopes[n:], self.slots, strict=True):
            # a mask instead of a scatter: it is known at tracing and XLA fuses it
            for effect in np.unique(of_row):
                mask = (of_row == effect).astype(dtype)[:, None]
                columns[n + effect] = columns[n + effect] + mask * slope
        return columns


@dataclass(frozen=True)
class TermLoss:
    """Minus ln density of each term of `Miss`, up to a constant.

    Attributes:
        noise: Distribution of the independent errors.
        rows: Number of terms that are readings.
        scored: Number of readings, effects and numbers with a prior; the terms after
            them are ln of the rows' scales.
    """

    noise: Noise
    rows: int
    scored: int

    def __call__(
        self, residual: Float[Array, "term lane"]
    ) -> tuple[Array, Array, Array | None, Array | None]:
        """Return the cost, its slope, its curvature, and the positive one of steps."""
        n, m = self.rows, self.scored
        u, normal, scale = residual[:n], residual[n:m], residual[m:]
        if self.noise == "gaussian" and not scale.shape[0]:
            return 0.5 * jnp.square(residual), residual, None, None
        slope, curvature = noise_slopes(u, self.noise)
        value = log_noise(jnp.zeros((), u.dtype), self.noise) - log_noise(u, self.noise)
        weight = reweighted(u, curvature, self.noise)
        one, zero = jnp.ones_like(normal), jnp.zeros_like(scale)
        return (
            jnp.concatenate([value, 0.5 * jnp.square(normal), scale]),
            jnp.concatenate([slope, normal, zero + 1]),
            jnp.concatenate([curvature, one, zero]),
            jnp.concatenate([weight, one, zero]),
        )

    def information(self, residual: Float[Array, "term lane"]) -> np.ndarray:
        """Return the expected curvature of each term."""
        of_rows = np.full(self.rows, information_of_row(self.noise))
        rest = np.ones(residual.shape[0] - self.rows)
        return np.concatenate([of_rows, rest]).astype(residual.dtype)[:, None]


@dataclass(frozen=True)
class LaneRows:
    """Logs of one layout.

    The unknowns are the coordinates of `parameters`, then the shared effects.

    Attributes:
        parameters: Fitted parameters.
        layout: Quantity and sensor of each row.
        laws: Pairs of quantity and law name.
        noise: Distribution of the independent errors.
        groups: Groups of rows.
        effects: Number of shared effects.
        offsets: Known clock offset of each row.
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
        """Number of unknowns in each lane."""
        return len(self.parameters.names) + self.effects

    @property
    def with_prior(self) -> list[int]:
        """Indices of the numbers with a prior."""
        return [
            k for k, b in enumerate(self.parameters.beliefs) if not isinstance(b, Free)
        ]

    @property
    def varies(self) -> bool:
        """True if the size of the errors may depend on the fitted numbers."""
        return self.parameters.scene.scatter

    @property
    def loss(self) -> TermLoss:
        """Loss of each term."""
        return TermLoss(self.noise, len(self.layout.quantity), self.scored)

    @property
    def scored(self) -> int:
        """Number of terms that are rows, effects or numbers with a prior."""
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
            sigma: Their instrument error, same unit. A NumPy array (row, 1) for errors
                common to all logs becomes a constant of the program.
            sd_known: Treat the size of the errors as known, as Fisher information does.
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
        # standard normal terms: their derivative is a unit vector
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
        """Return readings on the scale of errors, corrected for known clock offsets."""
        timed = np.isin(self.layout.quantity, CLOCK_TIMES)
        late = np.where(timed, self.offsets, 0.0).astype(readings.dtype)
        value = jax.vmap(lambda r: to_error_scale(r, self.layout.quantity))(readings)
        return (value - late[None, :]).T

    def _part(self, part: RowGroup, y, measured, sigma, *, sd_known):
        """Run the program of a group of rows over lanes."""
        n, rows, layout = len(self.parameters.names), part.rows, self.layout
        slots = len(part.slots)
        program = row_program(self.parameters, self.laws, part, sd_known=sd_known)

        def column(x):
            return np.asarray(x, y.dtype)[rows][:, None]

        shared = [y[n + of_row] for of_row in part.slots]
        shared = [
            # an effect common to all rows of the group is one row, which broadcasts
            x[:1] if np.ptp(i) == 0 else x
            for x, i in zip(shared, part.slots, strict=True)
        ]
        cells = over_cells(
            program,
            [
                *(y[k : k + 1] for k in range(n)),
                *shared,
                *(column(np.asarray(layout.position)[:, i]) for i in range(3)),
                column(layout.slant_range),
                column(np.asarray(layout.time) - self.offsets),
                part.of(measured),
                part.of(sigma),
            ],
        )
        u, ln_sd, slopes = cells[0], cells[1], cells[2:]
        return (
            u,
            part.spread(slopes[: n + slots], self.effects, y.dtype),
            ln_sd,
            part.spread(slopes[n + slots :], self.effects, y.dtype),
        )


def _is_zero(cell: Cell) -> bool:
    """Return True if a derivative is known to be zero at tracing."""
    return isinstance(cell, np.ndarray) and not cell.any()


def rows_of(
    parameters: Parameters, layout: Layout, laws: Mapping[str, str], noise: Noise
) -> LaneRows:
    """Return the rows of a layout in groups of equal programs."""
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


def row_program(
    parameters: Parameters,
    laws: tuple[tuple[str, str], ...],
    part: RowGroup,
    *,
    sd_known: bool,
) -> Callable[..., list[Array]]:
    """Return the program that the rows of a group share.

    The arguments are the fitted coordinates, the row's own effects, its position (east,
    north, up), slant range and time, its reading and instrument error. The results are
    the residual in standard deviations, ln of the standard deviation, the derivatives
    of the residual by each unknown, then those of ln of the standard deviation.

    Args:
        parameters: Fitted parameters.
        laws: Pairs of quantity and law name.
        part: The group of rows.
        sd_known: Treat the size of the errors as known.
    """
    n, slots = len(parameters.names), len(part.slots)

    def miss(here: Layout, reading, error, unknowns):
        beliefs = zip(parameters.names, parameters.beliefs, strict=True)
        numbers = {
            name: belief.constrain(at)
            for (name, belief), at in zip(beliefs, unknowns, strict=False)
        }
        recording = record(with_values(parameters.scene, numbers), here, dict(laws))
        sd = independent_scale(error, recording.record_sd[0])
        shared = loadings(recording, here)[0]
        # Fisher information of the mean alone: the dependence of the errors on the
        # parameters is left out, as in `fisher_information`
        if sd_known:
            sd, shared = jax.lax.stop_gradient((sd, shared))
        predicted = to_error_scale(recording.value, here.quantity)
        rest = residuals_of(reading[None], predicted, here.quantity)[0]
        for j in range(slots):
            rest = rest - shared[j] * unknowns[n + j]
        return rest / sd, jnp.log(sd)

    def split(numbers):
        east, north, up, slant, time, reading, error = numbers[n + slots :]
        layout = Layout(
            quantity=part.layout.quantity,
            position=jnp.stack([east, north, up])[None],
            slant_range=slant[None],
            time=time[None],
            group=(0,),
            shot=part.layout.shot,
            clock=part.layout.clock,
        )
        return list(numbers[: n + slots]), (layout, reading, error)

    def program(*numbers):
        unknowns, row = split(numbers)
        out = list(miss(*row, unknowns))
        slopes = []
        # one unknown after another: the six stations are fitted 1.2 times as fast as
        # with all slopes along an additional axis
        for k, at in enumerate(unknowns):

            def along(x, k=k):
                return miss(*row, [*unknowns[:k], x, *unknowns[k + 1 :]])

            slopes.append(jax.jvp(along, (at,), (jnp.ones_like(at),))[1])
        return [*out, *(s[0] for s in slopes), *(s[1] for s in slopes)]

    return program


def grouped_rows(
    parameters: Parameters, layout: Layout, laws: Mapping[str, str]
) -> tuple[tuple[RowGroup, ...], int]:
    """Return the groups of rows, and the number of shared effects."""
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
        # only the names of the effects are needed: no evaluation
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
    """Return the names of clocks with a fitted offset."""
    parts = [name.partition(".") for name in parameters.names]
    return [label for base, _, label in parts if base == CLOCK_OFFSET]


class Readings(NamedTuple):
    """Logs as they are fitted; the lane is the last axis.

    Attributes:
        measured: Readings; in ln unless `ADDITIVE`, corrected for known clock offsets.
        errors: Their instrument errors; None if all logs have the same.
        bad: True for logs with invalid readings, which are replaced by 1.
    """

    measured: Float[Array, "row lane"]
    errors: Float[Array, "row lane"] | None
    bad: Bool[Array, " lane"]


def checked(layout: Layout, values, sigma):
    """Return values and sigmas with checked shapes.

    Raises:
        InputError: The shapes do not match, common errors are not finite, or errors are
            in the unit of the reading instead of relative.
    """
    shape, rows = np.shape(values), len(layout.quantity)
    if len(shape) != 2 or shape[1] != rows:
        raise InputError(f"values: expected (log, row) with {rows} rows, got {shape}")
    if np.shape(sigma) not in (shape, shape[1:]):
        raise InputError(
            f"relative_sigma: expected {shape[1:]} or {shape}, got {np.shape(sigma)}"
        )
    errors = np.atleast_2d(np.asarray(sigma))
    # errors larger than the reading in most logs are not relative; single errors above
    # 1 occur: a relative error of 150 % is allowed
    most = np.mean(errors > 1.0, axis=0) > 0.5
    for row in np.flatnonzero(most & ~np.isin(layout.quantity, ADDITIVE)):
        typical = float(np.median(errors[:, row]))
        reading = float(np.median(np.abs(np.asarray(values)[:, row])))
        if np.isfinite(reading) and reading > typical:
            raise InputError(
                f"relative_sigma, row {row} ({layout.quantity[row]}): expected a share "
                f"of the reading, got {typical:g}: divide by the reading, {reading:g} "
                f"there, which makes {typical / reading:.3g}"
            )
    values = jnp.asarray(values)
    if np.ndim(sigma) > 1:
        return values, jnp.asarray(sigma)
    # NumPy arrays are known at tracing, so they are constants of the programs
    sigma = np.asarray(sigma, values.dtype)
    if not (np.isfinite(sigma) & (sigma >= 0)).all():
        raise InputError(f"relative_sigma: expected finite errors, got {sigma}")
    return values, sigma


def read(rows: LaneRows, values, sigma) -> Readings:
    """Return readings on the scale of errors, with a flag for invalid logs."""
    additive = np.isin(rows.layout.quantity, ADDITIVE)[None, :]
    good = jnp.isfinite(values) & (additive | (values > 0))
    sigmas = jnp.broadcast_to(jnp.atleast_2d(jnp.asarray(sigma)), values.shape)
    good = good & jnp.isfinite(sigmas) & (sigmas >= 0)
    bad = ~good.all(axis=1)
    # invalid readings become 1, so that no lane computes NaN
    measured = rows.to_error_scale(jnp.where(good, values, 1.0))
    same = np.ndim(sigma) == 1
    errors = None if same else jnp.where(bad[:, None], 1.0, sigmas).T
    return Readings(measured, errors, bad)


def faults_of(
    layout: Layout, values, sigma, bad: Bool[Array, " log"]
) -> tuple[tuple[int, str], ...]:
    """Return the fault of the first bad logs, each by its number."""
    if not bad.any():  # copies one number from the device instead of the mask
        return ()
    logs = [int(log) for log in np.flatnonzero(np.asarray(bad))[:MAX_NAMED]]
    return tuple((log, _fault(layout, values, sigma, log)) for log in logs)


def _fault(layout: Layout, values, sigma, log: int) -> str:
    """Return the fault of the first bad row of a log."""
    value = np.asarray(values[log])
    error = np.asarray(sigma if np.ndim(sigma) == 1 else sigma[log])
    for row, quantity in enumerate(layout.quantity):
        additive = quantity in ADDITIVE
        if not np.isfinite(value[row]) or not (additive or value[row] > 0):
            wanted = "a finite angle" if additive else "a positive number"
            wanted = "a finite time" if quantity in TIMES else wanted
            got = f"{value[row]}"
        elif not (np.isfinite(error[row]) and error[row] >= 0):
            wanted, got = "a finite sigma", f"{error[row]}"
        else:
            continue
        return f"log {log}, row {row}, {quantity}: expected {wanted}, got {got}"
    raise AssertionError(f"log {log} is not bad")
