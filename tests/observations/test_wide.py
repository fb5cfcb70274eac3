"""A column for each quantity is told how to become long, or is read so."""

import numpy as np

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


def test_units_may_stand_in_a_row(log):
    text = (
        "sensor;range;air_arrival;Sigma air arrival;shock_radius;time\n"
        ";ft;ms;ms;m;s\n"
        "a;10;12,5;0,5;7,25;0,001\n"
    )
    found = read(log(text), wide=True)
    np.testing.assert_allclose(found.value, [0.0125, 7.25])
    np.testing.assert_allclose(found.sigma, [0.0005, np.nan])
    np.testing.assert_array_equal(found.time, [np.nan, 0.001])


def test_one_column_of_shares_is_that_of_all_errors_that_are_shares(log):
    text = (
        "sensor;range_m;air_arrival_ms;peak_overpressure_kpa;Sigma (%);Note\n"
        "a;10;12,4;>12,4;7;1.5\n"
        "b;20;40,5;5;NA;\n"
    )
    found = read(log(text), wide=True)
    assert found.value[0] == 0.0124
    np.testing.assert_array_equal(found.sigma, [np.nan, 868, np.nan, np.nan])
    notes = {note.kind: note.numbers for note in found.understood}
    assert notes["share"]["rows"] == 1
    assert notes["no_errors"] == {"names": ["air_arrival_ms"]}
