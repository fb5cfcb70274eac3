"""The likelihood of rows with shared effects: against SciPy and by quadrature."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, stats

from jblast.inference.likelihood import (
    Paths,
    Rows,
    Seen,
    errors_of,
    exact_gain,
    log_likelihoods,
)
from jblast.inference.noise import (
    log_noise,
    noise_slopes,
)
from jblast.sensors.path_scatter import KERNELS

ERRORS: dict[str, Any] = {"gaussian": stats.norm(), "student": stats.t(df=4)}
RNG = np.random.default_rng(7)
RESIDUAL, SD = RNG.normal(size=6) * 0.1, RNG.uniform(0.05, 0.2, size=6)
LOADING = RNG.normal(size=(6, 2)) * 0.1
BOUND = np.array([True, False, True, True, False, False])


def made(residual, sd, loading, noise, bound=None, *, whole=False, **changes):
    """Rows of given residuals, and predictions of zero with shared effects."""
    residual = np.atleast_2d(residual)
    count = residual.shape[1]
    block = np.arange(count)[None] if whole else np.arange(count)[:, None]
    wide = block.shape[1]
    values: dict[str, Any] = {
        "measured": np.zeros(count),
        "sigma": np.asarray(sd, float),
        "circular": np.zeros(count, bool),
        "is_bound": np.zeros(count, bool) if bound is None else bound,
        "group": np.arange(count),
        "block": block,
        "shared": np.zeros((len(block), wide, wide)),
        "columns": np.zeros((count, 0)),
        "precision": np.zeros(0),
        "kernels": KERNELS[2:3],
        "paths": {},
        "correlated": whole,
        "anchored": False,
        "noise": noise,
    }
    effects = {str(k): np.tile(c, (len(residual), 1)) for k, c in enumerate(loading.T)}
    seen = Seen(
        predicted=-residual,
        record_sd=np.zeros_like(residual),
        shot=effects,
        path={},
        arrival={},
        place=np.zeros((*residual.shape, 4)),
        placed=np.zeros(residual.shape, bool),
        valid=np.ones(residual.shape, bool),
        slant_range=np.ones_like(residual),
    )
    return Rows(**(values | changes)), seen


def value(*args, **kwargs):
    return log_likelihoods(np, *made(*args, **kwargs))[0][:, 0]


def exact(residual, sd, loading, noise, bound=None, draws=2000):
    """The likelihood by draws of the scales, and the error of its logarithm."""
    rows, seen = made(residual, sd, loading, noise, bound)
    by_kernel, field = log_likelihoods(np, rows, seen)
    kernel = np.zeros(len(by_kernel), int)
    rng = np.random.default_rng(0)
    gain, _ = exact_gain(rows, field, kernel, by_kernel[:, 0], draws, rng)
    return by_kernel[:, 0] + gain


@pytest.mark.parametrize("whole", [False, True])
def test_normal_errors_with_shared_effects_are_one_multivariate_normal(whole):
    covariance = np.diag(SD**2) + LOADING @ LOADING.T
    expected = stats.multivariate_normal(cov=covariance).logpdf(RESIDUAL)  # type: ignore
    found = value(RESIDUAL, SD, LOADING, "gaussian", whole=whole)
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("noise", ERRORS)
def test_independent_rows_count_with_density_or_survival(noise):
    of, u = ERRORS[noise], RESIDUAL / SD
    read = of.logpdf(u) - np.log(SD)
    found = value(RESIDUAL, SD, np.zeros((6, 0)), noise, BOUND)
    np.testing.assert_allclose(
        found, np.where(BOUND, of.logsf(u), read).sum(), rtol=1e-9
    )


def integral(residual, sd, loading, noise, bound=None):
    """Rows that share one effect, by quadrature over a fine grid."""
    of = ERRORS[noise]
    v = np.linspace(-9, 9, 4001)[:, None]
    u = (residual - loading * v) / sd
    bound = np.zeros(len(residual), bool) if bound is None else bound
    rows = np.where(bound, of.logsf(u), of.logpdf(u) - np.log(sd))
    joint = rows.sum(axis=1) + stats.norm.logpdf(v[:, 0])
    return joint.max() + np.log(
        integrate.simpson(np.exp(joint - joint.max()), x=v[:, 0])
    )


@pytest.mark.parametrize("count", [2, 5, 20])
def test_the_mean_field_is_a_bound_and_its_gain_makes_it_exact(count):
    rng = np.random.default_rng(count)
    residual = rng.standard_t(4, size=count) * 0.1 + 0.05
    sd, loading = np.full(count, 0.1), np.full((count, 1), 0.1)
    for shift in (0.0, 0.1, 0.3):
        moved = residual + shift
        expected = integral(moved, sd, loading[:, 0], "student")
        bound = value(moved, sd, loading, "student")[0]
        assert expected - 0.8 < bound < expected + 1e-6
        # the mean of 2,000 ratios that vary by a factor of 1.5
        found = exact(moved, sd, loading, "student")[0]
        assert found == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("noise", ERRORS)
@pytest.mark.parametrize("scale", [0.3, 1.0, 3.0])
def test_bounds_that_share_an_effect_with_readings_have_the_integral(noise, scale):
    rng = np.random.default_rng(8)
    residual = rng.standard_t(4, size=8) * 0.1
    sd, loading = np.full(8, 0.1), np.full((8, 1), 0.1 * scale)
    bound = np.arange(8) < 4
    for shift in np.linspace(-0.6, 0.0, 4):
        moved = residual + np.where(bound, shift, 0.0)
        expected = integral(moved, sd, loading[:, 0], noise, bound)
        found = exact(moved, sd, loading, noise, bound)[0]
        # points of the effect given the readings, and draws of the scales
        assert found == pytest.approx(expected, abs=0.12)


def test_paths_apart_are_the_same_in_blocks_and_as_a_whole():
    count = 6
    path = {"q": np.tile(np.linspace(0.05, 0.2, count), (1, 1))}
    group = np.array([0, 0, 1, 1, 2, 2])
    paths = {"q": Paths(np.array([0, 2, 4]), group, np.ones(count, bool))}
    each = {"group": group, "paths": paths}
    blocks, seen = made(
        RESIDUAL,
        SD,
        LOADING,
        "student",
        block=np.arange(6).reshape(3, 2),
        shared=np.zeros((3, 2, 2)),
        **each,
    )
    whole, _ = made(RESIDUAL, SD, LOADING, "student", whole=True, **each)
    seen = seen._replace(path=path)
    one, _ = log_likelihoods(np, blocks, seen)
    other, _ = log_likelihoods(np, whole, seen)
    np.testing.assert_allclose(one, other, rtol=1e-6)


@pytest.mark.parametrize("far", [7.0, 7e3, 7e6])
def test_paths_that_coincide_have_a_positive_covariance(far):
    rows, seen = made(
        RESIDUAL, np.full(6, 1e-5), np.zeros((6, 0)), "student", whole=True
    )
    every = np.arange(6)
    rows = replace(rows, paths={"a": Paths(every, every, np.ones(6, bool))})
    sd = np.full((1, 6), far)
    # what rounding leaves of the directions to a charge far away
    place = 1e-9 * np.random.default_rng(1).normal(size=(1, 6, 4))
    placed = np.ones((1, 6), bool)
    seen = seen._replace(arrival={"a": sd}, record_sd=sd, place=place, placed=placed)
    errors = errors_of(np, rows, seen)
    # a Student-t error may be smaller than its scale by a fifth
    matrix = errors.shared[0, 0, 0] + 0.8 * np.diag(errors.own[0, 0])
    assert np.linalg.eigvalsh(matrix).min() > 1e-9 * far**2
    assert np.isfinite(log_likelihoods(np, rows, seen)[0]).all()


def test_anchors_share_what_neighbours_share():
    # forty paths in eight bundles: anchors explain most of each bundle
    count = 40
    turn = np.repeat(np.linspace(0, 2 * np.pi, 8, endpoint=False), 5)
    turn = turn + 0.01 * np.tile(np.arange(5), 8)
    place = np.stack([0 * turn, np.cos(turn), np.sin(turn), 0 * turn], 1)[None]
    paths = {"q": Paths(np.arange(count), np.arange(count), np.ones(count, bool))}
    residual, sd = 0.1 * RNG.normal(size=count), np.full(count, 0.1)
    nothing = np.zeros((count, 0))
    parts = {"path": {"q": np.full((1, count), 0.3)}, "place": place}
    parts["placed"] = np.ones((1, count), bool)
    found = {}
    for name, whole, anchored in (("dense", True, False), ("anchors", False, True)):
        rows, seen = made(
            residual,
            sd,
            nothing,
            "gaussian",
            whole=whole,
            paths=paths,
            anchored=anchored,
        )
        found[name] = log_likelihoods(np, rows, seen._replace(**parts))[0][0, 0]
    rows, seen = made(residual, sd, nothing, "gaussian", paths=paths)
    alone = log_likelihoods(np, rows, seen._replace(**parts))[0][0, 0]
    off = abs(found["anchors"] - found["dense"])
    assert off < 0.3 * abs(alone - found["dense"])


@pytest.mark.parametrize("bound", [None, pytest.param(BOUND, marks=pytest.mark.slow)])
def test_slopes_in_jax_agree_with_differences(bound):
    rows, seen = made(RESIDUAL, SD, LOADING, "student", bound)

    @jax.jit
    def of(x):
        there = jax.tree.map(jnp.asarray, seen)
        moved = there._replace(
            predicted=there.predicted - x[0], record_sd=there.record_sd + x[1]
        )
        return log_likelihoods(jnp, rows, moved)[0][0, 0]

    at, step = jnp.array([0.02, 0.1]), 1e-5 * np.eye(2)
    slope = jax.grad(of)(at)
    ends = [(of(at + s) - of(at - s)) / 2e-5 for s in step]
    np.testing.assert_allclose(slope, ends, rtol=1e-5)


def test_one_wild_row_moves_the_shared_effect_less_under_student_errors():
    wild = np.zeros(10)
    wild[3] = 3.0
    sd, loading = np.full(10, 0.1), np.full((10, 1), 0.1)
    moved = {}
    for noise in ERRORS:
        rows, seen = made(wild, sd, loading, noise)
        moved[noise] = log_likelihoods(np, rows, seen)[1].normal.linear[0, 0, 0]
    assert moved["gaussian"] > 2
    assert abs(moved["student"]) < 0.4


@pytest.mark.parametrize("noise", ERRORS)
def test_errors_have_the_density_of_scipy(noise):
    u = np.linspace(-30, 30, 41)
    np.testing.assert_allclose(
        log_noise(jnp.asarray(u), noise), ERRORS[noise].logpdf(u), rtol=1e-12
    )


@pytest.mark.parametrize("noise", ERRORS)
def test_slopes_of_an_error_are_its_derivatives(noise):
    u = jnp.linspace(-30, 30, 41)
    first = jax.grad(lambda u: -log_noise(u, noise))
    slope, curvature = noise_slopes(u, noise)
    np.testing.assert_allclose(slope, jax.vmap(first)(u), rtol=1e-11)
    np.testing.assert_allclose(curvature, jax.vmap(jax.grad(first))(u), rtol=1e-9)
