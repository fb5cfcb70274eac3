"""All that is wrong with a log can be gathered; what is sound is read all the same."""

import pytest

from jblast.errors import InputError
from jblast.observations import read
from tests.observations.rows import HEADER, ROW

BAD = (
    HEADER
    + ROW
    + "b,air_arival_s,fast,-1,1,2,3\n"
    + "c,air_arrival_s,1,,1,,3\n"
    + ROW
    + "d,air_arrival_s,2,0.1,5,6,7\n"
)


def test_every_fault_is_gathered_line_by_line(log):
    faults: list[InputError] = []
    observations = read(log(BAD), faults=faults)
    said = [str(fault).partition("log.csv: ")[2] for fault in faults]
    assert [text.partition(":")[0] for text in said] == [
        "line 3, column quantity",
        "line 3, column value",
        "line 3, column sigma",
        "line 4, column north_m",
        "line 5",
    ]
    assert observations.sensor == ("a", "d")
    assert observations.line == (2, 6)


def test_the_first_is_raised_where_nobody_gathers_them(log):
    with pytest.raises(InputError, match="line 3, column quantity"):
        read(log(BAD))


def test_a_file_in_which_nothing_can_be_read_is_a_log_without_rows(tmp_path):
    faults: list[InputError] = []
    assert len(read(tmp_path / "none.csv", faults=faults)) == 0
    assert "no such file" in str(faults[0])


def test_the_record_of_a_row_comes_back(log):
    header = HEADER.replace("\n", ",record\n")
    read_back = read(log(header + ROW.replace("\n", ",gate.wav\n")))
    assert read_back.records() == ("gate.wav",)
    assert read(log(HEADER + ROW)).record == ()
