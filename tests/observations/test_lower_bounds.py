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


def test_a_mark_before_a_value_makes_it_a_lower_bound(table):
    marked = table(LOG)
    np.testing.assert_array_equal(marked.bounds(), [True, False, True, False])
    np.testing.assert_array_equal(marked.value, [20000, 20000, 9000, 3000])
    # its sigma is that of a reading of the value
    np.testing.assert_allclose(marked.error_scale(), [0.05, 0.05, np.nan, 0.05])


def test_bounds_are_written_as_they_are_read(table, tmp_path):
    first = table(LOG)
    write(tmp_path / "again.csv", first)
    assert "b,peak_overpressure_pa,>9000.0,," in (tmp_path / "again.csv").read_text()
    second = read(tmp_path / "again.csv")
    np.testing.assert_array_equal(second.bounds(), first.bounds())
    np.testing.assert_array_equal(second.value, first.value)


def test_bounds_stay_with_their_rows_where_logs_are_taken_apart_or_joined(table):
    parts = by_shot(table(LOG))
    np.testing.assert_array_equal(parts["y"].bounds(), [True, False])
    plain = "sensor,quantity,value,sigma,range_m\nd,peak_overpressure_pa,5,1,9\n"
    one = plain.replace(",5,", ",>5,")
    joined, _ = one_event([table(plain, "n.csv"), table(one, "s.csv")])
    np.testing.assert_array_equal(joined.bounds(), [False, True])


@pytest.mark.parametrize(
    ("row", "told"),
    [
        (",peak_overpressure_pa,<5,1,", ["a lower bound as >0.12", "got <5"]),
        (",peak_overpressure_pa,>=5,1,", ["a lower bound as >0.12", "got >=5"]),
        (",peak_overpressure_pa,>>5,1,", ["finite number", ">5"]),
        (",peak_overpressure_pa,>,1,", ["a lower bound as >0.12", "got >"]),
        (",peak_overpressure_pa,>-5,1,", ["positive peak_overpressure_pa", "got -5"]),
        (",peak_overpressure_pa,>inf,1,", ["finite number", "'inf'"]),
        (",peak_overpressure_pa,5,>1,", ["column sigma", "finite number"]),
        (",air_arrival_s,>0.1,1,", ["air_arrival_s takes no lower bound", "got >0.1"]),
        (",arrival_difference_s,>1,1,", ["takes no lower bound"]),
        (",bearing_rad,>0.1,1,", ["bearing_rad takes no lower bound"]),
    ],
)
def test_what_is_no_lower_bound_is_refused_with_its_line(table, row, told):
    with pytest.raises(InputError) as error:
        table(f"{HEADER}a,peak_overpressure_pa,1,1,9,\nb{row}9,\n")
    for part in ("line 3, column", *told):
        assert part in str(error.value)
