r"""The log at its answer: residuals, slopes and information of the rows.

Everything is about given numbers, without linear numbers or draws: shared effects are
at their means, slopes are central differences. With slopes $J$ of the predictions by
the fitted coordinates and the precision $P$ of the rows by expected information, the
information is $J^T P J$; it answers what a small change of anything changes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.density import Density
from jblast.inference.likelihood import (
    SHAPE,
    Field,
    Normal,
    Rows,
    Seen,
    by_information,
    errors_of,
    log_likelihoods,
)
from jblast.inference.noise import information_of_row
from jblast.inference.posterior.fisher_information import (
    NULL,
    Inverse,
    inverted,
    unit_diagonal,
)
from jblast.quantities import ADDITIVE
from jblast.scene import Free, Scene, parameter_named, with_values

STEP = 1e-3
"""Step of central differences, relative to a standard deviation or a typical step. The
term of third order is then 1e-6; rounding stays far below the change."""
JOINT_STEPS, JOINT_STEP = 40, 1e-3
"""Largest number of steps to the joint optimum, and the differences of its slope [sd]:
the slope is then good to 1e-6."""


@dataclass(frozen=True)
class Answer:
    """The log about given numbers.

    Attributes:
        density: The density of the log.
        values: The fitted numbers.
        sds: Standard deviation of each coordinate, by which slopes are taken.
    """

    density: Density
    values: Float[np.ndarray, " name"]
    sds: Float[np.ndarray, " name"]

    @cached_property
    def scene(self) -> Scene:
        """The scene with these numbers."""
        return with_values(
            self.density.parameters.scene,
            dict(zip(self.names, self.values, strict=True)),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted numbers."""
        return self.density.coordinates.names

    @cached_property
    def z(self) -> Float[np.ndarray, " name"]:
        """Fitted coordinates: ln of positive numbers, normal scores of priors."""
        return unconstrained(self.density, self.values[None])[0]

    @cached_property
    def seen(self) -> Seen:
        """Predictions of the rows and their scatter."""
        return self.density.seen_with(self.values[None])

    @cached_property
    def rows(self) -> Rows:
        """The rows without linear numbers, by the kernel that suits them best."""
        rows = self.density.rows
        alone = rows.of_all_numbers
        if len(rows.kernels) == 1:
            return alone
        best = int(log_likelihoods(np, alone, self.seen)[0][0].argmax())
        return replace(alone, kernels=rows.kernels[best : best + 1])

    @cached_property
    def _field(self) -> Field:
        return log_likelihoods(np, self.rows, self.seen)[1]

    @cached_property
    def _normal(self) -> Normal:
        return self._field.normal.at((0, 0))

    @cached_property
    def valid(self) -> Bool[np.ndarray, " row"]:
        """True for rows within the range of their laws."""
        return self.seen.valid[0]

    @cached_property
    def slant_range(self) -> Float[np.ndarray, " row"]:
        """Distance of each row from its charge [m]."""
        return self.seen.slant_range[0]

    @cached_property
    def predicted(self) -> Float[np.ndarray, " row"]:
        """Prediction of each row, in its unit."""
        there = self.seen.predicted[0]
        plain = np.isin(self.density.layout.quantity, ADDITIVE)
        with np.errstate(over="ignore"):
            return np.where(plain, there, np.exp(np.where(plain, 0.0, there)))

    @cached_property
    def missed(self) -> Float[np.ndarray, " row"]:
        """Measured minus predicted, on the error scale."""
        return self._field.residual[0, 0]

    @cached_property
    def own_sd(self) -> Float[np.ndarray, " row"]:
        """Scale of the own error of each row."""
        return np.sqrt(self._field.errors.own[0, 0])

    @cached_property
    def own(self) -> Float[np.ndarray, " row"]:
        """Own error of each row [its scale], all effects removed.

        For a lower bound it is the smallest error that satisfies it: 0 where the law
        predicts more.
        """
        variance = self.own_sd**2 * self._field.rate[0, 0] / SHAPE
        if self.rows.noise == "gaussian":
            variance = self.own_sd**2
        error = variance * self._normal.weights(self.rows)
        own = np.where(self.rows.is_bound, self.missed - self._expected, error)
        return self._least(own / self.own_sd)

    def _least(self, residual: Float[np.ndarray, " row"]) -> Float[np.ndarray, " row"]:
        return np.where(self.rows.is_bound & (residual < 0), 0.0, residual)

    @cached_property
    def _weighted(self) -> Float[np.ndarray, "block member"]:
        return self._normal.weighted * self.rows.is_read

    def _by_blocks(self, shared) -> Float[np.ndarray, " row"]:
        """Return the expected values of effects of given covariance."""
        return (shared @ self._weighted[..., None])[..., 0][self.rows.place]

    @cached_property
    def _of_shots(self) -> Float[np.ndarray, " row"]:
        return self._field.errors.effect[0, 0] @ self._normal.linear

    @cached_property
    def _of_laws(self) -> Float[np.ndarray, "block member member"]:
        """Covariance of the effects of laws on paths."""
        return self._field.errors.shared[0, 0] - self.rows.shared

    @cached_property
    def _expected(self) -> Float[np.ndarray, " row"]:
        """All effects in each row."""
        return self._by_blocks(self._field.errors.shared[0, 0]) + self._of_shots

    @cached_property
    def shared(self) -> Float[np.ndarray, " row"]:
        """Effects of laws in each row, on the error scale."""
        return self._by_blocks(self._of_laws) + self._of_shots

    @cached_property
    def sd(self) -> Float[np.ndarray, " row"]:
        """Standard deviation of each row without the effects of laws."""
        of_record = np.diagonal(self.rows.shared, axis1=1, axis2=2)[self.rows.place]
        return np.sqrt(self.own_sd**2 + of_record)

    @cached_property
    def scatter(self) -> Float[np.ndarray, " row"]:
        """Standard deviation of each row, with all effects."""
        errors = self._field.errors
        within = np.diagonal(errors.shared[0, 0], axis1=1, axis2=2)[self.rows.place]
        of_shots = (errors.effect[0, 0] ** 2).sum(axis=1)
        return np.sqrt(self.own_sd**2 + within + of_shots)

    @cached_property
    def own_scatter(self) -> Float[np.ndarray, " row"]:
        """Variance of the laws' scatter in each row alone."""
        exact = replace(self.rows, sigma=np.zeros(len(self.rows.measured)))
        return errors_of(np, exact, self.seen).own[0, 0]

    def effects_among(
        self, rows: Int[np.ndarray, " some"]
    ) -> Float[np.ndarray, "some some"]:
        """Return the covariance of the effects of laws in some rows."""
        block, member = (at[rows] for at in self.rows.place)
        among = self._of_laws[block[:, None], member[:, None], member]
        effect = self._field.errors.effect[0, 0][rows]
        return among * (block[:, None] == block) + effect @ effect.T

    @cached_property
    def residual(self) -> Float[np.ndarray, " row"]:
        """(Measured - predicted - effects of laws) / sd; of a bound as `own`."""
        return self._least((self.missed - self.shared) / self.sd)

    @cached_property
    def largest_effect(self) -> float:
        """Largest effect of a law on a whole shot or path, in its own sd."""
        size = np.diagonal(self._of_laws, axis1=1, axis2=2)[self.rows.place]
        of_paths = np.abs(self._by_blocks(self._of_laws))
        of_paths = of_paths[size > 0] / np.sqrt(size[size > 0])
        return float(max([0.0, *np.abs(self._normal.linear), *of_paths]))

    @cached_property
    def shared_chi2(self) -> float:
        """Chi squared of all shared effects at their expected values."""
        weights = self._normal.weights(self.rows)
        variance = self.own_sd**2 * self._field.rate[0, 0] / SHAPE
        if self.rows.noise == "gaussian":
            variance = self.own_sd**2
        return float(max(weights @ self.missed - variance @ weights**2, 0.0))

    @cached_property
    def steps(self) -> Float[np.ndarray, " name"]:
        """Typical step of each coordinate."""
        return typical_steps(self.density)

    @cached_property
    def slopes(self) -> Float[np.ndarray, "row name"]:
        """Slopes of the predictions by each coordinate."""
        size = np.where(self.sds > 0, np.minimum(self.sds, self.steps), self.steps)
        moved = STEP * np.diag(size)
        z = np.concatenate([self.z + moved, self.z - moved])
        return self._differences(constrained(self.density, z), STEP * size)

    def slopes_by(self, held: Mapping[str, float]) -> Float[np.ndarray, "row held"]:
        """Return slopes by numbers that are not fitted.

        Args:
            held: Step of each.
        """
        count = len(held)
        moved = np.diag(list(held.values()))
        start = np.array([self.density.held[name] for name in held])
        at = np.concatenate([start + moved, start - moved])
        columns = dict(zip(held, at.T, strict=True))
        values = np.tile(self.values, (2 * count, 1))
        return self._differences(values, np.diag(moved), columns)

    def _differences(self, values, steps, held: Mapping[str, np.ndarray] | None = None):
        predicted = self.density.seen_with(values, **(held or {})).predicted
        up, down = np.split(predicted, 2)
        return (up - down).T / (2 * steps)

    def weigh(
        self,
        columns: Float[np.ndarray, "row column"],
        used: Bool[np.ndarray, " row"] | None = None,
    ) -> Float[np.ndarray, "row column"]:
        """Return the precision of the rows, by expected information, times columns.

        Args:
            columns: Columns.
            used: Rows that count; others get an error that leaves them no weight.
        """
        variance = self.own_sd**2 / information_of_row(self.rows.noise)
        if used is not None:
            variance = np.where(used, variance, 1e12)
        return by_information(self.rows, self._field.errors, variance, columns)

    @cached_property
    def has_prior(self) -> Float[np.ndarray, " name"]:
        """1 for numbers with a prior, 0 for free ones."""
        beliefs = self.density.coordinates.beliefs
        return np.array([float(not isinstance(b, Free)) for b in beliefs])

    @cached_property
    def information(self) -> Float[np.ndarray, "name name"]:
        """Information of the data about the coordinates, without priors."""
        known = self.slopes.T @ self.weigh(self.slopes)
        return 0.5 * (known + known.T)

    def covariance(
        self,
        beside: Float[np.ndarray, "row more"] | None = None,
        *,
        sd: float = np.inf,
        used: Bool[np.ndarray, " row"] | None = None,
    ) -> Float[np.ndarray, "name name"]:
        """Return the covariance of the coordinates for linear predictions.

        Null directions have a huge but finite variance. Without finite slopes it is
        NaN.

        Args:
            beside: Slopes of the rows by further unknowns, which are integrated out.
            sd: Their standard deviation before the data.
            used: Rows that count.
        """
        count = len(self.names)
        more = self.slopes[:, :0] if beside is None else beside
        columns = np.concatenate([self.slopes, more], axis=1)
        prior = np.append(self.has_prior, np.full(more.shape[1], sd**-2.0))
        known = columns.T @ self.weigh(columns, used) + np.diag(prior)
        if not np.isfinite(known).all():
            return np.full((count, count), np.nan)
        steps = np.append(self.steps, np.ones(more.shape[1]))
        size, values, vectors = unit_diagonal(0.5 * (known + known.T), steps)
        part = (vectors / size[:, None])[:count]
        return (part / np.maximum(values, NULL)) @ part.T

    @cached_property
    def inverse(self) -> Inverse:
        """Inverse of the information of data and priors."""
        known = self.information + np.diag(self.has_prior)
        return inverted(known, self.has_prior, self.steps)


