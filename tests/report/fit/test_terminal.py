from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

from jblast.inference.fitting.findings import ExchangedSensors, NoScene, WrongClock
from jblast.inference.importance import IntervalsOff
from jblast.inference.posterior.parameters import Estimate
from jblast.report import summary
from jblast.report.fit.document import fit_document
from jblast.report.fit.findings import goodness_p, goodness_sentence
from jblast.report.fit.terminal import conclusion, limits
from tests.report import example
from tests.report.made_up import PLAIN


def test_each_estimate_is_printed_with_its_interval_and_its_unit():
    text = summary(example.three_parameters())
    rows = {line[2:].split("  ")[0]: line for line in text.splitlines() if line}
    assert "209 kg" in rows["charge mass"]
    assert "161 to 272 kg" in rows["charge mass"]
    assert "412.30 ms" in rows["origin time"]
    assert "337.0 to 343.7 m/s" in rows["air sound speed"]
    assert "870 MJ" in rows["energy"]
    assert "All fitted parameters are identified." in text
    assert "within their errors (p = 0.43)" in text
    assert "chi2 = 9.1" not in text


def test_details_are_printed_if_requested():
    text = summary(example.three_parameters(), verbose=True)
    assert "kingery_bulmash: Z = 2.1 to 38 m/kg^(1/3) inside" in text
    assert "chi2 = 9.1 on 9 degrees of freedom, p = 0.43" in text


@pytest.mark.parametrize("make", example.EVERY)
def test_the_answer_fits_one_screen_of_40_lines(make):
    assert len(summary(make()).splitlines()) <= 40


def test_an_accepted_value_stands_beside_and_says_whether_it_is_inside():
    accepted = {
        "charge_mass_kg": (200, "weighed"),
        "charge_energy_j": (9e13, "a rumour"),
        "charge_up_m": (1.5, "a tape"),
    }
    text = summary(example.three_parameters(), accepted)
    assert "200 kg, weighed: inside" in text
    assert "90 TJ, a rumour: outside" in text
    assert "The accepted charge up (a tape) was not fitted." in text


def test_where_the_figures_went_is_said():
    assert "Report and figures: out/x" in summary(example.one_parameter(), out="out/x")


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


def test_a_wide_mass_is_practically_unidentified_and_keeps_its_interval():
    text = summary(example.one_parameter())
    assert "charge mass: practically unidentified (sd of ln 0.62)" in text
    assert "360 to 2800 kg" in text
    assert "reaches a factor of 2.8" in " ".join(conclusion(example.one_parameter()))


def test_a_poor_fit_and_a_law_left_behind_are_said():
    text = " ".join(summary(example.one_parameter()).split())
    assert "The fit is poor (p < 0.001)" in text
    assert "outside the range of a law it uses (positive impulse)" in text
    assert "`jblast scene quarry.csv` writes a scene" in text
    assert "`jblast check quarry.csv` searches for wrong units" in text


def test_outliers_and_ambiguities_are_named():
    text = " ".join(summary(example.with_outliers()).split())
    assert f"{example.NASTY}, peak overpressure: +14.9 sd" in text
    assert "charge mass 340 kg and origin time 410.1 ms" in text
    assert "Add: an air arrival at a new position off the sensors' line." in text


def test_a_fit_that_did_not_converge_says_so_first():
    assert "NOT CONVERGED" in summary(example.no_draws())
    assert conclusion(example.no_draws())[0].startswith("NOT CONVERGED")
    assert "nan" not in summary(example.no_draws()).lower()


@pytest.mark.parametrize("make", example.EVERY)
def test_the_terminal_answer_is_at_most_100_columns_wide(make):
    long = {
        "charge_mass_kg": (24800000.0, "Somebody with a long name et al. 1951-2023")
    }
    for line in summary(make(), long).splitlines():
        assert len(line) <= 100
        assert line == line.rstrip()


def test_the_conclusion_begins_with_how_big_the_charge_was():
    accepted = {"charge_energy_j": (9.0e13, "by radiochemistry")}
    first, *rest = conclusion(example.shock_radius(), accepted)
    assert first == "The charge was 21.0 kt of TNT (90 %: 17.3 to 25.6 kt)."
    assert any(
        "88 TJ, as much as 21.0 kt of TNT" in sentence
        and "(by radiochemistry) lies inside" in sentence
        for sentence in rest
    )
    assert "emcee" in " ".join(limits(example.shock_radius()))


def test_a_tnt_mass_equal_to_the_mass_is_not_said_twice():
    said = " ".join(conclusion(example.three_parameters()))
    assert said.count("209 kg") == 1


def test_what_was_taken_as_known_is_listed():
    (known, *_) = limits(example.three_parameters())
    assert known.startswith("Fixed: charge east 0 m")
    assert "origin time" not in known


