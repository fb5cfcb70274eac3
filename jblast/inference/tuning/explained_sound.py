"""How well a sound record is explained: in frequency, in time, at the blast."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float
from scipy.stats import chi2

from jblast.inference.tuning.result import Explained
from jblast.inference.tuning.sound import SoundEvidence, over
from jblast.scene import Scene

LAGS = 20
"""Samples apart between which what is left is looked at for a likeness."""


def explained_sound(
    evidence: SoundEvidence,
    scene: Scene,
    unknowns: int,
    blast: tuple[int, int] | None,
) -> Explained:
    """Return how well a record is explained by a scene.

    Args:
        evidence: The record.
        scene: What was found.
        unknowns: How many numbers were looked for.
        blast: First sample of the blast, and the one after its last; None: it is not
            in the record.
    """
    deviance, white = _left(evidence, scene)
    deviance, white = np.asarray(deviance), np.asarray(white)
    dof = max(deviance.size - unknowns, 1)
    total = float(np.square(deviance).sum())
    tests = {"spectrum": float(chi2.sf(total, dof))}
    inside = white[white != 0.0]
    tests["whiteness"] = whiteness(inside)
    if blast is not None:
        there = white[slice(*blast)]
        there = there[there != 0.0]
        if there.size:
            energy = float(np.square(there).sum())
            tests["blast"] = float(chi2.sf(energy, there.size))
    sum_of_squares = float(np.square(inside).sum())
    return Explained(sum_of_squares, int(inside.size), tests)


def whiteness(white: Float[np.ndarray, " sample"]) -> float:
    """Return the probability of so much likeness from lag to lag, by Ljung and Box."""
    n, energy = white.size, float(np.square(white).sum())
    lags = np.arange(1, min(LAGS, n // 4) + 1)
    likeness = np.array([white[lag:] @ white[:-lag] for lag in lags]) / energy
    q = n * (n + 2) * float((np.square(likeness) / (n - lags)).sum())
    return float(chi2.sf(q, lags.size))


@eqx.filter_jit
def _left(
    evidence: SoundEvidence, scene: Scene
) -> tuple[Float[Array, " band"], Float[Array, " sample"]]:
    weights = evidence.weights(scene)
    return evidence.deviance(scene, weights), evidence.time_residuals(scene)


@eqx.filter_jit
def best_lag(
    evidence: SoundEvidence, scene: Scene
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return by how many samples a record is later than a scene has it, and its SNR.

    By the matched filter for the noise that the scene has: the lag, in samples, around
    the record's end; and how many standard deviations the blast stands out there.
    """
    n = evidence.samples.size
    sd = evidence.weights(scene).sd
    expected = over(jnp.fft.rfft(evidence.predicted(scene)), sd)
    record = over(jnp.fft.rfft(evidence.samples), sd)
    match = jnp.fft.irfft(jnp.conj(expected) * record, n)
    lag = jnp.argmax(match)
    power = jnp.square(expected.real) + jnp.square(expected.imag)
    energy = jnp.fft.irfft(lax.complex(power, jnp.zeros_like(power)), n)[0]
    snr = match[lag] * jnp.sqrt(2.0 * n / energy) / jnp.sqrt(2.0)
    return jnp.where(lag > n // 2, lag - n, lag).astype(float), snr
