"""A charge beside a small array: its bearing, and its range where that has an end."""

from pathlib import Path

import numpy as np
import pytest

from jblast import read, read_scene
from jblast.inference.mode.range_profile import RangeProfile, range_profile
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import posterior_of
from jblast.sensors import layout_of

CASES = Path(__file__).parents[1] / "fitting" / "arrays"


@pytest.fixture(scope="module")
def ring():
    uncertain, log = read_scene(CASES / "free.toml"), read(CASES / "ring_40m.csv")
    layout = layout_of(log, uncertain.scene)
    laws = {"air_arrival_s": "kingery_bulmash"}
    return posterior_of(parameters_of(uncertain), layout, log, laws, "gaussian")


def at(posterior, **values):
    z = {"charge_mass_kg": 0.0, "origin_time_s": 1.06} | values
    return np.array([z[name] for name in posterior.parameters.names])


def test_a_ring_of_1_m_identifies_the_bearing_and_no_range(ring):
    found = range_profile(ring, at(ring, charge_east_m=18.0, charge_north_m=12.0))
    assert found is not None
    assert found.is_open
    k = found.likeliest()
    off = found.bearing[k] - np.arctan2(33.0, 22.0)
    assert abs(off) < 2 * found.bearing_sd[k] < np.radians(10)
    assert 2.0 < found.least_range() < np.hypot(33.0, 22.0)


def test_a_charge_within_the_layout_is_not_followed(ring):
    assert range_profile(ring, at(ring, charge_east_m=0.5, charge_north_m=0.5)) is None


def profile(density):
    ln = np.linspace(0.0, 5.0, 11)
    nothing = np.zeros_like(ln)
    z = np.stack([np.exp(ln), nothing], axis=1)
    return RangeProfile(
        np.exp(ln), density(ln), nothing, nothing, z, np.zeros((11, 2, 1))
    )


def test_a_density_that_falls_has_an_end_and_draws_of_it():
    found = profile(lambda ln: -0.5 * ((ln - 2.0) / 0.5) ** 2)
    assert not found.is_open
    drawn = np.log(found.draws(20_000, np.random.default_rng(0))[:, 0])
    # linear between ranges half an sd apart
    assert np.mean(drawn) == pytest.approx(2.0, abs=0.05)
    assert np.std(drawn) == pytest.approx(0.5, rel=0.15)


def test_a_density_without_an_end_has_a_least_range():
    found = profile(lambda ln: 3 * ln - 0.5 * np.exp(2 * (1.0 - ln)))
    assert found.is_open
    assert 1.0 < found.least_range() < np.e
