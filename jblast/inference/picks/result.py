"""What a pick says of a record."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

NAMES = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
    "decay",
    "rise_time_s",
    "negative_pressure_pa",
    "negative_duration_s",
)
"""What is picked, in the order of `Pick.spread`."""

IN_LOG = 4
"""The first ones go into a log with their covariance."""


class Pick(eqx.Module):
    """The pulse of a record, or of each record of a batch.

    Errors are those of the posterior, with all that is not asked for (rise, suction,
    drift) free. Where nothing was found, values are NaN.

    Attributes:
        air_arrival_s: When the first of it arrives, on the clock of the samples [s].
        peak_overpressure_pa: Overpressure behind the front [Pa].
        positive_duration_s: Of the positive phase, rise included [s].
        positive_impulse_pa_s: Of the positive phase [Pa s].
        decay: Friedlander's $b$ behind the rise [-].
        rise_time_s: From zero to the peak [s].
        negative_pressure_pa: Greatest underpressure; below zero where there is none and
            noise makes it so [Pa].
        negative_duration_s: Of the negative phase [s].
        covariance: Of arrival [s], ln peak, ln duration and ln impulse.
        spread: Standard deviations of the eight, in the order of `NAMES`: of their
            logarithms, but for arrival [s] and decay [-].
        found: Whether there is a pulse at all.
        converged: Whether the search ended at an optimum.
        lower_bound: Whether samples were clipped at the peak, which then is only
            bounded from below, by `clipped_at_pa`, but for what the prior adds.
        clipped_at_pa: Largest size of a sample, where it was clipped; else NaN [Pa].
        under_sampled: Whether fewer than eight samples make the positive phase.
        sharp: Whether the rise is shorter than a sample, so that the arrival is
            anywhere within one.
        high_passed: Whether what follows the pulse looks high-passed, and no corner was
            given.
        resonating: Whether the record rings at a frequency of its own.
        drifting: Whether the baseline moves by more than a fiftieth of the peak.
        curving: Whether it bends by more than 3 % of the peak within the stretch that
            is fitted, as a cubic that may not be all it does.
        cut_short: Whether the record ends before the positive phase does.
        noise_known: Whether enough quiet samples came before the front.
        shifted: Whether the baseline steps at the front and stays there.
        front_alone: Whether what follows the front is no blast pulse, so that the front
            alone was fitted and only arrival and peak are known.
        resonance_hz: At what frequency it rings, undamped; NaN: it does not [Hz].
        later_arrivals_s: Of a further front within the stretch that is fitted, one at
            most; NaN: none [s].
        later_sigmas_s: Their standard deviations [s].
        misfit: Squared misfit by degree of freedom: about 1 where the model holds [-].
            Above 1, errors are widened by its root.
        noise_pa: Standard deviation of the noise of a sample [Pa].
        baseline_pa: What was taken for zero, at the arrival [Pa].
    """

    air_arrival_s: Float[Array, "*batch"]
    peak_overpressure_pa: Float[Array, "*batch"]
    positive_duration_s: Float[Array, "*batch"]
    positive_impulse_pa_s: Float[Array, "*batch"]
    decay: Float[Array, "*batch"]
    rise_time_s: Float[Array, "*batch"]
    negative_pressure_pa: Float[Array, "*batch"]
    negative_duration_s: Float[Array, "*batch"]
    covariance: Float[Array, "*batch 4 4"]
    spread: Float[Array, "*batch 8"]
    found: Bool[Array, "*batch"]
    converged: Bool[Array, "*batch"]
    lower_bound: Bool[Array, "*batch"]
    clipped_at_pa: Float[Array, "*batch"]
    under_sampled: Bool[Array, "*batch"]
    sharp: Bool[Array, "*batch"]
    high_passed: Bool[Array, "*batch"]
    resonating: Bool[Array, "*batch"]
    drifting: Bool[Array, "*batch"]
    curving: Bool[Array, "*batch"]
    cut_short: Bool[Array, "*batch"]
    noise_known: Bool[Array, "*batch"]
    shifted: Bool[Array, "*batch"]
    front_alone: Bool[Array, "*batch"]
    resonance_hz: Float[Array, "*batch"]
    later_arrivals_s: Float[Array, "*batch later"]
    later_sigmas_s: Float[Array, "*batch later"]
    misfit: Float[Array, "*batch"]
    noise_pa: Float[Array, "*batch"]
    baseline_pa: Float[Array, "*batch"]

    def sd(self, name: str) -> Float[Array, "*batch"]:
        """Return the standard deviation of a value, in its own unit.

        Args:
            name: One of `NAMES`.

        Raises:
            ValueError: There is no such value.
        """
        if name not in NAMES:
            raise ValueError(f"expected one of {', '.join(NAMES)}, got {name}")
        sd = self.spread[..., NAMES.index(name)]
        if name in ("air_arrival_s", "decay"):
            return sd
        return sd * jnp.abs(getattr(self, name))
