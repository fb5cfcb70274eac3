"""Flights past their edges: what breaks alone, and what jblast does."""

import numpy as np
import pytest

from jblast.verification.stability import (
    flights,
)
from jblast.verification.stability.failure import measures_of


def test_flights_are_entered_into_the_map():
    assert measures_of("flights") == (flights.flight_failures,)


def test_a_summed_clock_runs_away_in_single_precision_and_ours_does_not():
    summed, ours = flights.clock_errors(60.0)
    assert summed[-1] > 10 * flights.STEP
    # half a spacing of float32 below 64 s
    assert ours <= np.spacing(np.float32(59.0)) / 2


def test_a_quaternion_ends_where_its_square_does():
    # the square root of the least normal number, to the decade
    for dtype in (np.float32, np.float64):
        least = np.sqrt(float(np.finfo(dtype).tiny))
        assert 0.01 * least < flights.shortest_quaternion(dtype) < 10 * least


def test_a_stretch_that_dies_away_is_not_a_swing():
    early = np.array([[1e-6, 1e-15, 1e-6, 1.0]])
    late = np.array([[1e-9, 2e-15, 3e-6, 0.9]])
    found = flights.Swings(np.ones(1), early, late)
    # grown from rounding; grown; so large that it no longer grows
    assert found.up().tolist() == [[False, False, True, True]]


def test_plain_sums_round_a_fall_away_and_kept_ones_do_not():
    plain, ours = flights.falls()
    assert plain[-1] > flights.ALLOWED_M
    assert ours.max() < 20 * np.spacing(np.float32(26.0))  # it ends 26 m down


@pytest.mark.slow
def test_a_blast_keeps_its_impulse_at_steps_of_a_hundred_phases():
    ratio, bare, ours = flights.impulse_errors()
    assert ours.max() < 1e-3
    assert (bare[ratio > 1] > 0.5).all()


@pytest.mark.slow
def test_rk4_keeps_the_energy_of_a_tumble():
    rk4 = flights.tumble_drift()
    assert rk4[flights.RATES <= 10].max() < flights.DRIFT
    # fifth order in the rate: its own error, fourth, is in the phase
    last = np.diff(np.log(rk4))[-1] / np.diff(np.log(flights.RATES))[-1]
    assert last == pytest.approx(6, abs=0.5)


@pytest.mark.slow
def test_who_is_too_fast_is_lost_alone():
    lost, alike = flights.lost_speeds()
    assert alike
    assert not lost[::2].any()
    assert 0 < lost[1::2].sum() < 50


@pytest.mark.slow
def test_loads_are_finite_and_marked_where_laws_end():
    sizes, held = flights.near_impulses()
    assert np.isfinite(sizes).all()
    assert held.tolist() == (flights.NEAR_DISTANCES > 0.178).tolist()


@pytest.mark.slow
def test_held_vehicles_fly_on_up_to_a_charge_and_no_more():
    alive, peak = flights.fly_on()
    assert alive[:, 0].all()
    assert not alive[:, -1].any()
    for one, moved in zip(alive, peak, strict=True):
        assert (np.diff(moved[one]) > 0).all()


@pytest.mark.slow
def test_no_hold_swings_up_below_its_limit():
    up = flights.swings().up()
    assert not up[:, flights.SHARES < 0.995].any()
    # the limit of the crazyflie's is the loop's own: it is met to a hundredth
    assert up[flights.NAMES.index("crazyflie"), flights.SHARES > 1.015].all()
