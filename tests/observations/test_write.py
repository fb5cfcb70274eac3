"""A log goes to pandas and back as it was."""

from dataclasses import fields, replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from jblast.errors import InputError
from jblast.observations import (
    QUANTITIES,
    TIMES,
    Observations,
    observed,
    read,
    to_pandas,
    write,
)
from jblast.quantities import DIRECTIONS, TIMED
from tests.observations.rows import HEADER, ROW

EXACT = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

FINITE = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(min_value=0, exclude_min=True, allow_infinity=False)
NAMES = st.text(
    st.characters(exclude_categories=("Cc", "Cs")), min_size=1, max_size=8
).filter(lambda name: name == name.strip())
MAYBE_NAMES = st.one_of(st.just(""), NAMES)


@st.composite
def rows(draw):
    """One valid row, in the order of the fields of `Observations`."""
    quantity = draw(st.sampled_from(list(QUANTITIES)))
    value = draw(FINITE if quantity in TIMES else POSITIVE)
    if quantity in DIRECTIONS:
        value = draw(st.floats(-DIRECTIONS[quantity], DIRECTIONS[quantity]))
    sigma = draw(st.one_of(st.just(np.nan), POSITIVE))
    position, slant_range = [np.nan] * 3, np.nan
    place = draw(st.sampled_from(["position", "range", "scene"]))
    if place == "position":
        position = draw(st.lists(FINITE, min_size=3, max_size=3))
    elif place == "range":
        slant_range = draw(POSITIVE)
    time = draw(FINITE) if quantity in TIMED else np.nan
    names = [draw(MAYBE_NAMES) for _ in range(3)]
    return (draw(NAMES), quantity, value, sigma, position, slant_range, time, *names)


def key(row):
    return tuple(map(str, (*row[:4], *(x + 0.0 for x in row[4]), *row[5:])))


def table(rows_, comments=()):
    *columns, position, slant_range, time, path, shot, clock = zip(*rows_, strict=True)
    return observed(
        *columns,
        position=np.array(position, dtype=float),
        slant_range=np.array(slant_range, dtype=float),
        time=np.array(time, dtype=float),
        path=path,
        shot=shot,
        clock=clock,
        comments=tuple(comments),
    )


def assert_equal(a, b):
    for field in fields(Observations):
        if field.name in ("line", "source"):
            continue  # where it stood in its file
        mine, theirs = getattr(a, field.name), getattr(b, field.name)
        if isinstance(mine, np.ndarray):
            np.testing.assert_array_equal(mine, theirs, err_msg=field.name)
        else:
            assert mine == theirs, field.name


@EXACT
@given(st.lists(rows(), min_size=1, max_size=6, unique_by=key), st.lists(MAYBE_NAMES))
def test_what_was_written_is_read_back_to_the_last_digit(tmp_path, rows_, comments):
    observations = table(rows_, comments)
    write(tmp_path / "log.csv", observations)
    assert_equal(read(tmp_path / "log.csv"), observations)


def one(name="a", **changes):
    row = (name, "air_arrival_s", 0.1, np.nan, [1.0, 2.0, 3.0], np.nan, np.nan)
    return replace(table([(*row, "", "", "")]), **changes)


def test_only_columns_that_hold_something_are_written(tmp_path):
    write(tmp_path / "log.csv", one(), comments=["by hand"])
    assert (tmp_path / "log.csv").read_text() == (
        "# by hand\n"
        "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
        "a,air_arrival_s,0.1,,1.0,2.0,3.0\n"
    )


@pytest.mark.parametrize("name", [" a", "a\nb", "a\0"])
def test_a_name_that_would_not_read_back_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match="one line without control characters"):
        write(tmp_path / "log.csv", one(name))
    assert not (tmp_path / "log.csv").exists()


def test_a_table_without_rows_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no rows"):
        write(tmp_path / "log.csv", observed([], [], [], []))


LOG = (
    "# by hand\n"
    + HEADER.replace("\n", ",time_s,clock,record\n")
    + ROW.replace("\n", ",,c,r\n")
    + "b,peak_overpressure_pa,>2e4,0.1,1,2,3,,,\n"
    + "b,peak_overpressure_pa,3e3,,1,2,3,,c,\n"
    + "film,shock_radius_m,11.1,0.1,,,,1e-4,,\n"
)


def test_a_log_comes_back_from_a_data_frame_as_it_was(log):
    ours = read(log(LOG))
    frame = to_pandas(ours)
    assert frame["value"].dtype == float
    back = read(frame)
    assert_equal(back, ours)
    assert back.source == "data frame"


def test_a_log_in_degrees_and_utc_comes_back(log):
    text = (
        "sensor,quantity,value,value_utc,sigma,lat_deg,lon_deg,alt_m\n"
        "a,air_arrival_s,,2020-08-04T15:08:18.310004Z,0.001,33.9,35.5,10\n"
        "b,air_arrival_s,,2020-08-04T15:08:19.5Z,0.001,33.902,35.5,20\n"
        "b,peak_overpressure_pa,900,,9,33.902,35.5,20\n"
    )
    ours = read(log(text))
    back = read(to_pandas(ours))
    np.testing.assert_allclose(back.position, ours.position, atol=1e-6)
    np.testing.assert_allclose(back.value, ours.value, rtol=1e-12, atol=1e-6)
    assert back.epoch == ours.epoch


def test_a_named_index_is_a_column_and_levels_of_columns_are_refused():
    frame = pd.DataFrame(
        {
            "quantity": ["air_arrival_ms"],
            "value": [5.0],
            "sigma": [1.0],
            "range_m": [2],
        },
        index=pd.Index([7], name="sensor"),
    )
    assert read(frame).sensor == ("7",)
    frame.columns = pd.MultiIndex.from_product([["x"], frame.columns])
    with pytest.raises(InputError, match="columns of one level"):
        read(frame)
