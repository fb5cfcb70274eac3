"""Fits past their edges: the bare method fails there, and jblast says so."""

import dataclasses

import numpy as np
import pytest

from jblast.inference import fit
from jblast.inference.fitting.unidentified import AMBIGUITY, other_modes
from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.verification.stability import fits
from jblast.verification.stability.failure import measures_of
from jblast.verification.stability.fits import (
    SOLVERS,
    TOLERANCE,
    line,
    ring,
    solved_log,
)


def test_fits_are_entered_into_the_map():
    assert fits.poor_start_failures in measures_of("fits")
    assert fits.outlier_failure in measures_of("fits")
    assert fits.collinear_failure in measures_of("fits")


@pytest.fixture(scope="module")
def logs():
    return fits.draw()


@pytest.fixture(scope="module")
def best(logs):
    return fits.best_known(logs)


@pytest.mark.slow
@pytest.mark.parametrize("precision", TOLERANCE)
@pytest.mark.parametrize("name", SOLVERS)
def test_stock_solvers_end_off_the_optimum_and_report_success(
    logs, best, name, precision
):
    of = fits.stock_misses(logs, best, name, precision)
    # shares of 400: a standard error of 0.025 at most
    assert of.missed.mean() > {"Gauss-Newton": 0.4, "BFGS": 0.25}.get(name, 0.05)
    assert of.false_successes() > 0
    if name != "Gauss-Newton":  # the flag hardly tells one from the other
        assert of.false_successes() > 0.8 * of.missed.sum()
    # none of those that start near the charge: the start is what is poor
    assert of.nearest > 10


@pytest.mark.slow
def test_the_best_ends_known_are_as_good_as_the_truth(logs, best):
    away = best - logs.truth
    assert np.isfinite(best).all()
    # 0.1 ms tells the mass to about 1 % and the place to about 2 cm
    assert np.abs(away).max() < 1.0
    assert not fits.missed_fits(logs, best, best, np.ones(len(best), bool)).missed.any()


@pytest.mark.slow
def test_fit_many_and_solve_end_at_the_optimum_of_the_same_logs(logs, best):
    own = fits.ours(logs)
    of = fits.missed_fits(logs, best, own.z, own.converged)
    assert not of.missed.any()
    assert own.converged.all()
    assert not own.doubtful.any()
    assert fits.solve_misses(logs, best) == 0


@pytest.mark.slow
def test_fit_many_doubts_the_ends_that_poor_starts_lead_to(logs, best):
    poor = fits.ours(logs, logs.starts)
    of = fits.missed_fits(logs, best, poor.z, ~poor.doubtful)
    assert of.missed.sum() > 10
    assert of.false_successes() == 0
    # an optimum all the same, some of them: converged alone would not have told
    assert (of.missed & np.asarray(poor.converged)).any()
    # and none is doubted that is good
    assert not (~of.missed & np.asarray(poor.doubtful)).any()


@pytest.mark.slow
def test_a_mirror_image_is_reported_as_often_as_the_charge_and_named_by_jblast():
    found = solved_log(line(), *fits.MIRRORED)
    ends = fits.stock_solutions(found.solution, fits.poor_starts())
    south = np.mean(ends[:, 2] < 0)
    assert len(ends) > 200
    # a coin of 200: four standard errors
    assert south == pytest.approx(0.5, abs=0.15)
    answer = fit(found.log, found.uncertain, noise="gaussian")
    (other,) = answer.summary.ambiguities
    north = answer.summary.estimates["charge_north_m"].value
    assert other.parameters["charge_north_m"] == pytest.approx(-north, abs=1e-3)
    assert not answer.summary.identifiable
    assert answer.exit_code == 4


@pytest.mark.slow
def test_the_mirror_image_is_told_apart_past_the_boundary_and_not_before():
    mode = fits.collinear_failure()
    assert mode.unit.startswith("m ")
    for bent, named in ((0.8 * mode.boundary, 1), (1.2 * mode.boundary, 0)):
        found = solved_log(line(bent), *fits.MIRRORED).solution
        assert len(other_modes(found, True)) == named
    # a charge at the height of its sensors: -2 ln density grows as the offset squared
    double = fits.mirror_excess(2 * mode.boundary)
    assert double / AMBIGUITY == pytest.approx(4.0, rel=0.25)


@pytest.mark.slow
def test_sensors_at_one_place_tell_neither_mass_nor_place_whatever_a_solver_says():
    mode = fits.one_place_failure()
    assert mode.boundary == 4  # mass and place are three; a mirror image is left at 3
    one = fits.log_at_positions(1)
    ends = fits.stock_solutions(one.solution, fits.poor_starts())
    assert len(ends) > 300
    assert np.ptp(ends[:, 0]) > np.log(1e6)
    answer = fit(one.log, one.uncertain, noise="gaussian")
    assert len(answer.summary.null_directions) == 2
    assert not any(of.identified for of in answer.summary.estimates.values())
    assert answer.exit_code == 4


@pytest.mark.slow
def test_one_outlier_moves_normal_errors_without_bound_and_student_errors_hardly():
    by = fits.outlier_shifts()
    mode = fits.outlier_failure()
    # least squares follows a reading in proportion, but for what the law bends
    far = np.abs(by.normal[-1]) / np.abs(by.normal[len(by.normal) // 4])
    assert far == pytest.approx(4.0, rel=0.1)
    at = np.interp(mode.boundary, fits.FINE_SIZES, np.abs(by.normal))
    assert at == pytest.approx(NORMAL_Q95, rel=1e-6)
    assert np.abs(by.student).max() < NORMAL_Q95
    assert by.suspected[fits.SIZES >= 10].all()
    assert not by.suspected[fits.SIZES <= 3].any()


@pytest.mark.slow
def test_an_outlier_is_named_in_the_answer():
    clean = solved_log(ring(), 30.0, 10.0, -5.0, "student")
    value = clean.log.value.copy()
    value[fits.OUTLIER_ROW] += fits.REPORTED_SD * 1e-4
    answer = fit(dataclasses.replace(clean.log, value=value), clean.uncertain).summary
    suspects = answer.suspected_outliers
    assert [o.sensor for o in suspects] == [clean.log.sensor[fits.OUTLIER_ROW]]


@pytest.mark.slow
def test_wu_hao_tells_no_mass_while_the_solver_reports_success_at_many():
    mode = fits.null_direction_failure()
    assert mode.boundary > 1000  # starts spread over 1e4; it stays near where it began
    found = fits.wu_hao_solution()
    (null,) = found.identifiability.null
    np.testing.assert_allclose(null, fits.WU_HAO_NULL, atol=1e-6)
    assert not any(found.identifiability.determined)
