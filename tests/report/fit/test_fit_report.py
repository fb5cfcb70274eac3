"""A fit in print: JSON, terminal, page, files and figures."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
import scipy.stats
from matplotlib.figure import Figure

import jblast
from jblast.errors import InputError
from jblast.inference.fitting.wrong import WrongSensor
from jblast.inference.posterior.parameters import Estimate
from jblast.observations import observed
from jblast.report import figures, fit_figures, summary, write_report
from jblast.report.fit_report import (
    answers_csv,
    fit_document,
    fits_report,
    goodness_p,
)
from jblast.report.view import terminal
from tests.report import example
from tests.report.made_up import PLAIN

NOTHING = dict.fromkeys(("value", "sd", "log_sd", "q05", "q50", "q95")) | {
    "identified": False
}


def printed(fit, **more) -> str:
    """Return the text of a fit in one line."""
    return " ".join(summary(fit, **more).split())


def test_what_is_not_identified_is_null_and_other_keys_have_their_values():
    document = fit_document(example.not_identifiable())
    assert list(document)[:5] == ["schema", "law", "law_reason", "law_valid",
                                  "law_valid_rows"]  # fmt: skip
    assert list(document)[-4:] == ["place", "origin_time_utc", "origin_clock",
                                   "charges_on_earth"]  # fmt: skip
    assert document["estimates"].pop("origin_time_s")["log_sd"] is None
    assert document["estimates"] == dict.fromkeys(
        ("charge_mass_kg", "air_sound_speed_m_s"), NOTHING
    )
    assert document["law_reason"] == {"air_arrival_s": "requested"}
    (null,) = document["null_directions"]
    assert null == {
        "parameters": {"charge_mass_kg": 1.0, "air_sound_speed_m_s": -0.2},
        "space": "ln",
        "cure": "a prior on, or a measurement of, charge_mass_kg or "
        "air_sound_speed_m_s; or a peak overpressure at a new range",
    }
    (determined,) = document["determined"]
    assert determined == {
        "combination": "0.2 ln charge_mass_kg + ln air_sound_speed_m_s",
        "value": 6.37128,
        "sd": 0.0051,
    }
    assert document["charges_on_earth"] == [
        {"charge": "", "place": None, "origin_time_utc": None}
    ]


def test_a_null_direction_is_named_with_what_is_identified_and_the_remedy():
    fit = example.not_identifiable()
    text = printed(fit)
    assert "Charge mass not identified -" in text
    assert "charge mass times 2.00 and air sound speed times 0.871" in text  # 2^-0.2
    assert "Add: a prior on, or a measurement of, charge_mass_kg or air_sound" in text
    assert (
        "Identified combinations 0.2 ln charge_mass_kg + ln air_sound_speed_m_s = "
        "6.3713 ± 0.0051" in text
    )
    # mass doubles over ln 2 / 0.5 of the direction, so east moves 20 * 2 ln 2
    mixed = {"charge_mass_kg": 0.5, "charge_east_m": -20.0}
    null = replace(fit.summary.null_directions[0], parameters=mixed, space="mixed")
    fit = replace(fit, summary=replace(fit.summary, null_directions=(null,)))
    assert "charge mass times 2.00 and charge east by -27.7 m" in printed(fit)


@pytest.mark.parametrize("make", example.EVERY)
def test_text_and_exit_code_agree_and_lines_are_short(make):
    fit = make()
    long = {"charge_mass_kg": (24800000.0, "Somebody with a long name et al. 1951")}
    text = summary(fit, long, verbose=True)
    # a row of a table is as long as the names of the log
    lines = text.partition("Recordings and residuals")[0].splitlines()
    assert max(map(len, lines)) <= 100
    starts = [line for line in text.splitlines() if re.match("[A-Z]{3,} [A-Z]", line)]
    assert bool(starts) <= (fit.exit_code == 4)
    assert "Laws" in text
    assert "Laws" not in summary(fit).splitlines()


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


def test_a_fit_that_identifies_nothing_it_was_asked_for_has_code_4():
    far = Estimate(q05=-300.0, q95=800.0)
    fit = wide_mass(charge_east_m=far, charge_north_m=far)
    assert fit.exit_code == 4
    assert "NOT IDENTIFIED: the recordings leave charge mass" in printed(fit)
    assert "Charge mass not identified 0.017 to 510000 kg" in printed(fit)
    # an offset of a clock is no answer to where and how much
    assert wide_mass(**{"clock_offset_s.b": Estimate(0.1)}).exit_code == 4
    one = wide_mass(charge_east_m=far, charge_north_m=Estimate(4.0))
    assert one.exit_code == 0


def test_weights_that_are_unreliable_are_a_problem_after_wrong_numbers():
    good = example.three_parameters()
    fit = replace(good, summary=replace(good.summary, unchecked=True))
    assert (good.exit_code, fit.exit_code) == (0, 4)
    text = summary(fit)
    assert text.index("UNCERTAIN INTERVALS") < text.index("Estimates")
    wrong = WrongSensor("gate", 3.0, 3, 0.4, 6, good.summary.estimates)
    text = printed(replace(fit, summary=replace(fit.summary, explained_by=(wrong,))))
    assert text.index("WRONG SENSOR OR CLOCK") < text.index("UNCERTAIN INTERVALS")
    assert "Without the sensor gate the others fit (p = 0.4): charge mass" in text
    assert "to leave it out, put a # before its rows." in text


def test_positions_of_a_map_are_printed_in_full():
    far = Estimate(685812.34, 3.0, q05=685807.0, q95=685817.0)
    fit = wide_mass(charge_east_m=far)
    assert "Charge east 685812.3 m 685807.0 to 685817.0 m" in printed(fit)
    accepted = {"charge_east_m": (685812.0, "survey")}
    assert "685812 m, survey: inside" in printed(fit, accepted=accepted)


class Tags(HTMLParser):
    """Collects every tag, and checks that they close in order."""

    EMPTY = ("meta", "img", "br")

    def __init__(self, page):
        super().__init__()
        self.open, self.seen = [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Every example's report; one is drawn, the figures of the others are empty."""
    root = tmp_path_factory.mktemp("reports")
    for make in example.EVERY:
        with pytest.MonkeyPatch.context() as patch:
            if make is not example.with_outliers:
                patch.setattr(figures.Figure, "savefig", Figure((1, 1)).savefig)
            write_report(make(), root / make.__name__)
    return root


