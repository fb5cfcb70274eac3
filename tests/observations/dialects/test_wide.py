"""A column for each quantity is told how to become long, or is read so."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import read

WIDE = (
    "sensor,east_m,north_m,up_m,air_arrival_s,peak_overpressure_kpa,"
    "sigma_peak_overpressure_kpa\n"
    "a,1,2,3,0.1,>5,0.5\n"
    "b,4,5,6,,6,\n"
)


def test_a_row_is_made_for_each_measurement(log):
    found = read(log(WIDE), wide=True)
    assert found.sensor == ("a", "a", "b")
    assert found.line == (2, 2, 3)
    assert found.quantity[1:] == ("peak_overpressure_pa",) * 2
    np.testing.assert_array_equal(found.value, [0.1, 5000, 6000])
    np.testing.assert_array_equal(found.sigma, [np.nan, 500, np.nan])
    np.testing.assert_array_equal(found.position[:, 0], [1, 1, 4])
    assert found.bounds().tolist() == [False, True, False]


def test_units_may_stand_in_a_row_and_errors_behind_the_name(log):
    text = (
        "sensor;range;air_arrival;Air arrival sigma;shock_radius;time\n"
        ";ft;ms;ms;m;s\n"
        "a;10;12,5;0,5;7,25;0,001\n"
    )
    found = read(log(text), wide=True)
    np.testing.assert_allclose(found.value, [0.0125, 7.25])
    np.testing.assert_allclose(found.sigma, [0.0005, np.nan])
    np.testing.assert_array_equal(found.time, [np.nan, 0.001])


@pytest.mark.parametrize(
    ("text", "wide", "said"),
    [
        (WIDE, False, "'air_arrival_s' is a quantity, not a column: a wide table"),
        ("sensor,air_arrival\n,ms\na,1\n", False, "a wide table, with 1 of them"),
        (WIDE.replace("air_arrival_s", "value"), True, "got a column value"),
        ("sensor,range_m\na,1\n", True, "a column for each quantity; got"),
        (
            "sensor,peak_overpressure_kpa,peak_overpressure_psi\na,1,2\n",
            True,
            "two units for one column",
        ),
        (
            WIDE.replace("sigma_peak_overpressure_kpa", "sigma_peak_overpressure_psi"),
            True,
            "expected sigma_ and the name of a quantity's column",
        ),
        (
            WIDE.replace("sigma_peak_overpressure_kpa", "sigma_percent"),
            True,
            "expected sigma_ and the name of a quantity's column",
        ),
    ],
)
def test_what_is_neither_long_nor_wide_is_refused(log, text, wide, said):
    with pytest.raises(InputError, match=said):
        read(log(text), wide=wide)
