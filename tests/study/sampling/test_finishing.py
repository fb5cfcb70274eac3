"""Fits of a study: finished block by block, or together where they are."""

import dataclasses

import jax
import numpy as np
import pytest

from jblast.study import run
from jblast.study.engine.launch import mesh_of
from jblast.study.engine.tiles import calculated
from jblast.study.outcome.family import FAMILIES
from jblast.study.sampling import work as work_module
from jblast.study.sampling.work import Work
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
    monkeypatch.setattr(work_module, "_tile_samples", lambda _: BLOCK)
    return study_in(tmp_path, STUDY, SCENE)


def columns(work, tiles):
    found = list(calculated(work, tiles))
    return {
        name: np.concatenate([part[name] for _, part in found]) for name in found[0][1]
    }


def test_fits_do_not_depend_on_tiles_or_devices(study, monkeypatch):
    one = run(study, mesh_of(1))
    assert one.fit_converged.all()
    monkeypatch.setattr(work_module, "_tile_samples", lambda _: 4 * BLOCK)
    all_of_them = run(study, mesh_of())
    for name in one:
        np.testing.assert_array_equal(one[name], all_of_them[name])


def test_fits_hold_what_they_say(study):
    found = run(study)
    # of 1,000: four standard errors of nine tenths (errors are Student's: a few more)
    assert abs(float(found.fit_truth_inside.mean()) - 0.9) < 4 * np.sqrt(0.09 / 1000)
    ratio = found.fit_error.std() / (found.fit_interval_width.mean() / 2 / 1.645)
    assert 0.8 < float(ratio) < 1.3


@pytest.mark.slow
def test_tiles_that_lie_on_devices_are_finished_there_to_the_same(study, monkeypatch):
    work = Work(study)
    by_block = columns(work, range(work.numbering.tiles))
    # as on a GPU: several tiles at once, all of a device together
    monkeypatch.setitem(work_module.LAUNCH, "gpu", 2 * BLOCK // jax.device_count())
    monkeypatch.setattr(work_module, "GROUP", BLOCK)
    there = Work(study)
    there.kind = "gpu"
    assert there.at_once == 2
    together = columns(there, range(there.numbering.tiles))
    for name, values in by_block.items():
        # fits end within a tolerance of 1e-8 of a standard deviation
        np.testing.assert_allclose(together[name], values, rtol=1e-6, atol=1e-9)
    some = dict(calculated(there, [2, 0]))
    assert list(some) == [2, 0]
    np.testing.assert_allclose(
        some[2]["fit_error"], by_block["fit_error"][2 * BLOCK : 3 * BLOCK], atol=1e-9
    )
