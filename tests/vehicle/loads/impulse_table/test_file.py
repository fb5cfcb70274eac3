"""Files of custom profiles: columns in any order, moments, and what is refused."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.vehicle.loads.impulse_table import (
    COLUMNS,
    custom_profile,
    read_custom_profile,
)
from tests.vehicle.loads.impulse_table.rows import ASIDE, ROWS, written

# the thesis's own sample, custom_blast_impulses.csv beside its code
SAMPLE = np.array(
    [
        [0.0152527222, 8.660254037844387, 125.26438968275465, -135.0],
        [0.029374545, 17.320508075688775, 125.26438968275465, -135.0],
    ]
)
FORCES = np.array(
    [
        [0.09279357141272189, 0.09566386866174002, 0.2117570789277321],
        [0.029612091682948406, 0.03139291896649157, 0.05660320046749514],
    ]
)
MOMENTS = np.array(
    [
        [-0.0017737493622030124, -21.17334931621583, 9.565926105132245],
        [-0.00027761661953933277, -5.659821222629029, 3.1391007587969755],
    ]
)


def test_columns_come_in_any_order_and_others_are_not_read(tmp_path):
    order = [3, 0, 9, 1, 2, 4, 5, 6, 7, 8]
    columns = ["Case Number", *(COLUMNS[n].lower().replace(" ", "") for n in order)]
    rows = [[case, *(row[n] for n in order)] for case, row in enumerate(ROWS)]
    found = read_custom_profile(written(tmp_path / "a.csv", rows, columns))
    expected = read_custom_profile(written(tmp_path / "b.csv", ROWS))
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(np.degrees(found[:, 2:4]), [[ASIDE, -135.0]] * 2)


def test_the_sample_s_moments_are_about_a_point_100_m_away(tmp_path):
    rows = np.hstack([SAMPLE, FORCES, MOMENTS]).tolist()
    cases = read_custom_profile(written(tmp_path / "sample.csv", rows))
    assert cases.shape == (2, 10)
    for case in cases:
        lever = -case[8] / case[6], case[9] / case[5]
        np.testing.assert_allclose(lever, 100.0, rtol=2e-4)
        about = case[7:] - np.cross([100.0, 0.0, 0.0], case[4:7])
        assert np.abs(about).max() < 3e-3
        # it pushes away from where the charge is seen
        polar, azimuth = case[2:4]
        toward = [
            np.sin(polar) * np.cos(azimuth),
            np.sin(polar) * np.sin(azimuth),
            np.cos(polar),
        ]
        assert np.dot(toward, case[4:7]) < -0.9 * np.linalg.norm(case[4:7])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: the file is empty"),
        (",".join(COLUMNS), "line 1: expected one case per row, got only a header"),
        (
            ",".join(COLUMNS[:8]) + "\n1,2,3,4,5,6,7,8",
            r"line 1: missing column Mm \(N\*m\*s\), Mn \(N\*m\*s\)",
        ),
        (
            ",".join(COLUMNS).replace("(s)", "(ms)", 1) + "\n" + "1," * 9 + "1",
            r"line 1: missing column Time Delay \(s\)",
        ),
        (",".join(COLUMNS) + "\n1,2,3", "line 2: expected 10 fields .* got 3"),
        (
            ",".join(COLUMNS) + "\n\n1,2,3,4,5,nan,7,8,9,10",
            r"line 3, column FS \(N\*s\): expected a finite number, got 'nan'",
        ),
        (
            ",".join(COLUMNS) + "\n1,2,3,4,5,,7,8,9,10",
            r"line 2, column FS .*: expected a finite number, got nothing",
        ),
        (
            ",".join(COLUMNS) + "\n0.1,0,3,4,5,6,7,8,9,10",
            r"line 2, column Distance \(m\): expected a positive number, got '0'",
        ),
        (
            ",".join(COLUMNS) + "\n0.1,1,190,4,5,6,7,8,9,10",
            r"line 2, column View Polar Angle .*: expected a number from 0 to 180",
        ),
        (
            ",".join(COLUMNS) + 2 * "\n0.1,1,90,4,5,6,7,8,9,10",
            "line 3: expected a new distance or direction, got the same as in line 2",
        ),
    ],
)
def test_files_that_cannot_be_used_are_refused(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_custom_profile(path)


def test_no_file_and_a_duration_of_nothing_are_refused(tmp_path, cases):
    with pytest.raises(InputError, match="no such file"):
        read_custom_profile(tmp_path / "none.csv")
    with pytest.raises(InputError, match="duration_s: expected a positive time"):
        custom_profile(cases, (0.0, 0.0, 0.0), duration_s=0.0)
    with pytest.raises(InputError, match="moment_point_m: expected 3 numbers"):
        custom_profile(cases, (0.0, 0.0, 0.0), moment_point_m=(1.0, 2.0))
