import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.geometry import pixel_rays, surfaces_seen
from jblast.sensors.camera.surroundings import brightened, flash, lit_rows

SCENE = Scene(charge=Charge(mass_kg=15.0))
SIZE = 41, 30


def seen(aim):
    place = np.array([0.0, -40.0, 3.0])
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, aim])),
        focal=np.full(2, 40.0),
        center=np.array([14.5, 20.0]),
        width=SIZE[1],
        height=SIZE[0],
    )
    return surfaces_seen(pixel_rays(camera), image=False)


@pytest.mark.parametrize("aim", [3.0, 12.0, -12.0, 60.0])
def test_the_light_is_that_of_the_whole_image(aim):
    """At the horizon, above it, on the ground, into the sky."""
    surfaces, time = seen(aim), jnp.asarray(0.02)
    behind = jnp.asarray(np.random.default_rng(0).uniform(size=(*SIZE, 3)))
    gained = flash(SCENE, surfaces, time, Appearance())
    whole = behind * (1.0 + jnp.moveaxis(gained, 0, -1))
    found = brightened(behind, lit_rows(surfaces), SCENE, time, Appearance())
    np.testing.assert_allclose(found, whole, rtol=1e-14)
    assert bool((whole > behind).any()) == bool(surfaces.solid.any())


def test_sky_is_left_out_and_what_is_lit_is_not():
    surfaces = seen(8.0)
    part = lit_rows(surfaces)
    height = part.surfaces.solid.shape[0]
    assert height < SIZE[0] - 10
    assert int(part.surfaces.solid.sum()) == int(surfaces.solid.sum())
    rows = slice(int(part.first), int(part.first) + height)
    np.testing.assert_array_equal(part.surfaces.place, surfaces.place[:, rows])
