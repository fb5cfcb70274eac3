"""Each kind of number has its way to begin: prior, factor, place, clock."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.mode.starts import start_sd, starts
from jblast.parameters import PARAMETERS
from jblast.scene import LogNormal
from tests.catalogue import AROUND, BOTH, TRUTH
from tests.inference.shots import shot

KEY = jax.random.key(5)
COUNT = 4000
FREE = (*TRUTH, "charge_up_m", "air_sound_speed_m_s", "wind_east_m_s")
MIDDLE = np.mean(AROUND, axis=0)


@pytest.fixture(scope="module")
def posterior():
    return shot(AROUND, BOTH, free=FREE)


@pytest.fixture(scope="module")
def drawn(posterior):
    z = np.asarray(starts(KEY, posterior, COUNT))
    return dict(zip(posterior.parameters.names, z.T, strict=True))


def of(posterior, values):
    return dict(zip(posterior.parameters.names, np.asarray(values), strict=True))


@pytest.mark.parametrize("name", ["charge_mass_kg", "air_sound_speed_m_s"])
def test_a_free_positive_number_is_spread_by_its_factor(posterior, drawn, name):
    sd = of(posterior, start_sd(posterior))[name]
    known = {"charge_mass_kg": TRUTH["charge_mass_kg"]}  # as the scene has it
    middle = np.log(known.get(name, PARAMETERS[name].default))
    assert drawn[name][0] == pytest.approx(middle)
    assert drawn[name].mean() == pytest.approx(middle, abs=4 * sd / np.sqrt(COUNT))
    assert drawn[name].std() == pytest.approx(sd, rel=4 / np.sqrt(2 * COUNT))


def test_a_free_place_is_spread_about_the_sensors_and_the_ground(posterior, drawn):
    sds = of(posterior, start_sd(posterior))
    middles = dict(zip(("charge_east_m", "charge_north_m"), MIDDLE, strict=True))
    for name, middle in (*middles.items(), ("charge_up_m", 0.0)):
        assert drawn[name][0] == pytest.approx(middle)
        error = 4 * sds[name] / np.sqrt(COUNT)
        assert drawn[name].mean() == pytest.approx(middle, abs=error)
        assert drawn[name].std() == pytest.approx(sds[name], rel=4 / np.sqrt(2 * COUNT))


def test_a_prior_is_drawn_as_a_normal_of_its_coordinate(posterior):
    parameters = posterior.parameters
    beliefs = (LogNormal(20.0, 3.0), *parameters.beliefs[1:])
    parameters = dataclasses.replace(parameters, beliefs=beliefs)
    z = starts(KEY, dataclasses.replace(posterior, parameters=parameters), COUNT)
    assert z[0, 0] == 0
    assert float(jnp.mean(z[:, 0])) == pytest.approx(0, abs=4 / np.sqrt(COUNT))
    assert float(jnp.std(z[:, 0])) == pytest.approx(1, rel=4 / np.sqrt(2 * COUNT))


def test_a_free_clock_meets_the_median_reading_of_its_own_rows():
    names = [*TRUTH, "clock_offset_s.m1"]
    posterior = shot(AROUND, BOTH, free=names)
    z = starts(KEY, posterior, 20)
    residual = jax.vmap(lambda z: posterior.misfit(z).residual)(z)
    timed = np.isin(posterior.layout.quantity, "air_arrival_s")
    own = timed & np.isin(posterior.layout.clock, "m1")
    np.testing.assert_allclose(np.median(residual[:, own], axis=1), 0, atol=1e-12)
    others = timed & ~np.isin(posterior.layout.clock, "m1")
    np.testing.assert_allclose(np.median(residual[:, others], axis=1), 0, atol=1e-12)
