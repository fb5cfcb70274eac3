"""The search of many logs: folded programs, rows over lanes, steps and equations."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from jax import lax
from scipy.optimize import least_squares

from jblast.inference.many.fold import CannotFoldError, fold, over_cells
from jblast.inference.many.residuals import rows_of
from jblast.inference.many.solver import (
    backward,
    cholesky,
    expansion,
    forward,
    inverse_of,
    levenberg_marquardt,
    squared,
)
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import posterior_of
from jblast.registry import LAWS, call
from jblast.scene import Clock, Ground, Scene, UncertainScene, freed
from jblast.sensors import layout_of
from jblast.waves.paths import Path
from tests.inference.logs import log

LANE = jnp.linspace(0.5, 2.0, 5)[None, :]
ROW = np.linspace(1.0, 3.0, 3)[:, None]
ONE = np.full((3, 1), 7.0)


def program(x, row, one):
    place = jnp.stack([x, row, one])
    turn = jnp.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    turned = turn @ place
    chosen = turned[np.array([2, 0])].at[1].add(x**1.4)
    far = jnp.where(one > 3, jnp.sum(chosen), jnp.nan)
    return [far * 0.0 + jnp.linalg.norm(turned), chosen[1], jnp.max(place[None, :])]


def expected(function, *cells):
    shape = np.broadcast_shapes(*(c.shape for c in cells))
    full = [jnp.broadcast_to(c, shape) for c in cells]
    return jax.vmap(jax.vmap(function))(*full)


def test_a_folded_program_is_the_program():
    for got, want in zip(
        fold(program, [LANE, ROW, ONE]), expected(program, LANE, ROW, ONE), strict=True
    ):
        np.testing.assert_allclose(jnp.broadcast_to(got, want.shape), want, rtol=1e-14)


def test_a_loop_cannot_be_taken_apart_and_is_batched_instead():
    def program(x, row):
        return [lax.fori_loop(0, 3, lambda _, v: v * row, x)]

    with pytest.raises(CannotFoldError, match=r"scan|while"):
        fold(program, [LANE, ROW])
    (got,) = over_cells(program, [LANE, ROW])
    np.testing.assert_allclose(got, LANE * ROW**3, rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("quantity", "name"),
    [
        k
        for k in LAWS
        if k[1]
        in {"kingery_bulmash", "wu_hao", "shock_kinematics", "sadovsky", "ford_2021"}
    ],
)
def test_laws_over_cells_are_the_laws(quantity, name):
    law = LAWS[quantity, name]

    def program(mass, distance):
        path = Path(
            slant_range=distance,
            ground_range=distance,
            charge_mass=mass,
            height_of_burst=jnp.zeros(()),
            ambient_pressure=jnp.asarray(101325.0),
            sound_speed=jnp.asarray(340.0),
            air_density=jnp.asarray(1.2),
            p_speed=jnp.asarray(5660.0),
            sedov_gamma=jnp.asarray(1.4),
            time_since_detonation=jnp.asarray(0.01),
            sensor_height=jnp.zeros(()),
            temperature=jnp.asarray(280.0),
            relative_humidity=jnp.asarray(0.5),
            burst="surface",
            ground_path="head",
        )
        return [call(law.function, path)]

    distance = np.geomspace(5.0, 300.0, 4)[:, None]
    (got,) = over_cells(program, [LANE, distance])
    (want,) = expected(program, LANE, distance)
    np.testing.assert_allclose(jnp.broadcast_to(got, want.shape), want, rtol=1e-12)


CHOSEN = {
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
    posterior = posterior_of(parameters, layout, observations, CHOSEN, "student")
    # batches take the scatter of neighbouring paths as independent
    posterior = dataclasses.replace(posterior, neighbours=False)
    rows = rows_of(parameters, layout, CHOSEN, "student")
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


TIMES = jnp.linspace(0.0, 3.0, 9)


def decay(y, data):
    """An exponential decay to a level, three unknowns."""
    return (y[0] * jnp.exp(-jnp.exp(y[1]) * TIMES) + y[2] - data) / 0.01


def data(seed):
    noise = np.random.default_rng(seed).standard_normal(9)
    return decay(jnp.array([2.0, 0.3, 0.5]), 0.0) * 0.01 + 0.01 * jnp.asarray(noise)


START = jnp.array([1.0, -0.5, 0.0])


def half_square(residual):
    return 0.5 * residual**2, residual, None, None


def search(residuals, start, loss=half_square, steps=60):
    """Minimise the cost of residuals of one problem, or of lanes."""

    def expand(y):
        residual, push = jax.linearize(residuals, y)
        units = [jnp.zeros_like(y).at[k].set(1.0) for k in range(len(y))]
        return expansion(loss, y, residual, [push(unit) for unit in units])

    return levenberg_marquardt(expand, start, max_steps=steps)


@jax.jit
def solve(readings, start=START):
    return search(lambda y: decay(y, readings), start)


@jax.jit
def solve_lanes(readings):
    lanes = jax.vmap(decay, in_axes=(1, 1), out_axes=1)
    starts = jnp.repeat(START[:, None], len(readings), axis=1)
    return search(lambda y: lanes(y, readings.T), starts)


def test_one_problem_ends_where_optimistix_and_scipy_end():
    ours = solve(data(0))
    solver = optx.LevenbergMarquardt(rtol=1e-12, atol=1e-12)
    theirs = optx.least_squares(decay, solver, START, data(0), max_steps=500)
    scipys = least_squares(
        lambda y: np.asarray(decay(jnp.asarray(y), data(0))),
        START,
        method="lm",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    # the optimum is known to the square root of rounding in the cost at worst
    np.testing.assert_allclose(ours.y, theirs.value, rtol=1e-8)
    np.testing.assert_allclose(ours.y, scipys.x, rtol=1e-8)
    assert ours.here.f == pytest.approx(scipys.cost, rel=1e-13)
    assert ours.done
    assert ours.here.at_optimum()


def test_lanes_under_vmap_and_a_loop_are_the_same():
    readings = jnp.stack([data(seed) for seed in range(4)])
    loop = jnp.stack([solve(r).y for r in readings])
    batch = jax.vmap(lambda r: solve(r).y)(readings)
    together = solve_lanes(readings)
    np.testing.assert_allclose(batch, loop, rtol=1e-10)
    np.testing.assert_allclose(together.y.T, loop, rtol=1e-10)
    assert together.done.all()


def test_a_start_at_the_rounding_floor_is_left_at_once():
    # there no step can make the cost fall, and a classical trust region rejects on
    end = solve(data(1)).y
    again = solve(data(1), end)
    assert again.steps == 1
    np.testing.assert_allclose(again.y, end, rtol=1e-12)


def test_a_lane_that_is_not_finite_stays_and_disturbs_no_other():
    readings = jnp.stack([data(0), jnp.full(9, jnp.nan), data(2), data(3)])
    found = solve_lanes(readings)
    np.testing.assert_array_equal(found.here.at_optimum(), [True, False, True, True])
    np.testing.assert_allclose(found.y[:, 2], solve(data(2)).y, rtol=1e-10)
    np.testing.assert_array_equal(found.y[:, 1], START)


def test_unknowns_that_no_residual_tells_apart_are_no_optimum():
    def ridge(y):
        return jnp.stack([y[0] + y[1] - 1.0, 2 * (y[0] + y[1]) - 2.5])

    found = search(ridge, jnp.zeros(2), steps=30)
    assert not found.here.at_optimum()
    assert np.isfinite(found.y).all()


def test_a_curvature_that_gauss_newton_does_not_see_is_no_trouble():
    # Gauss-Newton sees a curvature of 1 at y0 = 0, where it is 5
    def residuals(y):
        return jnp.stack([y[0] ** 2 + 2.0, y[0], y[1] - 3.0])

    found = search(residuals, jnp.array([[0.8, -1e-6], [0.0, 2.0]]))
    assert found.here.at_optimum().all()
    np.testing.assert_allclose(found.y, [[0.0, 0.0], [3.0, 3.0]], atol=1e-7)


def test_where_the_curvature_is_negative_reweighted_residuals_step():
    # minus ln of a Cauchy density, from where it curves downwards
    def cauchy(u):
        bend = 1 + u**2
        return jnp.log(bend) / 2, u / bend, (1 - u**2) / bend**2, 1 / bend

    found = search(lambda y: y - 1.0, jnp.array([[4.0]]), cauchy)
    assert found.here.at_optimum().all()
    np.testing.assert_allclose(found.y, 1.0, rtol=1e-9)


def triangles(lanes, unknowns, seed=0):
    rng = np.random.default_rng(seed)
    j = rng.standard_normal((lanes, 12, unknowns)) * np.geomspace(1e-3, 1e3, unknowns)
    h = np.einsum("nik,nim->nkm", j, j)
    packed = tuple(
        tuple(jnp.asarray(h[:, k, i]) for i in range(k + 1)) for k in range(unknowns)
    )
    return h, packed, rng.standard_normal((lanes, unknowns))


@pytest.mark.parametrize("unknowns", [1, 6])
def test_the_written_out_solve_is_that_of_numpy_in_every_lane(unknowns):
    h, packed, g = triangles(7, unknowns)
    factor = cholesky(packed, 0.3)
    found = backward(factor, forward(factor, tuple(jnp.asarray(g.T))))
    damped = h + 0.3 * h * np.eye(unknowns)
    expected = np.linalg.solve(damped, g[..., None])[..., 0]
    np.testing.assert_allclose(np.stack(found, axis=1), expected, rtol=1e-10)
    assert factor.positive.all()


def test_the_whitened_gradient_is_as_long_as_newtons_promise():
    h, packed, g = triangles(5, 4)
    length = squared(forward(cholesky(packed), tuple(jnp.asarray(g.T))))
    expected = np.einsum("lk,lkm,lm->l", g, np.linalg.inv(h), g)
    np.testing.assert_allclose(length, expected, rtol=1e-9)


def test_the_inverse_is_that_of_numpy():
    h, packed, _ = triangles(5, 4)
    found = np.moveaxis(
        np.stack([np.stack(c) for c in inverse_of(cholesky(packed))]), 2, 0
    )
    np.testing.assert_allclose(found, np.linalg.inv(h), rtol=1e-8)


def test_a_singular_matrix_is_not_positive_and_leaves_that_unknown_alone():
    one = jnp.ones(2)
    # the second unknown does what the first does, the third nothing at all
    factor = cholesky(((one,), (one, one), (0 * one, 0 * one, 0 * one)))
    step = backward(factor, forward(factor, (one, one, one)))
    assert not factor.positive.any()
    assert np.isfinite(np.stack(step)).all()
    assert (step[2] == 0).all()
