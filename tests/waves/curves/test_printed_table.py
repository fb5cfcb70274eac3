from importlib.resources import files

import pytest

from jblast.waves.curves import data_rows

NAMES = sorted(
    file.name.removesuffix(".csv")
    for file in files("jblast.waves").joinpath("data").iterdir()
    if file.name.endswith(".csv")
)


def test_rows_come_by_column_without_the_head_of_comments():
    rows = data_rows("point_source_euler")
    assert len(rows) == 139
    assert rows[0] == {
        "lambda": "0.1",
        "overpressure_ratio": "157.7283",
        "log_slope": "-2.97994",
        "arrival": "0.003440707",
    }


@pytest.mark.parametrize("name", NAMES)
def test_every_table_says_where_it_comes_from_and_is_complete(name):
    text = files("jblast.waves").joinpath(f"data/{name}.csv").read_text()
    assert text.startswith("#")
    rows = data_rows(name)
    assert rows
    for row in rows:  # no cell missing, none too many
        assert None not in row
        assert None not in row.values()
