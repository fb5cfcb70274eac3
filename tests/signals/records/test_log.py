"""Picks as rows: what a record cannot tell stands in none, and is named."""

import numpy as np
import pytest

from jblast.observations import read, write
from jblast.observations.records.recording import PressureRecord
from jblast.observations.records.stations import Station
from jblast.observations.table import RECORD_QUANTITIES
from jblast.signals.picks import Gathered, log_of
from tests.signals.records.made import SD, record_pick

STATIONS = {
    "a": Station((100.0, 0.0, 1.0), ""),
    "b": Station((0.0, 300.0, 1.0), ""),
}


def found(*named, **common) -> Gathered:
    """Picks of records: (name, changes)."""
    picks = []
    for name, changed in named:
        calibrated = changed.pop("calibrated", True)
        record = PressureRecord(name, np.zeros(0), rate_hz=1e4, calibrated=calibrated)
        picks.append(record_pick(record, **changed))
    return Gathered(tuple(picks), (), {}, (), None, 1)._replace(**common)


def test_a_good_pick_gives_four_rows_and_their_covariance(tmp_path):
    log = log_of(found(("a", {"air_arrival_s": 0.5})), STATIONS)
    rows = log.observations
    assert rows.quantity == RECORD_QUANTITIES
    np.testing.assert_allclose(rows.value, [0.5, 1000.0, 0.01, 4.0])
    # seconds for the arrival, shares of the value for the rest
    np.testing.assert_allclose(rows.sigma, [0.01, 10.0, 1e-4, 0.04])
    assert set(rows.record) == {"a"}
    np.testing.assert_array_equal(rows.position, [[100.0, 0.0, 1.0]] * 4)
    path = tmp_path / "picks.csv"
    write(path, rows)
    back = read(path)
    np.testing.assert_array_equal(back.value, rows.value)
    (covariance,) = back.covariances
    np.testing.assert_allclose(covariance.matrix, 1e-4 * (0.5 * np.eye(4) + 0.5))


@pytest.mark.parametrize(
    ("changed", "rows", "reasons"),
    [
        ({"notes": ("hopeless",)}, 0, {"poor"}),
        ({"calibrated": False}, 1, {"uncalibrated"}),
        ({"notes": ("high_passed",)}, 2, {"high_passed"}),
        ({"notes": ("resonating", "cut_short")}, 2, {"cut_short"}),
        ({"notes": ("cut_short",), "calibrated": False}, 1, {"uncalibrated"}),
        ({"notes": ("duration_lost", "faint")}, 3, {"duration_lost"}),
    ],
)
def test_what_a_record_cannot_tell_is_left_out_and_named(changed, rows, reasons):
    log = log_of(found(("a", dict(changed))))
    assert len(log.observations) == rows
    assert {left.reason for left in log.left_out} == reasons
    told = sum(len(left.quantities) for left in log.left_out)
    assert told + rows == 4


def test_a_clipped_peak_is_a_lower_bound_above_the_baseline(tmp_path):
    clipped = {"lower_bound": True, "clipped_at_pa": 800.0, "baseline_pa": 5.0}
    log = log_of(found(("a", clipped)), STATIONS)
    rows = log.observations
    np.testing.assert_array_equal(rows.bounds(), [False, True, False, False])
    assert rows.value[1] == 795.0
    assert rows.covariances[0].quantities == (
        RECORD_QUANTITIES[0],
        *RECORD_QUANTITIES[2:],
    )
    path = tmp_path / "picks.csv"
    write(path, rows)
    np.testing.assert_array_equal(read(path).bounds(), rows.bounds())


def test_bangs_are_told_apart_by_what_sound_takes_between_the_sensors():
    first = [("a", {"air_arrival_s": 1.0}), ("b", {"air_arrival_s": 1.9})]
    second = [("a", {"air_arrival_s": 8.0}), ("b", {"air_arrival_s": 8.5})]
    echo = [("a", {"air_arrival_s": 1.3, "peak_overpressure_pa": 100.0})]
    log = log_of(found(*first, *echo, *second), STATIONS)
    arrivals = {
        (rows, shot): value
        for rows, shot, value, quantity in zip(
            log.observations.sensor,
            log.observations.shot,
            log.observations.value,
            log.observations.quantity,
            strict=True,
        )
        if quantity == RECORD_QUANTITIES[0]
    }
    assert arrivals == {
        ("a", "1"): 1.0,
        ("b", "1"): 1.9,
        ("a", "2"): 8.0,
        ("b", "2"): 8.5,
    }
    assert [(left.record, left.reason) for left in log.left_out] == [("a#2", "weaker")]
    assert log.bangs == 2


ONSET = {
    "peak_overpressure_pa": np.nan,
    "covariance": np.full((4, 4), np.nan),
    "notes": ("onset_alone",),
}


def test_of_an_onset_alone_the_arrival_stands():
    log = log_of(found(("a", ONSET | {"air_arrival_s": 0.5})))
    assert log.observations.quantity == RECORD_QUANTITIES[:1]
    np.testing.assert_allclose(log.observations.sigma, [SD])
    assert [left.reason for left in log.left_out] == ["onset_alone"]


def test_a_pulse_is_stronger_than_an_onset_alone_at_its_place():
    onset, pulse = ONSET | {"air_arrival_s": 1.0}, {"air_arrival_s": 1.3}
    other = {"air_arrival_s": 1.5}
    picks = found(("a", onset), ("a", pulse), ("b", other))
    rows = log_of(picks, STATIONS).observations
    told = zip(rows.sensor, rows.quantity, rows.value, strict=True)
    assert ("a", RECORD_QUANTITIES[0], 1.3) in list(told)


def test_without_places_the_order_tells_bangs_apart():
    log = log_of(found(("a", {}), ("a", {"air_arrival_s": 5.0}), ("b", {})))
    assert set(zip(log.observations.record, log.observations.shot, strict=True)) == {
        ("a#1", "1"),
        ("a#2", "2"),
        ("b", "1"),
    }


def test_errors_that_no_covariance_holds_are_taken_as_independent():
    log = log_of(found(("a", {"covariance": 1e-4 * np.ones((4, 4))})), STATIONS)
    assert log.independent == ("a",)
    assert log.observations.covariances == ()
