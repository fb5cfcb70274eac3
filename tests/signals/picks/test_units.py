"""A record in another unit or on another clock is picked as the same."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks import pick, pick_records
from tests.signals.picks.simulated import RATE, TIME, Truth, noisy

pytestmark = pytest.mark.slow  # a program to compile
TRUTH = Truth()
RECORDS = noisy(TRUTH, 0.02 * TRUTH.peak, 32, seed=5)
FEW = settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)


@pytest.fixture(scope="module")
def usual():
    """The picks in pascals and seconds."""
    return pick(TIME, RECORDS)


@FEW
@given(exponent=st.floats(-15, 15), offset=st.floats(-10, 10))
def test_pressures_scale_and_their_zero_is_of_no_matter(usual, exponent, offset):
    factor = 10.0**exponent
    found = pick(TIME, factor * (RECORDS + offset * TRUTH.peak))
    # the search ends within 1e-4 standard deviations, of some percent
    for name, power in (
        ("air_arrival_s", 0),
        ("positive_duration_s", 0),
        ("peak_overpressure_pa", 1),
        ("positive_impulse_pa_s", 1),
    ):
        expected = getattr(usual, name) * factor**power
        np.testing.assert_allclose(getattr(found, name), expected, rtol=1e-4)
    np.testing.assert_allclose(found.spread, usual.spread, rtol=1e-2)


@FEW
@given(shift=st.floats(-1e5, 1e5), exponent=st.floats(-5, 5))
def test_clocks_shift_and_scale(usual, shift, exponent):
    unit = 10.0**exponent
    found = pick(unit * (TIME + shift), RECORDS)
    # the clock's own digits
    atol = unit * (1e-9 * abs(shift) + 1e-9)
    arrival = unit * (np.asarray(usual.air_arrival_s) + shift)
    np.testing.assert_allclose(found.air_arrival_s, arrival, atol=atol)
    duration = unit * np.asarray(usual.positive_duration_s)
    np.testing.assert_allclose(found.positive_duration_s, duration, rtol=1e-6)


def test_a_record_is_picked_alike_whoever_else_told_a_full_scale(usual):
    cut = np.minimum(RECORDS[1], 0.5 * TRUTH.peak)
    told = PressureRecord("told", RECORDS[0], RATE, full_scale=0.6 * TRUTH.peak)
    untold = PressureRecord("untold", RECORDS[0], RATE)
    equal = PressureRecord("equal", cut, RATE)
    found = [one.pick for one in pick_records([told, untold, equal])]
    assert [bool(np.isfinite(one.clipped_at_pa)) for one in found] == [
        True,
        False,
        True,
    ]
    # the step of the clock is told by its rate, or by its ends
    np.testing.assert_allclose(found[1].air_arrival_s, usual.air_arrival_s[0])
    alone = pick(TIME, RECORDS[0], full_scale_pa=0.6 * TRUTH.peak)
    np.testing.assert_allclose(
        found[0].peak_overpressure_pa, alone.peak_overpressure_pa, rtol=1e-9
    )
