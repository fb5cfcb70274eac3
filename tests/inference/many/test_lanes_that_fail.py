"""A log that cannot be fitted fails alone, and is named; a batch may be refused."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import fit_many
from jblast.inference.many.engine import engine_for
from jblast.scene import Sensor
from jblast.sensors import observe, planned_layout
from tests.inference.many.five_sensors import LAWS, RECORDS, problem


def test_one_bad_log_fails_alone_and_is_named():
    uncertain, layout, values, sigma, _ = problem(16)
    clean = fit_many(uncertain, layout, values, sigma, LAWS, noise="gaussian")
    broken = values.copy()
    broken[13, 3] = np.nan
    found = fit_many(uncertain, layout, broken, sigma, LAWS, noise="gaussian")
    assert list(np.flatnonzero(found.bad)) == [13]
    assert found.faults == (
        (13, "log 13, row 3, ground_arrival_s: expected a finite time, got nan"),
    )
    assert np.isnan(found.z[13]).all()
    assert not found.converged[13]
    others = np.arange(16) != 13
    assert found.converged[others].all()
    np.testing.assert_allclose(found.z[others], clean.z[others], rtol=1e-9)


@pytest.mark.slow
def test_a_log_that_cannot_tell_its_unknowns_does_not_converge():
    uncertain, _, _, _, _ = problem(1)
    # sensors in one place tell a distance, and nothing of the direction
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([60.0, 0.0, 0.0]), records=RECORDS) for i in range(3)
    )
    scene = dataclasses.replace(uncertain.scene, sensors=sensors)
    uncertain = dataclasses.replace(uncertain, scene=scene)
    layout, sigma, _ = planned_layout(scene)
    values = np.asarray(
        observe(jax.random.key(0), scene, layout, LAWS, sigma, noise="gaussian")
    )
    start = np.array([[3.0, 5.0, 5.0, 1.5]])
    found = fit_many(
        uncertain,
        layout,
        values[None],
        np.asarray(sigma),
        LAWS,
        noise="gaussian",
        starts=start,
    )
    assert not found.converged[0]
    assert not found.bad[0]
    assert np.isfinite(found.z).all()
    assert np.isnan(found.covariance).all()


@pytest.mark.slow
def test_every_lane_from_random_starts_is_at_the_optimum_or_says_it_is_not():
    uncertain, layout, values, sigma, _ = problem(16)
    best = fit_many(uncertain, layout, values, sigma, LAWS, noise="gaussian")
    rng = np.random.default_rng(0)
    starts = np.stack(
        [
            rng.uniform(0.0, 7.0, (3, 16)),
            *rng.uniform(-100, 100, (2, 3, 16)),
            1.5 + rng.uniform(-0.1, 0.1, (3, 16)),
        ],
        axis=-1,
    )
    found = fit_many(
        uncertain, layout, values, sigma, LAWS, noise="gaussian", starts=starts
    )
    away = np.abs(np.asarray((found.z - best.z) / best.sd())).max(axis=1)
    assert (away[np.asarray(found.converged)] < 1e-6).all()
    assert found.converged.mean() > 0.9


@pytest.mark.parametrize(
    ("values", "sigma", "starts", "said"),
    [
        (np.ones((2, 5)), np.ones(12), None, "values: expected"),
        (np.ones((2, 12)), np.ones(5), None, "relative_sigma: expected"),
        (np.ones((2, 12)), np.full(12, np.nan), None, "sigma: expected finite"),
        (np.ones((2, 12)), np.ones(12), np.ones((2, 3)), "starts: expected"),
    ],
)
def test_a_batch_of_the_wrong_shape_is_refused(values, sigma, starts, said):
    uncertain, layout, *_ = problem(1)
    with pytest.raises(InputError, match=said):
        fit_many(uncertain, layout, values, sigma, LAWS, starts=starts)


def test_effects_beyond_what_is_written_out_are_refused():
    records = (("air_arrival_s", 1e-4), ("positive_impulse_pa_s", 0.02))
    laws = {"air_arrival_s": "kingery_bulmash", "positive_impulse_pa_s": "ford_2021"}
    uncertain, *_ = problem(1, scatter=True, records=records, laws=tuple(laws.items()))
    sensors = uncertain.scene.sensors * 3
    scene = dataclasses.replace(uncertain.scene, sensors=sensors)
    layout, *_ = planned_layout(scene)
    uncertain = dataclasses.replace(uncertain, scene=scene)
    with pytest.raises(InputError, match="at most 16"):
        engine_for(uncertain, layout, laws, "gaussian")
