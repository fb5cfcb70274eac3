r"""Residuals of a log and their errors as a function that JAX differentiates.

The readings of one record have correlated errors of covariance $C = S R S$, with $S$
the diagonal matrix of the sigmas. With $\kappa$ the smallest eigenvalue of the
correlations $R$ it is $C = \kappa S^2 + S (R - \kappa I) S$: each row keeps an
independent error of variance $\kappa \sigma^2$, and the remainder, of one rank less, is
a sum of normal effects that the rows share. Among all splits with the same share for
each row this one leaves the rows the most, and a single row keeps all.

A log is rejected for a row that has no error at all, and if its shared effects would
exceed the memory or the time of a fit.
"""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.inference.posterior.parameters import Parameters
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.observations.clocks import refuse_unresolved
from jblast.observations.covariances import rows_with_covariance
from jblast.registry import law_for
from jblast.scene import Scene
from jblast.sensors import Layout, record
from jblast.sensors.forward_model import (
    Recording,
    effects_of,
    residuals_of,
    to_error_scale,
)
from jblast.sensors.layout import components
from jblast.sensors.path_scatter import TYPICAL
from jblast.sensors.simulated_readings import Noise, error_model, independent_scale

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
    """

    residual: Float[Array, " row"]
    sd: Float[Array, " row"]
    loading: Float[Array, "row effect"]
    predicted: Float[Array, " row"]
    valid: Bool[Array, " row"]
    slant_range: Float[Array, " row"]
    record_sd: Float[Array, " row"]


class Posterior(eqx.Module):
    """A scene's numbers and the readings of a layout.

    Attributes:
        parameters: Fitted parameters.
        layout: Quantity and sensor of each row.
        measured: The readings; in ln unless they are `ADDITIVE`.
        sigma: Their instrument error, same unit; 0 where none was given.
        laws: Pairs of quantity and law name.
        noise: Distribution of the independent errors.
        shared_error: Change of each row by one standard deviation of each error that
            readings of one record share; None if all are independent. `sigma` is then
            the remaining error of each row (see `own_and_shared_errors`).
        kernels: Weights of the correlation functions of neighbouring paths.
        neighbours: True if neighbouring paths share scatter.
    """

    parameters: Parameters
    layout: Layout
    measured: Float[Array, " row"]
    sigma: Float[Array, " row"]
    laws: tuple[tuple[str, str], ...] = eqx.field(static=True)
    noise: Noise = eqx.field(static=True, default="student")
    shared_error: Float[Array, "row effect"] | None = None
    kernels: Float[Array, " kernel"] = eqx.field(
        converter=jnp.asarray, default_factory=lambda: TYPICAL
    )
    neighbours: bool = eqx.field(static=True, default=True)

    @kept
    def misfit(self, z: Float[Array, " free"]) -> Misfit:
        """Return the misfit of the data at $z$."""
        found = record(self.parameters.scene_at(z), self.layout, dict(self.laws))
        return self._misfit(found)

    def _misfit(self, recording: Recording) -> Misfit:
        weights = self.kernels if self.neighbours else None
        of_laws = error_model(recording, self.layout, weights)
        loading = of_laws.loading
        if self.shared_error is not None:
            loading = jnp.concatenate([loading, self.shared_error], axis=1)
        return Misfit(
            residual=residuals_of(
                self.measured,
                to_error_scale(recording.value, self.layout.quantity),
                self.layout.quantity,
            ),
            sd=independent_scale(self.sigma, of_laws.record_sd),
            loading=loading,
            predicted=recording.value,
            valid=recording.valid,
            slant_range=recording.slant_range,
            record_sd=of_laws.record_sd,
        )


def posterior_of(
    parameters: Parameters,
    layout: Layout,
    observations: Observations,
    laws: Mapping[str, str],
    noise: Noise,
) -> Posterior:
    """Return the readings of a log.

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
    has_direction = np.isnan(observations.slant_range)
    return Posterior(
        parameters=parameters,
        layout=layout,
        measured=to_error_scale(observations.value, observations.quantity),
        sigma=jax.device_put(sigma),
        laws=tuple(sorted(laws.items())),
        noise=noise,
        shared_error=jax.device_put(shared) if shared.size else None,
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
    kinds = 2 * len(layout.quantities()) * len(scene.charges)
    most = kinds * (1 + len(set(layout.group))) + shared_errors
    if rows * most <= MAX_EFFECT_NUMBERS and rows * most**2 <= WORK:
        return  # counting them takes longer than a small fit
    found = effects_of(scene, layout, laws)
    paths = len(set(layout.group)) * len(found.path_loading)
    effects = len(found.shot_loading) + paths + shared_errors
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
