"""The one log-posterior that every method of inference calls."""

import math
from collections.abc import Mapping
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp
from jaxtyping import Array, Bool, Float

from jblast.inference.posterior.correlated_errors import own_and_shared_errors
from jblast.inference.posterior.density_correction import DensityCorrection
from jblast.inference.posterior.effect_systems import (
    Blocks,
    blocks_of,
    joined_blocks,
)
from jblast.inference.posterior.likelihood import log_likelihood
from jblast.inference.posterior.parameters import Parameters
from jblast.inference.posterior.record_likelihood import (
    ResidualRows,
    SampledRecords,
    record_log_likelihood,
)
from jblast.inference.posterior.refused_logs import refuse_exact, refuse_vast
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.observations.clocks import refuse_unresolved
from jblast.parameters import CHARGE_POSITION
from jblast.sensors import Layout, record
from jblast.sensors.path_scatter import DENSE, KERNELS, TYPICAL, kernel_weights
from jblast.sensors.record import Recording, residuals_of, to_error_scale
from jblast.sensors.simulate import ErrorModel, Noise, error_model, paths_of


class Misfit(eqx.Module):
    """How a scene misses the data, row by row: in ln, unless `ADDITIVE`.

    Attributes:
        residual: Measured minus predicted.
        sd: Independent scale: sigma and the law's record scatter in quadrature.
        loading: What one standard deviation of each shared effect adds.
        predicted: The reading without error, in the row's unit.
        valid: Whether the laws hold.
        slant_range: Distance from the charge [m].
        record_sd: Of the independent scale, what the law's record scatter is.
        blocks: Rows and columns of `loading` that share nothing with others, for speed
            alone (see `effect_systems`).
    """

    residual: Float[Array, " row"]
    sd: Float[Array, " row"]
    loading: Float[Array, "row effect"]
    predicted: Float[Array, " row"]
    valid: Bool[Array, " row"]
    slant_range: Float[Array, " row"]
    record_sd: Float[Array, " row"]
    blocks: Blocks = eqx.field(static=True, default=())


class Posterior(eqx.Module):
    """What a log says of a scene.

    Attributes:
        parameters: What is fitted.
        layout: Who recorded what.
        measured: The readings; in ln unless they are `ADDITIVE`.
        sigma: Their instrument error, same unit; 0 where none was given.
        laws: Pairs of quantity and law name.
        noise: Distribution of the independent errors.
        lower_bound: Whether each reading is a lower bound; None if none is.
        shared_error: What one standard deviation of each error that readings of one
            record share adds to each; None if all are independent. `sigma` is then
            what is left of each (see `correlated_errors`).
        error_blocks: Rows and columns of `shared_error` that each record has for
            itself, for speed alone; () if that is not known.
        records: Whose samples count in place of the rows read off them; None: of none.
        correction: What is added; None: nothing.
        kernels: Weights of the correlation functions of neighbouring paths in `misfit`.
            Where the place of the charge is fitted the density is the mean over all.
        neighbours: Whether neighbouring paths share scatter.
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

    # Jitted, so that each is traced once however many derivatives are taken of it.

    @kept
    def misfit(self, z: Float[Array, " free"]) -> Misfit:
        """Return how the scene at $z$ misses the data."""
        return self._misfit(self._recording(z), self.kernels)

    @kept
    def log_density(self, z: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the posterior density per unit of $z$, up to a constant."""
        recording = self._recording(z)
        if self._has_neighbours(recording):
            likelihood = logsumexp(self._of_kernels(recording)) - math.log(len(KERNELS))
        else:
            likelihood = self._log_likelihood(self._misfit(recording, self.kernels))
        more = 0.0 if self.correction is None else self.correction(z)
        return likelihood + more + self.parameters.log_prior(z)

    @kept
    def weighed(self, z: Float[Array, " free"]) -> "Posterior":
        """Return it with the correlation functions weighed by the data at $z$."""
        recording = self._recording(z)
        if not self._has_neighbours(recording):
            return self
        return replace(self, kernels=kernel_weights(self._of_kernels(recording)))

    def _recording(self, z: Float[Array, " free"]) -> Recording:
        return record(self.parameters.scene_at(z), self.layout, dict(self.laws))

    def _has_neighbours(self, recording: Recording) -> bool:
        """Return whether correlation functions are to be weighed by the data.

        They decide how far away an array places a charge. Where the place is fixed
        the typical one serves, at a quarter of the cost.
        """
        if not self.neighbours or not {*CHARGE_POSITION} & {*self.parameters.names}:
            return False
        sizes = [
            len(paths_of(self.layout, quantity, shot)[1])
            for _, quantity, shot in recording.fields
        ]
        return 2 <= max(sizes, default=0) <= DENSE

    def _of_kernels(self, recording: Recording) -> Float[Array, " kernel"]:
        """Return ln of the probability of the log by each correlation function."""
        return jax.vmap(
            lambda weights: self._log_likelihood(self._misfit(recording, weights))
        )(jnp.eye(len(KERNELS)))

    def _log_likelihood(self, misfit: Misfit) -> Float[Array, ""]:
        """Return ln of the probability of a misfit, of samples where they count."""
        if self.records is None:
            return self.likelihood(misfit)[0]
        return self._of_samples(misfit, self.records)

    def _misfit(self, recording: Recording, weights: Float[Array, " kernel"]) -> Misfit:
        """Return how a recording misses the data, its paths correlated by weights."""
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
            sd=jnp.hypot(self.sigma, of_laws.record_sd),
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
        """Return ln of the probability of a misfit, and its most probable effects."""
        return log_likelihood(
            misfit.residual,
            misfit.sd,
            misfit.loading,
            self.noise,
            self.lower_bound,
            misfit.blocks,
        )

    def _blocks(self, recording: Recording, of_laws: ErrorModel) -> Blocks:
        """Return what each path, and each record, has for itself of the effects."""
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
            return ()  # nobody knows what it loads
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


def posterior_of(
    parameters: Parameters,
    layout: Layout,
    observations: Observations,
    laws: Mapping[str, str],
    noise: Noise,
) -> Posterior:
    """Put a log, its layout and what is fitted together.

    Raises:
        InputError: A row has no error at all: no sigma, and a law taken as exact. Or a
            sigma disagrees with the covariance of its record. Or
            rows times shared effects are more than `HELD`.
    """
    refuse_exact(observations, parameters.scene.scatter, laws)
    refuse_unresolved(observations)
    sigma, shared = own_and_shared_errors(observations)
    refuse_vast(observations, parameters.scene, layout, laws, shared.shape[1])
    bounds = observations.bounds()
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
    )
