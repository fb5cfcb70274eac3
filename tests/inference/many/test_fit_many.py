"""Many logs at once: each lane ends where the fit of that log ends."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import fit_many
from jblast.inference.answer import Answer, constrained
from jblast.inference.density import density_of
from jblast.scene import LogNormal, with_laws
from tests.inference.logs import log
from tests.inference.many.five_sensors import LAWS, TRUTH, problem


def as_log(layout, names, values, sigma):
    timed = [q.endswith("arrival_s") for q in layout.quantity]
    return log(
        *(
            (name, quantity, value, s if t else s * value, tuple(place))
            for name, quantity, value, s, t, place in zip(
                names,
                layout.quantity,
                values,
                sigma,
                timed,
                np.asarray(layout.position),
                strict=True,
            )
        )
    )


def density_for(uncertain, layout, names, values, sigma, noise):
    named = with_laws(uncertain, LAWS)
    return density_of(as_log(layout, names, values, sigma), named, noise)


def newton_step(density, z):
    """How far Newton would step on the density that `fit` samples, and its curvature.

    Without the weak prior, and at the expected information.
    """
    values = constrained(density, np.asarray(z)[None])[0]
    answer = Answer(density, values, np.zeros(len(values)))
    known = answer.information + np.diag(answer.has_prior)
    slope = np.asarray(jax.jit(jax.grad(density.log_density))(jnp.asarray(z)))
    prior = jax.grad(lambda z: of_prior(density, z))(jnp.asarray(z))
    return np.linalg.solve(known, slope - np.asarray(prior)), known


def of_prior(density, z):
    """The prior of free numbers."""
    axes = density.coordinates
    values = [b.constrain(x) for b, x in zip(axes.beliefs, z, strict=True)]
    priors = [b.log_density(x) for b, x in zip(axes.beliefs, z, strict=True)]
    return axes.log_prior_of(jnp, jnp.stack(values)) - sum(priors)


@pytest.mark.slow
def test_each_lane_has_the_optimum_and_the_covariance_that_fit_finds():
    uncertain, layout, values, sigma, names = problem(16)
    found = fit_many(uncertain, layout, values, sigma, LAWS, noise="gaussian")
    assert found.converged.all()
    density = density_for(uncertain, layout, names, values[5], sigma, "gaussian")
    step, known = newton_step(density, found.z[5])
    # slopes by differences of 1e-3 of a step
    assert (np.abs(step) < 1e-4 * found.sd()[5]).all()
    product = known @ np.asarray(found.covariance[5])
    np.testing.assert_allclose(product, np.eye(4), atol=1e-3)


@pytest.mark.slow
def test_student_errors_end_where_their_density_is_level():
    uncertain, layout, values, sigma, names = problem(16)
    values[5, 2] += 30e-4  # a wild reading
    found = fit_many(uncertain, layout, values, sigma, LAWS, noise="student")
    assert found.converged.all()
    density = density_for(uncertain, layout, names, values[5], sigma, "student")
    step, known = newton_step(density, found.z[5])
    assert (np.abs(step) < 1e-4 * found.sd()[5]).all()
    product = known @ np.asarray(found.covariance[5])
    np.testing.assert_allclose(product, np.eye(4), atol=1e-3)
    truth = [math.log(30.0), 10.0, -5.0, 1.5]
    # normal errors beside the wild one: within 5 standard deviations
    assert (np.abs(found.z[5] - np.array(truth)) < 5 * found.sd()[5]).all()


@pytest.mark.slow
def test_with_scatter_and_a_prior_the_joint_optimum_is_near_that_of_fit():
    uncertain, layout, values, sigma, names = problem(1, scatter=True)
    prior = LogNormal(jnp.asarray(33.0), jnp.asarray(1.05))
    beliefs = dict(uncertain.beliefs) | {"charge_mass_kg": prior}
    uncertain = dataclasses.replace(uncertain, beliefs=beliefs)
    found = fit_many(uncertain, layout, values, sigma, LAWS, noise="gaussian")
    assert found.converged.all()
    density = density_for(uncertain, layout, names, values[0], sigma, "gaussian")
    step, known = newton_step(density, found.z[0])
    # effects at their mode, not integrated out
    assert (np.abs(step) < 0.1 * found.sd()[0]).all()
    expected = np.sqrt(np.diag(np.linalg.inv(known)))
    np.testing.assert_allclose(found.sd()[0], expected, rtol=0.02)


def test_answers_lie_about_the_truth_as_far_as_they_say():
    uncertain, layout, values, sigma, _ = problem(16)
    found = fit_many(uncertain, layout, values, sigma, LAWS, noise="gaussian")
    assert found.converged.all()
    truth = np.array([np.log(TRUTH["charge_mass_kg"]), *list(TRUTH.values())[1:]])
    off = (np.asarray(found.z) - truth) / np.asarray(found.sd())
    # the mean square of 64 unit normals, each log's four nearly independent: sd 0.18
    assert np.mean(off**2) == pytest.approx(1.0, abs=0.6)
    # 12 readings and 4 unknowns: minus ln of the density is half of chi-squared, of 8
    # degrees of freedom; the mean of 16 has an sd of 0.5
    assert np.mean(found.cost) == pytest.approx(4.0, abs=1.5)


@pytest.mark.slow
def test_logs_without_a_closed_form_start_from_the_nearest_of_a_reference_set():
    records = (("air_arrival_s", 1e-4), ("peak_overpressure_pa", 0.02))
    laws = dict.fromkeys(dict(records), "kingery_bulmash")
    uncertain, layout, values, sigma, _ = problem(
        16, records=records, laws=tuple(laws.items())
    )
    found = fit_many(uncertain, layout, values, sigma, laws, noise="gaussian")
    assert found.converged.all()
    away = (found.values["charge_east_m"] - 10.0) / found.sd()[:, 1]
    # normal errors: none of 16 is 5 standard deviations away
    assert (jnp.abs(away) < 5).all()
