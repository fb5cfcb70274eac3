"""Units: names of other tools, and factors to the last digit."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.table import COLUMNS
from jblast.quantities import QUANTITIES
from jblast.units import (
    LN_PER_DB,
    SI,
    SUFFIXES,
    our_name,
    overpressure,
    si_factor,
    what_to_write,
)

PSI = 4.4482216152605 / 0.0254**2  # a pound's weight on a square inch, both exact
MEANT = [
    ("overpressure_kPa", "peak_overpressure_pa", 1e3),
    ("Peak Overpressure (psi)", "peak_overpressure_pa", PSI),
    ("peak_overpressure_psig", "peak_overpressure_pa", PSI),
    (" PEAK OVERPRESSURE [hPa] ", "peak_overpressure_pa", 1e2),
    ("Peak\u00a0Overpressure\u00a0(kPa)", "peak_overpressure_pa", 1e3),
    ("reflected_pressure_MPa", "reflected_pressure_pa", 1e6),
    ("reflected_pressure_mPa", "reflected_pressure_pa", 1e-3),
    ("positive_impulse_psi_ms", "positive_impulse_pa_s", PSI * 1e-3),
    ("reflected impulse psi-ms", "reflected_impulse_pa_s", PSI * 1e-3),
    ("positive_impulse (kPa\u00b7ms)", "positive_impulse_pa_s", 1.0),
    ("arrival_ms", "air_arrival_s", 1e-3),
    ("TOA [ms]", "air_arrival_s", 1e-3),
    ("positive_duration_ms", "positive_duration_s", 1e-3),
    ("time_\u00b5s", "time_s", 1e-6),
    ("time_\u03bcs", "time_s", 1e-6),
    ("range_ft", "range_m", 0.3048),
    ("east_ft", "east_m", 0.3048),
    ("up_cm", "up_m", 1e-2),
    ("ground_displacement_nm", "ground_displacement_m", 1e-9),
    ("ground_peak_velocity_mm_s", "ground_peak_velocity_m_s", 1e-3),
    ("Peak ground velocity (mm/s)", "ground_peak_velocity_m_s", 1e-3),
    ("bearing_deg", "bearing_rad", 3.141592653589793 / 180),
    ("elevation (\u00b0)", "elevation_rad", 3.141592653589793 / 180),
    ("value_kpa", "value", 1e3),
    ("sigma_ms", "sigma", 1e-3),
    ("sigma (%)", "sigma", 1e-2),
    ("arrival (seconds)", "air_arrival_s", 1.0),
    ("positive_duration_milliseconds", "positive_duration_s", 1e-3),
    ("Range [feet]", "range_m", 0.3048),
    ("east (Metres)", "east_m", 1.0),
    ("bearing (degrees)", "bearing_rad", 3.141592653589793 / 180),
    ("overpressure (Megapascal)", "peak_overpressure_pa", 1e6),
    ("overpressure (Millipascals)", "peak_overpressure_pa", 1e-3),
    ("positive impulse (psi milliseconds)", "positive_impulse_pa_s", PSI * 1e-3),
]


@pytest.mark.parametrize(
    "theirs",
    [
        "Peak SPL [dB re 20 uPa]",
        "peak_level_db_re_20_\u00b5Pa",
        "peak level (decibels)",
    ],
)
def test_a_level_may_say_what_all_of_them_are_counted_from(theirs):
    found = our_name(theirs)
    assert found is not None
    assert (found.name, found.dimension) == ("peak_overpressure_pa", "level")


@pytest.mark.parametrize(("theirs", "ours", "factor"), MEANT)
def test_a_name_of_another_tool_is_one_of_ours_in_a_unit(theirs, ours, factor):
    found = our_name(theirs)
    assert found is not None
    # PSI's own rounding is the only one
    assert (found.name, found.factor) == (ours, pytest.approx(factor, rel=3e-16))
    assert ours in (*QUANTITIES, *COLUMNS)


@pytest.mark.parametrize(
    ("theirs", "said"),
    [
        ("peak_overpressure_mpa", "peak_overpressure_MPa or peak_overpressure_mPa"),
        ("positive_impulse_mpa_ms", "_impulse_MPa_ms or positive_impulse_mPa_ms"),
        ("PEAK_OVERPRESSURE_MPA", "may be MPa or mPa"),
        ("peak_overpressure_kpaa", "absolute"),
        ("peak_overpressure_psia", "absolute"),
        ("peak_overpressure_kpal", "'kpal' is no unit of pressure; did you mean kpa?"),
        ("peak_overpressure", "has no unit: expected peak_overpressure_pa"),
        ("value_parsec", "'parsec' is no unit"),
        ("impulse_kPa_ms", "did you mean positive_impulse_kpa_ms?"),
        ("distance_ft", "did you mean range_ft?"),
        ("radius_cm", "did you mean shock_radius_cm?"),
        ("level_db", "did you mean peak_level_db?"),
        ("peak_level_dba", "weighted or an equivalent level, not a peak"),
        ("Peak level [dB(C)]", "weighted or an equivalent level, not a peak"),
        ("Peak SPL (dB re 1 uPa)", "re another pressure: expected peak_level_db"),
        ("air_arrival_kpa", "'kpa' is no unit of time; expected one of s, "),
        ("range_furlongs", "'furlongs' is no unit of length; expected one of m, "),
        ("velocity_mm_s", "did you mean ground_peak_velocity_mm_s?"),
        ("latitude_deg", "did you mean lat_deg?"),
        (
            "\u00dcberdruck (psi)",
            "one of peak_overpressure_psi, reflected_pressure_psi",
        ),
        ("weather", ""),
        ("kPa", ""),
        ("x_y_z", ""),
        ("", ""),
    ],
)
def test_what_could_mean_two_things_means_none_and_is_told(theirs, said):
    assert our_name(theirs) is None
    assert said in what_to_write(theirs)


def test_every_quantity_and_column_with_a_unit_is_its_own_name():
    for name in QUANTITIES:
        found = our_name(name)
        assert found is not None
        assert (found.name, found.factor) == (name, 1.0)


@pytest.mark.parametrize(
    ("suffix", "factor"),
    [
        ("ft", 0.3048), ("in", 0.0254), ("yd", 0.9144), ("mi", 1609.344),
        ("nmi", 1852.0), ("kPa", 1e3), ("mbar", 1e2), ("bar_ms", 1e2),
        ("atm", 101325.0), ("psi", 6894.757293168361), ("lb", 0.45359237),
        ("torr", 101325.0 / 760), ("km_h", 1e3 / 3600), ("percent", 0.01),
        ("ksi", 6894757.293168361), ("deg", np.pi / 180), ("kn", 1852 / 3600),
    ],
)  # fmt: skip
def test_a_factor_is_the_definition(suffix, factor):
    # NIST SP 811 (2008), appendix B; psi is 0.45359237 * 9.80665 / 0.0254**2
    assert si_factor(suffix) == pytest.approx(factor, rel=2e-16)


@pytest.mark.parametrize("dimension", SI)
def test_every_ending_has_a_factor_and_ours_is_one(dimension):
    factors = {s: si_factor(s) for s in list(SUFFIXES[dimension])[:40]}
    assert factors[SI[dimension]] == 1.0
    assert all(np.isfinite(f) and f > 0 for f in factors.values())


@pytest.mark.parametrize(
    ("suffix", "said"),
    [("mpa", "expected MPa or mPa"), ("kpal", "a known unit"), ("db", "no factor")],
)
def test_what_is_no_unit_is_told(suffix, said):
    with pytest.raises(InputError, match=said):
        si_factor(suffix)


def test_a_peak_level_is_above_twenty_micropascals():
    # IEC 61672-1: 94 dB is 1.0024 Pa, what calibrators give; 0 dB is 20 uPa
    levels = np.array([0.0, 94.0, 120.0, 180.0])
    pascals = [2e-5, 1.00237, 20.0, 20_000.0]
    np.testing.assert_allclose(overpressure(levels), pascals, rtol=1e-5)


def test_an_error_in_decibels_is_one_in_ln_at_any_size():
    level, sigma = np.array([100.0, 150.0]), 6.0  # not small: the law is exact
    up = np.log(overpressure(level + sigma) / overpressure(level))
    down = np.log(overpressure(level) / overpressure(level - sigma))
    np.testing.assert_allclose(up, sigma * LN_PER_DB, rtol=1e-12)
    np.testing.assert_allclose(down, sigma * LN_PER_DB, rtol=1e-12)
