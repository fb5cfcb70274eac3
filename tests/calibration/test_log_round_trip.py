"""Logs that pandas wrote in random units and dialects come back as they were."""

import pytest

from calibration.log_round_trip import ALLOWED, round_trips


@pytest.mark.slow
@pytest.mark.parametrize("seed", [20, 21])
def test_random_logs_in_random_dialects_come_back(seed):
    for log, off in round_trips(200, seed):
        assert all(error <= ALLOWED[kind] for kind, error in off.items()), log.ways


def test_a_few_random_logs_come_back():
    for log, off in round_trips(12, seed=3):
        assert off, log.ways
        assert all(error <= ALLOWED[kind] for kind, error in off.items()), log.ways
