"""A log comes back as it was written, whatever wrote it."""

import subprocess
import sys

import numpy as np
import pytest

from jblast.observations import read
from tests.observations.rows import HEADER, ROW


def test_every_column_comes_back_by_name_in_any_order(log):
    observations = read(
        log(
            "# shot 1\n"
            "#measured by hand\n"
            "\n"
            " up_m,quantity, value,north_m,sensor,sigma,east_m,path,shot,clock,time_s\n"
            "1.5,air_arrival_s,0.05,0,a,0.001,20,p,s,c,\n"
            "  \n"
            '1,peak_overpressure_pa, 2e4,-3,"b, outdoors",,4,,s,c,\n'
            "# between\n"
            "0,shock_radius_m,11.1,0,camera,0.1,9,,s,c,1e-4\n"
        )
    )
    assert len(observations) == 3
    assert observations.sensor == ("a", "b, outdoors", "camera")
    assert observations.quantity[1] == "peak_overpressure_pa"
    np.testing.assert_array_equal(observations.value, [0.05, 2e4, 11.1])
    np.testing.assert_array_equal(observations.sigma, [0.001, np.nan, 0.1])
    np.testing.assert_array_equal(
        observations.position, [[20, 0, 1.5], [4, -3, 1], [9, 0, 0]]
    )
    np.testing.assert_array_equal(observations.time, [np.nan, np.nan, 1e-4])
    assert np.isnan(observations.slant_range).all()
    assert observations.path == ("p", "", "")
    assert observations.groups() == ("p", "b, outdoors", "camera")
    assert observations.shot == ("s",) * 3
    assert observations.clock == ("c",) * 3
    assert observations.line == (5, 7, 9)
    assert observations.comments == ("shot 1", "measured by hand", "between")
    assert observations.source.endswith("log.csv")


def test_a_place_may_be_left_to_the_scene_or_be_a_range(log):
    observations = read(log("sensor,quantity,value,sigma\na,air_arrival_s,1,\n"))
    assert np.isnan(observations.position).all()
    assert observations.clock == ("",)
    text = "sensor,quantity,value,sigma,range_m\na,air_arrival_s,1,,20\n"
    assert read(log(text)).slant_range[0] == 20


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: text.rstrip("\n"),
        lambda text: text.replace(",", ", "),
    ],
    ids=["byte order mark", "CRLF", "CR", "no last line end", "spaces"],
)
def test_what_other_programs_write_is_read_alike(log, change):
    observations = read(log(change(HEADER + ROW)))
    assert observations.sensor == ("a",)
    assert observations.value[0] == 0.05
    assert observations.position[0, 2] == 1.5


def test_a_text_is_read_and_worded_without_jax(tmp_path):
    (tmp_path / "log.csv").write_text(
        "sensor;quantity;value;sigma;lat_deg;lon_deg\n"
        "a;peak_overpressure_kpa;5,5;;48,2;11,5\n"
    )
    program = (
        "import sys, jblast.observations as o\n"
        "log = o.read('log.csv')\n"
        "from jblast.report.messages import sentences_of\n"
        "assert sentences_of(log.understood)\n"
        "print({'jax', 'pandas', 'equinox'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "set()\n"