def test_p_is_the_survival_of_chi_squared():
    for chi2, dof in [(9.1, 9), (41.0, 4), (0.3, 30)]:
        ours = goodness_p(replace(PLAIN, chi2=chi2, dof=dof))
        assert ours == pytest.approx(scipy.stats.chi2.sf(chi2, dof), rel=1e-10)
    assert goodness_p(replace(PLAIN, chi2=1.0, dof=0)) is None
    assert goodness_p(replace(PLAIN, chi2=np.nan, dof=3)) is None


def test_what_is_not_identified_is_the_first_thing_concluded():
    first, second, third, *_ = conclusion(example.not_identifiable())
    assert first == "The charge mass is not identified; time is."
    assert "Add: a prior on, or a measurement of, charge_mass_kg" in second
    assert third.startswith("It exploded at 100 µs")


@pytest.mark.parametrize(
    ("chi2", "words"),
    [
        (28.0, "The fit is poor (p < 0.001)"),  # p 0.00095
        (22.5, "The fit is marginal (p = 0.0074)"),
        (9.1, "agree with the law within their errors (p = 0.43)"),
        (0.5, "lie closer to the law than their errors allow (p > 0.999)"),
    ],
)
def test_goodness_is_told_in_words(chi2, words):
    assert words in goodness_sentence(replace(PLAIN, chi2=chi2, dof=9))


def wide_mass(**other):
    """A fit whose mass has an interval and no value, beside other numbers."""
    fit = example.three_parameters()
    mass = Estimate(q05=0.017, q95=510_000.0)
    estimates = {"charge_mass_kg": mass, **other}
    found = replace(fit.summary, estimates=estimates, free=tuple(estimates))
    return replace(fit, summary=replace(found, derived={}))


def test_a_mass_that_is_not_identified_is_the_headline_with_its_interval():
    place = {"charge_east_m": Estimate(3.0), "charge_north_m": Estimate(4.0)}
    fit = wide_mass(**place, origin_time_s=Estimate(2.0))
    said = (
        "The charge mass is not identified (0.017 to 510000 kg); position and time are."
    )
    assert said in " ".join(summary(fit).split())
    assert conclusion(fit)[0] == said
    assert not any("The charge was" in line for line in conclusion(fit))
    assert fit.exit_code == 0
    entry = fit_document(fit)["estimates"]["charge_mass_kg"]
    assert (entry["value"], entry["sd"], entry["log_sd"]) == (None, None, None)
    assert (entry["q05"], entry["q95"], entry["identified"]) == (0.017, 5.1e5, False)
    assert fit_document(fit)["estimates"]["charge_east_m"]["identified"]


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


def test_two_exchanged_sensors_are_named_with_what_to_do():
    fit = example.three_parameters()
    mass = {"charge_mass_kg": fit.summary.estimates["charge_mass_kg"]}
    swap = ExchangedSensors("b", 2.5, 3, 0.47, 4, mass, "e")
    clock = WrongClock("c", 2.5, 3, 0.47, 4, mass, -0.8, 0.01, "clock_offset_s.c")
    fit = replace(fit, summary=replace(fit.summary, explained_by=(swap, clock)))
    text = " ".join(summary(fit).split())
    assert (
        "the order of b and e or c is wrong; the log does not determine which." in text
    )
    assert (
        "With the positions of b and e exchanged all recordings fit (p = 0.47)." in text
    )
    assert "exchange their positions in the log." in text
    assert fit.exit_code == 4


def test_intervals_that_importance_sampling_cannot_check_are_a_problem():
    good = example.three_parameters()
    assert good.exit_code == 0
    off = IntervalsOff("charge_mass_kg", np.nan, 1.2)
    fit = replace(good, summary=replace(good.summary, warnings=(off,)))
    assert fit.exit_code == 4
    assert summary(fit).index("UNCERTAIN INTERVALS") < summary(fit).index("Estimates")
    only_off = IntervalsOff("charge_mass_kg", 0.5, np.nan)
    fit = replace(good, summary=replace(good.summary, warnings=(only_off,)))
    assert fit.exit_code == 0


def test_an_assumed_origin_is_stated_first_where_sensors_have_positions():
    fit = example.three_parameters()
    assumed = "No scene was given: a surface charge of TNT at the origin at time 0"
    for warning, first in ((NoScene(), True), (NoScene(("charge_east_m",)), False)):
        made = replace(fit, summary=replace(fit.summary, warnings=(warning,)))
        beginning = " ".join(summary(made).partition("Estimates")[0].split())
        assert (assumed in beginning) == first
        assert conclusion(made)[0].startswith(assumed) == first
