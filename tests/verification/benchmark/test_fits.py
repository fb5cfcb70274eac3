import numpy as np
import pytest

from jblast.verification.benchmark.chart import on_pareto_front
from jblast.verification.benchmark.fits import (
    STOCK,
    FitOutcome,
    by_scipy,
    fit_points,
    missed,
)
from jblast.verification.stability.fits import best_known, draw, ours, stock_fits

LOGS, SOLVED, LOOPED = 200, 2, 20


@pytest.fixture(scope="module")
def logs():
    return draw(LOGS)


@pytest.fixture(scope="module")
def misses(logs):
    """By the name of some ways, the share of the logs that they miss."""
    bfgs = stock_fits("BFGS", logs.blank, logs.readings, logs.starts, "float32")
    outcomes = [
        FitOutcome(name, "", 1.0, np.asarray(z))
        for name, z in (
            ("own", ours(logs).z),
            ("poor", ours(logs, logs.starts).z),
            ("bfgs", bfgs.z),
        )
    ]
    found = zip(outcomes, missed(logs, outcomes), strict=True)
    return {way.method: off / len(way.z) for way, off in found}


@pytest.mark.slow
def test_bfgs_in_float32_misses_what_fit_many_finds(misses):
    assert misses["own"] == 0.0
    # 733 of 2,000; the standard error of a share of 200 is 0.034
    assert misses["bfgs"] == pytest.approx(0.37, abs=0.15)
    assert misses["own"] < misses["poor"] < misses["bfgs"]


@pytest.mark.slow
def test_scipy_from_poor_starts_ends_mostly_at_the_optimum(logs):
    outcomes = FitOutcome("scipy", "", 1.0, np.asarray(by_scipy(logs, LOOPED)))
    # 38 of 500; of 20 hardly ever more than 6
    assert missed(logs, [outcomes])[0] / len(outcomes.z) <= 0.3


@pytest.mark.slow
def test_an_end_off_by_a_standard_deviation_or_by_nan_is_missed(logs):
    best = best_known(logs)
    other = best.copy()
    other[1, 0] += 1.0  # a factor e in mass
    other[2] = np.nan
    few = best[:3]
    outcomes = [
        FitOutcome(name, "", 1.0, z)
        for name, z in (("a", best), ("b", other), ("c", few))
    ]
    assert missed(logs, outcomes) == [0, 2, 0]


@pytest.mark.slow
def test_every_way_is_measured_and_fit_many_is_on_the_front():
    points = fit_points(LOGS, SOLVED, LOOPED)
    assert len(points) == len(STOCK) + 4
    by_name = {point.method: point for point in points}
    assert len(by_name) == len(points)
    assert all(0 < point.error <= 1 and point.cost_s > 0 for point in points)
    assert by_name["LM"].error < by_name["Gauss-Newton"].error
    # none, which counts as half a log
    assert by_name["fit_many"].error == 0.5 / LOGS
    assert by_name["solve"].error == 0.5 / SOLVED
    assert by_name["solve"].range == f"0 of {SOLVED} missed, own starts"
    front = [
        p.method for p, on in zip(points, on_pareto_front(points), strict=True) if on
    ]
    assert "fit_many" in front
