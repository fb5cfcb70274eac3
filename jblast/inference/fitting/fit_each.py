"""Many logs, one after the other: a bad one fails alone."""

from collections.abc import Mapping

from jblast.errors import InputError
from jblast.inference.fitting.fit import fit
from jblast.inference.fitting.result import Fit
from jblast.inference.fitting.uncertainty import Method
from jblast.observations import Observations
from jblast.observations.records.formats import Scaling
from jblast.progress import each
from jblast.scene import UncertainScene
from jblast.sensors.simulate import Noise


def fit_each(
    logs: Mapping[str, Observations],
    uncertain: UncertainScene | None = None,
    *,
    noise: Noise = "student",
    posterior: Method = "weighted",
    seed: int = 0,
    scaling: Scaling | None = None,
    high_pass_hz: float | None = None,
) -> dict[str, Fit | InputError]:
    """Fit every log with the same scene. Logs of the same rows compile once.

    Args:
        logs: By name.
        uncertain: As for `fit`.
        noise: As for `fit`.
        posterior: As for `fit`.
        seed: As for `fit`.
        scaling: As for `fit`.
        high_pass_hz: As for `fit`.

    Returns:
        By name, the fit; or why that log could not be fitted.
    """
    answers: dict[str, Fit | InputError] = {}
    for name, observations in each(logs.items(), "logs"):
        try:
            answers[name] = fit(
                observations,
                uncertain,
                noise=noise,
                posterior=posterior,
                seed=seed,
                scaling=scaling,
                high_pass_hz=high_pass_hz,
            )
        except InputError as error:
            answers[name] = error
    return answers
