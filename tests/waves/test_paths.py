"""Paths, the weight of the free-air curves, scaling, and all laws of a quantity."""

import subprocess
import sys
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import DRY_AIR_GAS_CONSTANT, STANDARD_PRESSURE
from jblast.registry import call, law_for, total_scatter
from jblast.scene import Charge, Scene
from jblast.sensors.calculator import Rows, calculated_laws
from jblast.waves import evaluate, scaled_distance
from jblast.waves.height_of_burst import free_air_weight, image_range
from jblast.waves.paths import slant_range
from jblast.waves.scaling import (
    NUCLEAR_SCALED_METRES,
    log_sachs_length,
    sachs_distance_factor,
    sachs_time_factor,
    scaled_value,
)

PEAK = "peak_overpressure_pa"


def test_slant_range_is_the_length_of_the_difference_with_slope_zero_at_zero():
    place, other = jnp.array([1.0, 2.0, 3.0]), jnp.array([3.0, 5.0, 9.0])
    assert slant_range(place, other) == 7.0
    slopes = jax.grad(slant_range, argnums=(0, 1))
    unit = np.array([2.0, 3.0, 6.0]) / 7.0
    np.testing.assert_allclose(slopes(place, other), [-unit, unit], rtol=1e-15)
    np.testing.assert_array_equal(slopes(place, place), np.zeros((2, 3)))
    assert jnp.isnan(slant_range(place, place * jnp.nan))
    assert slant_range(np.array([0.0, 3.0]), np.array([4.0, 0.0])) == 5.0


def test_the_image_stands_as_far_below_the_ground():
    rng = np.random.default_rng(0)
    charge, sensor = rng.uniform(-30.0, 30.0, (2, 100, 3))
    charge[:, 2], sensor[:, 2] = rng.uniform(0.0, 30.0, (2, 100))
    image = charge * np.array([1.0, 1.0, -1.0])
    direct = np.linalg.norm(charge - sensor, axis=1)
    np.testing.assert_allclose(
        image_range(direct, charge[:, 2], sensor[:, 2]),
        np.linalg.norm(image - sensor, axis=1),
        rtol=1e-12,
    )


@pytest.mark.parametrize(
    ("height", "sensor", "weight"),
    [
        (12.0, 12.0, 1.0),  # 19.5 m more of way, 57 ms; a phase of 2.6 ms
        (12.0, 0.0, 0.0),  # on the ground both come at once
        (0.0, 12.0, 0.0),
        (-1.0, 12.0, 0.0),
        (2.0, 2.0, 1.0),  # 1.4 m more, 3.6 ms
        (0.5, 0.5, 0.0),  # 0.1 m more
    ],
)
def test_one_kilogram_at_five_metres(height, sensor, weight):
    # free air at Z = 5: a positive phase of 2.6 ms (README of the reference tables:
    # 1.69 ms at 1.42), the front at 380 m/s and slower
    assert free_air_weight(5.0, 1.0, height, sensor) == weight


def test_the_weight_rises_smoothly_from_half_a_phase_of_delay_to_a_whole_one():
    heights = np.linspace(0.0, 3.0, 3001)
    weights = free_air_weight(5.0, 1.0, heights, heights)
    assert np.all(np.diff(weights) >= 0.0)
    between = heights[(weights > 0) & (weights < 1)]
    # the way is h^2/2.5 m longer: the delay doubles where the height is 1.4 times
    assert between[-1] / between[0] == pytest.approx(2**0.5, rel=0.03)
    slope = jax.vmap(jax.grad(lambda h: free_air_weight(5.0, 1.0, h, h)))(heights)
    differences = np.gradient(weights, heights)
    np.testing.assert_allclose(slope[1:-1], differences[1:-1], atol=1e-3)
    assert slope[0] == 0.0
    assert np.abs(np.diff(slope)).max() < 0.05


def path(weight=0.0, **changes):
    scene = Scene(charges=(Charge(mass_kg=1.0, burst="surface"),))
    ranges = np.array([2.0, 20.0])
    rows = jax.tree.map(jnp.asarray, Rows(scene, ranges, np.ones(2)).path())
    return replace(rows, burst=None, free_air=weight, **changes)


