"""Times that the numbers of a clock do not resolve are refused."""

import dataclasses

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import observed, resolve_positions
from jblast.observations.clocks import (
    refuse_unresolved,
    refuse_unsolvable_clocks,
    untied_flashes,
)
from jblast.scene import Clock, Scene, Sensor, UncertainScene, freed

HEADER = "sensor,quantity,value,sigma,east_m,north_m,up_m,clock\n"
TWO = HEADER + "a,air_arrival_s,1,.1,20,0,0,x\nb,air_arrival_s,2,.1,30,0,0,y\n"


@pytest.fixture
def two(table):
    return table(TWO)


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


ARRIVAL = "{0},air_arrival_s,1.0,.1,{1},0,0,{2}"
FLASH = "{0},flash_time_s,0.5,.1,{1},0,0,{2}"


@pytest.fixture
def log(table):
    return lambda *rows: table(HEADER + "".join(row + "\n" for row in rows))


def test_a_flash_on_a_clock_that_reads_nothing_else_is_tied_to_no_other(log):
    both = (FLASH.format("a", 20, "x"), ARRIVAL.format("a", 20, "x"))
    alone = FLASH.format("c", 40, "z")
    made = log(*both, ARRIVAL.format("b", 30, "y"), alone)
    assert untied_flashes(made, {}).tolist() == [False, False, False, True]
    assert not untied_flashes(made, {"z"}).any()  # its offset is known or fitted
    # wherever it stands; but not where the others are set by it
    first = log(alone, *both)
    assert untied_flashes(first, {}).tolist() == [True, False, False]
    assert not untied_flashes(first, {"x"}).any()
    # nor on the common clock, nor where there is nothing else
    assert not untied_flashes(log(*both, FLASH.format("c", 40, "")), {}).any()
    flashes = log(alone, FLASH.format("d", 50, "w"))
    assert not untied_flashes(flashes, {}).any()


def test_more_unknown_clocks_than_clock_times_are_refused_with_the_remedy(log):
    names = "abcde"
    rows = [ARRIVAL.format(name, 20 + 10 * i, name) for i, name in enumerate(names)]
    clocks = [f"clock_offset_s.{name}" for name in names[1:]]
    place = ["charge_east_m", "charge_north_m"]
    heard = log(*rows)

    def scene(*free):
        return freed(UncertainScene(Scene()), [*free, *clocks])

    refuse_unsolvable_clocks(heard, scene(*place))  # one too few, which a fit names
    message = (
        r"5 clock times and 0 other readings cannot determine 5 unknown clocks "
        r"\(clock_offset_s.b, .*, origin_time_s\) and 2 other unknowns; expected .*"
        r"common clock .* a flash_time_s beside the arrival"
    )
    with pytest.raises(InputError, match=message):
        refuse_unsolvable_clocks(heard, scene(*place, "origin_time_s"))
    # pressures may still tell where and how much; a flash on each clock sets it
    peaks = [
        f"{name},peak_overpressure_pa,1000,100,{20 + 10 * i},0,0,{name}"
        for i, name in enumerate(names)
    ]
    asked = scene(*place, "origin_time_s", "charge_mass_kg")
    refuse_unsolvable_clocks(log(*rows, *peaks), asked)
    flashes = [FLASH.format(name, 20 + 10 * i, name) for i, name in enumerate(names)]
    refuse_unsolvable_clocks(log(*rows, *flashes), asked)
    # fewer clock times than unknown clocks: whatever else was read
    few = log(rows[0], *rows[2:], *peaks)
    with pytest.raises(InputError, match="4 clock times and 5 other readings cannot"):
        refuse_unsolvable_clocks(
            few,
            freed(
                UncertainScene(Scene()),
                ["origin_time_s", *clocks[1:], "clock_offset_s.a"],
            ),
        )


def arrival_at(time: float, sigma: float):
    place = np.array([[30.0, 0.0, 0.0]])
    return observed(["a"], ["air_arrival_s"], [time], [sigma], position=place)


@pytest.mark.parametrize(
    ("time", "dtype", "refused"),
    [
        (60.0, np.float32, False),
        (3600.0, np.float32, False),
        # single precision steps over a millisecond from here on
        (16384.0, np.float32, True),
        (1.7e9, np.float32, True),
        (1.7e9, np.float64, False),
    ],
)
def test_a_time_too_coarse_for_its_sigma_is_refused(time, dtype, refused):
    log = arrival_at(time, 1e-3)
    if refused:
        with pytest.raises(InputError, match="expected times counted from near the"):
            refuse_unresolved(log, dtype)
    else:
        refuse_unresolved(log, dtype)


def test_rows_without_sigma_and_rows_of_no_clock_are_accepted():
    refuse_unresolved(arrival_at(1.7e9, np.nan), np.float32)
    pressure = dataclasses.replace(
        arrival_at(1.7e9, 1e-3), quantity=("peak_overpressure_pa",)
    )
    refuse_unresolved(pressure, np.float32)
