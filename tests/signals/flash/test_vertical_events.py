"""Algorithm 5: what counts as vertical, and when it says blast."""

import numpy as np
import pytest

from jblast.signals.flash.vertical_events import VerticalEvents, vertical_events


def bar(row=None, column=None):
    image = np.full((120, 160), 40, np.uint8)
    if row is not None:
        image[row : row + 6] = 200
    if column is not None:
        image[:, column : column + 6] = 200
    return image


def test_what_moves_up_makes_vertical_events_and_what_moves_aside_none():
    assert vertical_events(bar(row=60), bar(row=59)) == 2 * 160
    assert vertical_events(bar(column=60), bar(column=58)) == 0


def test_rows_are_counted_in_bins_that_cover_the_image():
    low = np.full((120, 160), 40, np.uint8)
    high = low.copy()
    high[115:] = 200  # raw rows would index far beyond 24 bins
    assert vertical_events(low, high, "rows") == 5 * 160
    assert vertical_events(low[:10], high[-10:], "rows") == 160  # fewer rows than bins


def test_no_change_is_no_event():
    assert vertical_events(bar(row=5), bar(row=5)) == 0


@pytest.mark.parametrize(("threshold", "found"), [(300, 3), (700, None)])
def test_an_increase_over_the_threshold_is_a_blast(threshold, found):
    # 320 events from frame 2 to 3, none before and after: the increase counts
    film = [bar(row=60), bar(row=60), bar(row=60), bar(row=59), bar(row=59)]
    assert VerticalEvents(threshold).blast(film) == found


def test_a_steady_count_is_no_increase():
    watch = VerticalEvents(0)
    told = [watch.increase(bar(row=60 - k)) for k in range(4)]
    assert told == [0, 2 * 160, 0, 0]
