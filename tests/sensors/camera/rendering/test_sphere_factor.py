import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.sensors.camera.geometry import Surfaces
from jblast.sensors.camera.surroundings import sphere_factor


@jax.jit
def factor(offset, radius=1.0, tilt=0.0):
    """Of a sphere at an offset, for a surface that leans to the east."""
    normal = jnp.stack([jnp.sin(tilt), 0.0 * tilt, jnp.cos(tilt)])
    at = Surfaces(jnp.zeros((3, 1, 1)), normal[:, None, None], jnp.ones((1, 1), bool))
    return sphere_factor(jnp.asarray(offset, float), jnp.asarray(radius), at)[0, 0]


def integral(offset, tilt):
    """Sum over 2000 x 2000 directions of the hemisphere, of equal factors."""
    parts = (np.arange(2000) + 0.5) / 2000
    square, turn = np.meshgrid(parts, 2 * np.pi * parts)
    away = np.sqrt(square)
    x, y, z = away * np.cos(turn), away * np.sin(turn), np.sqrt(1 - square)
    east = np.cos(tilt) * x + np.sin(tilt) * z
    up = -np.sin(tilt) * x + np.cos(tilt) * z
    along = offset[0] * east + offset[1] * y + offset[2] * up
    met = (along > 0) & (np.sum(np.square(offset)) - along**2 < 1.0)
    return met.mean()


@pytest.mark.parametrize(
    ("offset", "tilt"),
    [
        ((2.0, 1.0, 1.5), 0.0),
        ((1.2, 0.0, 0.3), 0.0),
        ((1.2, 0.4, -0.3), 0.0),
        ((3.0, 0.0, 0.1), 0.7),
        ((-1.5, 0.2, 0.9), 0.4),
    ],
)
def test_it_is_the_part_of_the_hemisphere_weighed_by_the_cosine(offset, tilt):
    # the edge of the sphere goes through some 6000 of 4e6 cells
    expected = integral(np.array(offset), tilt)
    assert float(factor(offset, tilt=tilt)) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("far", [1.5, 4.0, 100.0])
def test_a_sphere_seen_whole_falls_with_the_square_and_the_cosine(far):
    angle = 0.5 * np.arccos(1.0 / far)
    offset = far * np.array([np.sin(angle), 0.0, np.cos(angle)])
    expected = np.cos(angle) / far**2
    assert float(factor(offset)) == pytest.approx(expected, rel=1e-12)


def test_on_its_surface_and_within_it_depends_on_the_angle_alone():
    for length in (1.0, 0.5, 1e-3):
        for cosine in (-0.8, 0.0, 0.6):
            sine = np.sqrt(1 - cosine**2)
            offset = length * np.array([sine, 0.0, cosine])
            found = float(factor(offset))
            assert found == pytest.approx(0.5 + 0.5 * cosine, abs=1e-7)


@pytest.mark.parametrize(
    "offset", [(2.0, 1.0, 1.5), (1.2, 0.0, 0.3), (1.2, 0.4, -0.3), (0.1, 0.2, 0.3)]
)
def test_slopes_are_those_of_differences(offset):
    numbers = jnp.array([*offset, 1.0])

    def of(values):
        return factor(values[:3], values[3])

    slope, step = np.asarray(jax.grad(of)(numbers)), 1e-6
    for n in range(4):
        ends = [float(of(numbers.at[n].add(side * step))) for side in (-1, 1)]
        assert slope[n] == pytest.approx(np.diff(ends)[0] / (2 * step), abs=1e-7)


def test_slopes_are_numbers_everywhere():
    places = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (2.0, 0.0, 1.0)]
    for place in [*places, (2.0, 0.0, -1.0), (0.0, 0.0, -1.0)]:
        for radius in (0.0, 1.0):
            slope = jax.grad(factor, (0, 1))(jnp.array(place), radius)
            assert np.isfinite(np.concatenate([slope[0], slope[1][None]])).all()
