"""Laws of Kingery and Bulmash: smooth, finite, scaled by charge and air."""

import math
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.registry import law_for
from jblast.waves.laws import kingery_bulmash as kb
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from tests.tools.slopes import with_slopes
from tests.waves.laws.kingery_bulmash.curves import LAWS

BURSTS = ("surface", "free-air")
every_law = pytest.mark.parametrize("quantity", LAWS)
both_bursts = pytest.mark.parametrize("burst", BURSTS)


@cache
def log_law(quantity, burst):
    """Give ln y of ln Z, at 1 kg in standard air, its slope and its curvature."""
    return with_slopes(
        lambda log_z: jnp.log(LAWS[quantity](jnp.exp(log_z), 1.0, burst=burst))
    )


@both_bursts
def test_the_shock_speed_is_rankine_hugoniot_past_a_scaled_distance_of_one(burst):
    # reference README: within 0.5 % for Z >= 1.
    z = jnp.geomspace(1.0, 40.0, 100)
    relative = kb.kingery_bulmash_pressure(z, 1.0, burst=burst) / STANDARD_PRESSURE
    speed = STANDARD_SOUND_SPEED * jnp.sqrt(1 + 6 / 7 * relative)
    np.testing.assert_allclose(
        kb.kingery_bulmash_shock_speed(z, 1.0, burst=burst), speed, rtol=6e-3
    )


@pytest.mark.slow
@every_law
@both_bursts
def test_log_slopes_are_those_of_finite_differences(quantity, burst):
    law, h = log_law(quantity, burst), 3e-6
    curve = kingery_bulmash_curve(quantity, burst)
    log_z = np.linspace(math.log(0.01), math.log(1e5), 3001)
    for end in (curve.z_min, curve.z_max):  # listed points: the curvature jumps
        log_z = log_z[np.abs(log_z - math.log(end)) > 2 * h]
    values, slopes, _ = law([log_z + h, log_z, log_z - h])
    central = (values[0] - values[2]) / (2 * h)
    # Rounding 1e-15 / 6e-6 = 2e-10; truncation h^2/6 times a third derivative of up to
    # 60 * jump / width^3 = 1e4 in a blend: 2e-8.
    np.testing.assert_allclose(slopes[1], central, rtol=0, atol=1e-6)


@every_law
@both_bursts
def test_log_slopes_at_the_ends_of_the_table_are_the_same_from_both_sides(
    quantity, burst
):
    law, h = log_law(quantity, burst), 1e-5
    curve = kingery_bulmash_curve(quantity, burst)
    for end in (curve.z_min, curve.z_max):
        x = math.log(end)
        for side in (-h, h):
            # One-sided differences of second order: h^2 times a third derivative of
            # up to 1e3, rounding 4e-15 / 1e-5.
            (here, near, far), (slope, *_), _ = law([x, x + side, x + 2 * side])
            one_sided = (-3 * here + 4 * near - far) / (2 * side)
            assert one_sided == pytest.approx(slope, abs=1e-6)


@every_law
@both_bursts
def test_everything_is_finite_far_outside_the_table(quantity, burst):
    curve = kingery_bulmash_curve(quantity, burst)
    z = np.array([1e-3, 1e-2, curve.z_min, 40.0, 1e3, 1e6])
    for found in log_law(quantity, burst)(np.log(z)):
        assert np.isfinite(found).all()
    gradient = jax.vmap(jax.grad(lambda z: LAWS[quantity](z, 1.0, burst=burst)))
    assert np.isfinite(jax.jit(gradient)(z)).all()


@every_law
def test_past_the_table_the_log_slope_stays(quantity):
    _, slopes, _ = log_law(quantity, "surface")(np.log([40.0, 1e5, 1e-3, 1e-2]))
    assert slopes[1] == pytest.approx(slopes[0], rel=1e-12)
    assert slopes[3] == pytest.approx(slopes[2], rel=1e-12)


@every_law
@both_bursts
def test_second_derivatives_are_those_of_finite_differences(quantity, burst):
    law, h = log_law(quantity, burst), 1e-5
    # Spread over the table, two of them within blends.
    log_z = np.log([0.2, 0.5, 0.79, 0.96, 1.02, 2.3, 7.0, 30.0])
    _, slopes, curvatures = law([log_z + h, log_z, log_z - h])
    central = (slopes[0] - slopes[2]) / (2 * h)
    # h^2/6 times a fourth derivative of up to 360 * jump / width^4 = 1e6: 2e-5.
    np.testing.assert_allclose(curvatures[1], central, rtol=0, atol=1e-4)


