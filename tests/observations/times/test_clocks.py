import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import read, resolve_positions
from jblast.scene import Clock, Scene, Sensor

HEADER = "sensor,quantity,value,sigma,east_m,north_m,up_m,clock\n"
TWO = HEADER + "a,air_arrival_s,1,.1,20,0,0,x\nb,air_arrival_s,2,.1,30,0,0,y\n"


@pytest.fixture
def two(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(TWO)
    return read(path)


def test_recorders_may_run_free_but_for_the_first(two):
    assert (
        len(resolve_positions(two, Scene(clocks=(Clock("y"),)), {"clock_offset_s.y"}))
        == 2
    )
    with pytest.raises(InputError, match=r"'x' is the first clock.*clock_offset_s.y"):
        resolve_positions(two, Scene(clocks=(Clock("x"),)), {"clock_offset_s.x"})


def test_a_clock_the_log_does_not_have_is_named(two):
    with pytest.raises(InputError, match=r"no such clock.*expected one of x, y"):
        resolve_positions(two, Scene(clocks=(Clock("z"),)), {"clock_offset_s.z"})


def test_a_sensor_on_a_recorder_has_no_clock_of_its_own(two):
    own = Sensor("b", np.array([30.0, 0.0, 0.0]), clock_offset_s=0.5)
    with pytest.raises(InputError, match=r"line 3, column clock: got 'y'.*'b'"):
        resolve_positions(two, Scene(sensors=(own,)))


def test_a_fixed_offset_moves_the_earliest_possible_arrival(two):
    what = r"line 3.*after the origin time, 5 s.*origin_time_s or clock_offset_s\.y\)"
    with pytest.raises(InputError, match=what):
        resolve_positions(two, Scene(clocks=(Clock("y", 5.0),)))
