"""A world in a window: what came in by now, in buffers that do not grow."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg

from jblast.errors import InputError
from jblast.report import world_live
from jblast.report.figure_style import new_figure
from jblast.report.world_live import (
    CAPACITY,
    COLUMN_S,
    WINDOW_S,
    LiveFigure,
    Rolling,
    announced,
    check_display,
    lanes_of,
    play,
)
from jblast.report.world_page import RunFolder, Waveform

SECONDS = 8.0


@pytest.fixture(autouse=True)
def no_display():
    plt.switch_backend("agg")


@pytest.fixture
def run(tmp_path):
    """Eight seconds: a flight at 1 kHz, a microphone, events, two frames."""
    time = np.arange(0.0, SECONDS, 1e-3)
    columns = dict.fromkeys(
        ("path_error_m", "force_east_n", "force_north_n", "force_up_n"), time
    )
    wave = Waveform("mic", "overpressure_pa", time, -time, 2.0 * time)
    frames = []
    for number, taken in enumerate((0.0, 2.0)):
        file = tmp_path / f"{number}.png"
        plt.imsave(file, np.full((4, 6), 0.5 * number), vmin=0, vmax=1, cmap="gray")
        frames.append((taken, file))
    document = {
        "seconds": SECONDS,
        "blasts": [{"shot": "1", "time_s": 2.0}],
        "perceived": [
            {"shot": "1", "entity": "mic", "sense": "sound", "time_s": 2.25},
        ],
    }
    flight = pd.DataFrame({"time_s": time, **columns})
    events = np.array([2.001, 2.002, 2.5])
    return RunFolder(tmp_path, document, flight, (wave,), tuple(frames), events)


@given(st.integers(1, 7), st.lists(st.lists(st.integers(0, 9), max_size=9)))
def test_the_last_are_kept_and_the_oldest_go(capacity, packets):
    kept, came = Rolling(capacity), []
    for packet in packets:
        values = np.array(packet, float)
        kept.write(values, values - 1.0, values + 1.0)
        came += packet
        time, least, greatest = kept.shown()
        np.testing.assert_array_equal(time, came[-capacity:])
        np.testing.assert_array_equal(least, time - 1.0)
        np.testing.assert_array_equal(greatest, time + 1.0)


def test_a_lane_holds_its_window_and_no_more_at_any_instant(run):
    for lane in lanes_of(run):
        for now in (0.0, 1.0, 1.0, 7.9, 100.0):
            lane.advance(now)
            time, least, greatest = lane.kept.shown()
            assert time.size <= CAPACITY
            if not time.size:
                continue
            assert time[-1] <= now
            assert np.all(np.diff(time) > 0.0)
            assert np.all(least <= greatest)
        # the end of the run, and a window's worth of columns before it
        assert time[-1] > SECONDS - 2.0 * COLUMN_S
        if lane.title != "events":  # whose bins are wider, and fewer
            assert time[-1] - time[0] == pytest.approx(WINDOW_S, abs=2.0 * COLUMN_S)


@pytest.mark.parametrize(
    ("column", "title", "unit"),
    [
        ("overpressure_pa", "one: overpressure", "[Pa]"),
        ("ground_velocity_m_s", "one: ground velocity", "[m/s]"),
        ("wind_north_m_s", "one: wind north", "[m/s]"),
    ],
)
def test_a_lane_has_the_name_and_the_unit_of_what_is_sampled(run, column, title, unit):
    (wave,) = run.waveforms
    wave = replace(wave, sensor="one", column=column)
    lane = lanes_of(replace(run, waveforms=(wave,)))[2]
    assert (lane.title, lane.unit) == (title, unit)


def test_columns_lose_no_peak(run):
    run.flight.loc[4321, "path_error_m"] = 1e3
    lane = lanes_of(run)[0]
    assert lane.greatest.max() == 1e3
    assert lane.limits[1] > 1e3


def test_what_comes_is_announced_soonest_first(run):
    assert announced(run, 1.0) == [
        "blast 1 in 1.00 s",
        "blast 1 at mic: sound in 1.25 s",
    ]
    assert announced(run, 2.1) == ["blast 1 at mic: sound in 0.15 s"]
    assert announced(run, 3.0) == []


def test_a_picture_shows_what_came_by_then(run):
    figure = new_figure(8.0, 6.0)
    FigureCanvasAgg(figure)
    live = LiveFigure(run, figure)
    for now, told in ((0.5, "blast 1 in 1.50 s"), (7.0, "no further events")):
        live.show(now)
        figure.canvas.draw()
        words = [text.get_text() for axes in figure.axes for text in axes.texts]
        assert told in "".join(words)
        low, high = figure.axes[0].get_xlim()
        assert low <= now <= high
    assert "2.000 s" in [axes.get_title() for axes in figure.axes]  # the last frame


def test_where_there_is_no_display_that_is_said():
    with pytest.raises(InputError, match=r"expected a display .* got .*'agg'"):
        check_display()


def test_a_page_that_would_be_served_until_it_is_ended_is_no_window(monkeypatch):
    monkeypatch.setattr(plt, "get_backend", lambda: "WebAgg")
    with pytest.raises(InputError, match=r"expected a display .* got .*'webagg'"):
        check_display()


def test_it_plays_to_the_end_at_the_speed_that_is_asked_for(run, monkeypatch):
    shown = []
    monkeypatch.setattr(world_live, "check_display", lambda: None)
    monkeypatch.setattr(plt, "show", lambda: shown.append("kept open"))
    monkeypatch.setattr(plt, "pause", lambda seconds: shown.append(seconds))
    play(run, speed=40.0)
    plt.close("all")
    assert shown[-1] == "kept open"
    # 0.2 s; however long one drawing takes, the last is that of the end
    assert len(shown) >= 2