@pytest.mark.parametrize("make", example.EVERY)
def test_the_report_has_the_answer_and_a_page_that_needs_nothing_else(pages, make):
    folder = pages / make.__name__
    document = json.loads((folder / "fit.json").read_text("utf-8"))
    assert document.pop("provenance")["scene"] is None
    # an example without draws has NaN, which is no JSON
    assert document == fit_document(make())
    page = (folder / "report.html").read_text("utf-8")
    # what pictures are packed to may spell anything
    words = re.sub(r"data:image/png;base64,[\w+/=]+", "", page)
    assert "http" not in words
    assert "/home/somebody" not in page
    assert "Recordings and residuals" in page
    tags = Tags(page)
    assert tags.open == []
    assert not {"script", "link", "iframe"} & {tag for tag, _ in tags.seen}
    images = [attributes for tag, attributes in tags.seen if tag == "img"]
    assert len(images) == len(list(folder.glob("*.png"))) >= 2
    for attributes in images:
        assert attributes["src"].startswith("data:image/")
        assert len(attributes["alt"]) > 20


def test_names_of_a_log_are_escaped_and_outliers_marked(pages):
    page = (pages / "with_outliers" / "report.html").read_text("utf-8")
    assert "<script" not in page
    assert page.count("&lt;script&gt;alert(&#39;$x&#39;)&lt;/script&gt;") >= 2
    assert '<tr class="marked">' in page


def test_radii_at_a_time_have_no_range(pages):
    page = (pages / "shock_radius" / "report.html").read_text("utf-8")
    assert ">Range</th>" not in page


