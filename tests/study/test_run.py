import dataclasses

import jax
import numpy as np
import pytest
import xarray
from scipy.stats import lognorm

from jblast.errors import InputError
from jblast.scene import Air
from jblast.study import draw, outcomes, run, run_into
from jblast.study.slabs import devices_of
from jblast.study.statistics import standard_error
from jblast.waves import wu_hao_air_arrival_time
from jblast.waves.propagation import sound_speed_of
from tests.study.example import STUDY, study_in
from tests.study.test_killed import chunks, thousands  # noqa: F401  a fixture


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return study_in(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def whole(study):
    return run(study)


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


def test_samples_do_not_depend_on_slabs_devices_or_interruption(study, whole, tmp_path):
    small = dataclasses.replace(study, samples=1500)
    longer = run(small)
    for name in ("charge_mass_kg", "air_arrival_s"):
        np.testing.assert_array_equal(longer[name][:300], whole[name])
    run_into(small, tmp_path / "a", devices=devices_of(1))
    ran = run_into(small, tmp_path / "b", limit=1)
    assert (ran.samples, ran.complete) == (1024, False)
    ran = run_into(small, tmp_path / "b", resume=True)
    assert (ran.samples, ran.new, ran.complete) == (1500, 476, True)
    assert chunks(tmp_path / "a") == chunks(tmp_path / "b")
    found = xarray.open_zarr(tmp_path / "b", consolidated=False)
    np.testing.assert_array_equal(found.air_arrival_s, longer.air_arrival_s)


def test_a_study_ends_when_its_standard_errors_are_reached(tmp_path):
    text = STUDY.replace("samples = 300", "samples = 9000") + (
        "sd_target = { air_arrival_s = 2e-3 }\n"
    )
    ran = run_into(study_in(tmp_path, text), tmp_path / "store")
    error = standard_error(ran.moments["air_arrival_s"])
    assert ran.complete
    assert ran.reached
    assert ran.samples % 1024 == 0
    assert 0 < ran.samples < 9000
    assert error.max() <= 2e-3
    found = xarray.open_zarr(tmp_path / "store", consolidated=False)
    assert found.sizes["draw"] == ran.samples
    np.testing.assert_allclose(
        error[0],
        found.air_arrival_s.std("draw", ddof=1) / np.sqrt(ran.samples),
        rtol=1e-12,
    )


def test_cases_have_dimensions_and_the_keys_of_their_samples(tmp_path):
    axes = "[axes]\ncharge_east_m = [0.0, 5.0]\n'law.scatter' = [true, false]\n"
    study = study_in(tmp_path, STUDY + axes)
    found = run(study)
    assert found.air_arrival_s.dims == (
        "draw",
        "law.scatter",
        "charge_east_m",
        "sensor",
    )
    key = jax.random.fold_in(jax.random.key(7), 2 * 123 + 1)
    one = outcomes(key, study, variant=1, cell=1)["air_arrival_s"]
    np.testing.assert_allclose(one, found.air_arrival_s[123, 1, 1], rtol=1e-14)


def test_moments_beyond_the_stored_samples_are_those_of_all(study, tmp_path):
    small = dataclasses.replace(study, samples=5000)
    some = run_into(dataclasses.replace(small, keep=600), tmp_path / "some")
    every = run_into(small, tmp_path / "all")
    for one, other in zip(
        *(r.moments["air_arrival_s"] for r in (some, every)), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    assert xarray.open_zarr(tmp_path / "some", consolidated=False).sizes["draw"] == 600


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