def test_a_law_between_its_bursts_is_their_mean_and_not_valid():
    law = law_for(PEAK, "kingery_bulmash")
    low, free = (
        call(law.function, replace(path(), burst=b)) for b in ("surface", "free-air")
    )
    for weight in (0.0, 0.25, 1.0):
        value = call(law.function, path(weight))
        mean = weight * free + (1 - weight) * low
        np.testing.assert_allclose(value, mean, rtol=1e-14)
        assert bool(call(law.valid, path(weight)).all()) is (weight != 0.25)
    # valid in free air only, and for any burst
    for name, expected in (
        ("kinney_graham", [False, False, True]),
        ("acoustic", [False] * 3),
    ):
        named = law_for("air_arrival_s", name)
        valid = [bool(call(named.valid, path(w)).all()) for w in (0.0, 0.25, 1.0)]
        assert valid == expected


def test_all_laws_of_a_quantity_are_evaluated_as_each_alone():
    quantity = PEAK
    rows = replace(path(), burst="free-air")
    found = evaluate(quantity, rows)
    for n, name in enumerate(found.names):
        law = law_for(quantity, name)
        value = call(law.function, rows)
        np.testing.assert_allclose(found.value[n], value, rtol=1e-12)
        assert (
            found.valid[n].tolist()
            == jnp.broadcast_to(call(law.valid, rows), 2).tolist()
        )
        np.testing.assert_allclose(found.sd[n], total_scatter(law, rows), rtol=1e-12)


def test_numpy_and_jax_evaluate_the_same_laws_by_the_same_curves():
    """NumPy calls laws by their printed forms, JAX by tables within 1e-7 of them."""
    for weight in (0.0, 0.25, 1.0):  # of the curves of free air
        in_jax = path(weight)
        in_numpy = jax.tree.map(np.asarray, in_jax)
        for quantity in dict.fromkeys(law.quantity for law in calculated_laws()):
            found, expected = evaluate(quantity, in_numpy), evaluate(quantity, in_jax)
            assert isinstance(found.value, np.ndarray)
            np.testing.assert_allclose(found.value, expected.value, rtol=1e-6)
            np.testing.assert_array_equal(found.valid, expected.valid)
            np.testing.assert_allclose(found.sd, expected.sd, rtol=1e-6)


WITHOUT_JAX = """
import sys
import numpy as np
from jblast.constants import STANDARD_PRESSURE
from jblast.registry import LAWS
from jblast.waves import Path, evaluate
rows = Path(
    slant_range=np.array([2.0, 20.0]), ground_range=2.0, charge_mass=1.0,
    height_of_burst=0.0, ambient_pressure=STANDARD_PRESSURE, sound_speed=340.29,
    air_density=1.2, p_speed=5e3, sedov_gamma=1.4, time_since_detonation=1e-3,
    sensor_height=0.0, temperature=288.0, relative_humidity=0.5, toward_east=1.0,
    toward_north=1.0, toward_up=1.0, camera_focal=1e3,
)
for quantity in dict.fromkeys(quantity for quantity, _ in LAWS):
    assert np.isfinite(evaluate(quantity, rows).value).all(), quantity
print(evaluate("peak_overpressure_pa", rows).value[0].tolist())
assert not {"jax", "equinox"} & set(sys.modules)
"""


def test_all_laws_are_evaluated_without_jax():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_JAX], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    expected = evaluate(PEAK, replace(path(), burst="surface")).value[0]
    assert expected.tolist() == pytest.approx(eval(done.stdout), rel=1e-6)


def test_factors_have_the_exponents_of_hopkinson_and_sachs():
    assert scaled_distance(10.0, 8.0) == pytest.approx(5.0, rel=1e-15)
    eighth = sachs_distance_factor(1.0, STANDARD_PRESSURE / 8)
    assert eighth == pytest.approx(2.0, rel=1e-15)
    # formulas.md 8: S_t = S_d (288.15/T)^1/2, S_i = W^1/3 S_p^2/3 (288.15/T)^1/2
    mass, relative, kelvin = 50.0, 0.7, 260.0
    sound = (1.4 * DRY_AIR_GAS_CONSTANT * kelvin) ** 0.5
    air, warmth = relative * STANDARD_PRESSURE, (288.15 / kelvin) ** 0.5
    # the tabulated 340.29 m/s has five digits, sqrt(1.4 287.05 288.15) = 340.292
    assert sachs_time_factor(mass, air, sound) == pytest.approx(
        (mass / relative) ** (1 / 3) * warmth, rel=1e-5
    )
    length = log_sachs_length(mass, air)
    assert scaled_value("_pa_s", 0.0, length, 1.0, air, sound) == pytest.approx(
        mass ** (1 / 3) * relative ** (2 / 3) * warmth, rel=1e-5
    )
    # half a kiloton of TNT at its scaled metre is one nuclear kiloton at 79.37 m
    assert pytest.approx(0.5e6 ** (1 / 3), rel=1e-14) == NUCLEAR_SCALED_METRES
