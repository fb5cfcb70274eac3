"""Fits of a study: finished block by block, or together where they are."""

import dataclasses

import numpy as np
import pytest

from jblast.study import run
from jblast.study.outcome.family import FAMILIES
from jblast.study.slabs import devices_of
from tests.study.example import study_in

SCENE = """
[charge]
mass_kg = { lognormal = [10.0, 2.0] }
position_m = [0.0, 0.0, 0.0]
[law]
scatter = false
air_arrival_s = "wu_hao"
[[sensor]]
name = "near"
position_m = [20.0, 0.0, 0.0]
records = { air_arrival_s = 1e-4 }
[[sensor]]
name = "far"
position_m = [0.0, 50.0, 0.0]
records = { air_arrival_s = 1e-4 }
"""
STUDY = """
scene = "scene.toml"
seed = 3
samples = 1000
outcomes = ["fit_error", "fit_interval_width", "fit_truth_inside", "fit_converged"]
"""
BLOCK = 256


@pytest.fixture
def study(tmp_path, monkeypatch):
    few = dataclasses.replace(FAMILIES["fit"], block=BLOCK)
    monkeypatch.setitem(FAMILIES, "fit", few)
    return study_in(tmp_path, STUDY, SCENE)


def test_fits_do_not_depend_on_devices(study):
    one = run(study, devices_of(1))
    assert one.fit_converged.all()
    all_of_them = run(study, devices_of())
    for name in one:
        np.testing.assert_array_equal(one[name], all_of_them[name])


@pytest.mark.slow
def test_fits_hold_what_they_say(study):
    found = run(study)
    # of 1,000: four standard errors of nine tenths (errors are Student's: a few more)
    assert abs(float(found.fit_truth_inside.mean()) - 0.9) < 4 * np.sqrt(0.09 / 1000)
    ratio = found.fit_error.std() / (found.fit_interval_width.mean() / 2 / 1.645)
    assert 0.8 < float(ratio) < 1.3
