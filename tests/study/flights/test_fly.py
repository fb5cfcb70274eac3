"""Flights through a scene's blasts: when it comes, and what is measured of it."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import binomtest

from jblast.scene import Charge, Scene
from jblast.study.flight_results import (
    Options,
    encounter_at,
    load_of,
    quantiles,
    share_interval,
)
from jblast.study.flights import flight_seconds, fly
from jblast.vehicle import blast_load, flight_metrics
from tests.study.flights.scenes import PLACE, SHORT, SPEC, scene


@pytest.fixture(scope="module")
def flights():
    return fly(scene(), **SHORT)


@pytest.mark.slow
def test_the_blast_comes_when_the_load_says(flights):
    load = blast_load(scene().scene)
    for flown in flights.holds.values():
        expected = load.arrival_time_s(PLACE)
        np.testing.assert_allclose(flown.encounter.arrival_s, expected, rtol=1e-9)
        # 1 kg at standard pressure: metres are scaled metres
        np.testing.assert_allclose(
            flown.encounter.scaled_distance, [29**0.5], rtol=1e-6
        )
        assert flown.encounter.in_range.tolist() == [True]


@pytest.mark.slow
def test_metrics_are_those_of_the_trajectory(flights):
    for flown in flights.holds.values():
        expected = flight_metrics(
            flown.trajectory, PLACE, flown.encounter.arrival_s[0], ground_up_m=0.0
        )
        np.testing.assert_array_equal(
            flown.metrics.peak_deviation_m, expected.peak_deviation_m
        )
        assert 0.01 < flown.metrics.peak_deviation_m < 0.2
        assert not flown.metrics.crashed


def test_a_flight_lasts_five_seconds_past_the_last_blast():
    one = scene(charge=Charge(mass_kg=1.0, time_s=2.0, name="a"))
    both = scene(
        charge=(
            Charge(mass_kg=1.0, time_s=2.0, name="a"),
            Charge(mass_kg=1.0, time_s=3.0, name="b"),
        ),
    )
    for uncertain, blast in ((one, 2.0), (both, 3.0)):
        arrival = blast + 0.0092  # at 5.4 m
        load = load_of(uncertain.scene, Options())
        seconds = flight_seconds(uncertain.scene, load, SPEC, "scene.toml", Options())
        assert arrival + 5.0 <= seconds < arrival + 5.1


def test_quantiles_may_be_infinite():
    values = np.array([1.0, 2.0, np.inf, np.nan, 3.0])
    assert quantiles(values, (0.25, 0.5, 0.95)) == [1.0, 2.0, np.inf]
    assert np.isnan(quantiles(np.array([np.nan]), (0.5,))).all()


def test_the_interval_of_a_share_is_an_interval_about_the_share():
    low, high = share_interval(np.arange(100) >= 20)
    # the interval of every share that is reported: Wilson's
    theirs = binomtest(80, 100).proportion_ci(0.90, method="wilson")
    assert (low, high) == pytest.approx((theirs.low, theirs.high), abs=1e-9)


@pytest.mark.slow  # a program with a profile
def test_a_custom_profile_takes_the_place_of_the_charge():
    case = np.array([0.01, 8.0, np.pi / 2, np.pi, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0])
    made = Scene(Charge(mass_kg=1.0, position_m=(-3.0, 0.0, 2.0), time_s=0.3))
    load = load_of(made, Options(profile=case[None]))
    level = jnp.array([0.0, 0.0, 0.0, 1.0])
    encounter = encounter_at(load, PLACE, level)
    assert float(encounter.arrival_s[0]) == pytest.approx(0.31)
    assert float(encounter.distance_m[0]) == pytest.approx(8.0)
    assert encounter.in_range.tolist() == [True]
    assert np.isnan(encounter.scaled_distance[0])
