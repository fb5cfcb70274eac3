"""The pages of charts and of failure modes are those of their kept tables."""

import numpy as np
import pytest

from calibration import charts, stability
from calibration.charts import Point, pareto_front
from calibration.stability import Mode, boundary_at, first_failure, verified

LEVELS = np.array([1.0, 2.0, 4.0])


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


def test_failure_modes_of_clocks_are_measured_as_kept():
    measured, kept = stability.clock_failures(), stability.read()["clocks"]
    assert measured == kept
    assert [mode.boundary for mode in measured] == [2.0**14, 2.0**33]


@pytest.mark.slow
@pytest.mark.parametrize("area", ["laws", "wave forms", "cameras", "detectors"])
def test_failure_modes_are_observed_at_the_kept_limits(area):
    _, function = stability.AREAS[area]
    for now, kept in zip(
        getattr(stability, function)(), stability.read()[area], strict=True
    ):
        assert now[:3] + now[4:5] == kept[:3] + kept[4:5]
        assert now.boundary == pytest.approx(kept.boundary, rel=1e-6)


def test_a_boundary_lies_between_two_levels_and_only_there():
    measured = np.array([0.0, 0.25, 0.75])
    assert boundary_at(0.5, measured, LEVELS, "a method") == pytest.approx(3.0)
    for limit in (-0.1, 0.75, 2.0, np.nan):
        with pytest.raises(RuntimeError, match="measured at 1 and 4, to contain"):
            boundary_at(limit, measured, LEVELS, "a method")
    assert first_failure(np.array([False, True, False]), "a method") == 1
    with pytest.raises(RuntimeError, match="got none"):
        first_failure(np.zeros(3, bool), "a method")


def test_a_response_that_was_not_seen_is_not_stated():
    assert verified("marks", True, "a") == "marks"
    with pytest.raises(RuntimeError, match='expected the response "marks"'):
        verified("marks", False, "a")


def test_a_share_of_cases_has_a_number():
    mode = Mode("fits", "a", "b", 3.0, "of 400", "", "marks", "")
    assert mode.cases == 400
    assert mode._replace(unit="of the peak").cases == 0
    assert stability.boundary_words(mode) == "3 of 400"
