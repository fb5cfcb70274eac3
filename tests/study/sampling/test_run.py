import dataclasses

import jax
import numpy as np
import pytest
import xarray
from scipy.stats import lognorm

from jblast.errors import InputError
from jblast.scene import Air
from jblast.study import draw, outcomes, run, run_into
from jblast.study.engine.launch import mesh_of
from jblast.study.engine.store import Variable
from jblast.study.engine.tiles import Estimates, Numbering
from jblast.study.sampling import work
from jblast.waves import wu_hao_air_arrival_time
from jblast.waves.propagation import sound_speed_of
from tests.study.example import STUDY, study_in


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return study_in(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def whole(study):
    return run(study)


def chunks(folder):
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p.name[0] != ".")
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in files
        if p.name != "zarr.json"
    }


def test_arrivals_are_the_laws_of_the_drawn_numbers(whole):
    distance = np.array([[20.0, 50.0]])
    mass = whole.charge_mass_kg.values[:, None]
    travel = whole.air_arrival_s.values - whole.origin_time_s.values[:, None]
    speed = float(sound_speed_of(Air()))
    exponent = np.log(travel[:, 1] / travel[:, 0]) / np.log(50.0 / 20.0)
    np.testing.assert_allclose(exponent, 1.4, rtol=1e-9)
    unit = np.asarray(wu_hao_air_arrival_time(distance, mass, speed))
    np.testing.assert_allclose(travel, unit, rtol=1e-12)


def test_draws_are_those_of_the_priors(whole):
    # of 300 draws: 4 standard errors
    scores = np.log(whole.charge_mass_kg.values / 10.0) / np.log(2.0)
    assert abs(scores.mean()) < 4 / np.sqrt(300)
    assert abs(scores.std() - 1) < 4 / np.sqrt(600)
    assert lognorm(np.log(2.0), scale=10.0).cdf(whole.charge_mass_kg.values).max() < 1


def test_one_sample_as_a_pure_function_is_that_of_the_run(study, whole):
    key = jax.random.fold_in(jax.random.key(7), 123)
    drawn = jax.jit(lambda key: draw(key, study))(key)
    assert float(drawn["charge_mass_kg"]) == whole.charge_mass_kg.values[123]
    one = jax.jit(lambda key: outcomes(key, study))(key)["air_arrival_s"]
    np.testing.assert_allclose(one, whole.air_arrival_s.values[123], rtol=1e-14)


def test_a_derivative_is_that_of_the_law(study):
    key = jax.random.fold_in(jax.random.key(7), 123)

    def arrival(mass):
        given = {"charge_mass_kg": mass, "origin_time_s": 0.0}
        return outcomes(key, study, given)["air_arrival_s"][0]

    value, slope = jax.value_and_grad(arrival)(10.0)
    np.testing.assert_allclose(slope, -0.2 * value / 10.0, rtol=1e-12)


def test_a_number_that_is_not_drawn_is_refused_with_the_nearest(study):
    with pytest.raises(InputError, match="did you mean charge_mass_kg"):
        outcomes(jax.random.key(0), study, {"charge_mas_kg": 1.0})


def test_samples_do_not_depend_on_tiles_devices_or_interruption(
    study, whole, tmp_path, monkeypatch
):
    monkeypatch.setattr(work, "_tile_samples", lambda _: 512)
    small = dataclasses.replace(study, samples=1500)
    longer = run(dataclasses.replace(study, samples=1500))
    monkeypatch.setattr(work, "_tile_samples", lambda _: 1024)
    for name in ("charge_mass_kg", "air_arrival_s"):
        np.testing.assert_array_equal(longer[name][:300], whole[name])
    run_into(small, tmp_path / "a", mesh=mesh_of(1))
    ran = run_into(small, tmp_path / "b", limit=1)
    assert (ran.samples, ran.complete) == (1024, False)
    assert not xarray.open_zarr(tmp_path / "b").complete
    ran = run_into(small, tmp_path / "b", resume=True)
    assert (ran.samples, ran.new, ran.complete) == (1500, 476, True)
    assert chunks(tmp_path / "a") == chunks(tmp_path / "b")
    np.testing.assert_array_equal(
        xarray.open_zarr(tmp_path / "b").air_arrival_s, longer.air_arrival_s
    )


def test_a_study_ends_when_its_standard_errors_are_reached(tmp_path, monkeypatch):
    monkeypatch.setattr(work, "_tile_samples", lambda _: 512)
    text = STUDY.replace("samples = 300", "samples = 5000") + (
        "sd_target = { air_arrival_s = 2e-3 }\n"
    )
    ran = run_into(study_in(tmp_path, text), tmp_path / "store")
    error = ran.estimates.moments["air_arrival_s"].standard_error()
    assert ran.complete
    assert ran.reached
    assert ran.samples % 512 == 0
    assert 0 < ran.samples < 5000
    assert error.max() <= 2e-3
    found = xarray.open_zarr(tmp_path / "store")
    assert found.sizes["sample"] == ran.samples
    np.testing.assert_allclose(
        error[0],
        found.air_arrival_s.std("sample", ddof=1) / np.sqrt(ran.samples),
        rtol=1e-12,
    )


def test_a_share_of_nothing_yet_is_not_a_share_of_zero():
    event = Variable("rare", "outcome", "1", "an event", "yes_no")
    estimates = Estimates([event], Numbering(64, 1, 1, 4096, 64))
    none = {"rare": np.zeros(998, np.int8)}
    estimates.add(0, none)
    assert estimates.moments["rare"].standard_error() == 0.0
    # sqrt(p (1 - p) / n) with p = 1/1000 of 1,000 samples, two of which are added
    assert not estimates.reached({"rare": 9.99e-4})
    assert estimates.reached({"rare": 1e-3})
    estimates.add(998, none)
    assert estimates.reached({"rare": 5.01e-4})


def test_an_infinite_value_does_not_hold_up_a_target():
    time = Variable("time", "outcome", "s", "a time")
    estimates = Estimates([time], Numbering(64, 1, 1, 4096, 64))
    estimates.add(0, {"time": np.array([1.0, np.inf, 2.0, np.nan, 3.0])})
    found = estimates.moments["time"]
    assert (found.mean.item(), found.failed.item()) == (2.0, 2)
    assert estimates.reached({"time": 0.6})


def test_a_draw_that_cannot_be_fails_alone_and_is_counted(tmp_path):
    scene = (
        "[charge]\nmass_kg = 10.0\nposition_m = [0.0, 0.0, 0.0]\n[air]\n"
        'temperature_k = { normal = [390.0, 10.0] }\n[law]\nair_arrival_s = "wu_hao"\n'
        'scatter = false\n[[sensor]]\nname = "near"\nposition_m = [20.0, 0.0, 0.0]\n'
    )
    found = run(study_in(tmp_path, scene=scene))
    hot = found.air_temperature_k > 400.0
    assert 20 < hot.sum() < 80  # of 300 a share of 16 %
    assert bool((np.isnan(found.air_arrival_s[:, 0]) == hot).all())
