import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.grouping import by_shot, one_event

HEADER = "sensor,quantity,value,sigma,range_m"
SHOTS = f"""# kept
{HEADER},shot
a,air_arrival_s,1,.1,300,x
a,air_arrival_s,2,.1,600,y
b,air_arrival_s,3,.1,900,x
"""


def test_each_shot_is_a_log_of_its_own_rows_with_their_lines(table):
    parts = by_shot(table(SHOTS))
    assert list(parts) == ["x", "y"]
    assert parts["x"].sensor == ("a", "b")
    np.testing.assert_array_equal(parts["x"].value, [1, 3])
    assert parts["x"].line == (3, 5)
    assert parts["y"].where(0).endswith("line 4")
    assert parts["y"].comments == ("kept",)


def test_recordings_of_one_event_keep_their_rows_and_get_clocks(table):
    row = "\n{},air_arrival_s,{},.1,300\n"
    logs = [
        table(HEADER + row.format("a", 1), "north.csv"),
        table(HEADER + row.format("b", 2), "south.csv"),
    ]
    together, free = one_event(logs)
    assert together.sensor == ("a", "b")
    assert together.clock == ("north", "south")
    assert free == ("south",)
    np.testing.assert_array_equal(together.value, [1, 2])
    assert together.source.endswith("south.csv")


def test_what_makes_no_event_is_refused(table, tmp_path):
    plain = table(f"{HEADER}\na,air_arrival_s,1,.1,300\n")
    with pytest.raises(InputError, match="'log' twice"):
        one_event([plain, plain])
    clocked = table(f"{HEADER},clock\na,air_arrival_s,1,.1,300,c\n", "c.csv")
    with pytest.raises(InputError, match="expected no such column"):
        one_event([plain, clocked])
    with pytest.raises(InputError, match="got 'x', 'y'"):
        one_event([table(SHOTS, "s.csv")])


def test_recordings_of_one_event_count_from_one_place_and_moment(table):
    head = "sensor,quantity,value_utc,sigma,lat_deg,lon_deg\n"
    row = "{},air_arrival_s,2020-08-04T15:08:{},0.1,{},35.5\n"
    logs = [
        table(head + row.format("a", "20.25Z", 33.9), "north.csv"),
        table(head + row.format("b", "18.5Z", 33.902), "south.csv"),
    ]
    together, _ = one_event(logs)
    assert together.frame == logs[0].frame
    assert together.epoch == logs[1].epoch
    np.testing.assert_array_equal(together.value, [2.25, 0.5])
    # two thousandths of a degree of latitude, 110.92 km each
    np.testing.assert_allclose(together.position[1] - together.position[0],
                               [0, 221.84, 0], atol=0.01)  # fmt: skip
    metres = table(f"{HEADER}\na,air_arrival_s,1,.1,300\n", "east.csv")
    with pytest.raises(InputError, match=r"east.csv: expected value_utc as in .*north"):
        one_event([*logs, metres])
