"""A sound that a search found, and its comparison with the form of a blast."""

from typing import NamedTuple


class PulseFit(NamedTuple):
    """Fit of an arrival by a blast pulse.

    Attributes:
        blast_form: Whether the arrival has the form of a blast pulse, which exceeds the
            threshold in the noise just before it.
        misfit: Unexplained energy over that of the pulse.
        log_likelihood_ratio: Natural logarithm of the likelihood of the pulse over that
            of the best decaying oscillation, or two.
        fit_p: Probability of a larger chi-squared for the largest accepted misfit.
        fit_dof: Degrees of freedom of chi-squared.
        noise_level: Rms noise in the pulse's band in the second before, over that of
            the whole recording.
    """

    blast_form: bool
    misfit: float
    log_likelihood_ratio: float
    fit_p: float
    fit_dof: int
    noise_level: float


class Detection(NamedTuple):
    """One detected sound.

    Attributes:
        time_s: Arrival of the template's first sample, from the first sample on [s].
        sigma_s: Standard deviation of that time [s].
        snr_db: Estimate of 2E/N0 [dB].
        statistic: The same, in standard deviations of the noise.
        template_s: Length of the template [s].
        spread_s: Range of the times by all templates of a bank, each at its loudest
            [s]: none for a sound of their form, large for any other.
        fit: Comparison with the form of a blast; None in a search without that test.
    """

    time_s: float
    sigma_s: float
    snr_db: float
    statistic: float
    template_s: float = 0.0
    spread_s: float = 0.0
    fit: PulseFit | None = None

    @property
    def is_blast(self) -> bool:
        """False if the form is not that of a blast, or the noise before it as loud."""
        return self.fit is None or self.fit.blast_form
