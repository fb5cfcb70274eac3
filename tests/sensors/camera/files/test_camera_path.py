import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.files.recordings import read_camera_path

HEAD = "time_s,east_m,north_m,up_m,quaternion_i,quaternion_j,quaternion_k,quaternion_w"
ROWS = "0,1,2,3,0,0,0,1\n0.5,2,2,3,0,0,0,2\n"


def written(tmp_path, text):
    path = tmp_path / "flight.csv"
    path.write_text(text)
    return path


def test_columns_are_found_by_name_and_turns_have_length_one(tmp_path):
    text = f"# a flight\n{HEAD},velocity_east_m_s\n" + ROWS.replace("\n", ",9\n")
    path = read_camera_path(written(tmp_path, text))
    np.testing.assert_array_equal(path.time, [0.0, 0.5])
    np.testing.assert_array_equal(path.position, [[1, 2, 3], [2, 2, 3]])
    np.testing.assert_array_equal(path.quaternion, [[0, 0, 0, 1]] * 2)


BAD = {
    "no column": (HEAD.replace("up_m", "height_m") + "\n" + ROWS, "a column up_m"),
    "nothing": ("", "a column time_s"),
    "one row": (HEAD + "\n0,1,2,3,0,0,0,1\n", "two or more rows .* got 1"),
    "a word": (HEAD + "\n" + ROWS.replace("0.5,2", "0.5,x"), "line 3: .*finite"),
    "not finite": (HEAD + "\n" + ROWS.replace("0.5,2", "0.5,nan"), "line 3: .*finite"),
    "a short row": (HEAD + "\n" + ROWS + "0.7,1\n", "line 4: .*finite numbers"),
    "back in time": (
        HEAD + "\n" + ROWS.replace("0.5", "-1"),
        "line 3: .* -1 s after 0",
    ),
    "no turn": (HEAD + "\n" + ROWS.replace("0,0,0,2", "0,0,0,0"), "line 3: .*not zero"),
}


@pytest.mark.parametrize(("text", "said"), BAD.values(), ids=BAD)
def test_a_file_that_is_no_flight_is_refused_by_its_line(tmp_path, text, said):
    with pytest.raises(InputError, match=rf"flight\.csv: .*{said}"):
        read_camera_path(written(tmp_path, text))
