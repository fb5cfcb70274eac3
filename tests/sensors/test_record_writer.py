"""Files of records: their names, and tables that grow packet by packet."""

import os

import numpy as np
import pytest

from jblast.scene import Sensor
from jblast.sensors.record_writer import record_names, write_samples


def packets(*sizes: int, end: BaseException | None = None):
    """Packets of numbers in a row."""
    start = 0
    for size in sizes:
        yield np.arange(start, start + size)[:, None] / np.array([3.0, -1.0])
        start += size
    if end is not None:
        raise end


def test_every_sensor_has_a_file_of_its_own_whatever_its_name():
    called = ["a", "A", "truth", "../b", "c/d", "c_d", "...", "x" * 300, "Ö 1", "con\n"]
    sensors = [Sensor(name, np.zeros(3), "pressure") for name in called]
    names = record_names([*sensors, Sensor("phone", np.zeros(3), "microphone")])
    assert [*names.values()] == [
        *("a.csv", "A_2.csv", "truth_2.csv", "_b.csv", "c_d.csv", "c_d_2.csv"),
        *("_.csv", "x" * 80 + ".csv", "Ö 1.csv", "con_.csv", "phone.wav"),
    ]


def test_packets_make_the_file_that_the_whole_makes(tmp_path):
    one, many = tmp_path / "one.csv", tmp_path / "many.csv"
    comments = ["made up", "of two\nlines"]
    write_samples(one, packets(7), 4.0, ("a_pa", "b_pa"), comments)
    write_samples(many, packets(2, 0, 4, 1), 4.0, ("a_pa", "b_pa"), comments)
    assert one.read_bytes() == many.read_bytes()
    first, second, head, *_, last = one.read_text().splitlines()
    assert (first, second) == ("# made up", "# of two lines")
    assert (head, last) == ("time_s,a_pa,b_pa", "1.500000000,2,-6")


@pytest.mark.parametrize("end", [RuntimeError("broke"), KeyboardInterrupt()])
def test_a_stream_that_breaks_keeps_the_samples_before(tmp_path, end):
    path = tmp_path / "a.csv"
    with pytest.raises(type(end)):
        write_samples(path, packets(3, 2, end=end), 4.0, ("a_pa", "b_pa"), [])
    before = path.read_text()
    assert len(before.splitlines()) == 6
    with pytest.raises(type(end)):  # none had come: what was there stays
        write_samples(path, packets(0, end=end), 4.0, ("a_pa", "b_pa"), [])
    assert path.read_text() == before
    assert os.listdir(tmp_path) == ["a.csv"]
