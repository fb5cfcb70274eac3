"""Values, errors, places and times in other units are ours afterwards, and told."""

import math

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import read
from tests.cli.cli_files import table

PSI = 6894.757293168361
HEAD = "sensor,quantity,value,sigma,range_m\n"


def of(log, *rows, head=HEAD):
    return read(log(head + "\n".join(rows) + "\n"))


@pytest.mark.parametrize(
    ("quantity", "value", "sigma", "ours", "in_ours", "sigma_in_ours"),
    [
        ("peak_overpressure_psi", 2, 0.1, "peak_overpressure_pa", 2 * PSI, 0.1 * PSI),
        (
            "positive_impulse_psi_ms",
            2,
            1,
            "positive_impulse_pa_s",
            PSI / 500,
            PSI / 1e3,
        ),
        ("positive_duration_ms", 12.5, 0.5, "positive_duration_s", 0.0125, 0.0005),
        ("Air Arrival (ms)", 120, 1, "air_arrival_s", 0.12, 0.001),
        ("bearing_deg", 350, 2, "bearing_rad", math.radians(350), math.radians(2)),
        ("bearing_deg", -10, 2, "bearing_rad", math.radians(-10), math.radians(2)),
    ],
)
def test_a_quantity_may_end_in_another_unit(
    log, quantity, value, sigma, ours, in_ours, sigma_in_ours
):
    found = of(log, f"a,{quantity},{value},{sigma},20")
    assert found.quantity == (ours,)
    np.testing.assert_allclose(found.value, in_ours, rtol=4e-16)
    np.testing.assert_allclose(found.sigma, sigma_in_ours, rtol=4e-16)
    (told,) = found.understood
    assert told.kind == "converted"
    assert (told["theirs"], told["ours"], told["rows"]) == (quantity, ours, 1)


def test_a_column_may_be_in_another_unit_and_its_sigma_with_it(log):
    head = "sensor,quantity,value_kpa,sigma,range_ft\n"
    found = of(log, "a,peak_overpressure_pa,5,0.25,100", head=head)
    np.testing.assert_allclose(found.value, 5000)
    np.testing.assert_allclose(found.sigma, 250)
    np.testing.assert_allclose(found.slant_range, 30.48)
    converted = [told for told in found.understood if told.kind == "converted"]
    assert {told["theirs"] for told in converted} == {"value_kpa", "range_ft"}


@pytest.mark.parametrize("quantity", ["peak_overpressure", "peak_overpressure_kpa"])
def test_a_quantity_beside_a_column_with_a_unit_needs_none_or_the_same(log, quantity):
    head = "sensor,quantity,Value (kPa),sigma,range_m\n"
    found = of(log, f"a,{quantity},5,,100", head=head)
    assert found.quantity == ("peak_overpressure_pa",)
    np.testing.assert_allclose(found.value, 5000)


def test_a_column_may_hold_the_unit_of_each_value(log):
    head = "sensor,quantity,value,unit,sigma,range_m\n"
    rows = (
        "a,peak_overpressure,5,kPa,0.1,1",
        "a,air_arrival,2,ms,,1",
        "b,peak_overpressure_psi,2,psi,,1",
        "b,air_arrival_s,2,,,1",
    )
    found = of(log, *rows, head=head)
    np.testing.assert_allclose(found.value, [5000, 2e-3, 2 * PSI, 2])
    np.testing.assert_allclose(found.sigma[0], 100)
    with pytest.raises(InputError, match=r"line 2.*'peak_overpressure_pa_kPa'"):
        of(log, "a,peak_overpressure_pa,5,kPa,,1", head=head)


