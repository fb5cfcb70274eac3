"""Fits of real shots against the exact posterior of the mass, by quadrature."""

import pytest

from calibration.ford_2021 import QUANTITIES, records
from calibration.leave_out import EMCEE, FIT, estimate, weigh
from jblast.registry import law_for

LAWS = [law_for(quantity, "ford_2021") for quantity in QUANTITIES]


def log_of(shot):
    return records().where(records().shot == shot)


def agree(told, exact, mean, sd, ends):
    assert told.mean == pytest.approx(exact.mean, abs=mean * exact.sd)
    assert told.sd == pytest.approx(exact.sd, rel=sd)
    assert told.q05 == pytest.approx(exact.q05, abs=ends * exact.sd)
    assert told.q95 == pytest.approx(exact.q95, abs=ends * exact.sd)


@pytest.mark.slow  # a walk
# the second is buried deeper than the range of the law
@pytest.mark.parametrize(("shot", "valid"), [("HRI-2", True), ("HTP-7", False)])
def test_a_fit_agrees_with_the_exact_posterior_of_the_mass(shot, valid):
    (told, marked), exact = weigh(shot, LAWS), estimate(log_of(shot), LAWS)
    assert marked == valid
    # Some thousand effective draws know the mean to 0.04 sd and the sd to 3 %, ends to
    # 0.08 sd; walkers stop when their ends have a standard error of 0.05 sd. Three of
    # each.
    agree(told[FIT], exact, mean=0.12, sd=0.1, ends=0.25)
    agree(told[EMCEE], exact, mean=0.12, sd=0.1, ends=0.25)
