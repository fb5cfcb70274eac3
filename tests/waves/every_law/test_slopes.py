"""Slopes of every law are finite, and those of finite differences."""

import numpy as np

from tests.waves.every_law.laws import (
    STEP,
    arguments,
    away_from_joins,
    compiled,
    every_law,
    quotients,
    sweep,
)


@every_law
def test_value_slopes_and_curvatures_are_finite_from_fireball_to_far_field(law, word):
    # a branch not taken makes NaN of nothing times an infinite second derivative here
    # as it does in reverse over reverse
    value, slopes, curvatures = compiled(law, word)(sweep(law)[0])
    assert np.all(np.isfinite(value))
    for name, slope in slopes.items():
        assert np.all(np.isfinite(slope)), name
        assert np.all(np.isfinite(curvatures[name])), name


@every_law
def test_log_slopes_are_those_of_finite_differences(law, word):
    values, _ = sweep(law)
    keep = away_from_joins(law, values)
    assert keep[:404].mean() > 0.98
    _, slopes, _ = compiled(law, word)(values)
    differences = quotients(law, word, values, STEP, -STEP)
    for name in arguments(law):
        # truncation: a sixth of the step squared times the third derivative, which
        # inside a blend (5 % wide, jump 2 %) is up to 1e4; rounding: 1e-9
        np.testing.assert_allclose(
            slopes[name][keep], differences[name][keep], rtol=0, atol=1e-6, err_msg=name
        )


@every_law
def test_at_a_join_the_slope_lies_between_those_of_its_sides(law, word):
    values, at_join = sweep(law)
    _, slopes, _ = compiled(law, word)(values)
    step = 1e-6  # one-sided: half a step times a curvature of up to 100
    right = quotients(law, word, values, step, 0.0)
    left = quotients(law, word, values, 0.0, -step)
    for name, slope in slopes.items():
        low, high = np.sort([left[name], right[name]], axis=0)
        assert np.all((slope >= low - 5e-5)[at_join]), name
        assert np.all((slope <= high + 5e-5)[at_join]), name
