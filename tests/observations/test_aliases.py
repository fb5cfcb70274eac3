import pytest

from jblast.observations.aliases import our_name
from jblast.observations.table import COLUMNS, QUANTITIES


@pytest.mark.parametrize(
    ("theirs", "ours", "factor"),
    [
        ("impulse_kPa_ms", "positive_impulse_pa_s", 1.0),
        ("overpressure_kPa", "peak_overpressure_pa", 1e3),
        ("Peak Overpressure (psi)", "peak_overpressure_pa", 6894.757),
        ("arrival_ms", "air_arrival_s", 1e-3),
        ("arrival_time_us", "air_arrival_s", 1e-6),
        ("TOA [ms]", "air_arrival_s", 1e-3),
        ("ground_arrival_ms", "ground_arrival_s", 1e-3),
        ("duration_ms", "positive_duration_s", 1e-3),
        ("reflected_pressure_MPa", "reflected_pressure_pa", 1e6),
        ("refl. impulse psi-ms", "reflected_impulse_pa_s", 6.894757),
        ("range_km", "range_m", 1e3),
        ("sigma_ms", "sigma", 1e-3),
        ("distance_ft", "range_m", 0.3048),
        ("radius_cm", "shock_radius_m", 1e-2),
        ("time_\u00b5s", "time_s", 1e-6),
        ("displacement_nm", "ground_displacement_m", 1e-9),
        ("velocity_mm_s", "ground_peak_velocity_m_s", 1e-3),
    ],
)
def test_a_name_of_another_tool_has_one_of_ours_and_a_factor(theirs, ours, factor):
    assert our_name(theirs) == (ours, pytest.approx(factor))
    assert ours in (*QUANTITIES, *COLUMNS)


@pytest.mark.parametrize("name", ["", "m", "kPa", "value_parsec", "weather", "x_y_z"])
def test_a_name_without_a_unit_or_a_word_has_none(name):
    assert our_name(name) is None
