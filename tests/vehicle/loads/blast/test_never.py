"""A charge whose time is infinite gives a vehicle nothing, and silences no other."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Scene
from jblast.vehicle import BlastLoad, CustomProfile, blast_load, named, simulate
from jblast.vehicle.loads.impulse_table import custom_profile
from tests.vehicle.flights import at_hover

CRAFT = named("hummingbird")
REAL = Charge(mass_kg=2.0, time_s=0.01, name="real")
OTHER = Charge(mass_kg=5.0, position_m=(11.0, 2.0, 0.0), time_s=0.004, name="other")
NEVER = dataclasses.replace(OTHER, time_s=jnp.inf)
PLACE = np.array([5.0, 0.0, 4.0])
SECONDS, STEP = 0.05, 5e-4
SPAN = jnp.array(0.012), jnp.array(0.022)
"""Within which the front of the real charge comes."""
ALONE = Scene(dataclasses.replace(REAL, name=""))


def load(*others: Charge) -> BlastLoad:
    return blast_load(Scene(charges=(REAL, *others)))


def state():
    return dataclasses.replace(at_hover(CRAFT), position_m=jnp.asarray(PLACE))


def flown(loads, **options):
    options = {"duration_s": SECONDS, "step_s": STEP, **options}
    return simulate(CRAFT, state(), loads=(loads,), **options)


@pytest.mark.slow  # compiled for some 6 s; in the kernel it is asked by default
def test_it_is_as_if_it_were_not_there():
    expected = flown(blast_load(ALONE), store_every=100).velocity_m_s[-1]
    found = flown(load(NEVER), store_every=100).velocity_m_s[-1]
    moved = np.abs(np.asarray(expected)).max()
    np.testing.assert_allclose(found, expected, atol=1e-12 * moved)


@pytest.mark.parametrize(
    "dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)]
)
def test_in_the_kernel_too(dtype):
    start = jax.tree.map(lambda x: x.astype(dtype), state())
    options = {"duration_s": SECONDS, "step_s": STEP, "backend": "warp:cpu"}
    expected = simulate(CRAFT, start, loads=(blast_load(ALONE),), **options)
    found = simulate(CRAFT, start, loads=(load(NEVER),), **options)
    assert float(jnp.abs(expected.velocity_m_s[-1]).max()) > 0.4
    np.testing.assert_array_equal(found.lost, False)
    np.testing.assert_array_equal(found.velocity_m_s, expected.velocity_m_s)


@pytest.mark.slow  # compiled for some 10 s
def test_gradients_are_those_without_it_and_none_is_its_own():
    def told(scene):
        push, turn = blast_load(scene).impulse(*SPAN, state(), CRAFT)
        return jnp.sum(push * jnp.array([1.0, 2.0, 3.0])) + jnp.sum(turn)

    of_real, of_never = jax.jit(
        jax.grad(lambda a, b: told(Scene(charges=(a, b))), (0, 1))
    )(REAL, NEVER)
    expected = jax.jit(jax.grad(lambda a: told(Scene(a))))(ALONE.charge)
    for here, there in zip(*map(jax.tree.leaves, (of_real, expected)), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-9, atol=1e-15)
    assert [float(x) for x in jax.tree.leaves(of_never)] == [0.0] * 5
    assert abs(float(expected.mass_kg)) > 1e-6


def test_its_wave_never_comes_and_has_no_pressure():
    found = load(NEVER)
    place = jnp.asarray(PLACE)
    assert found.arrival_time_s(place)[1] == jnp.inf
    assert jnp.isfinite(found.arrival_time_s(place)[0])
    assert found.wave_of(found.blasts[1], place).peak == 0.0

    def peak(one):
        alone = blast_load(Scene(one))
        return alone.wave_of(alone.blasts[0], place).peak

    slopes = jax.jit(jax.grad(peak))(NEVER)
    assert all(float(x) == 0.0 for x in jax.tree.leaves(slopes))


@pytest.mark.slow
@pytest.mark.parametrize("field", ["time_s", "mass_kg", "impulse_mass_kg"])
def test_what_is_no_number_loses_the_vehicle_and_is_not_never(field):
    broken = load(OTHER)
    second = dataclasses.replace(broken.blasts[1], **{field: jnp.nan})
    broken = dataclasses.replace(broken, blasts=(broken.blasts[0], second))
    assert bool(flown(broken, backend="jax", store_every=100).lost)
    assert bool(flown(broken, backend="warp:cpu", store_every=100).lost)


def test_a_profile_of_a_charge_that_never_happens_gives_nothing():
    cases = np.array([[0.01, 5.0, 1.0, 0.5, 1.0, 2.0, 3.0, 0.1, 0.2, 0.3]])
    profile = custom_profile(cases, (0.0, 0.0, 0.0), time_s=np.inf)

    def given(profile: CustomProfile):
        push, turn = profile.impulse(jnp.asarray(0.0), jnp.asarray(1.0), state(), CRAFT)
        return jnp.sum(push) + jnp.sum(turn)

    value, slopes = jax.jit(jax.value_and_grad(given))(profile)
    assert value == 0.0
    assert all((np.asarray(x) == 0.0).all() for x in jax.tree.leaves(slopes))
