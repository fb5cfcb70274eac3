"""A sensor's ring outlasts the single samples: in wide bins it is no smooth signal."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lfilter

from jblast.signals.picks.preparation import Noise, bins_about_front, whitened_means
from jblast.signals.picks.pulse_means import pole_of, ringing
from jblast.waves.pulse import Pulse

SAMPLES = 1024
TAPS = (1.0, -0.6, 0.1, 0.0, 0.0)
OMEGA, DAMPING = 0.5, 0.02
PULSE = Pulse(*map(jnp.asarray, (-3.3, 0.9, 5.0, 300.0, 1.2, 0.3, 700.0, 0.0)))


def of_bins(bins):
    """Return what the ring adds to the means."""
    return ringing(bins, PULSE, jnp.asarray(OMEGA), jnp.asarray(DAMPING))


@pytest.mark.slow  # operations compiled one by one
def test_taps_pass_over_wide_bins_as_over_the_samples_in_them():
    bins = bins_about_front(SAMPLES)
    first, width = bins.first, bins.width
    start = int(first[0])
    single = bins._replace(
        first=np.arange(start, int(first[-1] + width[-1])),
        width=np.ones(int(width.sum()), int),
    )
    samples = np.asarray(lfilter(TAPS, [1.0], np.asarray(of_bins(single).mean)))
    right = np.array(
        [
            samples[a - start : a - start + n].mean()
            for a, n in zip(first, width, strict=True)
        ]
    )
    found = of_bins(bins)
    later = np.exp(-complex(pole_of(jnp.asarray(OMEGA), jnp.asarray(DAMPING))))
    gain = sum(tap * later**k for k, tap in enumerate(TAPS))
    passed = gain.real * found.real - gain.imag * found.imaginary
    number = jnp.zeros(())
    noise = Noise(jnp.asarray(TAPS), number, number, jnp.asarray(True), number)
    made = whitened_means(noise, bins, found.mean, found.real, passed)
    wide = width > 1
    np.testing.assert_allclose(made[wide], right[wide], atol=1e-4)
    # as a smooth signal it would be off by a hundred times that
    smooth = whitened_means(noise, bins, found.mean)
    assert np.abs(np.asarray(smooth)[wide] - right[wide]).max() > 1e-2
