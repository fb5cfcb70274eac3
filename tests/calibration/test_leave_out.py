import numpy as np
import pytest

from calibration.ford_records import QUANTITIES, read_records
from calibration.leave_out import weigh
from calibration.leave_out_table import Judged, inside, resamples
from calibration.mass_posterior import MassEstimate, estimate
from jblast.registry import law_for

LAWS = [law_for(quantity, "ford_2021") for quantity in QUANTITIES]


def log_of(shot):
    records = read_records()
    return records.where(records.shot == shot)


@pytest.mark.parametrize(
    "shot", ["HRI-2", pytest.param("HTP-3", marks=pytest.mark.slow)]
)
def test_a_fit_agrees_with_the_exact_posterior_of_the_mass(shot):
    fitted, valid = weigh(shot, LAWS)
    exact = estimate(log_of(shot), LAWS)
    assert valid
    # What Laplace's method and the expected information may cost.
    assert fitted.mean == pytest.approx(exact.mean, abs=0.1 * exact.sd)
    assert fitted.sd == pytest.approx(exact.sd, rel=0.1)
    assert fitted.q05 == pytest.approx(exact.q05, abs=0.2 * exact.sd)
    assert fitted.q95 == pytest.approx(exact.q95, abs=0.2 * exact.sd)


def test_score_is_the_normal_density_at_the_recorded_mass():
    log = log_of("HRI-2")
    fitted, _ = weigh("HRI-2", LAWS)
    miss = (fitted.mean - np.log(log.charge_mass[0])) / fitted.sd
    expected = -0.5 * miss**2 - np.log(fitted.sd * np.sqrt(2 * np.pi))
    assert fitted.log_density_at_truth == pytest.approx(expected)


def judged(campaign, log_mass=0.0):
    told = MassEstimate(0.0, 1.0, -1.0, 1.0, -0.9)
    return Judged("shot", campaign, 1, 0.0, log_mass, told, True, told, told)


def test_resampled_campaigns_keep_their_shots_together():
    few = [judged("A"), judged("A"), judged("B"), judged("B")]
    rows = resamples(few, by_campaign=True, n=200)
    campaign = np.array(["A", "A", "B", "B"])[rows]
    assert np.all(campaign[:, 0] == campaign[:, 1])
    assert np.all(campaign[:, 2] == campaign[:, 3])
    # Both from one campaign in half of the rows: within 4 standard errors.
    same = np.mean(campaign[:, 0] == campaign[:, 2])
    assert same == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(200))


def test_a_mass_at_the_edge_of_its_interval_is_inside():
    told = judged("A").fitted
    assert inside(judged("A", 1.0), told)
    assert not inside(judged("A", 1.01), told)
