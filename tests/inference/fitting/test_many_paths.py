"""Logs of so many paths that these are taken as independent are marked."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jblast.inference.answer import Answer
from jblast.inference.density import density_of
from jblast.inference.fitting.assumptions import paths_taken_as_independent
from jblast.observations import Observations
from jblast.report.messages import sentence_of
from jblast.results import assumption, warning
from jblast.scene import Charge, Scene, UncertainScene, freed
from jblast.sensors.path_scatter import MAX_PATHS

PLACE = ("charge_east_m", "charge_north_m", "origin_time_s")
RANGE_M, SOUND = 200.0, 340.0


def log_of(count, width_m, ranges=False):
    """Return arrivals at microphones in a square, 200 m from a charge at the origin."""
    rng = np.random.default_rng(0)
    at = width_m * (rng.random((count, 2)) - 0.5) + [RANGE_M, 0.0]
    away = np.hypot(*at.T)
    nan = np.full(count, np.nan)
    return Observations(
        sensor=tuple(f"s{i}" for i in range(count)),
        quantity=("air_arrival_s",) * count,
        value=away / SOUND,
        sigma=np.full(count, 1e-3),
        position=np.full((count, 3), np.nan)
        if ranges
        else np.column_stack([at, np.zeros(count)]),
        slant_range=away if ranges else nan,
        time=nan,
        path=("",) * count,
        shot=("",) * count,
        clock=("",) * count,
        line=tuple(range(2, count + 2)),
        source="log.csv",
    )


def solved(log, free=PLACE, scatter=True) -> Any:
    """Return a solution at the truth, as far as its paths are concerned."""
    law = (("air_arrival_s", "acoustic"),)
    charge = Charge(mass_kg=1.0, position_m=(0.0, 0.0, 0.0))
    scene = Scene(charge, scatter=scatter, law=law)
    density = density_of(log, freed(UncertainScene(scene), free))
    answer = Answer(density, np.zeros(len(free)), np.ones(len(free)))
    return SimpleNamespace(density=density, answer=answer)


def test_many_sensors_close_together_are_marked_with_what_follows():
    (found,) = paths_taken_as_independent(solved(log_of(MAX_PATHS + 1, 20.0)))
    assert found == warning("paths_beyond_array", paths=MAX_PATHS + 1, limit=MAX_PATHS)
    said = sentence_of(found)
    assert "the scatter of 1,001 paths was assumed independent" in said
    assert "intervals of bearing and range are too narrow" in said


def test_many_sensors_about_the_charge_are_an_assumption():
    (found,) = paths_taken_as_independent(solved(log_of(MAX_PATHS + 1, 900.0)))
    numbers = {"paths": MAX_PATHS + 1, "limit": MAX_PATHS}
    assert found == assumption("paths_independent", **numbers)
    assert "intervals of position and time are too narrow" in sentence_of(found)


def test_a_known_place_has_neither_bearing_nor_range_to_be_fitted():
    log = log_of(MAX_PATHS + 1, 20.0)
    (found,) = paths_taken_as_independent(solved(log, free=("origin_time_s",)))
    assert found.level == "assumption"


@pytest.mark.parametrize(
    ("log", "scatter"),
    [
        (log_of(MAX_PATHS, 20.0), True),  # their correlation is taken into account
        (log_of(MAX_PATHS + 1, 20.0), False),  # laws that are exact do not scatter
        (log_of(MAX_PATHS + 1, 20.0, ranges=True), True),  # without directions
    ],
)
def test_logs_without_independent_neighbours_are_not_marked(log, scatter):
    free = ("origin_time_s",) if np.isnan(log.position).all() else PLACE
    assert paths_taken_as_independent(solved(log, free, scatter)) == []
