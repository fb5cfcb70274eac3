from importlib.resources import files

import pytest

from jblast.waves.curves import data_rows

NAMES = sorted(
    file.name.removesuffix(".csv")
    for file in files("jblast.waves").joinpath("data").iterdir()
    if file.name.endswith(".csv")
)


@pytest.mark.parametrize("name", NAMES)
def test_every_table_says_where_it_comes_from_and_is_complete(name):
    text = files("jblast.waves").joinpath(f"data/{name}.csv").read_text()
    assert text.startswith("#")
    rows = data_rows(name)
    assert rows
    for row in rows:  # no cell missing, none too many
        assert None not in row
        assert None not in row.values()