@every_law
def test_a_batch_equals_its_loop_with_and_without_jit(quantity):
    law = LAWS[quantity]
    z = np.geomspace(0.02, 300.0, 50)
    mass = np.linspace(1.0, 20.0, 50)
    loop = [float(law(r, w)) for r, w in zip(z, mass, strict=True)]
    # The compiler may fuse and reorder: a few roundings of the exponent, up to 20.
    np.testing.assert_allclose(law(z, mass), loop, rtol=1e-13)
    np.testing.assert_allclose(jax.jit(law)(z, mass), loop, rtol=1e-13)
    np.testing.assert_allclose(jax.jit(jax.vmap(law))(z, mass), loop, rtol=1e-13)


@settings(deadline=None)  # the first call compiles
@given(
    z=st.floats(0.02, 200.0),
    mass=st.floats(1e-2, 1e7),
    ambient=st.floats(2e4, 1.1e5),
    sound_speed=st.floats(280.0, 370.0),
    burst=st.sampled_from(BURSTS),
)
def test_sachs_scaling_brings_every_charge_to_one_kilogram(
    z, mass, ambient, sound_speed, burst
):
    size = (mass * STANDARD_PRESSURE / ambient) ** (1 / 3)
    p_factor, c_factor = ambient / STANDARD_PRESSURE, sound_speed / STANDARD_SOUND_SPEED
    t_factor = size / c_factor
    path = (z * size, mass, ambient)
    # Rounding of ln Z, up to 7 * 1e-16, times slopes up to 5, and of large exponents.
    for name, factor in {
        "incident_pressure": p_factor,
        "reflected_pressure": p_factor,
    }.items():
        assert LAWS[name](*path, burst) == pytest.approx(
            float(LAWS[name](z, 1.0, burst=burst)) * factor, rel=1e-12
        )
    for name, factor in {
        "incident_impulse": p_factor * t_factor,
        "reflected_impulse": p_factor * t_factor,
        "positive_phase_duration": t_factor,
        "arrival_time": t_factor,
        "shock_front_velocity": c_factor,
    }.items():
        assert LAWS[name](*path, sound_speed, burst) == pytest.approx(
            float(LAWS[name](z, 1.0, burst=burst)) * factor, rel=1e-12
        )


@every_law
@both_bursts
def test_single_precision_keeps_five_digits(quantity, burst):
    z = jnp.geomspace(0.01, 1e5, 500)
    single = LAWS[quantity](z.astype("float32"), 1.0, burst=burst)
    assert single.dtype == jnp.float32
    double = LAWS[quantity](z, 1.0, burst=burst)
    # The logarithm of a value reaches 25, where float32 is spaced by 2e-6; a few.
    np.testing.assert_allclose(single, double, rtol=1e-5)


def test_nothing_is_valid_past_40_nor_below_the_first_row():
    surface = {0.06: False, 0.07: True, 39.9: True, 40.1: False}
    for z, valid in surface.items():
        assert bool(kb.kingery_bulmash_valid(z, 1.0)) is valid
    assert bool(kb.kingery_bulmash_valid(0.06, 1.0, burst="free-air"))
    assert not kb.kingery_bulmash_duration_valid(0.17, 1.0)
    assert kb.kingery_bulmash_duration_valid(0.18, 1.0)
    assert not kb.kingery_bulmash_duration_valid(0.14, 1.0, burst="free-air")
    assert kb.kingery_bulmash_duration_valid(0.15, 1.0, burst="free-air")
    assert not kb.kingery_bulmash_duration_valid(40.1, 1.0)


def test_the_range_counts_scaled_metres():
    # 100 m of 1 t is Z = 10; of 1 kg it is 100; of 1 kg in an eighth of the air, 50.
    assert kb.kingery_bulmash_valid(100.0, 1e3)
    assert not kb.kingery_bulmash_valid(100.0, 1.0)
    assert kb.kingery_bulmash_valid(70.0, 1.0, STANDARD_PRESSURE / 8)


def test_an_unknown_burst_is_named():
    with pytest.raises(ValueError, match="burst must be 'surface' or 'free-air'"):
        kb.kingery_bulmash_pressure(1.0, 1.0, burst="underwater")


@pytest.mark.parametrize(
    ("quantity", "sd"),
    [
        ("air_arrival_s", 0.01),
        ("peak_overpressure_pa", 0.10),
        ("positive_impulse_pa_s", 0.10),
        ("positive_duration_s", 0.10),
        ("reflected_pressure_pa", 0.10),
        ("reflected_impulse_pa_s", 0.10),
    ],
)
def test_the_registry_knows_each_quantity_and_its_declared_scatter(quantity, sd):
    law = law_for(quantity, "kingery_bulmash")
    assert law.scatter() == (sd, 0.0, sd)
    assert law.scatter_source == "declared"
    assert law.arguments()[:2] == ("slant_range", "charge_mass")
    assert law.arguments()[-1] == "burst"
