"""Values written as lower bounds: read, written, grouped, refused."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import read, write
from jblast.observations.grouping import by_shot, one_event

HEADER = "sensor,quantity,value,sigma,range_m,shot\n"
LOG = (
    HEADER
    + "a,peak_overpressure_pa,>20000,1000,10,x\n"
    + "a,peak_overpressure_pa,20000,1000,10,x\n"
    + "b,peak_overpressure_pa, > 9e3 ,,30,y\n"
    + "c,peak_overpressure_pa,3000,150,60,y\n"
)


@pytest.fixture
def log(tmp_path):
    def reading(text, name="log.csv"):
        (tmp_path / name).write_text(text)
        return read(tmp_path / name)

    return reading


def test_a_mark_before_a_value_makes_it_a_lower_bound(log):
    table = log(LOG)
    np.testing.assert_array_equal(table.bounds(), [True, False, True, False])
    np.testing.assert_array_equal(table.value, [20000, 20000, 9000, 3000])
    # its sigma is that of a reading of the value
    np.testing.assert_allclose(table.error_scale(), [0.05, 0.05, np.nan, 0.05])


def test_a_log_of_readings_has_no_column_of_bounds(log):
    table = log(LOG.replace(">", "", 1).replace("> ", "").replace("10,x", "9,x", 1))
    assert table.lower_bound is None
    assert not table.bounds().any()


def test_bounds_are_written_as_they_are_read(log, tmp_path):
    first = log(LOG)
    write(tmp_path / "again.csv", first)
    assert "b,peak_overpressure_pa,>9000.0,," in (tmp_path / "again.csv").read_text()
    second = read(tmp_path / "again.csv")
    np.testing.assert_array_equal(second.bounds(), first.bounds())
    np.testing.assert_array_equal(second.value, first.value)


def test_bounds_stay_with_their_rows_where_logs_are_taken_apart_or_joined(log):
    parts = by_shot(log(LOG))
    np.testing.assert_array_equal(parts["y"].bounds(), [True, False])
    plain = "sensor,quantity,value,sigma,range_m\nd,peak_overpressure_pa,5,1,9\n"
    one = plain.replace(",5,", ",>5,")
    joined, _ = one_event([log(plain, "n.csv"), log(one, "s.csv")])
    np.testing.assert_array_equal(joined.bounds(), [False, True])


@pytest.mark.parametrize(
    ("row", "told"),
    [
        (",peak_overpressure_pa,<5,1,", ["a lower bound as >0.12", "got <5"]),
        (",peak_overpressure_pa,>=5,1,", ["a lower bound as >0.12", "got >=5"]),
        (",peak_overpressure_pa,>>5,1,", ["finite number", ">5"]),
        (",peak_overpressure_pa,>,1,", ["finite number", "got nothing"]),
        (",peak_overpressure_pa,>-5,1,", ["positive peak_overpressure_pa", "got -5"]),
        (",peak_overpressure_pa,>inf,1,", ["finite number", "'inf'"]),
        (",peak_overpressure_pa,5,>1,", ["column sigma", "finite number"]),
        (",air_arrival_s,>0.1,1,", ["air_arrival_s takes no lower bound", "got >0.1"]),
        (",arrival_difference_s,>1,1,", ["takes no lower bound"]),
        (",bearing_rad,>0.1,1,", ["bearing_rad takes no lower bound"]),
    ],
)
def test_what_is_no_lower_bound_is_refused_with_its_line(log, row, told):
    with pytest.raises(InputError) as error:
        log(f"{HEADER}a,peak_overpressure_pa,1,1,9,\nb{row}9,\n")
    for part in ("line 3, column", *told):
        assert part in str(error.value)
