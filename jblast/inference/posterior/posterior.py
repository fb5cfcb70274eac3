r"""The one log-posterior that every method of inference calls.

It is the sum of the log-prior of the fitted coordinates (`parameters`) and of the
log-likelihood of the readings (`likelihood`), or of the samples of pressure records
(`record_likelihood`).

The readings of one record have correlated errors of covariance $C = S R S$, with $S$
the diagonal matrix of the sigmas. With $\kappa$ the smallest eigenvalue of the
correlations $R$ it is $C = \kappa S^2 + S (R - \kappa I) S$: each row keeps an
independent error of variance $\kappa \sigma^2$, and the remainder, of one rank less, is
a sum of normal effects that the rows share. Among all splits with the same share for
each row this one leaves the rows the most, and a single row keeps all.

A correction may be added to the log-density where another one, which is too expensive
to evaluate often, is known at some nodes $w_i$. It is the polyharmonic spline (Duchon
1977, Lect. Notes Math. 571:85)
$s(w) = \sum_i \lambda_i |w - w_i|^3 + q(w)$ through the differences $d_i$, with a
quadratic $q$ and weights orthogonal to all quadratics, $\sum_i \lambda_i q(w_i) = 0$.
Its leave-one-out error at a node is $\lambda_i / B_{ii}$, with $B$ the inverse of the
spline's equations (Rippa 1999, Adv. Comput. Math. 11:193). Beyond the nodes it is
constant, with its value at their edge.

A posterior is rejected for a row that has no error at all, and for a log whose shared
effects would exceed the memory or the time of a fit.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.inference.posterior.likelihood import (
    Blocks,
    blocks_of,
    joined_blocks,
    log_likelihood,
)
from jblast.inference.posterior.parameters import Parameters
from jblast.inference.posterior.record_likelihood import (
    ResidualRows,
    SampledRecords,
    record_log_likelihood,
)
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.observations.clocks import refuse_unresolved
from jblast.observations.covariances import rows_with_covariance
from jblast.parameters import CHARGE_POSITION
from jblast.registry import law_for
from jblast.scene import Scene
from jblast.sensors import Layout, record
from jblast.sensors.layout import components
from jblast.sensors.path_scatter import DENSE, KERNELS, TYPICAL, kernel_weights
from jblast.sensors.record import Recording, count_effects, residuals_of, to_error_scale
from jblast.sensors.simulated_readings import (
    ErrorModel,
    Noise,
    error_model,
    independent_scale,
    paths_of,
)

MAX_EFFECT_NUMBERS = 30_000_000
"""Largest product of rows and shared effects. A fit needs a few arrays of this size
(0.24 GB each); a log with more is rejected.
"""
WORK = 5_000_000_000
"""Largest product of rows and the square of the effects. Each density takes several
times as many operations: with four times as much a fit took more than five minutes on
two cores."""
EQUAL_EIGENVALUES = 1e-12
"""An eigenvalue of the correlations that exceeds the smallest by no more than this is
equal to it up to rounding, and gets no column."""
ROOT_GUARD = 1e-30
"""Added under a square root, so that its slope at zero is finite. It is far below the
square of any distance between nodes."""
PSEUDO_INVERSE_CUTOFF = 1e-12
"""Relative cutoff of the singular values of the spline's equations. Smaller ones are
rounding, of directions in which no node lies."""


class Misfit(eqx.Module):
    """Residuals of the data, row by row: in ln, unless `ADDITIVE`.

    Attributes:
        residual: Measured minus predicted.
        sd: Independent scale: sigma and the law's record scatter in quadrature.
        loading: Change of each row by one standard deviation of each shared effect.
        predicted: Prediction without error, in the row's unit.
        valid: True if the laws of the row are within their range.
        slant_range: Distance from the charge [m].
        record_sd: The law's record scatter alone.
        blocks: Independent blocks of rows and columns of `loading`, used for speed
            only (see `likelihood.Apart`).
    """

    residual: Float[Array, " row"]
    sd: Float[Array, " row"]
    loading: Float[Array, "row effect"]
    predicted: Float[Array, " row"]
    valid: Bool[Array, " row"]
    slant_range: Float[Array, " row"]
    record_sd: Float[Array, " row"]
    blocks: Blocks = eqx.field(static=True, default=())


class DensityCorrection(eqx.Module):
    """A correction that is added to a log-density.

    Attributes:
        center: Origin of the spline's coordinates.
        inverse: Matrix from differences of $z$ to these coordinates (standard
            deviations).
        nodes: Nodes $w_i$ with a known difference.
        weights: Weight of each node; 0 for unused ones.
        tail: Coefficients of the quadratic.
        reach: Distance of the farthest node from the center.
    """

    center: Float[Array, " free"]
    inverse: Float[Array, "free free"]
    nodes: Float[Array, "node free"]
    weights: Float[Array, " node"]
    tail: Float[Array, " term"]
    reach: Float[Array, ""]

    def __call__(self, z: Float[Array, " free"]) -> Float[Array, ""]:
        """Return the correction at a place."""
        w = self.inverse @ (z - self.center)
        # Beyond the nodes a cubic spline grows without bound. So a place outside is
        # projected onto the sphere of the farthest node, and the correction is constant
        # along the ray.
        w = w * jnp.minimum(1.0, self.reach / jnp.sqrt(w @ w + ROOT_GUARD))
        away = jnp.sum(jnp.square(self.nodes - w[None, :]), axis=1)
        cubes = away * jnp.sqrt(away + ROOT_GUARD)
        return self.weights @ cubes + self.tail @ _quadratic(w)


class Posterior(eqx.Module):
    """The posterior of a scene's numbers given a log.

    Attributes:
        parameters: Fitted parameters.
        layout: Quantity and sensor of each row.
        measured: The readings; in ln unless they are `ADDITIVE`.
        sigma: Their instrument error, same unit; 0 where none was given.
        laws: Pairs of quantity and law name.
        noise: Distribution of the independent errors.
        lower_bound: True for readings that are lower bounds; None if none is.
        shared_error: Change of each row by one standard deviation of each error that
            readings of one record share; None if all are independent. `sigma` is then
            the remaining error of each row (see `own_and_shared_errors`).
        error_blocks: Rows and columns of `shared_error` of each record, for speed
            only; () if unknown.
        records: Records whose samples replace the rows picked from them; None for none.
        correction: Term added to the log-density; None for none.
        kernels: Weights of the correlation functions of neighbouring paths in `misfit`.
            If the position of the charge is fitted, the density is the mean over all.
        neighbours: True if neighbouring paths share scatter.
    """

    parameters: Parameters
    layout: Layout
    measured: Float[Array, " row"]
    sigma: Float[Array, " row"]
    laws: tuple[tuple[str, str], ...] = eqx.field(static=True)
    noise: Noise = eqx.field(static=True, default="student")
    lower_bound: Bool[Array, " row"] | None = None
    shared_error: Float[Array, "row effect"] | None = None
    error_blocks: Blocks = eqx.field(static=True, default=())
    records: SampledRecords | None = None
    correction: DensityCorrection | None = None
    kernels: Float[Array, " kernel"] = eqx.field(
        converter=jnp.asarray, default_factory=lambda: TYPICAL
    )
    neighbours: bool = eqx.field(static=True, default=True)

    # The methods are jitted one by one: each is then traced once for all derivatives
    # that are taken of it, and its compiled program is stored and loaded by later runs.

    @kept
    def misfit(self, z: Float[Array, " free"]) -> Misfit:
        """Return the misfit of the data at $z$."""
        return self._misfit(self._recording(z), self.kernels)

    @property
    def log_density(self) -> Callable[[Float[Array, " free"]], Float[Array, ""]]:
        """Return ln of the posterior density per unit of $z$, up to a constant.

        It is a plain function of $z$: `jax.jit` rejects a bound method of a module with
        arrays, which have no hash.
        """
        return partial(_log_density, self)

    def log_densities(self, z: Float[Array, " free"]) -> Float[Array, " kernel"]:
        """Return ln of the contribution of each correlation function to the density.

        There is only one entry if the data do not weight the functions.
        """
        recording = self._recording(z)
        if self._has_neighbours(recording):
            likelihood = self._of_kernels(recording) - math.log(len(KERNELS))
        else:
            misfit = self._misfit(recording, self.kernels)
            likelihood = self._log_likelihood(misfit)[None]
        more = 0.0 if self.correction is None else self.correction(z)
        return likelihood + more + self.parameters.log_prior(z)

    @kept
    def weighed(self, z: Float[Array, " free"]) -> "Posterior":
        """Return the posterior with kernel weights given by the data at $z$."""
        recording = self._recording(z)
        if not self._has_neighbours(recording):
            return self
        return replace(self, kernels=kernel_weights(self._of_kernels(recording)))

    def _recording(self, z: Float[Array, " free"]) -> Recording:
        return record(self.parameters.scene_at(z), self.layout, dict(self.laws))

    def _has_neighbours(self, recording: Recording) -> bool:
        """Return True if the data weight the correlation functions.

        The functions decide the range that an array gives to a charge. With a fixed
        position the typical function suffices, at a quarter of the cost.
        """
        if not self.neighbours or not {*CHARGE_POSITION} & {*self.parameters.names}:
            return False
        # neighbours need two paths; above `DENSE` the correlated solution is too slow
        sizes = [
            len(paths_of(self.layout, quantity, shot)[1])
            for _, quantity, shot in recording.fields
        ]
        return 2 <= max(sizes, default=0) <= DENSE

    def _of_kernels(self, recording: Recording) -> Float[Array, " kernel"]:
        """Return ln of the probability of the log for each correlation function."""
        return jax.vmap(
            lambda weights: self._log_likelihood(self._misfit(recording, weights))
        )(jnp.eye(len(KERNELS)))

    def _log_likelihood(self, misfit: Misfit) -> Float[Array, ""]:
        """Return ln of the probability of a misfit, or of samples if there are any."""
        if self.records is None:
            return self.likelihood(misfit)[0]
        return self._of_samples(misfit, self.records)

    def _misfit(self, recording: Recording, weights: Float[Array, " kernel"]) -> Misfit:
        """Return the misfit of a recording, with the given kernel weights."""
        predicted = recording.value
        of_laws = error_model(
            recording, self.layout, weights if self.neighbours else None
        )
        return Misfit(
            residual=residuals_of(
                self.measured,
                to_error_scale(predicted, self.layout.quantity),
                self.layout.quantity,
            ),
            sd=independent_scale(self.sigma, of_laws.record_sd),
            loading=self._loading(of_laws),
            predicted=predicted,
            valid=recording.valid,
            slant_range=recording.slant_range,
            record_sd=of_laws.record_sd,
            blocks=self._blocks(recording, of_laws),
        )

    @kept
    def effects(self, z: Float[Array, " free"]) -> Float[Array, " effect"]:
        """Return the most probable shared effects at $z$."""
        return self.likelihood(self.misfit(z))[1]

    def likelihood(
        self, misfit: Misfit
    ) -> tuple[Float[Array, ""], Float[Array, " effect"]]:
        """Return ln of the probability of a misfit, and its expected effects."""
        return log_likelihood(
            misfit.residual,
            misfit.sd,
            misfit.loading,
            self.noise,
            self.lower_bound,
            misfit.blocks,
        )

    def _blocks(self, recording: Recording, of_laws: ErrorModel) -> Blocks:
        """Return the rows and effects that belong to one path or one record alone."""
        shots, paths = len(recording.shot_loading), len(recording.path_loading)
        groups: dict[int, list[int]] = {}
        for row, group in enumerate(self.layout.group):
            groups.setdefault(group, []).append(row)
        before = of_laws.loading.shape[1]
        of_records = tuple(
            (rows, tuple(before + column for column in columns))
            for rows, columns in self.error_blocks
        )
        if self.shared_error is not None and not of_records:
            return ()  # the rows of each column are unknown: solve one dense system
        of_paths = tuple(
            (tuple(rows), tuple(range(shots + at, of_laws.common, len(groups))))
            for at, rows in enumerate(groups.values())
        )
        return joined_blocks([*of_paths, *of_records] if paths else of_records)

    def _of_samples(self, misfit: Misfit, records: SampledRecords) -> Float[Array, ""]:
        """Return ln of the probability of the samples and of all other rows."""
        sampled = np.array(records.rows)
        others = np.setdiff1d(np.arange(len(self.layout.quantity)), sampled)
        effects, errors = misfit.loading.shape[1], 0
        if self.shared_error is not None:
            errors = self.shared_error.shape[1]
        kept = [effects - errors + column for column in records.error_columns]
        columns = np.array([*range(effects - errors), *kept], int)
        loading = misfit.loading[:, columns]
        bounds = self.lower_bound
        return record_log_likelihood(
            ResidualRows(
                misfit.residual[others],
                misfit.sd[others],
                loading[others],
                None if bounds is None else bounds[others],
            ),
            self.measured[sampled] - misfit.residual[sampled],
            misfit.record_sd[sampled],
            # errors that rows of a record share are in its samples
            loading[sampled].at[:, :, effects - errors :].set(0.0),
            records,
            self.noise,
        )

    def _loading(self, of_laws: ErrorModel) -> Float[Array, "row effect"]:
        """Return the effects of laws, and after them the errors that records share."""
        if self.shared_error is None:
            return of_laws.loading
        return jnp.concatenate([of_laws.loading, self.shared_error], axis=1)

    def of_readings(self) -> "Posterior":
        """Return it with what was read off records in place of their samples."""
        return replace(self, records=None)

    def independent(self) -> "Posterior":
        """Return it of readings alone, with errors of the same sizes that none share.

        It has its optima near those of the other, and fewer effects to look for.
        """
        if self.shared_error is None:
            return replace(self, records=None, neighbours=False)
        shared = jnp.sum(jnp.square(self.shared_error), axis=1)
        sigma = jnp.sqrt(jnp.square(self.sigma) + shared)
        return replace(
            self,
            sigma=sigma,
            shared_error=None,
            error_blocks=(),
            records=None,
            neighbours=False,
        )


@kept
def _log_density(posterior: Posterior, z: Float[Array, " free"]) -> Float[Array, ""]:
    return logsumexp(posterior.log_densities(z))


def posterior_of(
    parameters: Parameters,
    layout: Layout,
    observations: Observations,
    laws: Mapping[str, str],
    noise: Noise,
) -> Posterior:
    """Build the posterior of a log.

    Raises:
        InputError: A row has no error at all: no sigma, and a law taken as exact. Or a
            sigma disagrees with the covariance of its record. Or rows times shared
            effects are more than `MAX_EFFECT_NUMBERS`, or times their square more than
            `WORK`.
    """
    refuse_exact(observations, parameters.scene.scatter, laws)
    refuse_unresolved(observations)
    sigma, shared = own_and_shared_errors(observations)
    refuse_vast(observations, parameters.scene, layout, laws, shared.shape[1])
    bounds = observations.bounds()
    # Paths of unknown direction share no scatter, so their effects are solved path by
    # path, in a twentieth of the time.
    has_direction = np.isnan(observations.slant_range)
    return Posterior(
        parameters=parameters,
        layout=layout,
        measured=to_error_scale(observations.value, observations.quantity),
        sigma=jax.device_put(sigma),
        laws=tuple(sorted(laws.items())),
        noise=noise,
        lower_bound=jax.device_put(bounds) if bounds.any() else None,
        shared_error=jax.device_put(shared) if shared.size else None,
        error_blocks=blocks_of(shared),
        neighbours=len(set(np.array(layout.group)[has_direction].tolist())) > 1,
    )


def refuse_exact(
    observations: Observations, scatter: bool, laws: Mapping[str, str]
) -> None:
    """Reject a log with a row without any error, of the instrument or the law.

    Raises:
        InputError: There is such a row; the message names the first.
    """
    for quantity in dict.fromkeys(observations.quantity):
        of_law = [law_for(q, laws[q]) for q, _ in components(quantity)]
        if scatter and not all(law.is_exact() for law in of_law):
            continue
        of_kind = np.array([q == quantity for q in observations.quantity])
        for row in np.flatnonzero(of_kind & ~(observations.sigma > 0)):
            why = (
                f"{' and '.join(law.name for law in of_law)} is exact"
                if scatter
                else "the scene has scatter = false"
            )
            raise InputError(
                f"{observations.source or 'observations'}: "
                f"{observations.sensor[row]}, {quantity}: expected a sigma, since "
                f"{why}; got none"
            )


def refuse_vast(
    observations: Observations,
    scene: Scene,
    layout: Layout,
    laws: Mapping[str, str],
    shared_errors: int,
) -> None:
    """Reject a log with too many rows and effects for memory or time.

    Raises:
        InputError: A product exceeds its limit; the message states both.
    """
    rows = len(observations)
    effects = count_effects(scene, layout, laws) + shared_errors
    if rows * effects > MAX_EFFECT_NUMBERS or rows * effects**2 > WORK:
        raise InputError(
            f"{observations.source or 'observations'}: {rows} rows of "
            f"{len(set(layout.group))} paths share {effects} effects; expected rows "
            f"times effects to be at most {MAX_EFFECT_NUMBERS:.0e}, and times their "
            f"square {WORK:.0e}: put the mean of a path's readings, and its sigma, in "
            "place of them all; or name a law that does not scatter from path to path"
        )


def own_and_shared_errors(
    observations: Observations,
) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, "row effect"]]:
    """Split instrument errors into independent and shared ones (see the module).

    Args:
        observations: A log; see `Observations.covariances`.

    Returns:
        The standard deviation of each row's own error (0 where the log gives none), and
        the change of each row by one standard deviation of each shared error: in
        seconds for times, else in ln.

    Raises:
        InputError: A sigma disagrees with its covariance, or a quantity of a record
            stands in two rows.
    """
    sigma = np.nan_to_num(observations.error_scale())
    own, columns = sigma.copy(), []
    for rows, covariance in rows_with_covariance(observations):
        # ascending: the first is the smallest eigenvalue kappa
        values, vectors = np.linalg.eigh(covariance.correlation)
        if len(rows) < 2:
            continue
        own[rows] *= np.sqrt(values[0])
        for value, vector in zip(values[1:], vectors.T[1:], strict=True):
            if value - values[0] <= EQUAL_EIGENVALUES:
                continue
            column = np.zeros(len(sigma))
            column[rows] = sigma[rows] * np.sqrt(value - values[0]) * vector
            columns.append(column)
    return own, np.stack(columns, axis=1) if columns else np.zeros((len(sigma), 0))


def no_correction(free: int, nodes: int) -> DensityCorrection:
    """Return a correction of zero with the array shapes of a real one.

    Args:
        free: Number of coordinates.
        nodes: Largest number of nodes.
    """
    terms = (free + 1) * (free + 2) // 2
    return DensityCorrection(
        jnp.zeros(free),
        jnp.eye(free),
        jnp.zeros((nodes, free)),
        jnp.zeros(nodes),
        jnp.zeros(terms),
        jnp.asarray(1.0),
    )


def correction_by(
    blank: DensityCorrection,
    w: Float[np.ndarray, "node free"],
    apart: Float[np.ndarray, " node"],
) -> tuple[DensityCorrection, Float[np.ndarray, " node"]]:
    """Interpolate differences by a spline.

    Args:
        blank: Correction of zero with center and coordinates, and space for all nodes.
        w: Nodes in these coordinates.
        apart: Difference at each node.

    Returns:
        The correction, and its leave-one-out error at each node.
    """
    count, free = w.shape
    room = blank.nodes.shape[0]
    away = np.linalg.norm(w[:, None, :] - w[None, :, :], axis=2) ** 3
    terms = np.asarray(_quadratic(jnp.asarray(w.T))).T
    none = np.zeros((terms.shape[1], terms.shape[1]))
    equations = np.block([[away, terms], [terms.T, none]])
    # A pseudo-inverse: with fewer nodes than terms of the quadratic the equations are
    # singular, and the solution of least norm is used.
    inverse = np.linalg.pinv(equations, rcond=PSEUDO_INVERSE_CUTOFF, hermitian=True)
    found = inverse @ np.concatenate([apart, np.zeros(len(none))])
    missed = found[:count] / np.diag(inverse)[:count]
    nodes, weights = np.zeros((room, free)), np.zeros(room)
    nodes[:count], weights[:count] = w, found[:count]
    made = DensityCorrection(
        blank.center,
        blank.inverse,
        jnp.asarray(nodes),
        jnp.asarray(weights),
        jnp.asarray(found[count:]),
        jnp.asarray(np.linalg.norm(w, axis=1).max()),
    )
    return made, missed


def _quadratic(w: Float[Array, "free ..."]) -> Float[Array, "term ..."]:
    """Return the terms of a quadratic."""
    first, second = np.triu_indices(w.shape[0])
    return jnp.concatenate([jnp.ones_like(w[:1]), w, w[first] * w[second]])
