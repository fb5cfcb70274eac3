"""A log goes to pandas and back as it was."""

import numpy as np
import pandas as pd
import pytest

from jblast.errors import InputError
from jblast.observations import read, to_pandas
from tests.observations.rows import HEADER, ROW
from tests.observations.test_write import assert_equal

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