def joint_mode(answer: Answer) -> Float[np.ndarray, " name"]:
    """Return the optimum of the density of all numbers, in the fitted coordinates.

    The most probable numbers are those of the density with linear numbers integrated
    out, which is near. Newton's steps are in standard deviations, by the expected
    information and slopes from differences.
    """
    density = answer.density
    known = answer.information + np.diag(answer.has_prior)
    size, values, vectors = unit_diagonal(known, answer.steps)
    root = vectors / size[:, None] / np.sqrt(np.maximum(values, NULL))
    step = JOINT_STEP * root.T

    def height(z):
        at = constrained(density, z)
        prior = [float(density.coordinates.log_prior_of(np, one)) for one in at]
        return density.of_readings(at) + np.array(prior)

    z, top = answer.z, height(answer.z[None])[0]
    for _ in range(JOINT_STEPS):
        ends = height(np.concatenate([z + step, z - step])).reshape(2, -1)
        slope = (ends[0] - ends[1]) / (2 * JOINT_STEP)
        for part in (1.0, 0.5, 0.25):
            there = z + part * (root @ slope)
            if (found := height(there[None])[0]) > top:
                break
        else:
            break
        z, top = there, found
    return z


def typical_steps(density: Density) -> Float[np.ndarray, " name"]:
    """Return a typical step of each coordinate."""
    size = layout_size(density)
    units = {"unit": 1.0, "layout": size, "travel": size / STANDARD_SOUND_SPEED}
    axes = density.coordinates
    found = []
    for name, belief in zip(axes.names, axes.beliefs, strict=True):
        amount, of = parameter_named(name).spread
        plain = not isinstance(belief, Free) or belief.positive
        found.append(1.0 if plain else amount * units[of])
    return np.array(found)


