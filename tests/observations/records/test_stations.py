"""Tables of where recorders stood."""

import pytest

from jblast.errors import InputError
from jblast.observations.records.stations import read_stations

TABLE = """# a campaign
sensor,note,east_m,north_m,up_m,clock
gate,tripod,1.5,-2,0.5,phone
"mast.1",top,0,0,10,
"""


def table(tmp_path, text):
    path = tmp_path / "stations.csv"
    path.write_text(text)
    return path


def test_places_and_clocks_are_read(tmp_path):
    stations = read_stations(table(tmp_path, TABLE))
    assert list(stations) == ["gate", "mast.1"]
    assert stations["gate"] == ((1.5, -2.0, 0.5), "phone")
    assert stations["mast.1"].clock == ""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "got 0 lines"),
        (TABLE.replace("1.5", "inf"), "line 3, column east_m: expected a number"),
        (TABLE.replace("gate", ""), "column sensor: expected a new name, got nothing"),
        (TABLE.replace("up_m", "north_m"), "column north_m once, got it twice"),
        (TABLE.replace("clock", "watch"), "unknown column 'watch'"),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        read_stations(table(tmp_path, text))
