"""Any log becomes one of ours, with what was done to it in comments."""

import numpy as np
import pandas as pd

from jblast.observations import read

FORENSIC = (
    "Sensor;Quantity;Value;Sigma;East (ft);North (ft);Note\n"
    "gate;peak_overpressure_psi;1,5;0,1;100;0;near\n"
    "gate;Arrival (ms);81,25;0,5;100;0;\n"
    "mast;peak_level_db;164;1,5;0;400;phone\n"
    "mast;positive_duration_ms;NA;;0;400;\n"
)


def test_a_log_is_written_in_our_units_with_what_was_done(jblast):
    code, out, _ = jblast(
        "convert", jblast.file("theirs.txt", FORENSIC), "--out", jblast.path("log.csv")
    )
    assert code == 0
    assert "peak_overpressure_psi was converted to peak_overpressure_pa" in out
    text = jblast.text("log.csv")
    assert text.startswith("# converted from theirs.txt by jblast ")
    for said in (
        "decimal comma",
        "left out: line 5",
        "up = 0",
        "columns: Note",
        "20 uPa",
    ):
        assert said in text
    ours = read(jblast.path("log.csv"))
    theirs = read(jblast.path("theirs.txt"))
    np.testing.assert_array_equal(ours.value, theirs.value)
    np.testing.assert_array_equal(ours.sigma, theirs.sigma)
    np.testing.assert_array_equal(ours.position, theirs.position)
    assert not ours.understood


def test_what_was_short_in_their_unit_is_short_in_ours(jblast):
    rows = "a,air_arrival_ms,12.4,0.7,1.1\na,peak_overpressure_kpa,4.1,0.07,1.1\n"
    theirs = jblast.file("t.csv", "sensor,quantity,value,sigma,range_ft\n" + rows)
    _, out, _ = jblast("convert", theirs)
    assert "a,air_arrival_s,0.0124,0.0007,0.33528\n" in out
    assert "a,peak_overpressure_pa,4100.0,70.0,0.33528\n" in out


def test_a_wide_table_is_told_the_option_and_made_long_by_it(jblast):
    frame = pd.DataFrame(
        {
            "sensor": ["a", "b"],
            "range_m": [20, 40],
            "air_arrival_ms": [30.0, 90.0],
            "sigma_air_arrival_ms": [1.0, 1.0],
            "peak_overpressure_kpa": [40.0, np.nan],
        }
    )
    frame.to_excel(jblast.path("wide.xlsx"), index=False)
    wide = jblast.path("wide.xlsx")
    code, _, said = jblast("convert", wide)
    assert (code, "read a wide table with --wide" in said) == (2, True)
    code, _, _ = jblast("convert", wide, "--wide", "--out", jblast.path("long.csv"))
    assert code == 0
    long = read(jblast.path("long.csv"))
    assert long.sensor == ("a", "a", "b")
    np.testing.assert_allclose(long.value, [0.03, 4e4, 0.09])
    np.testing.assert_allclose(long.sigma, [0.001, np.nan, 0.001])
