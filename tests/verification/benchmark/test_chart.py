import numpy as np
from hypothesis import given, strategies as st

from jblast.verification.benchmark.chart import BenchmarkPoint, on_pareto_front, panels

positive = st.floats(1e-9, 1e3)
some = st.lists(st.tuples(positive, positive, st.sampled_from("ab")), max_size=12)


def points(rows):
    return [BenchmarkPoint(f"m{i}", c, e, "", p) for i, (c, e, p) in enumerate(rows)]


@given(some)
def test_no_method_on_the_front_is_beaten_and_every_other_is(rows):
    drawn = points(rows)
    front = on_pareto_front(drawn)
    for one, on in zip(drawn, front, strict=True):
        beaten = any(
            other.panel == one.panel
            and other.cost_s <= one.cost_s
            and other.error <= one.error
            and (other.cost_s, other.error) != (one.cost_s, one.error)
            for other in drawn
        )
        assert on == (not beaten)


@given(some)
def test_every_panel_has_a_front(rows):
    drawn = points(rows)
    front = on_pareto_front(drawn)
    for name, within in panels(drawn).items():
        ids = {id(point) for point in within}
        assert any(front[i] for i, p in enumerate(drawn) if id(p) in ids), name


def test_what_covers_a_part_of_the_panel_is_not_on_its_front():
    whole, part = (
        BenchmarkPoint("a", 2.0, 2.0, ""),
        BenchmarkPoint("b", 1.0, 1.0, "", whole=False),
    )
    np.testing.assert_array_equal(on_pareto_front([whole, part]), [True, False])
