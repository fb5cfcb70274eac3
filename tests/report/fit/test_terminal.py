from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

from jblast.inference.fitting.wrong import WrongSensor
from jblast.inference.posterior.parameters import Estimate
from jblast.report import summary
from jblast.report.fit.goodness import goodness_p
from jblast.report.fit.terminal import conclusion
from tests.report import example
from tests.report.made_up import PLAIN


def test_a_null_direction_is_named_with_what_stays_determined_and_the_cure():
    text = " ".join(summary(example.not_identifiable()).split())
    assert "charge mass not identified -" in text
    assert "charge mass times 2.00 and air sound speed times 0.871" in text  # 2^-0.2
    assert (
        "Add: a prior on, or a measurement of, charge_mass_kg or air_sound_speed_m_s; "
        in text
    )
    assert "0.2 ln charge_mass_kg + ln air_sound_speed_m_s = 6.3713 ± 0.0051" in text


def test_a_mixed_null_direction_doubles_what_is_in_ln_and_shifts_the_rest():
    direction = {"charge_mass_kg": 0.5, "charge_east_m": -20.0}
    fit = example.not_identifiable()
    null = replace(fit.summary.null_directions[0], parameters=direction, space="mixed")
    fit = replace(fit, summary=replace(fit.summary, null_directions=(null,)))
    text = " ".join(summary(fit).split())
    # mass doubles over ln 2 / 0.5 of the direction, so east moves 20 * 2 ln 2
    assert "charge mass times 2.00 and charge east by -27.7 m" in text


@pytest.mark.parametrize("make", example.EVERY)
def test_the_terminal_answer_is_at_most_100_columns_wide(make):
    long = {
        "charge_mass_kg": (24800000.0, "Somebody with a long name et al. 1951-2023")
    }
    for line in summary(make(), long).splitlines():
        assert len(line) <= 100
        assert line == line.rstrip()


def test_p_is_the_survival_of_chi_squared():
    for chi2, dof in [(9.1, 9), (41.0, 4), (0.3, 30)]:
        ours = goodness_p(replace(PLAIN, chi2=chi2, dof=dof))
        assert ours == pytest.approx(scipy.stats.chi2.sf(chi2, dof), rel=1e-10)
    assert goodness_p(replace(PLAIN, chi2=1.0, dof=0)) is None
    assert goodness_p(replace(PLAIN, chi2=np.nan, dof=3)) is None


def wide_mass(**other):
    """A fit whose mass has an interval and no value, beside other numbers."""
    fit = example.three_parameters()
    mass = Estimate(q05=0.017, q95=510_000.0)
    estimates = {"charge_mass_kg": mass, **other}
    found = replace(fit.summary, estimates=estimates, free=tuple(estimates))
    return replace(fit, summary=replace(found, derived={}))


def test_a_fit_that_identifies_nothing_it_was_asked_for_ends_with_code_4():
    far = Estimate(q05=-300.0, q95=800.0)
    fit = wide_mass(charge_east_m=far, charge_north_m=far)
    assert fit.exit_code == 4
    assert conclusion(fit)[0] == (
        "The charge mass (0.017 to 510000 kg) and position (charge east -300 to 800 m, "
        "charge north -300 to 800 m) are not identified."
    )
    # an offset of a clock is no answer to where and how much
    assert wide_mass(**{"clock_offset_s.b": Estimate(0.1)}).exit_code == 4
    one = wide_mass(charge_east_m=far, charge_north_m=Estimate(4.0))
    assert one.exit_code == 0
    assert conclusion(one)[0].endswith("are not identified; charge north is.")


def test_weights_that_are_unreliable_are_a_problem():
    good = example.three_parameters()
    assert good.exit_code == 0
    fit = replace(good, summary=replace(good.summary, unchecked=True))
    assert fit.exit_code == 4
    assert summary(fit).index("UNCERTAIN INTERVALS") < summary(fit).index("Estimates")
    # numbers that are wrong come before intervals that are not checked
    wrong = WrongSensor("gate", 3.0, 3, 0.4, 6, good.summary.estimates)
    explained = replace(fit.summary, explained_by=(wrong,))
    problems = summary(replace(fit, summary=explained))
    assert problems.index("WRONG SENSOR OR CLOCK") < problems.index(
        "UNCERTAIN INTERVALS"
    )
