"""Fits of real shots against the exact posterior of the mass, by quadrature."""

import pytest

from calibration.ford_2021 import QUANTITIES, read_records
from calibration.leave_out import estimate, weigh
from jblast.registry import law_for

LAWS = [law_for(quantity, "ford_2021") for quantity in QUANTITIES]


def log_of(shot):
    records = read_records()
    return records.where(records.shot == shot)


def agree(told, exact, mean, sd, ends):
    assert told.mean == pytest.approx(exact.mean, abs=mean * exact.sd)
    assert told.sd == pytest.approx(exact.sd, rel=sd)
    assert told.q05 == pytest.approx(exact.q05, abs=ends * exact.sd)
    assert told.q95 == pytest.approx(exact.q95, abs=ends * exact.sd)


@pytest.mark.slow  # a walk
def test_a_fit_agrees_with_the_exact_posterior_of_the_mass():
    fitted, exact = weigh("HRI-2", LAWS), estimate(log_of("HRI-2"), LAWS)
    assert fitted.valid
    # What Laplace's method and the expected information may cost.
    agree(fitted.laplace, exact, mean=0.1, sd=0.1, ends=0.2)
    # Walkers stop when their ends have a standard error of 0.05 sd; 4000 effective
    # draws know the mean to 0.016 sd and the sd to 1.1 %. Four of each.
    agree(fitted.emcee, exact, mean=0.06, sd=0.04, ends=0.2)


@pytest.mark.slow
def test_where_the_scatter_grows_emcee_is_nearer_to_the_exact_posterior():
    fitted, exact = weigh("HTP-7", LAWS), estimate(log_of("HTP-7"), LAWS)
    agree(fitted.emcee, exact, mean=0.06, sd=0.04, ends=0.2)
    away = abs(fitted.laplace.mean - exact.mean)
    assert away > 2 * abs(fitted.emcee.mean - exact.mean)