def test_a_report_is_refused_where_one_is_and_force_replaces_it(tmp_path):
    # the log of picks may be what is fitted
    kept = ("notes.txt", "picks/picks.csv")
    # they would show another fit
    removed = ("corner.png", "fits.json", "answers.csv", "records_2.png")
    (tmp_path / "picks").mkdir()
    for name in ("fit.json", *kept, *removed):
        (tmp_path / name).write_text("old")
    with pytest.raises(InputError, match=r"fit\.json: exists already") as caught:
        write_report(example.no_draws(), tmp_path)
    assert "--force" not in str(caught.value)
    assert (tmp_path / "fit.json").read_text() == "old"
    write_report(example.no_draws(), tmp_path, force=True)
    assert all((tmp_path / name).read_text() == "old" for name in kept)
    assert not any((tmp_path / name).exists() for name in removed)
    assert json.loads((tmp_path / "fit.json").read_text())["converged"] is False
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_report(example.no_draws(), tmp_path / "file", force=True)


def test_a_figure_that_fails_costs_only_itself(tmp_path, monkeypatch):
    def fails(fit):
        raise RuntimeError("no ink")

    monkeypatch.setattr(fit_figures, "residuals_figure", fails)
    with pytest.warns(UserWarning, match=r"residuals.png was not drawn.*no ink"):
        paths = write_report(example.no_draws(), tmp_path)
    left = {"fit.json", "map.png", "recordings.png", "report.html"}
    assert {path.name for path in paths} == left


@pytest.mark.parametrize("make", example.EVERY)
def test_every_artist_of_a_figure_is_finite(make):
    fit = make()
    drawn = [fit_figures.recordings_figure(fit), fit_figures.residuals_figure(fit)]
    if fit.draws:
        drawn.append(fit_figures.corner_figure(fit, {"charge_mass_kg": (200.0, "x")}))
    for figure in drawn:
        for axes in figure.axes:
            assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()
            for line in axes.lines:
                assert np.isfinite(np.asarray(line.get_xydata(), float)).all()


def test_contours_contain_their_shares_of_normal_draws():
    rng = np.random.default_rng(0)
    fit = example.three_parameters()
    names = fit.summary.free[:2]
    draws = dict(zip(names, rng.normal(size=(2, 40_000)) + 200.0, strict=True))
    found = replace(fit.summary, free=names)
    figure = fit_figures.corner_figure(replace(fit, draws=draws, summary=found))
    (outer,) = [a for a in figure.axes if len(a.collections) == 2]
    lines = outer.collections[1].get_paths()
    for path, share in zip(lines, (0.9, 0.5), strict=True):
        x, y = draws.values()
        inside = path.contains_points(np.stack([x, 1e3 * y], axis=1))  # kg and ms
        assert inside.mean() == pytest.approx(share, abs=0.03)


def test_several_logs_have_a_row_each_and_the_worst_exit_code():
    bad = InputError("bad.csv: line 2: expected a number")
    fits = {"a": example.three_parameters(), "b": example.one_parameter()}
    answer = fits_report(fits | {"bad": bad})
    text = terminal(answer.view)
    assert answer.exit_code == 4
    assert text.startswith("2 of 3 logs fitted")
    assert text.index("\na ") < text.index("\nb ") < text.index("Not fitted\n  bad: ")
    assert "poor fit" in text
    assert fits_report({"a": fits["a"]}).exit_code == 0
    assert fits_report(fits).exit_code == fits["b"].exit_code
    rows = answers_csv(fits | {"bad": bad}).splitlines()
    assert len(rows) == 1 + 3 + 1 + 1
    assert rows[-1].endswith("expected a number")
    with pytest.raises(InputError, match=r"none of 1 logs.*: bad\.csv: line 2"):
        fits_report({"bad": bad})


def test_answers_are_passed_on_as_they_are_computed():
    log = observed(["a"], ["peak_overpressure_pa"], [9000.0], [450.0])
    seen = []
    # without a position there is nothing to fit: each log has its error
    jblast.fit_each({"x": log, "y": log}, done=lambda found: seen.append(list(found)))
    assert seen == [["x"], ["x", "y"]]
