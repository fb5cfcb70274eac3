"""Statistics alone: what a store without rows says is what all the rows would."""

import dataclasses
import shutil

import numpy as np
import pytest
import xarray

from jblast.errors import InputError
from jblast.study import run, run_into
from jblast.study.engine.launch import mesh_of
from jblast.study.engine.merge import merged
from jblast.study.engine.store import open_store
from jblast.study.engine.summary import SummaryStore, merged_states
from jblast.study.sampling import work
from jblast.study.statistics import NUMBER
from tests.study.engine.test_killed import chunks
from tests.study.example import SCENE, STUDY, study_in

SAMPLES = 5000
SUMMARY = STUDY.replace("samples = 300", f'samples = {SAMPLES}\nkeep = "summary"')
AXIS = "[axes]\ncharge_mass_kg = [1.0, 10.0, 100.0]\n"
YES_NO = SUMMARY.replace(
    '["air_arrival_s"]', '["air_arrival_s", "above_threshold", "above_glass_threshold"]'
)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(work, "_tile_samples", lambda _: 1024)
    monkeypatch.setattr(work, "PART", 2048)


def whole_state(folder, name="air_arrival_s"):
    store = open_store(folder)
    assert store is not None
    groups = store.attributes["cells"] * store.attributes["variants"]
    summary = SummaryStore(store.path, store.variables, groups, 1000)
    anchors, state = summary.anchors(), None
    for tile in sorted(summary.done()):
        own = summary.read(tile, anchors)
        state = own if state is None else merged_states(store.variables, state, own)
    assert state is not None
    return state[name]


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["", AXIS])
def test_the_statistics_are_those_of_all_rows(tmp_path, axis):
    study = study_in(tmp_path, SUMMARY + axis)
    ran = run_into(study, tmp_path / "store")
    assert ran.complete
    rows = run(study).air_arrival_s.values
    cells = 3 if axis else 1
    by_cell = rows.reshape(-1, cells, 2)
    found = NUMBER.finish(whole_state(tmp_path / "store"), (0.05, 0.5, 0.95))
    # sums of thousands of values in another order
    np.testing.assert_allclose(found["mean"], by_cell.mean(0), rtol=1e-13)
    np.testing.assert_allclose(found["sd"], by_cell.std(0, ddof=1), rtol=1e-11)
    np.testing.assert_array_equal(found["minimum"], by_cell.min(0))
    np.testing.assert_array_equal(found["maximum"], by_cell.max(0))
    assert (found["count"] == SAMPLES).all()
    exact = np.quantile(by_cell, [0.05, 0.5, 0.95], axis=0, method="inverted_cdf")
    # a bin is 0.8 % of the distance from its origin, which is a median of the first
    spread = np.abs(by_cell - np.median(by_cell, 0)).max(0)
    assert (np.abs(found["quantiles"] - exact) < 0.01 * spread).all()


def test_it_does_not_depend_on_devices_or_interruption(tmp_path):
    study = study_in(tmp_path, SUMMARY)
    run_into(study, tmp_path / "a", mesh=mesh_of(1))
    ran = run_into(study, tmp_path / "b", limit=1)
    assert (ran.samples, ran.complete) == (1024, False)
    half = tmp_path / "b" / "summary" / "air_arrival_s.counts" / "0.0.0.0"
    half.write_bytes(half.read_bytes()[:-30])  # as a loss of power may leave it
    ran = run_into(study, tmp_path / "b", resume=True)
    assert (ran.samples, ran.new, ran.complete) == (SAMPLES, SAMPLES, True)
    assert chunks(tmp_path / "a") == chunks(tmp_path / "b")
    assert run_into(study, tmp_path / "b", resume=True).new == 0


def test_the_first_samples_are_kept_where_a_number_of_them_is_asked_for(tmp_path):
    text = SUMMARY.replace('keep = "summary"', "keep = 1500")
    study = study_in(tmp_path, text)
    ran = run_into(study, tmp_path / "store")
    assert (ran.samples, ran.complete) == (SAMPLES, True)
    found = xarray.open_zarr(tmp_path / "store")
    assert found.sizes["sample"] == 1500
    np.testing.assert_array_equal(found.air_arrival_s, run(study).air_arrival_s[:1500])
    state = whole_state(tmp_path / "store")
    assert (state.moments.finite == SAMPLES).all()


def test_xarray_reads_the_statistics(tmp_path):
    run_into(study_in(tmp_path, SUMMARY), tmp_path / "store")
    found = xarray.open_zarr(tmp_path / "store", group="summary", consolidated=False)
    assert found["air_arrival_s.counts"].sum() == 2 * SAMPLES


@pytest.mark.slow
def test_parts_are_merged(tmp_path):
    study = study_in(tmp_path, SUMMARY)
    run_into(study, tmp_path / "whole")
    run_into(study, tmp_path / "part", limit=2048)
    run_into(study, tmp_path / "rest")
    shutil.copytree(tmp_path / "rest", tmp_path / "lost")
    (tmp_path / "lost" / "summary" / "air_arrival_s.counts" / "0.0.0.0").unlink()
    with pytest.raises(InputError, match=r"expected a chunk of the store, got none"):
        merged([tmp_path / "part", tmp_path / "lost"], tmp_path / "both")
    both = merged([tmp_path / "part", tmp_path / "rest"], tmp_path / "both")
    assert both.attributes["complete"]
    assert chunks(tmp_path / "both") == chunks(tmp_path / "whole")


@pytest.mark.slow
def test_shares_count_lanes_that_failed(tmp_path):
    text = YES_NO + "[options]\nthreshold_pa = 30000.0\n"
    study = study_in(tmp_path, text)
    run_into(study, tmp_path / "store")
    rows = run(study).above_threshold.values
    state = whole_state(tmp_path / "store", "above_threshold")
    np.testing.assert_array_equal(state.yes[0], (rows == 1).sum(0))
    np.testing.assert_array_equal(state.lost[0], (rows < 0).sum(0))
    assert 0 < state.yes[0, 0] < SAMPLES


def test_sketches_of_too_many_cells_are_refused(tmp_path):
    axis = "[axes]\ncharge_mass_kg = { from = 1, to = 100, count = 2000 }\n"
    study = study_in(tmp_path, SUMMARY.replace(f"{SAMPLES}", "1") + axis)
    with pytest.raises(InputError, match="keep: expected at most"):
        run_into(study, tmp_path / "store")
    more = dataclasses.replace(study, keep="all")
    assert run_into(more, tmp_path / "rows").complete


@pytest.mark.slow
def test_each_variant_of_the_scene_has_its_own(tmp_path):
    (tmp_path / "other.toml").write_text(SCENE.replace("20.0, 0.0", "40.0, 0.0"))
    text = SUMMARY.replace('"scene.toml"', '["scene.toml", "other.toml"]')
    study = study_in(tmp_path, text)
    run_into(study, tmp_path / "store")
    rows = run(study)
    found = NUMBER.finish(whole_state(tmp_path / "store"))
    for n in (0, 1):
        own = rows.air_arrival_s.values[rows.scene.values == n]
        np.testing.assert_allclose(found["mean"][n], own.mean(0), rtol=1e-13)
        assert (found["count"][n] == len(own)).all()
