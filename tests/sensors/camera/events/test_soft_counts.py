import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast.sensors.camera.events.ideal import (
    count_events,
    first_reference,
    smooth_counts,
)

BOTH = (jnp.asarray(0.2), jnp.asarray(0.3))


def frames():
    """Light that goes up and down; no change ends close to a threshold."""
    change = jnp.array([0.0, 0.7, 0.45, -0.75, -0.33, 0.5])[:, None, None]
    return change * jnp.ones((1, 2, 3))


def hard():
    counts, _, _ = count_events(frames(), BOTH, first_reference(frames()[0]))
    counts = np.asarray(counts, float)
    return np.maximum(counts, 0.0), np.maximum(-counts, 0.0)


def test_as_the_temperature_falls_the_counts_become_the_hard_ones():
    known, errors = hard(), []
    assert known[0].sum() > 0
    assert known[1].sum() > 0
    for temperature in (0.1, 0.03, 0.01):
        smooth = smooth_counts(frames(), BOTH, temperature)
        pairs = zip(smooth, known, strict=True)
        errors.append(max(float(jnp.abs(a - b).max()) for a, b in pairs))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-3


@pytest.mark.parametrize("temperature", [0.05, 0.2])
def test_counts_have_the_gradients_of_finite_differences(temperature):
    def total(frames, thresholds):
        up, down = smooth_counts(frames, thresholds, temperature)
        return jnp.sum(up * jnp.arange(1.0, 6.0)[:, None, None]) + jnp.sum(down**2)

    # the step is short beside the temperature
    check_grads(
        jax.jit(total),
        (frames(), BOTH),
        order=1,
        modes=["rev"],
        eps=1e-6,
        atol=1e-4,
        rtol=1e-4,
    )


def test_a_still_pixel_sends_almost_nothing():
    up, down = smooth_counts(jnp.zeros((11, 1, 1)), BOTH, 0.1)
    # ten frames of exp(-1/T); meanwhile the reference creeps by as little
    np.testing.assert_allclose(up.sum(), 10 * np.exp(-10.0), rtol=1e-2)
    np.testing.assert_allclose(down.sum(), 10 * np.exp(-10.0), rtol=1e-2)
