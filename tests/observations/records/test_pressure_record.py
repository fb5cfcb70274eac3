"""A record's clock is even, and what is no record is refused."""

from datetime import UTC, datetime

import numpy as np
import pytest

from jblast.observations.records.recording import PressureRecord


def test_times_begin_where_the_record_does_and_step_by_the_rate():
    record = PressureRecord("a", np.zeros(5), rate_hz=4.0, start_s=10.0)
    np.testing.assert_array_equal(record.time_s, [10.0, 10.25, 10.5, 10.75, 11.0])
    assert record.seconds == 1.25


def test_a_day_of_microseconds_keeps_its_times():
    record = PressureRecord("a", np.zeros(3), rate_hz=1e6, start_s=86400.0)
    # doubles are 1.5e-11 s apart there
    np.testing.assert_allclose(np.diff(record.time_s), 1e-6, atol=3e-11)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"rate_hz": 0.0}, "rate_hz must be positive"),
        ({"rate_hz": float("nan")}, "rate_hz must be positive"),
        ({"start_s": float("inf")}, "start_s must be finite"),
        ({"epoch": datetime(2026, 1, 1)}, "epoch must have a time zone"),
    ],
)
def test_what_is_no_record_is_refused(changed, named):
    good = {"rate_hz": 1.0, "start_s": 0.0, "epoch": datetime(2026, 1, 1, tzinfo=UTC)}
    with pytest.raises(ValueError, match=named):
        PressureRecord("a", np.zeros(2), **(good | changed))
