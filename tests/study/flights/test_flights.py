"""Flights through blasts: what is flown, and what is measured of it."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.report.flights import fly_answer
from jblast.report.view import terminal
from jblast.scene import Charge, Free, Normal, Scene, UncertainScene, VehicleSpec
from jblast.study.flight_results import (
    Options,
    burst_remarks,
    encounter_at,
    load_of,
    quantiles,
)
from jblast.study.flights import flight_seconds, fly, named_controllers
from jblast.study.thinning import largest_since
from jblast.vehicle import BlastLoad, blast_load
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


CRAFT = VehicleSpec(model="crazyflie", position=np.array([5.0, 0.0, 12.0]))


def scene_of(up, burst=None):
    charge = Charge(mass_kg=1.0, position_m=(0.0, 0.0, up), burst=burst)
    return Scene(charge, vehicle=CRAFT)


def test_a_charge_high_up_has_the_free_air_curves_with_a_remark():
    (note,) = burst_remarks(scene_of(12.0), CRAFT)
    assert "free-air curves at 1 of 1 vehicles" in note
    assert note.endswith("all waves are those of a free-air burst")
    assert burst_remarks(scene_of(0.0), CRAFT) == ()
    (note,) = burst_remarks(scene_of(12.0, "surface"), CRAFT)
    assert 'burst = "surface" contradicts the height' in note
    assert note.endswith("all waves are those of a surface burst")


def test_each_vehicle_of_a_batch_of_both_has_its_own_set():
    scenes = jax.vmap(scene_of)(jnp.array([0.2, 12.0]))
    (note,) = burst_remarks(scenes, CRAFT)
    assert "free-air burst at 1 of 2 vehicles, else of a surface burst" in note
    load = load_of(scenes, Options())
    assert isinstance(load, BlastLoad)
    waves = load.waves
    np.testing.assert_array_equal(waves.free_air[:, 0], [0.0, 1.0])
    # only the higher charge has an image, and none has one where no charge is high
    np.testing.assert_array_equal(waves.time_s[:, 1], [np.inf, 0.0])
    low = eqx.filter_vmap(scene_of)(jnp.array([0.1, 0.2]))
    load = load_of(low, Options())
    assert isinstance(load, BlastLoad)
    assert load.waves.time_s.shape == (2, 1)


@pytest.mark.parametrize(
    ("asked", "own", "flown"),
    [
        (None, None, ("with_integral", "without_integral")),
        (None, "without_integral", ("without_integral", "with_integral")),
        (("cascade", "hold"), None, ("cascade", "with_integral")),
        (("hold", "cascade"), "without_integral", ("without_integral", "cascade")),
        (("hold", "with_integral"), None, ("with_integral",)),
    ],
)
def test_the_hold_is_the_scenes_own_and_each_is_flown_once(asked, own, flown):
    assert named_controllers(asked, own) == flown


def test_one_that_is_none_ends_it_with_the_nearest_before_any_flies():
    with pytest.raises(InputError, match=r"'cascad': expected one of .*cascade"):
        fly(scene(), controllers=("hold", "cascad"))
    with pytest.raises(InputError, match="expected one or more, got none"):
        fly(scene(), controllers=())


@pytest.mark.slow  # a program for each
def test_all_fly_through_the_same_blast():
    flights = fly(
        scene(),
        seconds=6.0,
        step_s=2e-3,
        controllers=("hold", "cascade", "without_integral"),
    )
    assert tuple(flights.holds) == ("with_integral", "cascade", "without_integral")
    held = flights.holds.values()
    arrivals = {float(np.min(f.encounter.arrival_s)) for f in held}
    assert len(arrivals) == 1
    peaks = [float(f.metrics.peak_deviation_m) for f in held]
    assert all(0 < peak < math.inf for peak in peaks)
    assert len(set(peaks)) == 3
    words = terminal(fly_answer(flights).view)
    assert "by a cascade as PX4's" in words


@pytest.mark.slow
def test_a_batch_flies_by_its_estimates_through_a_blast():
    vehicle = VehicleSpec("iris", position=np.array([8.0, 0.0, 10.0]), integral=True)
    scene = Scene(Charge(10.0, time_s=2.0), vehicle=vehicle)
    uncertain = UncertainScene(scene, {"charge_mass_kg": Normal(10.0, 0.5)})
    flights = fly(uncertain, seconds=4.0, estimator="ekf", vehicles=3, seed=4)
    found = flights.holds["with_integral"]
    assert found.thrown is not None
    places = np.asarray(found.thrown.place_m)
    assert places.shape == (3, 1)
    # each has instruments of its own
    assert len(np.unique(places)) == 3
    assert (places < 1.0).all()
    assert not np.asarray(found.metrics.crashed).any()
    assert np.asarray(found.metrics.peak_deviation_m).max() < 2.0


def test_a_push_between_two_rows_is_in_the_later_row():
    force = np.zeros(13)
    force[[0, 6, 8, 12]] = 1.0, 17.4, 3.0, 99.0
    np.testing.assert_array_equal(force[largest_since(force, 5)], [1.0, 0.0, 17.4])
    np.testing.assert_array_equal(largest_since(force, 1), np.arange(13))


REFUSED: dict[str, Any] = {
    "charges that never happen": (
        lambda: scene(charge=Charge(mass_kg=1.0, time_s=np.inf)),
        {},
        ["scene.toml: [charge] time_s: expected a charge with a finite", "got inf"],
    ),
    "no vehicle": (lambda: scene(None), {}, ["[vehicle]", "got none"]),
    "a charge without a place": (
        lambda: scene(charge=Charge(mass_kg=1.0, range_m=10.0)),
        {},
        ["[charge] range_m", "expected position_m"],
    ),
    "below ground": (
        lambda: scene(VehicleSpec("iris", jnp.array([5.0, 0.0, -1.0]))),
        {},
        ["[vehicle] position_m", "expected a height of 0 m", "-1 m"],
    ),
    "a free mass": (
        lambda: scene(beliefs={"charge_mass_kg": Free(positive=True)}),
        {},
        ["free and cannot be drawn"],
    ),
    "several alike": (scene, {"vehicles": 3}, ["expected a prior", "all flights"]),
    "none": (scene, {"vehicles": 0}, ["vehicles", "got 0"]),
    "a blast that is over": (
        lambda: scene(charge=Charge(mass_kg=1.0, time_s=-1.0)),
        {},
        ["[charge] time_s", "when the flight begins", "-0.9908 s"],
    ),
    "too short": (
        scene,
        {"seconds": 0.005},
        ["seconds: expected more than 0.0092 s", "got 0.005 s"],
    ),
    "too long": (scene, {"seconds": 1e6}, ["seconds", "at most"]),
    "a negative tolerance": (
        scene,
        {"tolerance_m": -1.0},
        ["tolerance: expected a positive number"],
    ),
}


@pytest.mark.parametrize(("make", "options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_flown_is_refused(make, options, said):
    with pytest.raises(InputError) as caught:
        fly(make(), **options)
    for words in said:
        assert words in str(caught.value), caught.value


def test_draws_that_cannot_be_are_refused():
    """A normal mass with 3 sd to zero is negative in one of 741 draws."""
    uncertain = scene(beliefs={"charge_mass_kg": Normal(3.0, 1.0)})
    with pytest.raises(
        InputError, match=r"a prior of charge_mass_kg .* got -.* of 10000 samples"
    ):
        fly(uncertain, **SHORT, vehicles=10_000)


def test_a_profile_whose_moments_are_about_another_place_is_not_flown():
    case = np.array([0.01, 8.0, np.pi / 2, np.pi, 1e-3, 0.0, 0.0, 0.0, 0.1, 0.0])
    with pytest.raises(InputError, match=r"at most 0\.13 m.*got one of 100 m"):
        fly(scene(), **SHORT, profile=case[None])
