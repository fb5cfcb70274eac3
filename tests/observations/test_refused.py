"""What a log must not say is told by file, line, column, expectation and find."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from jblast.errors import InputError
from jblast.observations import QUANTITIES, read
from jblast.quantities import ADDITIVE, TIMED
from tests.cli.cli_files import says, table
from tests.observations.rows import HEADER, ROW

# lines of a file between slashes, H and R for a header and a row, W for a wide table
# of E, an arrival with its east; then parts of the message
BAD = table("""
sensor,range_m,impulse_kPa_ms / a,1,2 => line 1 | did you mean positive_impulse_kpa_ms
 => line 1 | empty | sensor,quantity,value,sigma
# c / H => line 2 | nothing after the header
sensor,quantity,value / a,air_arrival_s,1 => line 1 | missing column sigma
H,sgima / R,1 => line 1 | unknown column 'sgima' | did you mean sigma?
H,distance / R,1 => unknown column 'distance' | did you mean range_m?
H,sigma / R,1 => line 1 | sigma once | 'sigma' and 'sigma'
L,east_m,up_m / a,air_arrival_s,1,,2,3 => line 2 | column north_m | all of east_m
H / R / b,air_arrival_s,1,,2,,3 => line 3 | column north_m | all of east_m | got nothing
H,range_m / R,20 => line 2 | column range_m | either range_m or east_m | got both
L,range_m / a,air_arrival_s,1,,-20 => line 2 | column range_m | positive | got -20
H / R / b,air_arival_s,1,,1,2,3 => line 3, column quantity | did you mean air_arr
H / ,air_arrival_s,1,,1,2,3 => line 2 | column sensor | a name | got nothing
H / a,air_arrival_s,fast,,1,2,3 => column value | a finite number | got 'fast'
H / a,air_arrival_s,1_000,,1,2,3 => line 2 | column value | '1_000'
H / a,air_arrival_s,True,,1,2,3 => a finite number, got 'True'
H / a,air_arrival_s,2026-03-01,,1,2,3 => a date, into which spreadsheets
H / a,air_arrival_s,5 kPa,,1,2,3 => a unit belongs in the name
H / a,air_arrival_s,12:30:01,,1,2,3 => a time of day belongs in column
H / a,air_arrival_s,1,5%,1,2,3 => column sigma | whose errors are not relative
H / a,air_arrival_s,1,,-inf,2,3 => line 2 | column east_m | a finite number | '-inf'
H / a,air_arrival_s,1,0,1,2,3 => line 2 | column sigma | a positive number | got 0
H / R / # c / R => line 4 | a duplicate of line 2
H / R / b,air_arrival_s,1 => line 3 | expected 7 fields | got 3
H / R,05 => line 2 | expected 7 fields | got 8 | decimal comma
H / R / H => line 3, column quantity | unknown quantity 'quantity'
H / a,air_arrival_s,NA,,1,2,3 / a,air_arrival_s,,,1,2,3 => line 2: expected a value in
T / c,shock_radius_m,1,,1 / c,shock_radius_m,2,, => line 3 | the time at which | nothing
T / a,air_arrival_s,1,,2 => column time_s | expected nothing | got 2 for air_arrival_s
H / a,bearing_rad,225,1,1,2,3 => column value | within 6.28319 rad | got 225
H / a,elevation_rad,-1.6,,1,2,3 => column value | within 1.5708 rad | got -1.6
H / "a / b",air_arrival_s,1,,1,2,3 => line 2 | a stray or unclosed quote
sensor|quantity / a|b => commas, semicolons or tabs, got one column
time_s,pressure_pa / 0,1 / 0.1,2 / 0.2,5 => got 'time_s, pressure_pa' | jblast pick
sensor,peak_overpressure_kpa,range_m / a,1,2 => it is a quantity | read a wide table
sensor,air_arrival / ,ms / a,1 => 'air_arrival' | air_arrival_ms in column quantity
L,lat_deg,lon_deg / a,air_arrival_s,1,1,33°54'10",35.5 => lat_deg | decimal degrees
wide: sensor,value,air_arrival_s / a,1,2 => expected column value once
wide: sensor,range_m / a,1 => a column for each quantity; got
wide: sensor;\u00dcberdruck [kPa] / a;5 => expected one of peak_overpressure_kpa
wide: W,peak_overpressure_kpa,peak_overpressure_psi / E,1,2 => two units for one column
wide: W,sigma_air_arrival_ms / E,2 => sigma_ and the name of a quantity's column
wide: W,sigma_percent / E,3 => quantities whose errors are relative; got 'sigma_percent'
wide: W,sigma_air_arrival_percent / E,3 => quantity's column, as sigma_air_arrival_s
wide: sensor,air_arrival,sigma_air_arrival / ,ms,s / a,2,3 => line 2 | expected ms, the
wide: W,sigma_air_arrival_s / E,x => column sigma of air_arrival_s | a finite | got 'x'
wide: W,peak_overpressure_kpa / E,x => line 2, column peak_overpressure_kpa: | 'x'
wide: W,peak_overpressure_kpa,sigma_percent / E,5,x => column sigma of peak_overpr | 'x'
""")
SHORT = {
    "H": HEADER.strip(),
    "R": ROW.strip(),
    "L": "sensor,quantity,value,sigma",
    "T": "sensor,quantity,value,sigma,time_s",
    "W": "sensor,east_m,north_m,air_arrival_s",
    "E": "a,1,2,0.1",
}


@pytest.mark.parametrize(("content", "said"), BAD)
def test_bad_input_is_told_by_file_line_column_expectation_and_find(log, content, said):
    wide = content.startswith("wide: ")
    lines = content.removeprefix("wide: ").split(" / ")
    lines = [
        SHORT.get(x[:1], x[:1]) + x[1:] if x[1:2] in ("", ",") else x for x in lines
    ]
    with pytest.raises(InputError) as caught:
        read(log("\n".join(lines) + "\n"), wide=wide)
    assert "log.csv: " in str(caught.value)
    says(f"{caught.value}\n", said)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ((HEADER + ROW).encode("utf-16-le"), "0x00 | or UTF-16"),
        (HEADER.encode() + b"\x7fELF\x00\x01", "line 2 | a CSV file | 0x7f | binary"),
    ],
)
def test_bytes_that_are_no_text_are_named(log, content, said):
    with pytest.raises(InputError) as caught:
        read(log(content))
    says(f"{caught.value}\n", said)


def test_a_quote_that_swallows_the_file_is_named_where_it_opens(log):
    with pytest.raises(InputError, match=r"line 3: .*quote"):
        read(log(HEADER + ROW + '"b,' + ROW * 10_000))


@pytest.mark.parametrize(
    "quantity", [q for q in QUANTITIES if q not in ADDITIVE and q not in TIMED]
)
@pytest.mark.parametrize("value", ["0", "-1"])
def test_what_errs_in_ln_must_be_positive(log, quantity, value):
    with pytest.raises(InputError, match=f"a positive {quantity}, got {value}"):
        read(log(HEADER + f"a,{quantity},{value},,1,2,3\n"))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.csv", "no such file; expected a CSV"),
        ("", "is a directory"),
        ("a\0b.csv", "cannot be read"),
        ("x" * 5000, "cannot be read"),
    ],
)
def test_a_path_that_leads_to_no_file_is_told(tmp_path, name, said):
    with pytest.raises(InputError, match=said):
        read(f"{tmp_path}/{name}")


FUZZ = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@FUZZ
@given(st.binary(max_size=200))
def test_random_bytes_raise_nothing_but_input_errors(log, data):
    with pytest.raises(InputError):
        read(log(data))


FIELD = st.one_of(
    st.sampled_from(["a", "air_arrival_s", "shock_radius_m", "1", "-1", "", "nan"]),
    st.text(max_size=6),
    st.floats().map(repr),
)


@FUZZ
@given(
    st.lists(st.sampled_from(["range_m", "time_s", "path", "shot", "clock", "x"])),
    st.lists(st.lists(FIELD, min_size=4, max_size=7).map(",".join), max_size=4),
)
def test_random_rows_raise_nothing_but_input_errors(log, more, rows):
    header = ",".join(["sensor", "quantity", "value", "sigma", *more])
    text = "\n".join([header, *rows]).encode("utf-8", "replace")
    with suppress(InputError):
        assert np.isfinite(read(log(text)).value).all()


SEVERAL = (
    HEADER
    + ROW
    + "b,air_arival_s,fast,-1,1,2,3\n"
    + "c,air_arrival_s,1,,1,,3\n"
    + ROW
    + "d,air_arrival_s,2,0.1,5,6,7\n"
)


def test_every_fault_is_gathered_line_by_line(log):
    faults: list[InputError] = []
    observations = read(log(SEVERAL), faults=faults)
    said = [str(fault).partition("log.csv: ")[2] for fault in faults]
    assert [text.partition(":")[0] for text in said] == [
        "line 3, column quantity",
        "line 3, column value",
        "line 3, column sigma",
        "line 4, column north_m",
        "line 5",
    ]
    assert observations.sensor == ("a", "d")
    assert observations.line == (2, 6)


def test_a_file_in_which_nothing_can_be_read_is_a_log_without_rows(tmp_path):
    faults: list[InputError] = []
    assert len(read(tmp_path / "none.csv", faults=faults)) == 0
    assert "no such file" in str(faults[0])
