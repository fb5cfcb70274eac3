"""Ellipses of draws: what they hold, how long they are, which way they point."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from jblast.inference.fitting.place import (
    charge_ellipse,
    confidence_ellipse,
    place_draws,
)
from tests.report.example import three_parameters

RNG = np.random.default_rng(4)


def draws_of(major, minor, azimuth_deg, count=40_000, centre=(300.0, -20.0)):
    """Normal draws, their sd along and across an azimuth."""
    turn = np.deg2rad(azimuth_deg)
    along = np.array([np.sin(turn), np.cos(turn)])
    across = np.array([np.cos(turn), -np.sin(turn)])
    z = RNG.standard_normal((count, 2)) * [major, minor]
    return (np.array(centre) + z @ np.stack([along, across])).T


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("azimuth", [0.0, 30.0, 90.0, 150.0])
def test_of_normal_draws_it_is_as_long_as_chi_squared_says(share, azimuth):
    east, north = draws_of(12.0, 3.0, azimuth)
    found = confidence_ellipse(east, north, share)
    length = np.sqrt(chi2.ppf(share, 2))
    # 40,000 draws know a quantile of d to 0.5 %, an sd to 0.4 %: four of both
    assert found.major == pytest.approx(12.0 * length, rel=0.03)
    assert found.minor == pytest.approx(3.0 * length, rel=0.03)
    off = (found.azimuth_deg - azimuth + 90.0) % 180.0 - 90.0
    assert abs(off) < 0.6  # sd of the azimuth: 0.076 degrees
    assert (found.east, found.north) == pytest.approx((300.0, -20.0), abs=0.3)


def shapes(kind, count):
    """Draws that no normal density makes."""
    turn = RNG.normal(0.0, 0.8, count)
    radius = 100.0 + RNG.normal(0.0, 2.0, count)
    return {
        "banana": np.stack([radius * np.sin(turn), radius * np.cos(turn)]),
        "tails": RNG.standard_t(3, (2, count)) * np.array([[5.0], [1.0]]),
        "two heaps": RNG.normal(0, 1, (2, count)) + 20.0 * (RNG.random(count) < 0.5),
    }[kind]


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("kind", ["banana", "tails", "two heaps"])
def test_it_holds_its_share_of_draws_of_any_shape(kind, share):
    east, north = shapes(kind, 8000)
    found = confidence_ellipse(east, north, share)
    assert found.holds(east, north).mean() == pytest.approx(share, abs=2e-3)


def test_its_outline_goes_anticlockwise_around_what_it_holds():
    found = confidence_ellipse(*draws_of(12.0, 3.0, 70.0))
    x, y = (found.outline() - [found.east, found.north]).T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    # of 72 corners, 0.13 % less than the ellipse's
    assert area == pytest.approx(np.pi * found.major * found.minor, rel=2e-3)
    assert found.holds(x * 0.999 + found.east, y * 0.999 + found.north).all()
    assert not found.holds(x * 1.001 + found.east, y * 1.001 + found.north).any()


def test_one_coordinate_alone_has_a_length_and_no_width():
    east = RNG.normal(5.0, 2.0, 20_000)
    found = confidence_ellipse(east, np.full(east.size, 7.0))
    assert found.minor == 0.0
    assert found.azimuth_deg == pytest.approx(90.0)
    # 1.645 sd either way, of one normal number; quantiles of 20,000 draws to 1.5 %
    assert found.major == pytest.approx(2.0 * 1.645, rel=0.04)
    assert found.holds(east, np.full(east.size, 7.0)).mean() == pytest.approx(0.9, 2e-3)


def with_place(**draws):
    fit = three_parameters()
    asked = ("charge_east_m", "charge_north_m")
    summary = replace(fit.summary, free=(*fit.summary.free, *asked))
    return replace(fit, summary=summary, draws={**fit.draws, **draws})


def test_a_place_that_was_given_or_cannot_be_told_has_no_ellipse():
    assert charge_ellipse(three_parameters()) is None
    east = RNG.normal(0.0, 1.0, 100)
    assert place_draws(with_place(charge_east_m=east)) is None
    spoilt = np.where(np.arange(100) == 3, np.nan, east)
    assert place_draws(with_place(charge_east_m=east, charge_north_m=spoilt)) is None
