"""The pages of charts and of failure modes are those of their kept tables."""

import numpy as np
import pytest

from calibration import charts, stability
from calibration.charts import Point, pareto_front
from calibration.stability import Mode, first_failure, row


def test_the_page_of_charts_is_that_of_the_kept_table():
    kept, measured_on = charts.read()
    assert list(kept) == list(charts.TOPICS)
    assert charts.KEPT.with_suffix(".md").read_text() == charts.page(kept, measured_on)
    assert charts.KEPT.read_text() == charts.table(kept, measured_on)
    # one reference a panel at most, and all points have a place on logarithmic axes
    for points in kept.values():
        assert all(point.cost_s > 0.0 and point.error > 0.0 for point in points)
        for panel in charts.panels(points).values():
            assert sum(point.reference for point in panel) <= 1


def test_the_front_has_no_point_that_another_beats_and_no_part_of_a_range():
    good, worse = Point("", "a", 1.0, 1.0), Point("", "b", 2.0, 1.0)
    equal, part = Point("", "c", 1.0, 1.0), Point("", "d", 0.5, 0.5, whole=False)
    precise = Point("", "e", 3.0, 0.1)
    front = pareto_front([good, worse, equal, part, precise])
    assert front == {good, equal, precise}


def test_a_chart_is_drawn_with_all_its_names():
    points = [Point("x", "a", 1e-3, 0.1), Point("x", "b", 1e-1, 1e-3, reference=True)]
    figure = charts.figure_of(charts.TOPICS["arrival"], points)
    words = {text.get_text() for text in figure.axes[0].texts}
    assert words == {"a", "b"}


def test_the_page_of_failure_modes_is_that_of_the_kept_table():
    kept = stability.read()
    assert list(kept) == list(stability.AREAS)
    assert stability.KEPT.with_suffix(".md").read_text() == stability.page(kept)
    for area, modes in kept.items():
        assert len({(m.method, m.failure) for m in modes}) == len(modes)
        assert {m.area for m in modes} == {area}
        assert {m.response for m in modes} <= set(stability.COLOURS)
    assert {words["area"] for words in stability.WORDS.values()} == set(kept)


def test_failure_modes_of_clocks_are_measured_as_kept():
    measured, kept = list(stability.clock_failures()), stability.read()["clocks"]
    assert measured == kept
    assert [mode.boundary for mode in measured] == [2.0**14, 2.0**33]


@pytest.mark.slow
@pytest.mark.parametrize("area", ["laws", "wave forms", "cameras", "detectors"])
def test_failure_modes_are_observed_at_the_kept_limits(area):
    for now, kept in zip(stability.AREAS[area](), stability.read()[area], strict=True):
        assert now[:3] + now[4:5] == kept[:3] + kept[4:5]
        assert now.boundary == pytest.approx(kept.boundary, rel=1e-6)


def test_a_level_without_failure_and_a_response_that_was_not_seen_are_errors():
    assert first_failure(np.array([False, True, False]), "a method") == 1
    with pytest.raises(RuntimeError, match="got none"):
        first_failure(np.zeros(3, bool), "a method")
    seen = row("silence", 1.0, True, message="words")
    assert (seen.response, seen.message, seen.boundary) == ("refuses", "words", 1.0)
    with pytest.raises(RuntimeError, match='expected the response "refuses"'):
        row("silence", 1.0, False, message="words")


def test_a_share_of_cases_has_a_number():
    mode = Mode("fits", "a", "b", 3.0, "of 400", "", "marks", "")
    assert mode.cases == 400
    assert mode._replace(unit="of the peak").cases == 0
    assert stability.boundary_words(mode) == "3 of 400"
