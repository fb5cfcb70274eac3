import pytest

from jblast.inference.posterior.parameters import Estimate
from jblast.report.estimates import printed_estimate
from jblast.report.numbers import printed_number, rounded, significant, unit_for


@pytest.mark.parametrize(
    ("number", "sd", "text"),
    [
        (209.3, 33.4, "209"),
        (2093.0, 133.0, "2090"),
        (0.41230, 8e-4, "0.41230"),
        (1.0, 0.0996, "1.00"),
        (-1e-9, 0.1, "0.00"),
        (3.14159, 0.99, "3.14"),
        (2.345e9, 1.2e7, "2.345e9"),
    ],
)
def test_two_digits_of_the_sd_decide_how_far_a_number_goes(number, sd, text):
    assert rounded(number, sd) == text


def test_a_number_known_within_a_factor_has_two_significant_digits():
    estimate = Estimate(value=3.0, sd=4.0, log_sd=1.5, q05=0.2543, q95=35.4)
    printed = printed_estimate("charge_mass_kg", estimate)
    assert (printed.value, printed.interval) == ("3.0 kg", "0.25 to 35 kg")


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("charge_mass_kg", 2.1e7, "21 kt"),
        ("charge_mass_kg", 15.0, "15 kg"),
        ("origin_time_s", 0.0123, "12.3 ms"),
        ("clock_offset_s.B", -2.5, "-2.5 s"),
        ("peak_overpressure_pa", 12500.0, "12.5 kPa"),
        ("air_sound_speed_m_s", 340.29, "340.3 m/s"),
        ("charge_energy_j", 8.8e13, "88 TJ"),
        ("charge_east_m", 0.0, "0 m"),
        ("sedov_gamma", 1.4, "1.4"),
        ("air_relative_humidity", 0.5, "0.5"),
        ("charge_range_m", 12345.0, "12.35 km"),
        ("moment_x_n_m", 0.02, "0.02 N m"),
        ("full_scale_rad_s", 34.9, "34.9 rad/s"),
        ("noise_m_s2_sqrt_hz", 0.01, "0.01 m/s²/√Hz"),
        ("force_up_n", 9.81, "9.81 N"),
    ],
)
def test_the_suffix_of_a_name_gives_its_unit(name, value, text):
    assert printed_number(name, value) == text


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("peak_overpressure_pa", 6894.757293168361, "1 psi"),
        ("range_m", 30.48, "100 ft"),
        ("range_m", 0.0254, "1 in"),
        ("charge_mass_kg", 0.45359237, "1 lb"),
        ("positive_impulse_pa_s", 68.94757293168361, "10 psi ms"),
        ("air_temperature_k", 288.15, "288.1 K"),
    ],
)
def test_customary_units_are_exact(name, value, text):
    assert printed_number(name, value, system="us") == text


def test_a_kiloton_is_printed_beside_kilograms_and_an_energy_beside_tnt():
    mass = Estimate(value=2.1e7, sd=2e6, log_sd=0.1, q05=1.8e7, q95=2.5e7)
    assert (
        printed_estimate("charge_mass_kg", mass).value_and_beside
        == "21.0 kt (2.10e7 kg)"
    )
    printed = printed_estimate("charge_energy_j", mass.times(4.184e6))
    assert printed.value_and_beside == "87.9 TJ (21.0 kt of TNT)"


def test_an_unidentified_number_has_no_value_and_no_interval():
    printed = printed_estimate("charge_mass_kg", Estimate())
    assert (printed.value, printed.interval) == ("not identified", "-")


def test_units_are_chosen_by_the_largest_number():
    assert unit_for("_s", 2e-3, -0.5, None).symbol == "ms"
    assert unit_for("_s").symbol == "s"
    assert significant(123456789.0, 3) == "1.23e8"
    assert significant(0.0) == "0"
