import numpy as np
import pytest

from jblast.report.benchmark import chart_figure
from jblast.verification.benchmark import flights
from jblast.verification.benchmark.chart import BENCHMARKS, BenchmarkPoint


def test_the_order_is_read_where_neither_rounding_nor_stability_flattens_it():
    steps = [1e-4, 1e-3, 2e-3, 4e-3]
    errors = [max(step**4, 1e-12) for step in steps]
    assert flights.order(errors, steps) == pytest.approx(4)


def test_orders_are_drawn_through_a_methods_points():
    benchmark = BENCHMARKS["vehicle"]
    points = [
        BenchmarkPoint(f"{name} {step:g} ms", 1e-3 / step, step**order, "")
        for name, order in (("RK4", 4), ("Euler", 1))
        for step in (0.5, 1.0, 2.0)
    ]
    axes = chart_figure(benchmark, points).axes[0]
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    slopes = [float(np.diff(np.log(x.get_ydata()))[0]) for x in dashed]
    spans = [float(np.diff(np.log(x.get_xdata()))[0]) for x in dashed]
    assert np.divide(slopes, spans) == pytest.approx([-4, -1])


@pytest.mark.slow
def test_in_a_smooth_wind_rk4_has_its_order():
    case = flights.cases(4)[0]
    truth = flights.fly(case, 5e-4, "float64")
    steps = (2e-3, 5e-3)
    errors = [
        flights.farthest(flights.fly(case, step, "float64"), truth) for step in steps
    ]
    assert flights.order(errors, steps) == pytest.approx(4, abs=0.2)


@pytest.mark.slow
def test_the_blast_is_met_by_every_vehicle():
    case = flights.cases(4)[1]
    flown = flights.fly(case, 1e-2, "float64")
    calm = flights.fly(
        case._replace(options={**case.options, "loads": ()}), 1e-2, "float64"
    )
    off = np.linalg.norm(flown.position_m - calm.position_m, axis=-1).max(axis=1)
    assert (off > 1e-2).all()
