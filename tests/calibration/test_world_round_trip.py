"""Answers of random worlds are kept as they come, and uniform ranks are called so."""

import numpy as np
import pytest

from calibration.world_round_trip import Answer, add, by_subset, go_on, kept, table

SUBSET = "flash + air"


def some(ranks, method="walk", k_hat=0.9):
    return [
        Answer(
            SUBSET,
            seed,
            method,
            True,
            k_hat,
            0.25,
            0.2,
            tuple(round(float(x), 6) for x in rank),
        )
        for seed, rank in enumerate(ranks)
    ]


@pytest.fixture
def uniform():
    rows = np.tile(np.arange(100), (4, 1))
    return np.random.default_rng(0).permuted(rows, axis=1).T


def test_what_is_added_is_kept_and_adding_goes_on(tmp_path, uniform):
    path, rows = tmp_path / "rows.csv", some(uniform / 100 + 0.005)
    add(path, rows[:3])
    add(path, rows[3:])
    assert kept(path) == rows
    assert kept(tmp_path / "none.csv") == []


def test_what_is_kept_is_not_done_again(tmp_path):
    path = tmp_path / "rows.csv"
    add(path, some(np.full((4, 4), 0.5)))

    def never(subset, seeds):
        raise AssertionError("it is all there")

    go_on(path, [SUBSET], 4, 2, never, 1.0, 1)
    assert len(kept(path)) == 4


def test_uniform_ranks_are_called_so_and_others_are_not(uniform):
    ranks = uniform / 100 + 0.005
    assert "nothing against uniform" in table(by_subset(some(ranks)))
    assert "not uniform" in table(by_subset(some(np.sqrt(ranks))))
    # of a uniform rank nine in ten lie within
    assert "0.900" in table(by_subset(some(ranks)))


def test_weights_that_cannot_be_believed_are_counted():
    ranks = np.full((4, 4), 0.5)
    rows = some(ranks, "weights", 0.9)[:1] + some(ranks, "weights", 0.6)[1:]
    (found,) = by_subset(rows).values()
    assert found.good.tolist() == [False, True, True, True]
