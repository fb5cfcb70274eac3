import pytest

from calibration.benchmark_events import event_kernel_text


@pytest.mark.slow
def test_every_way_counts_the_known_events():
    lines = event_kernel_text((32, 40), 24).splitlines()
    rows = [line.split() for line in lines if line.startswith(("comp", "conv"))]
    assert len(rows) == 3
    for row in rows:
        assert row[-1] == row[-2] != "0"
