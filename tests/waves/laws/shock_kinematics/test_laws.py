"""Pressure, speed and arrival of a shock: smooth, scaled, and in batches."""

import math
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import law_for
from jblast.waves.laws.shock_kinematics import JOIN, shock_kinematics_valid
from tests.waves.laws.shock_kinematics.cases import (
    BURSTS,
    FIRST,
    LAWS,
    both_bursts,
    log_law,
)

every_law = pytest.mark.parametrize("name", LAWS)


@cache
def compiled(name):
    return jax.jit(LAWS[name], static_argnames="burst")


@every_law
@both_bursts
def test_log_slopes_are_those_of_finite_differences(name, burst):
    law, h = log_law(name, burst), 1e-5
    log_z = np.linspace(math.log(0.01), math.log(1e5), 3001)
    for listed in (FIRST[burst], JOIN):
        log_z = log_z[np.abs(log_z - math.log(listed)) > 2 * h]
    above, _, below = law([log_z + h, log_z, log_z - h])[0]
    central = (above - below) / (2 * h)
    # Truncation h^2/6 times a third derivative below 100, rounding 4e-15 / h, and a
    # series whose derivative is 1e-8 off the 1/U that stands for it.
    np.testing.assert_allclose(law(log_z)[1], central, rtol=0, atol=1e-6)


@every_law
@both_bursts
@pytest.mark.parametrize("sides", [("join", -1), ("join", 1), ("first", 1)])
def test_log_slopes_at_listed_points_are_one_sided_differences(name, burst, sides):
    where, sign = sides
    point = math.log(JOIN if where == "join" else FIRST[burst])
    law, side = log_law(name, burst), 1e-5 * sign
    x = point + 1e-13 * (where == "first")  # on the valid side of the front's start
    (here, near, far), (slope, *_), _ = law([x, x + side, x + 2 * side])
    one_sided = (-3 * here + 4 * near - far) / (2 * side)
    # As above: second order in the step. At the first point ln has exponents of 20.
    assert slope == pytest.approx(one_sided, abs=1e-6)


@every_law
@both_bursts
def test_values_and_two_derivatives_are_finite_everywhere(name, burst):
    z = np.array([1e-3, 0.01, FIRST[burst], 1.0, JOIN, 1e3, 1e5, 1e8])
    for found in log_law(name, burst)(np.log(z)):
        assert np.isfinite(found).all()


@every_law
@both_bursts
def test_second_derivatives_are_those_of_finite_differences(name, burst):
    h, log_z = 1e-5, np.log([0.02, 0.1, 0.5, 3.0, 15.0, 25.0, 1e3])
    _, slopes, curvatures = log_law(name, burst)([log_z + h, log_z, log_z - h])
    central = (slopes[0] - slopes[2]) / (2 * h)
    # The slope of the arrival holds the series (error 1e-10) and its own derivative
    # 1/U (1e-8); rounding 1e-15 / h.
    np.testing.assert_allclose(curvatures[1], central, rtol=0, atol=1e-6)


@every_law
def test_a_batch_equals_its_loop_with_and_without_jit(name):
    law, jitted = LAWS[name], compiled(name)
    r, mass = np.geomspace(0.02, 3e5, 50), np.linspace(1.0, 20.0, 50)
    loop = [float(jitted(r_, w)) for r_, w in zip(r, mass, strict=True)]
    # The compiler may fuse and reorder: a few roundings of the exponent, up to 20.
    np.testing.assert_allclose(law(r, mass), loop, rtol=1e-13)
    np.testing.assert_allclose(jitted(r, mass), loop, rtol=1e-13)
    np.testing.assert_allclose(jax.jit(jax.vmap(law))(r, mass), loop, rtol=1e-13)


@every_law
def test_forward_and_reverse_mode_agree_under_jit(name):
    law = jax.jit(partial(LAWS[name], burst="free-air"))
    arguments = (30.0, 15.0, 9e4)
    forward = jax.jit(jax.jacfwd(law, (0, 1, 2)))(*arguments)
    reverse = jax.jit(jax.grad(law, (0, 1, 2)))(*arguments)
    np.testing.assert_allclose(forward, reverse, rtol=1e-13)


@settings(deadline=None)  # the first call compiles
@given(
    z=st.floats(0.02, 1e6),
    mass=st.floats(1e-2, 1e7),
    ambient=st.floats(2e4, 1.1e5),
    sound_speed=st.floats(280.0, 370.0),
    burst=st.sampled_from(BURSTS),
)
def test_sachs_scaling_brings_every_charge_to_one_kilogram(
    z, mass, ambient, sound_speed, burst
):
    size = (mass * STANDARD_PRESSURE / ambient) ** (1 / 3)
    ratio = sound_speed / STANDARD_SOUND_SPEED
    path = (z * size, mass, ambient)
    # Rounding of ln Z, up to 20 * 1e-16, times slopes up to 3, and of the exponents.
    for name, value, factor in (
        (
            "pressure",
            compiled("pressure")(*path, burst=burst),
            ambient / STANDARD_PRESSURE,
        ),
        (
            "shock_speed",
            compiled("shock_speed")(*path, sound_speed, burst=burst),
            ratio,
        ),
        (
            "arrival_time",
            compiled("arrival_time")(*path, sound_speed, burst=burst),
            size / ratio,
        ),
    ):
        assert float(value) == pytest.approx(
            math.exp(log_law(name, burst)(math.log(z))[0]) * factor, rel=1e-12
        )


@every_law
@both_bursts
def test_single_precision_keeps_five_digits(name, burst):
    z = jnp.geomspace(0.01, 1e5, 500)
    single = LAWS[name](z.astype("float32"), 1.0, burst=burst)
    assert single.dtype == jnp.float32
    # ln p reaches 20, where float32 is spaced by 2e-6; a few of these.
    np.testing.assert_allclose(single, LAWS[name](z, 1.0, burst=burst), rtol=1e-5)


@both_bursts
def test_it_is_valid_from_the_first_row_to_ten_thousand(burst):
    first = FIRST[burst]
    z = jnp.array([0.99 * first, 1.01 * first, 40.0, 400.0, 9.9e3, 1.01e4])
    valid = shock_kinematics_valid(z, 1.0, burst=burst)
    assert valid.tolist() == [False, True, True, True, True, False]


@pytest.mark.parametrize(
    ("quantity", "sd"), [("air_arrival_s", 0.01), ("peak_overpressure_pa", 0.10)]
)
def test_the_registry_knows_both_quantities_and_their_declared_scatter(quantity, sd):
    law = law_for(quantity, "shock_kinematics")
    assert law.scatter() == (sd, 0.0, sd)
    assert law.arguments()[:3] == ("slant_range", "charge_mass", "ambient_pressure")
    assert law.arguments()[-1] == "burst"
