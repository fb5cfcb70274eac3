"""Ellipses and regions of draws of a place, and shock rings about a charge."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.path import Path
from scipy.stats import chi2

from jblast.inference.fitting.place import (
    LEVELS,
    charge_ellipse,
    confidence_ellipse,
    credible_regions,
    peak_law,
    place_draws,
    shock_rings,
)
from jblast.scene import Charge, Sensor
from jblast.sensors.forward_model import record
from jblast.sensors.layout import planned_layout
from tests.report.example import not_identifiable, shock_radius, three_parameters
from tests.report.made_up import changed

RNG = np.random.default_rng(4)


def draws_of(major, minor, azimuth_deg, count=40_000, centre=(300.0, -20.0)):
    """Normal draws, their sd along and across an azimuth."""
    turn = np.deg2rad(azimuth_deg)
    along = np.array([np.sin(turn), np.cos(turn)])
    across = np.array([np.cos(turn), -np.sin(turn)])
    z = RNG.standard_normal((count, 2)) * [major, minor]
    return (np.array(centre) + z @ np.stack([along, across])).T


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("azimuth", [0.0, 30.0, 150.0])
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


COUNT = 8000


def normal(rng):
    return rng.multivariate_normal([400.0, -3.0], [[9.0, 4.0], [4.0, 3.0]], COUNT)


def picked_again(rng):
    """As weighted draws are: a thousand places, many of them several times."""
    return normal(rng)[rng.integers(0, 1000, COUNT)]


def bent(rng):
    turn, radius = rng.normal(0.0, 0.9, COUNT), rng.normal(100.0, 3.0, COUNT)
    return np.stack([radius * np.sin(turn), radius * np.cos(turn)], axis=-1)


def ring(rng):
    turn, radius = rng.uniform(0.0, 2 * np.pi, COUNT), rng.normal(100.0, 3.0, COUNT)
    return np.stack([radius * np.sin(turn), radius * np.cos(turn)], axis=-1)


def two_places(rng):
    heap = rng.random(COUNT) < 0.4
    return rng.normal(0.0, 2.0, (COUNT, 2)) + 50.0 * heap[:, None]


def heavy_tails(rng):
    """Student's t of two variates, 4 degrees of freedom: ellipses, but not normal."""
    scale = np.sqrt(rng.chisquare(4, (COUNT, 1)) / 4)
    return rng.standard_normal((COUNT, 2)) * [3.0, 1.0] / scale


@pytest.mark.parametrize("draw", [normal, picked_again, heavy_tails])
def test_draws_that_fill_their_ellipse_need_no_more(draw):
    for seed in range(2):
        assert credible_regions(*draw(np.random.default_rng(seed)).T) == ()


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize(
    ("draw", "parts", "holes"), [(bent, 1, 0), (ring, 1, 1), (two_places, 2, 0)]
)
def test_a_region_holds_its_share(draw, share, parts, holes):
    draws = draw(np.random.default_rng(1))
    (found,) = credible_regions(draws[:, 0], draws[:, 1], [share])
    held = np.zeros(COUNT, bool)
    for outer, inner in found.parts:
        # outlines run anticlockwise, holes clockwise
        assert area(outer) > 0.0
        assert all(area(hole) < 0.0 for hole in inner)
        held |= Path(outer).contains_points(draws)
        for hole in inner:
            held &= ~Path(hole).contains_points(draws)
    # the outline runs straight between grid points, thinner than the curve is wide
    assert held.mean() == pytest.approx(share, abs=0.04)
    if share == 0.9:
        large = [part for part in found.parts if abs(area(part[0])) > 5.0]
        assert (len(large), len(large[0][1])) == (parts, holes)


def area(ring):
    x, y = (ring - ring[0]).T
    return 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))


def test_a_place_known_along_one_direction_has_no_region():
    east = np.random.default_rng(3).uniform(0.0, 1.0, 500)
    assert credible_regions(east, np.zeros(500)) == ()


MASS = 209.0


def test_a_sensor_on_a_ring_reads_its_pressure():
    fit = three_parameters()
    scene = replace(fit.scene, sensors=())
    rings = shock_rings(fit)
    assert [ring.peak_overpressure_pa for ring in rings] == list(LEVELS)
    sensors = tuple(
        Sensor(
            f"r{i}",
            jnp.array([0.0, ring.range_m, 0.0]),
            records=(("peak_overpressure_pa", 0.1),),
        )
        for i, ring in enumerate(rings)
    )
    scene = replace(scene, sensors=sensors)
    layout, _, _ = planned_layout(scene)
    read = record(scene, layout, {"peak_overpressure_pa": "kingery_bulmash"})
    # the range is to 1e-5, the pressure falls with up to its third power
    assert np.asarray(read.value) == pytest.approx(np.array(LEVELS), rel=1e-4)
    assert [bool(v) for v in read.valid] == [ring.valid for ring in rings]


def test_rings_grow_with_the_cube_root_of_the_mass():
    fit = three_parameters()
    estimate = fit.summary.estimates["charge_mass_kg"]
    for ring in shock_rings(fit):
        assert ring.law == "kingery_bulmash"
        for told, mass in (
            (ring.range_q05_m, estimate.q05),
            (ring.range_q95_m, estimate.q95),
        ):
            grown = ring.range_m * np.cbrt(mass / MASS)
            assert told == pytest.approx(grown, rel=1e-5)


def test_a_charge_above_the_ground_has_narrower_rings():
    fit = three_parameters()
    low = shock_rings(fit, levels=[100e3])[0].range_m
    for up, expected in ((10.0, [np.sqrt(low**2 - 100.0)]), (500.0, [])):
        charge = Charge(mass_kg=MASS, position_m=(0.0, 0.0, up), burst="surface")
        raised = changed(fit, scene=replace(fit.scene, charges=(charge,)))
        rings = [ring.range_m for ring in shock_rings(raised, levels=[100e3])]
        assert rings == pytest.approx(expected, rel=1e-5)


def test_without_a_mass_or_a_law_of_the_peak_there_are_none():
    assert peak_law(shock_radius()) is None
    assert shock_rings(shock_radius()) == ()
    assert shock_rings(not_identifiable()) == ()
