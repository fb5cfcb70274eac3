"""A log whose near gauges clip: the truth by bounds, too little by readings."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import batch_of, fit
from jblast.inference.answer import Answer
from jblast.inference.density import LEFT_OUT_SIGMA, density_of
from jblast.inference.fitting.goodness_of_fit import chi_squared, suspected_outliers
from jblast.scene import Scene, UncertainScene, freed, with_laws
from jblast.sensors import layout_of, record
from jblast.sensors.simulated_readings import Noise
from tests.inference.logs import log

RNG = np.random.default_rng
TRUTH = 15.0
LAWS = {"peak_overpressure_pa": "kingery_bulmash"}
UNCERTAIN = with_laws(freed(UncertainScene(Scene()), ["charge_mass_kg"]), LAWS)
RANGES = (9.0, 10.0, 11.0, 18.0, 30.0, 40.0, 60.0, 80.0)
FULL_SCALE = 20e3
LOG_MASS = np.linspace(np.log(1.0), np.log(400.0), 1200)


def made(peak):
    """A log of one peak at each range, each good to 5 %."""
    rows = zip("abcdefgh", peak, RANGES, strict=True)
    return log(
        *((n, "peak_overpressure_pa", p, 0.05 * p, (r, 0.0, 0.0)) for n, p, r in rows)
    )


def read():
    """What gauges would read of the truth, with errors of 5 %."""
    errors = 0.05 * np.array([1.1, -0.4, 0.3, -1.6, 0.8, 0.2, -0.9, 0.6])
    layout = layout_of(made(np.ones(8)), UNCERTAIN.scene)
    charge = replace(UNCERTAIN.scene.charge, mass_kg=jnp.asarray(TRUTH))
    exact = replace(UNCERTAIN.scene, charges=(charge,))
    return np.asarray(record(exact, layout, LAWS).value) * np.exp(errors)


def clipped():
    """The log with gauges that clip, those rows as bounds."""
    peak = read()
    return replace(
        made(np.minimum(peak, FULL_SCALE)), lower_bound=np.array(peak >= FULL_SCALE)
    )


def interval(table, noise: Noise = "student"):
    """The posterior's 90 % interval of the mass, by quadrature in ln."""
    density = density_of(table, UNCERTAIN, noise)
    height = density(LOG_MASS[:, None])
    # what the bound on the likelihood leaves out, by many draws of the scales
    gain = np.mean([density.exact(LOG_MASS[:, None], RNG(i))[1] for i in range(8)], 0)
    height = height + gain
    mass = np.cumsum(np.exp(height - height.max()))
    return np.exp(np.interp([0.05, 0.95], mass / mass[-1], LOG_MASS))


def answer_of(table):
    return Answer(density_of(table, UNCERTAIN), np.array([TRUTH]), np.ones(1))


@pytest.mark.slow
def test_four_clipped_gauges_leave_the_truth_in_and_as_readings_do_not():
    table = clipped()
    assert table.bounds().sum() == 4
    low, high = interval(table)
    assert low < TRUTH < high
    as_readings = replace(table, lower_bound=None)
    assert interval(as_readings, "gaussian")[1] < TRUTH / 3
    # Student-t errors disbelieve four alike in part; what is left is still too little
    assert interval(as_readings)[1] < 0.75 * high
    # bounds tell something: more than nothing is known without their rows, less than
    # by what was clipped
    sigma = np.where(table.bounds(), LEFT_OUT_SIGMA * table.value, table.sigma)
    deaf = interval(replace(table, sigma=sigma, lower_bound=None))
    whole = interval(made(read()))
    assert whole[1] / whole[0] < high / low < deaf[1] / deaf[0]


def test_bounds_that_are_kept_are_no_residuals_and_no_degrees_of_freedom():
    table = clipped()
    answer = answer_of(table)
    np.testing.assert_array_equal(answer.residual[:4], 0.0)
    assert np.all(answer.residual[4:] != 0)
    chi2, dof = chi_squared(answer, 1)
    assert dof == 3
    assert 0 < chi2 < 10
    # one no gauge could have reached counts, and is suspected
    wild = table.value.copy()
    wild[0] *= 100
    answer = answer_of(replace(table, value=wild, sigma=0.05 * wild))
    assert chi_squared(answer, 1)[1] == 4
    outliers = suspected_outliers(table, answer.residual, "student")
    assert [outlier.sensor for outlier in outliers] == ["a"]


def test_bounds_alone_leave_a_mass_without_an_upper_end():
    alone = replace(clipped(), lower_bound=np.ones(8, bool))
    found = fit(alone, UNCERTAIN, noise="gaussian")
    mass = found.summary.estimates["charge_mass_kg"]
    assert not mass.identified
    assert mass.q05 > 1.0
    assert np.isnan(mass.q95)


def test_many_logs_at_once_refuse_a_bound_by_its_row():
    table = clipped()
    with pytest.raises(ValueError, match=r"row 1: .* lower bound >20000; .* fit_each"):
        batch_of([table], UNCERTAIN)


@pytest.mark.slow
def test_a_fit_of_a_clipped_log_has_the_interval_of_quadrature():
    found = fit(clipped(), UNCERTAIN)
    mass = found.summary.estimates["charge_mass_kg"]
    low, high = interval(clipped())
    # some thousand draws against quadrature
    assert mass.q05 == pytest.approx(low, rel=0.03)
    assert mass.q95 == pytest.approx(high, rel=0.03)
    assert found.exit_code == 0