BAD = table("""
value_kpa,sigma,range_m / a,peak_overpressure_psi,5,,1 => two units for one column
value_kpa,sigma,range_m / a,air_arrival_s,5,,1 => two units for one column
value,sigma_percent,range_m / a,air_arrival_s,5,1,1 => are not relative
value,sigma_ms,range_m / a,peak_overpressure_pa,5,1,1 => got one in ms
value,sigma,range_m / a,peak_overpressure_mpa,5,1,1 => MPa or mPa
value,sigma,range_m / a,peak_overpressure_psia,5,1,1 => absolute
value,sigma,range_m / a,peak_overpressure_kpb,5,1,1 => did you mean kpa
value,sigma,range_m / a,level_dba,150,1,1 => unknown quantity
value,sigma,range_m / a,bearing_deg,361,1,1 => bearing_deg within 360 deg either way
value,sigma,range_m / a,elevation_deg,91,1,1 => elevation_deg within 90
value,sigma,range_m / a,peak_overpressure_kpa,-5,1,1 => positive peak_overpressure_k
value,value_kpa,sigma,range_m / a,air_arrival_s,1,2,3,4 => got 'value' and 'value_kpa'
value,Value,sigma,range_m / a,air_arrival_s,1,2,3,4 => once, got 'value' and 'Value'
value,sigma,range_m,range_ft / a,air_arrival_s,1,2,3,4 => 'range_m' and 'range_ft'
value,sigma,sigma_percent,range_m / a,air_arrival_s,1,2,3,4 => column sigma once
value,sigma,range_furlong / a,air_arrival_s,1,2,3 => 'furlong' is no unit of length
value_parsec,sigma,range_m / a,air_arrival_s,1,2,3 => 'parsec' is no unit
""")


@pytest.mark.parametrize(("given", "said"), BAD)
def test_what_does_not_go_together_is_refused(log, given, said):
    head, row = given.split(" / ")
    with pytest.raises(InputError, match=said):
        of(log, row, head=f"sensor,quantity,{head}\n")


def test_an_error_may_be_a_share_of_its_value(log):
    head = "sensor,quantity,value,Sigma (%),range_m\n"
    rows = "a,peak_overpressure_kpa,5,8,1", "b,peak_overpressure_pa,9,,1"
    found = of(log, *rows, head=head)
    np.testing.assert_allclose(found.sigma, [400, np.nan])
    found = of(log, "a,peak_overpressure_kpa,5,8%,1", "b,peak_level_db,154,8 %,1")
    np.testing.assert_allclose(found.error_scale(), 0.08)
    assert found.understood[0].kind == "share"
    with pytest.raises(InputError, match="a finite number, got '%'"):
        of(log, "a,peak_overpressure_kpa,5,%,1")


def test_a_peak_level_is_a_pressure_and_its_decibels_a_share(log):
    for name in ("peak level dB(L)", "PSPL dBL", "Peak SPL [dBZ]"):
        assert (
            of(log, f"a,{name},154,1,90").value
            == of(log, "a,peak_level_db,154,1,90").value
        )
    (velocity,) = of(log, "a,PPV (mm/s),5,1,90").value
    assert velocity == pytest.approx(5e-3)
    found = of(log, "a,peak_level_db,154,1,90", "b,Peak level (dB),>160,2,90")
    assert set(found.quantity) == {"peak_overpressure_pa"}
    np.testing.assert_allclose(found.value, [1002.374, 2000.0], rtol=1e-6)
    np.testing.assert_allclose(
        found.error_scale(), np.array([1, 2]) * math.log(10) / 20, rtol=1e-12
    )
    assert found.bounds().tolist() == [False, True]
    assert {told.kind for told in found.understood} == {"level"}


def test_a_date_is_no_number_to_convert_but_its_error_is(log):
    head = "sensor,quantity,value_utc,sigma,range_m\n"
    rows = [f"{t},arrival_ms,2026-03-01T12:00:0{t}.5Z,2,20" for t in (1, 3)]
    found = of(log, *rows, head=head)
    np.testing.assert_allclose(found.value, [0.5, 2.5])
    np.testing.assert_allclose(found.sigma, 0.002)


def test_a_column_of_levels_holds_levels_alone(log):
    head = "sensor,quantity,value_db,sigma,range_m\n"
    for quantity in ("peak_level", "peak_level_db"):
        found = of(log, f"a,{quantity},154,1,1", head=head)
        np.testing.assert_allclose(found.value, 1002.374, rtol=1e-6)
        np.testing.assert_allclose(found.error_scale(), math.log(10) / 20)
    for quantity in ("peak_overpressure_pa", "air_arrival_s"):
        with pytest.raises(InputError, match="two units for one column"):
            of(log, f"a,{quantity},154,1,1", head=head)


def test_a_row_of_units_is_heeded_second_or_last(log):
    head = "sensor,quantity,value,sigma,range\n"
    rows = "a,peak_overpressure,5,1,30", "b,peak_overpressure,4,1,40"
    units = ",,kPa,[kPa],(ft)"
    for body in ((units, *rows), (*rows, units)):
        found = of(log, *body, head=head)
        np.testing.assert_allclose(found.value, [5000, 4000])
        np.testing.assert_allclose(found.sigma, 1000)
        np.testing.assert_allclose(found.slant_range, [9.144, 12.192])