def layout_size(density: Density) -> float:
    """Return the extent of the layout, or the largest given slant range [m].

    Sensors that measure directions may stand at one place. The distance that sound
    travels between their times counts then.
    """
    given = np.nan_to_num(np.asarray(density.layout.slant_range)).max(initial=0.0)
    if given > 0:
        return float(given)
    extent = float(np.linalg.norm(np.ptp(np.asarray(density.layout.position), axis=0)))
    return max(extent, density.heard if extent < 1.0 else 0.0, 1.0)


def constrained(
    density: Density, z: Float[np.ndarray, "draw name"]
) -> Float[np.ndarray, "draw name"]:
    """Return numbers in their units."""
    beliefs = density.coordinates.beliefs
    columns = [b.constrain(x) for b, x in zip(beliefs, z.T, strict=True)]
    return np.stack([np.asarray(x, float) for x in columns], axis=1)


def unconstrained(
    density: Density, values: Float[np.ndarray, "draw name"]
) -> Float[np.ndarray, "draw name"]:
    """Return fitted coordinates of numbers."""
    beliefs = density.coordinates.beliefs
    columns = [b.unconstrain(x) for b, x in zip(beliefs, values.T, strict=True)]
    return np.stack([np.asarray(x, float) for x in columns], axis=1)
