import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.many.residuals import rows_of
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import posterior_of
from jblast.scene import Clock, Ground, Scene, UncertainScene, freed
from jblast.sensors import layout_of
from tests.inference.logs import log

LAWS = {
    "air_arrival_s": "kingery_bulmash",
    "ground_arrival_s": "wu_hao",
    "peak_overpressure_pa": "kingery_bulmash",
    "positive_impulse_pa_s": "ford_2021",
}
FREE = [
    "charge_mass_kg",
    "charge_east_m",
    "origin_time_s",
    "air_sound_speed_m_s",
    "wind_east_m_s",
    "clock_offset_s.free",
]


def mixed_log():
    a, b, c = (60.0, 5.0, 2.0), (-70.0, 30.0, 0.0), (0.0, 90.0, 10.0)
    rows = [
        ("a", "air_arrival_s", 0.2, 1e-3, a),
        ("a", "peak_overpressure_pa", 4e3, 200.0, a),
        ("a", "positive_impulse_pa_s", 50.0, None, a),
        ("b", "air_arrival_s", 0.3, 1e-3, b),
        ("b", "positive_impulse_pa_s", 40.0, 4.0, b),
        ("c", "arrival_difference_s", 0.3, 1e-3, c),
        ("c", "ground_arrival_s", 0.04, None, c),
    ]
    clocks = ("", "", "", "free", "free", "late", "late")
    return dataclasses.replace(log(*rows), clock=clocks)


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [False, True])
def test_rows_over_lanes_miss_as_the_posterior_does(scatter):
    observations = mixed_log()
    if not scatter:
        sigma = np.nan_to_num(observations.sigma, nan=1e-2)
        observations = dataclasses.replace(observations, sigma=sigma)
    scene = dataclasses.replace(
        Scene(),
        scatter=scatter,
        ground=Ground(path="thesis"),
        clocks=(Clock("late", 0.25), Clock("free", 0.0)),
    )
    uncertain = freed(UncertainScene(scene), FREE)
    parameters = parameters_of(uncertain)
    layout = layout_of(observations, scene)
    posterior = posterior_of(parameters, layout, observations, LAWS, "student")
    # batches take the scatter of neighbouring paths as independent
    posterior = dataclasses.replace(posterior, neighbours=False)
    rows = rows_of(parameters, layout, LAWS, "student")
    values = jnp.asarray(observations.value)
    z = jnp.array([3.0, 5.0, 0.01, 5.8, 2.0, -0.02])
    v = 0.3 * jnp.arange(rows.effects, dtype=float)
    y = jnp.stack([jnp.concatenate([z, 0 * v]), jnp.concatenate([z * 1.01, v])], 1)
    measured = jnp.repeat(rows.to_error_scale(values[None, :]), 2, axis=1)
    sigma = np.asarray(posterior.sigma)[:, None]
    at = jax.jit(lambda y: rows.miss(y, measured, sigma))
    miss = at(y)
    order = np.concatenate([part.rows for part in rows.groups])
    n = len(order)
    want = posterior.misfit(z)
    # a hundred operations' rounding, of readings of up to 10 in units of 1e-3
    np.testing.assert_allclose(
        miss.residual[:n, 0], (want.residual / want.sd)[order], rtol=1e-9, atol=1e-9
    )
    want = posterior.misfit(z * 1.01)
    # the effects count alike, in whichever order; one that loads no row has no place
    load = np.asarray(want.loading)
    assert np.any(load != 0, axis=0).sum() == rows.effects
    shared = np.asarray(miss.residual[:n, 1] * want.sd[order], float)
    shared = shared - np.asarray(want.residual, float)[order]
    if scatter:
        with_effects, *_ = np.linalg.lstsq(load[order], -shared)
        np.testing.assert_allclose(load[order] @ with_effects, -shared, atol=1e-9)
        assert np.abs(shared).max() > 1e-3
    else:
        np.testing.assert_allclose(shared, 0.0, atol=1e-9)
    # slopes against central differences
    step = 1e-6
    for k in range(rows.unknowns):
        up, down = (at(y.at[k].add(sign * step)).residual for sign in (1, -1))
        slope = (up - down) / (2 * step)
        size = float(jnp.abs(miss.columns[k]).max())
        np.testing.assert_allclose(miss.columns[k], slope, atol=1e-6 * (1 + size))
