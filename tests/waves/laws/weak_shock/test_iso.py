import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.registry import call, law_for
from jblast.scene import Air, Charge, Scene
from jblast.sensors.calculator import scene_path, with_rows
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_duration
from jblast.waves.laws.shock_kinematics import front_tail, shock_kinematics_pressure
from jblast.waves.laws.weak_shock import (
    weak_shock_iso_pressure,
    weak_shock_iso_valid,
)
from jblast.waves.propagation import iso_9613_absorption

both_bursts = pytest.mark.parametrize("burst", ["surface", "free-air"])
COLD = {"ambient_pressure": 8e4, "sound_speed": 330.0}
DRY = {"temperature": 288.15, "relative_humidity": 0.1}


def loss(z, mass, relative_humidity=0.5, burst="surface"):
    """Fraction of the pressure that is absorbed at sea level, at 15 C."""
    r = z * mass ** (1 / 3)
    law = weak_shock_iso_pressure(
        r, mass, relative_humidity=relative_humidity, burst=burst
    )
    return 1.0 - np.asarray(law / shock_kinematics_pressure(r, mass, burst=burst))


@both_bursts
def test_it_is_the_weak_shock_absorbed_as_a_tone_of_half_a_period(burst):
    mass, size = 3.0, (3.0 * 101_325.0 / 8e4) ** (1 / 3)
    z = np.array([25.0, 100.0, 900.0])
    first = kingery_bulmash_duration(20.0 * size, mass, **COLD, burst=burst)
    b = front_tail(burst).length
    duration = first * np.sqrt(np.log(z / b) / math.log(20.0 / b))
    alpha = iso_9613_absorption(1.0 / (2.0 * duration), 288.15, 8e4, 0.1)
    peak = shock_kinematics_pressure(z * size, mass, 8e4, burst)
    np.testing.assert_allclose(
        weak_shock_iso_pressure(z * size, mass, **COLD, **DRY, burst=burst),
        peak * np.exp(-alpha * (z - 20.0) * size),
        rtol=1e-12,
    )


@pytest.mark.parametrize(
    ("mass", "humidity", "percent"),
    [
        (1e-3, 0.5, (0.25, 0.77, 2.4)),
        (1e-3, 0.1, (0.75, 2.1, 5.8)),
        (1.0, 0.5, (0.13, 0.35, 0.97)),
        (1.0, 0.1, (0.32, 0.96, 2.9)),
        (15.0, 0.5, (0.06, 0.15, 0.41)),
        (15.0, 0.1, (0.22, 0.60, 1.7)),
    ],
)
def test_the_losses_are_the_printed_ones(mass, humidity, percent):
    got = 100.0 * loss(np.array([100.0, 300.0, 1000.0]), mass, humidity)
    # half of the last of two digits, 0.055 being printed as 0.06
    np.testing.assert_allclose(got, percent, rtol=0.025, atol=0.005)


@both_bursts
def test_nearer_than_20_nothing_is_absorbed(burst):
    assert loss(np.array([0.1, 5.0, 19.999]), 15.0, burst=burst).tolist() == [0, 0, 0]


def test_at_20_the_value_is_continuous_and_the_slope_little_changed():
    def log_law(log_z):
        return jnp.log(
            weak_shock_iso_pressure(0.1 * jnp.exp(log_z), 1e-3, relative_humidity=0.1)
        )

    ends = math.log(20.0) + np.array([-1e-9, 1e-9])
    value, slope = jax.vmap(jax.value_and_grad(log_law))(jnp.asarray(ends))
    assert float(value[1] - value[0]) == pytest.approx(0.0, abs=3e-9)  # slope -1.2
    # minus the absorption times the range, 2 m at 842 Hz
    assert float(slope[1] - slope[0]) == pytest.approx(-0.00318, abs=5e-6)


def test_what_absorption_breaks_is_the_scaling():
    # a charge a thousand times as heavy is ten times as low in pitch: less is lost
    small, large = loss(100.0, 1.0), loss(100.0, 1e3)
    assert small > 5.0 * large > 0.0
    # denser air with the same vapour in it absorbs more of this small charge's blast
    thin, dense = (
        weak_shock_iso_pressure(80.0, 1e-3 * k, k * 5e4, relative_humidity=0.1)
        for k in (1.0, 1.7)
    )
    assert float(dense / thin) / 1.7 == pytest.approx(0.9938, abs=5e-4)


def test_valid_from_20_to_300_and_to_five_kilometres():
    z = np.array([19.9, 20.1, 299.0, 301.0])
    assert weak_shock_iso_valid(z, 1.0).tolist() == [False, True, True, False]
    far = np.array([4_990.0, 5_010.0])
    assert weak_shock_iso_valid(far, 1e5).tolist() == [True, False]


def test_a_scene_gives_it_temperature_and_humidity():
    law = law_for("peak_overpressure_pa", "weak_shock_iso")
    r = jnp.array([2000.0, 2500.0])
    for air in (
        Air(temperature=300.0, relative_humidity=0.2),
        Air(altitude=3000.0, relative_humidity=0.8),
    ):
        path = scene_path(Scene(Charge(mass_kg=15.0), air=air))
        way = with_rows(path, r, jnp.full(2, 15.0))
        kelvin = 300.0 if air.altitude is None else 288.15 - 0.0065 * 3000.0
        expected = weak_shock_iso_pressure(
            r,
            15.0,
            path.ambient_pressure,
            path.sound_speed,
            kelvin,
            air.relative_humidity,
        )
        np.testing.assert_allclose(call(law.function, way), expected, rtol=1e-12)
