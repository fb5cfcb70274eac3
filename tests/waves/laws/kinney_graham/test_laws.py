"""Laws of Kinney and Graham: slopes, scaling, batches and where they hold."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import law_for
from jblast.waves.laws import kinney_graham as kg
from jblast.waves.laws.shock_kinematics import (
    shock_kinematics_arrival_time,
    shock_kinematics_pressure,
)
from tests.tools.slopes import check_slopes

LAWS = {
    "pressure": kg.kinney_graham_pressure,
    "duration": kg.kinney_graham_duration,
    "impulse": kg.kinney_graham_impulse,
    "arrival_time": kg.kinney_graham_arrival_time,
    "shock_speed": kg.kinney_graham_shock_speed,
}
every_law = pytest.mark.parametrize("name", LAWS)


def test_far_away_the_pressure_is_one_over_the_distance():
    far = 808 / 4.5**2 * 0.048 * 0.32 * 1.35
    # what is left of the bend at 4.5: (4.5 / 1e5)^2
    assert float(kg.kinney_graham_pressure(1e5, 1.0)) == pytest.approx(
        far / 1e5 * STANDARD_PRESSURE, rel=1e-8
    )


@pytest.mark.parametrize(("z", "ratio"), [(100.0, 1.4), (500.0, 1.7)])
def test_far_away_the_pressure_is_above_a_weak_shock_as_the_docstring_says(z, ratio):
    ours = kg.kinney_graham_pressure(z, 1.0)
    weak = shock_kinematics_pressure(z, 1.0, burst="free-air")
    assert float(ours / weak) == pytest.approx(ratio, abs=0.05)


def test_past_seven_the_arrival_is_that_of_shock_kinematics_within_two_per_mille():
    z = jnp.geomspace(7.0, 1e4, 200)
    ours = kg.kinney_graham_arrival_time(z, 1.0)
    theirs = shock_kinematics_arrival_time(z, 1.0, burst="free-air")
    np.testing.assert_allclose(ours, theirs, rtol=2e-3)


def test_the_shock_speed_is_rankine_hugoniot():
    z = jnp.geomspace(0.05, 1e5, 100)
    relative = kg.kinney_graham_pressure(z, 1.0) / STANDARD_PRESSURE
    mach = kg.kinney_graham_shock_speed(z, 1.0) / STANDARD_SOUND_SPEED
    np.testing.assert_allclose(mach**2, 1 + 6 / 7 * relative, rtol=1e-13)


def test_the_derivative_of_the_arrival_is_one_over_the_shock_speed():
    slowness = jax.jit(
        jax.vmap(jax.grad(kg.kinney_graham_arrival_time), in_axes=(0, None, None, None))
    )
    distance = np.geomspace(0.07, 1e5, 60) * 2.0
    air = (8.0, STANDARD_PRESSURE, 331.0)
    speed = kg.kinney_graham_shock_speed(distance, *air)
    np.testing.assert_allclose(slowness(distance, *air) * speed, 1.0, rtol=1e-12)


@pytest.mark.slow
@every_law
def test_gradients_are_those_of_finite_differences_twice(name):
    law = LAWS[name]
    extra = () if name == "pressure" else (335.0,)

    def log_law(log_distance, log_mass):
        return jnp.log(law(jnp.exp(log_distance), jnp.exp(log_mass), 9e4, *extra))

    # All places in one, as numbers of their own. Steps of 1e-4: h^2/6 times a third
    # derivative of up to 1e3
    z = np.array([0.03, 0.09, 0.6, 4.0, 90.0])
    masses = np.full(z.size, math.log(8.0))
    at = np.log(2 * z), masses
    if name == "arrival_time":  # its rule of differentiation is our own
        check_grads(jax.jit(log_law), at, 2, atol=1e-4, rtol=1e-4)
    else:
        check_slopes(log_law, at, 2, atol=1e-4, rtol=1e-4)


@every_law
def test_sachs_scaling_brings_every_charge_to_one_kilogram(name):
    mass, ambient, sound_speed = 250.0, 6e4, 310.0
    size = (mass * STANDARD_PRESSURE / ambient) ** (1 / 3)
    p_factor, c_factor = ambient / STANDARD_PRESSURE, sound_speed / STANDARD_SOUND_SPEED
    factor = {
        "pressure": p_factor,
        "duration": size / c_factor,
        "impulse": p_factor * size / c_factor,
        "arrival_time": size / c_factor,
        "shock_speed": c_factor,
    }[name]
    extra = () if name == "pressure" else (sound_speed,)
    z = np.array([0.02, 0.3, 1.0, 8.0, 200.0])
    # rounding of ln Z times slopes up to 9
    np.testing.assert_allclose(
        LAWS[name](z * size, mass, ambient, *extra),
        LAWS[name](z, 1.0) * factor,
        rtol=1e-13,
    )


@every_law
def test_a_batch_equals_its_loop(name):
    z, mass = np.geomspace(0.02, 300.0, 30), np.linspace(1.0, 20.0, 30)
    loop = [float(LAWS[name](r, w)) for r, w in zip(z, mass, strict=True)]
    np.testing.assert_allclose(jax.jit(jax.vmap(LAWS[name]))(z, mass), loop, rtol=1e-12)


def test_each_quantity_says_where_it_holds():
    expected = {
        kg.kinney_graham_valid: (0.053, 40.0),
        kg.kinney_graham_duration_valid: kg.DURATION_COMPARES,
        kg.kinney_graham_arrival_valid: (0.06, 1e4),
    }
    for valid, (first, last) in expected.items():
        # 8 kg: twice as far
        distance = 2.0 * np.array(
            [0.99 * first, 1.01 * first, 0.99 * last, 1.01 * last]
        )
        assert valid(distance, 8.0).tolist() == [False, True, True, False]


def test_nothing_is_valid_on_the_surface():
    for valid in (
        kg.kinney_graham_valid,
        kg.kinney_graham_duration_valid,
        kg.kinney_graham_arrival_valid,
    ):
        assert bool(valid(10.0, 1.0, burst="free-air"))
        assert not bool(valid(10.0, 1.0, burst="surface"))


def test_a_charge_without_mass_is_refused():
    with pytest.raises(ValueError, match="charge_mass must be positive"):
        kg.kinney_graham_pressure(1.0, 0.0)


@pytest.mark.parametrize(
    ("quantity", "sd"),
    [
        ("air_arrival_s", 0.01),
        ("peak_overpressure_pa", 0.10),
        ("positive_impulse_pa_s", 0.10),
        ("positive_duration_s", 0.10),
        ("shock_speed_m_s", 0.01),
    ],
)
def test_the_registry_knows_each_quantity_and_its_declared_scatter(quantity, sd):
    law = law_for(quantity, "kinney_graham")
    assert law.scatter() == (sd, 0.0, sd)
    assert law.scatter_source == "declared"
    assert "burst" not in law.arguments()
    assert law.range.startswith("free air")
