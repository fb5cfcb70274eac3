"""Each thing that a reader understood has a sentence."""

import pytest

from jblast.observations import table
from jblast.report.understood import understood_words

SAID = [
    (table.Dialect("Excel workbook", sheet="a"), "read as Excel workbook: sheet 'a'"),
    (
        table.Dialect(separator="tab", encoding="UTF-16 (big-endian)"),
        "read as text: fields separated by tabs, UTF-16 (big-endian)",
    ),
    (table.DecimalComma(3, "0,5"), "decimal commas, as in 0,5 (line 3)"),
    (table.Renamed("toa_s", "air_arrival_s"), "toa_s was read as air_arrival_s"),
    (
        table.Converted("range_ft", "range_m", "ft", 0.3048, 2),
        "range_ft was converted to range_m: times 0.3048 (2 rows)",
    ),
    (
        table.Converted("Sigma (%)", "sigma", "percent", 0.01, 1),
        "per cent of each value",
    ),
    (table.LevelConverted("peak_level_db", 1), "20 uPa times 10^(dB/20)"),
    (table.LevelConverted("sigma_db", 2), "1 dB is ln(10)/20 = 11.5 %"),
    (table.EmptySkipped((4,)), "1 row without a value left out: line 4"),
    (table.EmptySkipped(tuple(range(9))), "lines 0, 1, 2, 3, 4 and 4 more"),
    (
        table.ClockTimesTaken("2020-08-04", 2, "Asia/Beirut", 3, 1),
        "value_utc: times of day read as of 2020-08-04 (2 rows); times without a "
        "zone read as Asia/Beirut (3 rows); times with an offset converted to UTC "
        "(1 row)",
    ),
    (table.LongitudesWrapped(2), "read as west: less 360 (2 rows)"),
    (table.HeightTaken(), "sensors assumed at up = 0"),
    (table.ColumnsIgnored(("Note",)), "column Note ignored"),
    (table.UnitsRow(2), "line 2 was read as the units"),
    (table.MadeLong(("a", "b"), ("b",)), "for b: only the law's scatter"),
]


@pytest.mark.parametrize(("found", "said"), SAID)
def test_each_finding_has_a_sentence(found, said):
    assert said in understood_words(found)
