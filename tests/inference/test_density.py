"""The density of a log: against sums, integrals and the same in JAX."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import t as student

from jblast.inference.answer import unconstrained
from jblast.inference.density import density_of
from jblast.inference.likelihood import exact_gain, log_likelihoods
from jblast.inference.sample import pareto_smoothed, solve
from jblast.scene import Scene, UncertainScene, freed
from jblast.sensors import layout_of, record
from jblast.sensors.simulated_readings import Noise
from tests.catalogue import AROUND
from tests.inference.logs import log

SIGMA = {"air_arrival_s": 1e-3, "peak_overpressure_pa": 0.05}
LAWS = tuple((quantity, "shock_kinematics") for quantity in SIGMA)
RNG = np.random.default_rng


def made(scatter=True):
    """Return a log of five microphones about 15 kg at the origin, without errors."""
    rows = [
        (f"m{i}", quantity, 1.0, 1.0, (*place, 1.5))
        for i, place in enumerate(AROUND)
        for quantity in SIGMA
    ]
    scene = Scene(law=LAWS, scatter=scatter)
    blank = log(*rows)
    value = record(scene, layout_of(blank, scene), dict(LAWS)).value
    rows = [
        (*row[:2], float(x), SIGMA[row[1]] * (x if "peak" in row[1] else 1.0), row[4])
        for row, x in zip(rows, np.asarray(value), strict=True)
    ]
    return log(*rows), scene


@functools.cache
def density(free, noise: Noise = "student", scatter=True):
    observations, scene = made(scatter)
    return density_of(observations, freed(UncertainScene(scene), list(free)), noise)


MASS = ("charge_mass_kg",)
TIMED = ("charge_mass_kg", "origin_time_s")
PLACED = ("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s")


def test_the_density_of_all_numbers_has_that_of_the_coordinates():
    found = density(MASS, "gaussian")
    assert found.coordinates.linear == ()
    ln_mass = np.log([8.0, 15.0, 30.0])[:, None]
    expected = [float(found.log_density(jnp.asarray(z))) for z in ln_mass]
    # the flat prior of a mass has a density in one, up to a constant in the other
    prior = found.coordinates.log_prior(ln_mass)
    np.testing.assert_allclose(found(ln_mass) - prior, expected, rtol=1e-8)


def test_a_linear_time_is_integrated_out():
    found = density(TIMED, "gaussian")
    names = found.coordinates.names
    assert [names[i] for i in found.coordinates.linear] == ["origin_time_s"]
    ln_mass = np.log([12.0, 15.0])[:, None]
    times = np.linspace(-0.03, 0.03, 2001)
    order = [names.index(name) for name in TIMED]
    each = jax.jit(jax.vmap(found.log_density))
    for z, own in zip(
        ln_mass, found(ln_mass) - found.coordinates.log_prior(ln_mass), strict=True
    ):
        at = np.empty((len(times), 2))
        at[:, order[0]], at[:, order[1]] = z[0], times
        # the trapezoidal rule is exact for a normal far inside its ends
        whole = logsumexp(np.asarray(each(at))) + np.log(times[1] - times[0])
        assert own == pytest.approx(whole, abs=1e-6)


@pytest.mark.parametrize("free", [MASS, PLACED])
def test_the_prior_of_all_numbers_is_that_of_the_coordinates(free):
    found = density(free)
    axes = found.coordinates
    u = axes.start(3)[:5]
    values = axes.values(u)
    # the Jacobian of the coordinates, by differences
    z = unconstrained(found, values)
    kept = [i for i in range(len(axes.names)) if i not in axes.linear]
    log_size = []
    for at in u:
        step = 1e-5 * np.eye(axes.size)
        ends = [unconstrained(found, axes.values(at + s[:, None].T)) for s in step]
        back = [unconstrained(found, axes.values(at - s[:, None].T)) for s in step]
        slopes = (np.concatenate(ends) - np.concatenate(back))[:, kept] / 2e-5
        log_size.append(np.linalg.slogdet(slopes)[1])
    by_values = np.array([float(axes.log_prior_of(np, one)) for one in values])
    off = axes.log_prior(u) - np.array(log_size) - by_values
    assert z.shape == values.shape
    np.testing.assert_allclose(off, off[0], atol=1e-4)


def test_coordinates_lead_back_to_themselves():
    axes = density(PLACED).coordinates
    u = axes.start(2)[:50]
    np.testing.assert_allclose(axes.of_values(axes.values(u)), u, atol=1e-9)


def test_student_errors_that_nobody_shares_are_those_of_their_formula():
    found = density(MASS, scatter=False)
    rows, u = found.rows, np.log([[13.0], [15.0], [16.0]])
    seen = found.seen(u)
    total, field = log_likelihoods(np, rows, seen)
    away = (rows.measured - seen.predicted) / rows.sigma
    exact = (student.logpdf(away, 4) - np.log(rows.sigma)).sum(1)
    # without shared errors the field is no approximation
    np.testing.assert_allclose(total[:, 0], exact, rtol=1e-9)
    kernel = np.zeros(len(u), int)
    gain, _ = exact_gain(rows, field, kernel, total[:, 0], 100, RNG(0))
    np.testing.assert_allclose(gain, 0.0, atol=1e-9)


def test_numpy_and_jax_agree():
    found = density(PLACED)
    assert len(found.rows.kernels) > 1
    u = found.coordinates.start(0)[:40]
    seen = found.seen(u)
    one, _ = log_likelihoods(np, found.rows, seen)
    other, _ = log_likelihoods(jnp, found.rows, jax.tree.map(jnp.asarray, seen))
    best = one > one.max() - 1e4
    np.testing.assert_allclose(one[best], np.asarray(other)[best], rtol=1e-8)


def test_slopes_are_those_of_differences():
    found = density(PLACED)
    # beside the answer, where the change of the errors themselves hardly counts
    at = solve(found)[1].modes.u[0] + np.array([2e-4, -3e-4, 0.02])
    slope = found.scored(at[None]).slope[0]
    step = 1e-5 * np.eye(3)
    ends = found(np.concatenate([at + step, at - step])).reshape(2, 3)
    differences = (ends[0] - ends[1]) / 2e-5
    np.testing.assert_allclose(slope, differences, rtol=0.1, atol=2.0)


def test_the_start_and_the_prior_are_densities():
    axes = density(PLACED).coordinates
    u = axes.start(1)
    assert np.isfinite(axes.log_start(u)).all()
    # the mean of prior over start is 1: both integrate to 1
    share = np.exp(axes.log_prior(u) - axes.log_start(u)).mean()
    assert share == pytest.approx(1.0, abs=0.1)


def test_draws_hold_the_truth_and_know_their_weights():
    found, draws = solve(density(PLACED))
    assert draws.reliable
    assert draws.weights.sum() == pytest.approx(1.0)
    mean = draws.weights @ draws.values
    sd = np.sqrt(draws.weights @ (draws.values - mean) ** 2)
    truth = {"charge_mass_kg": 15.0}
    exact = np.array([truth.get(name, 0.0) for name in found.coordinates.names])
    assert (np.abs(mean - exact) < 2 * sd).all()


def test_weights_of_a_pareto_tail_tell_its_shape():
    # ratios with tail index 1/k
    for k in (0.3, 0.9):
        ratio = RNG(0).pareto(1 / k, 20_000) + 1
        _, found = pareto_smoothed(np.log(ratio))
        assert found == pytest.approx(k, abs=0.15)
