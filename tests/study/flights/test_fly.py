"""Flights through a scene's blasts: when it comes, and what is measured of it."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import binomtest

from jblast.errors import InputError
from jblast.progress import Listener, heard_by
from jblast.report.flight_figures import loads_figure
from jblast.report.flights import flights_answer, flights_text
from jblast.scene import (
    Air,
    Charge,
    LogNormal,
    Normal,
    Scene,
    UncertainScene,
    with_values,
)
from jblast.study import flights as flights_module
from jblast.study.flight_results import (
    Profile,
    encounter_at,
    load_of,
    quantiles,
    share_interval,
    warnings_of,
)
from jblast.study.flights import Options, fly
from jblast.vehicle import blast_load, flight_metrics
from tests.study.flights.scenes import PLACE, SHORT, SPEC, scene


@pytest.fixture(scope="module")
def flights():
    return fly(scene(), SHORT)


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


@pytest.mark.slow
def test_the_two_holds_differ(flights):
    deviations = [f.metrics.error_after_m for f in flights.holds.values()]
    assert deviations[0] != deviations[1]
    assert tuple(flights.holds) == ("with_integral", "without_integral")
    assert flights.own is None


@pytest.mark.slow  # a whole study of flights is compiled
def test_the_scenes_own_hold_comes_first():
    spec = dataclasses.replace(SPEC, integral=False)
    flights = fly(scene(spec), SHORT)
    assert tuple(flights.holds) == ("without_integral", "with_integral")
    assert flights.own == "without_integral"


@pytest.mark.slow  # a flight is compiled; cli/verbs/simulate/test_fly.py flies one
def test_wind_before_the_blast_is_told_apart():
    windy = scene(air=Air(wind_east=8.0), charge=Charge(mass_kg=1.0, time_s=0.5))
    flights = fly(windy, SHORT)
    for flown in flights.holds.values():
        assert flown.error_at_blast_m > 0.05
    assert any("before the first blast arrives" in w for w in warnings_of(flights))
    assert flights.wind_m_s.tolist() == [8.0, 0.0]


def test_a_flight_lasts_five_seconds_past_the_last_blast():
    one = scene(charge=Charge(mass_kg=1.0, time_s=2.0, name="a"))
    both = scene(
        charge=Charge(mass_kg=1.0, time_s=2.0, name="a"),
        others=(Charge(mass_kg=1.0, time_s=3.0, name="b"),),
    )
    for uncertain, blast in ((one, 2.0), (both, 3.0)):
        arrival = blast + 0.0092  # at 5.4 m
        seconds = flights_module.flight_seconds(
            uncertain.scene, SPEC, "scene.toml", Options()
        )
        assert arrival + 5.0 <= seconds < arrival + 5.1


@pytest.mark.slow  # two charges are a program for itself; test_never.py flies them
def test_a_charge_that_never_happens_changes_nothing(flights):
    never = Charge(mass_kg=5.0, position_m=(4.0, 0.0, 0.0), time_s=np.inf, name="b")
    both = scene(charge=Charge(mass_kg=1.0, name="a"), others=(never,))
    found = fly(both, SHORT)
    for name, flown in found.holds.items():
        expected = flights.holds[name]
        for here, there in zip(
            *map(jax.tree.leaves, (flown.metrics, expected.metrics)), strict=True
        ):
            np.testing.assert_allclose(here, there, rtol=1e-9)
        encounter = flown.encounter
        assert (float(encounter.arrival_s[1]), float(encounter.overpressure_pa[1])) == (
            np.inf,
            0.0,
        )
    said = warnings_of(found)
    assert [w for w in said if w not in warnings_of(flights)] == [
        "a blast does not occur: the time of its charge is infinite"
    ]
    assert any(
        row.split()[:2] == ["b", "never"] for row in flights_text(found).splitlines()
    )
    answer = flights_answer(found, scene="scene.toml", seed=0)
    assert answer.blasts[1].arrival_s == np.inf
    assert answer.to_dict()["blasts"][1]["arrival_s"] is None
    assert loads_figure(found) is not None
    seconds = [
        flights_module.flight_seconds(of.scene, SPEC, "scene.toml", Options())
        for of in (both, scene())
    ]
    assert seconds[0] == seconds[1]


def test_a_long_flight_has_as_fine_rows_as_a_short_one(monkeypatch):
    """Else its peak falls between two of them; then fewer vehicles fit in memory."""
    assert flights_module.rows_stored(6.0, 10) == 500
    for vehicles in (1, 10):
        assert 1000.0 / flights_module.rows_stored(1000.0, vehicles) <= 0.02
    monkeypatch.setitem(flights_module.CHUNK, "cpu", 20)
    sizes = []

    def noted(scenes, spec, hold, seconds, vehicles, options):
        sizes.append(scenes.charge.mass_kg.shape[0])
        raise InputError("enough")

    monkeypatch.setattr(flights_module, "flown_by", noted)
    uncertain = scene(beliefs={"charge_mass_kg": LogNormal(1.0, 1.5)})
    for seconds in (6.0, 100.0):
        with pytest.raises(InputError, match="enough"):
            fly(uncertain, Options(seconds=seconds), vehicles=20)
    assert sizes == [20, 2]


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
    made = Scene(charge=Charge(mass_kg=1.0, position_m=(-3.0, 0.0, 2.0), time_s=0.3))
    load = load_of(made, Profile(case[None]))
    level = jnp.array([0.0, 0.0, 0.0, 1.0])
    encounter = encounter_at(load, PLACE, level)
    assert float(encounter.arrival_s[0]) == pytest.approx(0.31)
    assert float(encounter.distance_m[0]) == pytest.approx(8.0)
    assert encounter.in_range.tolist() == [True]
    assert np.isnan(encounter.scaled_distance[0])


@pytest.mark.slow
def test_a_batch_flies_as_its_vehicles_alone(monkeypatch):
    """In two chunks, the last filled up; rounding in another order aside."""
    monkeypatch.setitem(flights_module.CHUNK, "cpu", 2)
    uncertain = scene(
        beliefs={
            "charge_mass_kg": LogNormal(1.0, 1.5),
            "charge_north_m": Normal(0.0, 1.0),
            "wind_east_m_s": Normal(0.0, 3.0),
        }
    )
    told = []
    options = dataclasses.replace(SHORT, seconds=0.5)
    listener = Listener()
    monkeypatch.setattr(listener, "heard", lambda: told.append(listener.words()))
    with heard_by(listener):
        flights = fly(uncertain, options, vehicles=3, seed=5)
    counts = ("0", "1", "2", "2", "3")  # each vehicle with two holds
    assert told == [f"{count} of 3 vehicles" for count in counts]
    for lane in range(3):
        values = {name: drawn[lane] for name, drawn in flights.drawn.items()}
        alone = UncertainScene(with_values(uncertain.scene, values))
        single = fly(alone, options)
        for name, flown in flights.holds.items():
            own = single.holds[name]
            found = flown.metrics, flown.encounter, flown.error_at_blast_m
            expected = own.metrics, own.encounter, own.error_at_blast_m
            for many, one in zip(
                jax.tree.leaves(found), jax.tree.leaves(expected), strict=True
            ):
                np.testing.assert_allclose(many[lane], one, rtol=1e-6, atol=1e-9)
