import os

import numpy as np
import pytest

from jblast.report.listen import write_samples


def packets(*sizes: int, end: BaseException | None = None):
    """Packets of numbers in a row."""
    start = 0
    for size in sizes:
        yield np.arange(start, start + size)[:, None] / np.array([3.0, -1.0])
        start += size
    if end is not None:
        raise end


def test_packets_make_the_file_that_the_whole_makes(tmp_path):
    one, many = tmp_path / "one.csv", tmp_path / "many.csv"
    comments = ["made up", "of two\nlines"]
    assert write_samples(one, packets(7), 4.0, ("a_pa", "b_pa"), comments) == 7
    assert (
        write_samples(many, packets(2, 0, 4, 1), 4.0, ("a_pa", "b_pa"), comments) == 7
    )
    assert one.read_bytes() == many.read_bytes()
    first, second, head, *_, last = one.read_text().splitlines()
    assert (first, second) == ("# made up", "# of two lines")
    assert (head, last) == ("time_s,a_pa,b_pa", "1.500000000,2,-6")


@pytest.mark.parametrize("end", [RuntimeError("broke"), KeyboardInterrupt()])
def test_a_stream_that_breaks_keeps_what_it_had(tmp_path, end):
    path = tmp_path / "a.csv"
    with pytest.raises(type(end)):
        write_samples(path, packets(3, 2, end=end), 4.0, ("a_pa", "b_pa"), [])
    before = path.read_text()
    assert len(before.splitlines()) == 6
    with pytest.raises(type(end)):  # none had come: what was there stays
        write_samples(path, packets(0, end=end), 4.0, ("a_pa", "b_pa"), [])
    assert path.read_text() == before
    assert os.listdir(tmp_path) == ["a.csv"]
