import numpy as np
import pytest

from calibration.ford_2021 import QUANTITIES, read_records
from calibration.leave_out import (
    Judged,
    MassEstimate,
    compare,
    estimate,
    inside,
    log_and_scene,
    log_integral,
    resamples,
    show,
    weigh,
)
from jblast.inference import fit
from jblast.registry import law_for

LAWS = [law_for(quantity, "ford_2021") for quantity in QUANTITIES]


def log_of(shot):
    records = read_records()
    return records.where(records.shot == shot)


@pytest.fixture(scope="module")
def hri_2():
    return weigh("HRI-2", LAWS), estimate(log_of("HRI-2"), LAWS)


def agree(told, exact, mean, sd, ends):
    assert told.mean == pytest.approx(exact.mean, abs=mean * exact.sd)
    assert told.sd == pytest.approx(exact.sd, rel=sd)
    assert told.q05 == pytest.approx(exact.q05, abs=ends * exact.sd)
    assert told.q95 == pytest.approx(exact.q95, abs=ends * exact.sd)


@pytest.mark.slow  # a walk
def test_a_fit_agrees_with_the_exact_posterior_of_the_mass(hri_2):
    fitted, exact = hri_2
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


@pytest.mark.slow  # of the same walk
def test_score_is_the_normal_density_at_the_recorded_mass(hri_2):
    log, fitted = log_of("HRI-2"), hri_2[0].laplace
    miss = (fitted.mean - np.log(log.charge_mass[0])) / fitted.sd
    expected = -0.5 * miss**2 - np.log(fitted.sd * np.sqrt(2 * np.pi))
    assert fitted.log_density_at_truth == pytest.approx(expected)


@pytest.mark.slow  # of the same walk
def test_score_of_emcee_is_the_exact_density_at_the_recorded_mass(hri_2):
    fitted, exact = hri_2
    # apart from what Laplace's method costs in the integral over shared effects
    assert fitted.emcee.log_density_at_truth == pytest.approx(
        exact.log_density_at_truth, abs=0.02
    )


def test_density_of_a_normal_walked_is_normalised():
    z = np.random.default_rng(0).standard_normal((8, 500, 1))
    log_density = -0.5 * z[:, :, 0] ** 2 - 1000.0  # whose exp alone would vanish
    # 4000 draws leave about 1/4000 beyond either end
    expected = 0.5 * np.log(2 * np.pi) - 1000.0
    assert log_integral(z, log_density) == pytest.approx(expected, abs=2e-3)


@pytest.mark.slow
def test_emcee_is_judged_by_what_the_fit_answers(hri_2):
    answer = fit(*log_and_scene("HRI-2", LAWS), posterior="emcee").summary
    mass, told = answer.estimates["charge_mass_kg"], hri_2[0].emcee
    for key, judged_by in (("q05", told.q05), ("q95", told.q95)):
        assert np.log(getattr(mass, key)) == pytest.approx(judged_by, rel=1e-12)
    assert mass.log_sd == pytest.approx(told.sd, rel=1e-12)


def judged(campaign, log_mass=0.0):
    told = MassEstimate(0.0, 1.0, -1.0, 1.0, -0.9)
    return Judged("shot", campaign, 1, 0.0, log_mass, told, told, True, told, told)


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
    told = judged("A").laplace
    assert inside(judged("A", 1.0), told)
    assert not inside(judged("A", 1.01), told)


def test_the_largest_distance_from_the_quadrature_keeps_its_sign(capsys):
    one = judged("A")
    far = one._replace(laplace=MassEstimate(-0.2, 1.0, -1.5, 1.25, -0.4))
    compare([one, far, one])
    laplace, emcee = capsys.readouterr().out.splitlines()[1:]
    assert laplace.split() == [
        "Laplace",
        "-0.200",
        "+0.000",
        "-0.500",
        "+0.250",
        "+0.500",
    ]
    assert emcee.split() == ["emcee", *["+0.000"] * 5]


def test_a_shot_outside_by_one_method_alone_is_told_so(capsys):
    short = MassEstimate(0.0, 1.0, -1.0, 0.4, -0.9)
    show([judged("A", 0.5)._replace(emcee=short)])
    laplace, emcee = capsys.readouterr().out.splitlines()[-1].split("|")
    assert " in " in laplace
    assert " OUT " in emcee
