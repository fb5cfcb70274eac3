"""Against the function of Ishigami and Homma, whose indices are known."""

import numpy as np
import pytest

from jblast.study.sensitivity import (
    disagreement,
    fitted_slopes,
    shares_from_samples,
)

A, B = 7.0, 0.1
NAMES = ("x", "y", "z")


def ishigami(angles):
    x, y, z = angles.T
    return np.sin(x) + A * np.sin(y) ** 2 + B * z**4 * np.sin(x)


def exact():
    """First and total indices: Ishigami and Homma (1990), Saltelli et al. (2008)."""
    p4, p8 = np.pi**4, np.pi**8
    own_x = 0.5 * (1 + B * p4 / 5) ** 2
    own_y = A**2 / 8
    both = B**2 * p8 * (1 / 18 - 1 / 50)
    whole = own_x + own_y + both
    return (
        np.array([own_x, own_y, 0.0]) / whole,
        np.array([own_x + both, own_y, both]) / whole,
    )


def column(found, name):
    return np.array([getattr(one, name) for one in found.numbers])


def test_samples_alone_tell_the_indices_of_ishigami():
    angles = np.random.default_rng(1).uniform(-np.pi, np.pi, size=(4000, 3))
    inputs = {name: angles[:, n] for n, name in enumerate(NAMES)}
    found = shares_from_samples(inputs, ishigami(angles), resamples=50)
    assert found is not None
    first, total = exact()
    # 4000 samples scatter shares by a few hundredths
    assert column(found, "first") == pytest.approx(first, abs=0.04)
    assert column(found, "total") == pytest.approx(total, abs=0.04)
    assert found.explained > 0.97
    assert (
        column(found, "total_interval")[:, 0] <= column(found, "total") + 0.02
    ).all()


def test_an_axis_of_three_levels_has_its_shares_of_the_variance():
    """As an analysis of variance: y = a + b + a b, a of three levels, b normal."""
    a = np.repeat([-0.5, 0.0, 2.0], 1000)
    b = np.random.default_rng(3).normal(size=3000)
    found = shares_from_samples({"x": a, "y": b}, a + b + a * b, resamples=50)
    assert found is not None
    # of E[y | a] = a, of E[y | b] = (1 + mean a) b, and of both: var(a) b^2 alone
    parts = np.array([a.var(), (1 + a.mean()) ** 2, a.var()])
    shares = parts / parts.sum()
    # 3,000 normal scores scatter shares by some hundredths
    assert column(found, "first") == pytest.approx(shares[:2], abs=0.05)
    assert column(found, "total") == pytest.approx(shares[:2] + shares[2], abs=0.05)
    # noise-free, and a sum of products of the polynomials
    assert found.explained > 0.99


@pytest.mark.slow
def test_intervals_hold_the_indices_nine_times_in_ten():
    """Of a product of two normals and a third: S = (0.2, 0.3, 0), T = (0.7, 0.8, 0)."""
    held = []
    for seed in range(30):
        u = np.random.default_rng(seed).normal(size=(600, 3))
        y = np.sqrt(0.2) * u[:, 0] + np.sqrt(0.3) * u[:, 1]
        y = y + np.sqrt(0.5) * u[:, 0] * u[:, 1]
        found = shares_from_samples(dict(zip(NAMES, u.T, strict=True)), y)
        assert found is not None
        for n, true in enumerate((0.7, 0.8)):
            low, high = found.numbers[n].total_interval
            held.append(low <= true <= high)
    # 60 of which 54 are expected, standard deviation 2.3 or, as pairs, 3.3: four
    assert sum(held) >= 41


def test_noise_belongs_to_no_number():
    rng = np.random.default_rng(2)
    u = rng.normal(size=(3000, 2))
    found = shares_from_samples(
        {"x": u[:, 0], "y": u[:, 1]}, u[:, 0] + rng.normal(size=3000), resamples=20
    )
    assert found is not None
    assert found.explained == pytest.approx(0.5, abs=0.05)
    assert column(found, "first") == pytest.approx([0.5, 0.0], abs=0.05)


def test_what_does_not_vary_tells_nothing():
    u = np.random.default_rng(3).normal(size=100)
    assert shares_from_samples({"x": u}, np.ones(100)) is None
    assert shares_from_samples({"x": np.ones(100)}, u) is None
    assert shares_from_samples({"x": u[:5]}, u[:5]) is None
    assert shares_from_samples({"x": u}, np.full(100, np.nan)) is None


def test_slopes_of_samples_are_those_of_the_function():
    rng = np.random.default_rng(4)
    mass, away = rng.lognormal(3, 0.1, 5000), rng.normal(20, 0.5, 5000)
    elastic, shares = fitted_slopes(
        {"mass": mass, "range": away}, mass**0.5 * away**-2.0
    )
    assert elastic == pytest.approx({"mass": 0.5, "range": -2.0}, rel=0.05)
    # (0.5 * 0.1)^2 and (2 * 0.025)^2 are alike
    assert shares["mass"] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("outcome", "by_slope", "words"),
    [
        (lambda x, y: x**2 + 0.1 * y, 0.0, "larger effect over its whole range"),
        (lambda x, y: x**2 + 0.1 * x, 1.2, "steep at the middle"),
        (lambda x, y: x * y, 0.5, "acts together"),
        (lambda x, y: x + y, 0.5, ""),
    ],
)
def test_where_slope_and_variance_disagree_the_reason_is_told(outcome, by_slope, words):
    u = np.random.default_rng(5).normal(size=(3000, 2))
    inputs = {"x": u[:, 0], "y": u[:, 1]}
    found = shares_from_samples(inputs, outcome(*u.T), resamples=5)
    assert found is not None
    one = found.numbers[0]
    reason = disagreement(one.first, one.total, by_slope)
    assert words in (reason or "")
    assert bool(words) == bool(reason)
