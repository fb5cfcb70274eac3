"""The bound of a planned layout: against a textbook and a fit, and what is refused."""

import dataclasses

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import bound, fit
from jblast.inference.design.planned_log import values_at
from jblast.scene import Free, LogUniform
from jblast.waves import kingery_bulmash_pressure
from tests.inference.design.plans import (
    MASS,
    PLACE,
    PLAN,
    PRESSURE,
    RING,
    TRUE,
    C,
    scene_of,
)

FOUR = scene_of(MASS, {name: (30.0, 0.0) for name in "abcd"}, PRESSURE)
FIFTEEN = {"charge_mass_kg": 15.0}


def textbook():
    """Give sd(ln W) of four pressures by exact laws, and how ln p falls in ln R."""
    step = 1e-4
    up, down = (
        kingery_bulmash_pressure(30.0 * np.exp(s * step), 15.0) for s in (1, -1)
    )
    slope = abs(float(np.log(up / down))) / (2 * step)
    # ln p falls as s ln R: sd(ln W) = 3 sigma / (|s| sqrt n)
    return 3 * 0.05 / (slope * 2), slope


def test_normal_errors_give_the_textbook_standard_deviation():
    found = bound(FOUR, FIFTEEN, noise="gaussian")
    assert found.exit_code == 0
    expected, slope = textbook()
    # finite differences of the slope are good to 1e-6
    spread = found.summary.parameters["charge_mass_kg"]
    assert spread.log_sd == pytest.approx(expected, rel=1e-4)
    (low, high) = found.summary.mass_exponents["peak_overpressure_pa"]
    assert low == high == pytest.approx(slope / 3, rel=1e-4)


@pytest.mark.slow
def test_the_bound_is_what_a_fit_of_the_errorless_log_says(planned):
    scene = dataclasses.replace(PLAN.scene, law=tuple(planned.summary.law.items()))
    free = dataclasses.replace(PLAN, scene=scene)
    estimates = fit(planned.log, free).summary.estimates
    assert planned.summary.identifiable
    assert planned.exit_code == 0
    assert planned.summary.at == TRUE | {"air_sound_speed_m_s": C}
    for name, spread in planned.summary.parameters.items():
        # the bound is that of a normal: a mass in kilograms is skewed
        assert estimates[name].sd == pytest.approx(spread.sd, rel=0.12)
        assert np.isnan(spread.log_sd) == name.endswith(("east_m", "north_m"))


@pytest.mark.slow
def test_a_value_away_from_the_priors_middle_keeps_the_priors_width():
    # a prior that pulled the answer would make a second solution of the first
    wide = {"charge_mass_kg": LogUniform(1.0, 100.0)}
    places = {"a": (30.0, 0.0)}
    weak = (("peak_overpressure_pa", 3.0),)
    found = bound(scene_of(wide, places, weak), {"charge_mass_kg": 50.0})
    assert found.summary.ambiguities == ()
    assert found.summary.at == {"charge_mass_kg": 50.0}
    middle = bound(scene_of(wide, places, weak))
    assert middle.summary.at["charge_mass_kg"] == pytest.approx(10.0)
    # uniform in ln over a factor of 100: sd ln 100 / sqrt 12; a datum that tells
    # little takes a little of it
    uniform = np.log(100.0) / np.sqrt(12.0)
    sd = middle.summary.parameters["charge_mass_kg"].log_sd
    assert 0.9 * uniform < sd < uniform


@pytest.mark.parametrize(
    ("at", "beliefs", "places", "words"),
    [
        ({}, MASS, RING, "at charge_mass_kg=VALUE"),
        ({"charge_mas_kg": 1.0}, MASS, RING, "did you mean charge_mass_kg"),
        ({"charge_up_m": 1.0}, MASS, RING, "charge_up_m is fixed"),
        ({"charge_mass_kg": -1.0}, MASS, RING, "positive"),
        ({"charge_mass_kg": np.inf}, MASS, RING, "finite"),
        ({"charge_east_m": 1e200, "charge_north_m": 0.0}, PLACE, RING, "reading"),
        (
            {"charge_mass_kg": 500.0},
            {"charge_mass_kg": LogUniform(1.0, 100.0)},
            RING,
            "within its prior",
        ),
        ({}, {}, RING, "nothing to bound"),
        ({"charge_mass_kg": 1.0}, MASS, {}, "no sensor records"),
        ({"charge_mass_kg": 1.0}, MASS, {"a": (0.0, 0.0)}, "where the charge is"),
        (
            {"charge_east_m": 60.0, "charge_north_m": 0.0},
            PLACE,
            RING,
            "where the charge is",
        ),
    ],
)
def test_what_cannot_be_bounded_is_refused(at, beliefs, places, words):
    with pytest.raises(ValueError, match=words):
        bound(scene_of(beliefs, places), at)


def test_what_only_shifts_clocks_needs_no_value():
    shifts = {n: Free(positive=False) for n in ("origin_time_s", "clock_offset_s.b")}
    scene = scene_of(MASS | shifts, RING)
    values = values_at(scene, {"charge_mass_kg": 10.0, "clock_offset_s.b": 0.5})
    assert values["origin_time_s"] == 0.0
    assert values["clock_offset_s.b"] == 0.5
    with pytest.raises(InputError, match="at charge_mass_kg=VALUE; the information"):
        values_at(scene, {})
