"""200 g at 2 m: the numbers of the record, and which charge explains them."""

import numpy as np
import pytest

from calibration import gauge_200g
from calibration.gauge_200g import figure, text_200g
from jblast.scene.charge import EXPLOSIVES
from jblast.waves.laws.kinney_graham import kinney_graham_duration
from jblast.waves.waveform import (
    friedlander_impulse,
    modified_friedlander_pressure,
)


def test_the_law_gives_what_the_head_of_the_record_says():
    # 74 and 104 kPa at Z = 3.13: whole kilopascals, of other copies of the table.
    assert gauge_200g.predicted("peak", "free-air") == pytest.approx(74e3, rel=0.02)
    assert gauge_200g.predicted("peak", "surface") == pytest.approx(104e3, rel=0.02)


def test_the_numbers_of_the_record_are_those_printed_in_si():
    read, fitted = gauge_200g.as_read(), gauge_200g.fitted()
    # 75.92 is of 11.0116 psi, which is printed as 11.012
    assert 1e-3 * read.peak == pytest.approx(75.92, abs=0.01)
    assert round(read.impulse, 2) == 38.22
    assert round(1e-3 * fitted.peak, 2) == 78.92
    assert round(fitted.decay, 4) == 1.3801


def test_a_readings_decay_gives_its_impulse_back():
    read = gauge_200g.as_read()
    told = float(friedlander_impulse(read.peak, read.duration, read.decay))
    assert told == pytest.approx(read.impulse, rel=1e-10)


def test_the_pulse_at_the_front_is_the_fitted_one_begun_earlier():
    late, front = gauge_200g.fitted(), gauge_200g.at_front()
    time = np.linspace(0.0, late.duration, 7)
    early = modified_friedlander_pressure(
        time + gauge_200g.rise_time(), front.peak, front.duration, front.decay
    )
    told = modified_friedlander_pressure(time, late.peak, late.duration, late.decay)
    np.testing.assert_allclose(early, told, rtol=1e-10, atol=1e-6)
    assert front.arrival == pytest.approx(gauge_200g.as_read().arrival, abs=1e-12)


@pytest.mark.parametrize("quantity", ["peak", "impulse", "arrival"])
def test_the_factor_makes_the_law_agree(quantity):
    value = getattr(gauge_200g.as_read(), quantity)
    mass = 0.2 * gauge_200g.factor(quantity, "free-air", value)
    told = gauge_200g.predicted(quantity, "free-air", mass)
    assert told == pytest.approx(value, rel=1e-9)


def test_the_slope_at_the_end_is_that_of_friedlander():
    pulse = gauge_200g.fitted()
    slope = pulse.peak / pulse.duration * np.exp(-pulse.decay)
    assert gauge_200g.end_slope() == pytest.approx(slope, rel=1e-10)


def test_an_echo_from_the_lowest_height_comes_so_late():
    height = gauge_200g.lowest_height(0.5)
    assert 2 * np.hypot(1.0, height) - 2.0 == pytest.approx(0.5)


def test_free_air_and_c4_explain_the_peak_and_the_impulse(said):
    read = gauge_200g.as_read()
    name, off = gauge_200g.nearest_explosive("free-air")
    assert name == "C4"
    assert 3 * off < gauge_200g.nearest_explosive("surface")[1]
    told = EXPLOSIVES[name]
    for quantity, factor in (("peak", told.pressure), ("impulse", told.impulse)):
        law = gauge_200g.predicted(quantity, "free-air", 0.2 * factor)
        assert getattr(read, quantity) == pytest.approx(law, rel=0.03)
    assert "In free air 1.33 and 1.23: C4 has 1.37 and 1.19" in said


def test_neither_law_nor_factor_explains_duration_and_arrival(said):
    read, front = gauge_200g.as_read(), gauge_200g.at_front()
    law = gauge_200g.predicted("duration", "free-air", 0.2 * 1.19)
    short = float(kinney_graham_duration(2.0, 0.2 * 1.19))
    assert short < read.duration < front.duration < law
    needed = gauge_200g.factor("arrival", "free-air", read.arrival)
    assert needed > max(told.pressure for told in EXPLOSIVES.values())
    by_peak = gauge_200g.factor("peak", "surface", read.peak)
    late = gauge_200g.predicted("arrival", "surface", 0.2 * by_peak) - read.arrival
    assert late > 1e-4
    assert f"there, at the factor of the peak, it is {1e3 * late:.2f} ms" in said


def test_the_text_follows_the_record(monkeypatch, tmp_path):
    changed = tmp_path / "changed.csv"
    record = gauge_200g.DATA.read_text(encoding="utf-8")
    changed.write_text(
        record.replace("overpressure_raw,11.012", "overpressure_raw,12.5"),
        encoding="utf-8",
    )
    before = text_200g()
    monkeypatch.setattr(gauge_200g, "DATA", changed)
    gauge_200g.table.cache_clear()
    try:
        after = text_200g()
    finally:
        gauge_200g.table.cache_clear()
    assert "75.925" in before
    assert "75.925" not in after
    assert "86.184" in after


def test_the_figure_holds_both_waves_and_the_record():
    axes = figure().axes[0]
    free, surface, record, points = (
        np.asarray(line.get_xydata()) for line in axes.lines
    )
    assert free[0, 1] == pytest.approx(
        1e-3 * gauge_200g.predicted("peak", "free-air"), rel=1e-9
    )
    assert surface[0, 1] > record[0, 1] > free[0, 1]
    assert points[1, 1] == pytest.approx(75.925, abs=1e-3)
    assert free[:, 1].min() < 0
