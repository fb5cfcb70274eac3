"""A magnetometer on a vehicle, and the field of the Earth's dipole."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.flight_sensors import (
    DIPOLE_GAUSS,
    Magnetometer,
    dipole_field,
    field_read,
)


def test_at_the_geomagnetic_pole_the_field_points_down_with_twice_its_moment():
    # the pole of 2025 as the British Geological Survey prints it: 80.8 N, 72.8 W
    east, north, up = dipole_field(80.8, -72.8)
    moment = float(np.linalg.norm(DIPOLE_GAUSS))
    assert up == pytest.approx(-2 * moment, rel=1e-5)
    # a tenth of a degree of latitude is all that is printed
    assert np.hypot(east, north) < 2 * moment * np.radians(0.1)


def test_across_from_the_pole_it_points_north_with_its_moment():
    found = dipole_field(80.8 - 90.0, -72.8)
    moment = float(np.linalg.norm(DIPOLE_GAUSS))
    np.testing.assert_allclose(found, [0, moment, 0], atol=2e-3 * moment)


def test_it_reads_the_field_along_the_bodys_axes_and_noise_of_its_size():
    magnetometer = Magnetometer(jnp.array([0.0, 0.2, -0.4]))
    quarter = jnp.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])  # ahead is north
    noise = jax.random.normal(jax.random.key(1), (20_000, 3))
    read = jax.vmap(lambda three: field_read(three, magnetometer, quarter))(noise)
    # one standard error is 0.00006 gauss
    np.testing.assert_allclose(np.mean(read, axis=0), [0.2, 0.0, -0.4], atol=3e-4)
    assert np.std(np.asarray(read)[:, 1]) == pytest.approx(
        float(magnetometer.noise), rel=0.02
    )
