"""Samples at the end of a scale, and those that only fill a record up."""

import jax.numpy as jnp
import numpy as np

from jblast.signals.picks.pick import filled_length
from jblast.signals.picks.preparation import clipped_samples

RAMP = np.linspace(0.0, 1.0, 20)


def clipped(samples, full_scale=None, fill=0):
    """Return what is clipped of one record, filled up with its last sample."""
    filled = np.pad(samples, (0, fill), mode="edge")
    found = clipped_samples(jnp.asarray(filled), jnp.asarray(samples.size), full_scale)
    return np.flatnonzero(np.asarray(found)).tolist()


def test_equal_samples_in_a_row_at_the_top_are_clipped():
    assert clipped(np.minimum(RAMP, 0.8)) == [16, 17, 18, 19]
    assert clipped(np.r_[np.minimum(RAMP, 0.8), 0.0]) == [16, 17, 18, 19]
    assert clipped(RAMP) == []


def test_what_a_record_is_filled_up_with_is_not():
    assert clipped(RAMP, fill=12) == []
    assert clipped(-RAMP, fill=12) == []
    assert clipped(RAMP, full_scale=jnp.asarray(1.0), fill=12) == [19]
    assert clipped(np.minimum(RAMP, 0.8), fill=12) == [16, 17, 18, 19]


def test_records_of_any_length_are_of_few():
    lengths = {filled_length(n) for n in range(16, 70_000, 7)}
    assert lengths == {2**k for k in range(9, 18)}
