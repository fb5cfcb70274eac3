"""Looking for fireballs in a window shows what looking everywhere does."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera import Appearance, pixel_rays
from jblast.sensors.camera.fireball import fireballs_in_window, fireballs_seen

PLACE = np.array([0.0, -60.0, 2.0])
APPEARANCE = Appearance()


def camera(aim, focal=130.0, **said) -> Camera:
    return Camera(
        position=PLACE,
        quaternion=look_at(PLACE, np.array(aim)),
        focal=np.array([focal, focal]),
        center=np.array([64.0, 48.0]),
        width=129,
        height=97,
        **said,
    )


CAMERAS = {
    "in the middle": camera([0.0, 0.0, 3.0]),
    "at the edge": camera([29.0, 0.0, 3.0]),
    "in a corner": camera([-29.0, 0.0, 22.0]),
    "larger than the window": camera([0.0, 0.0, 3.0], focal=900.0),
    "behind the camera": camera([0.0, -120.0, 3.0]),
    "far, a few pixels": camera([0.0, 0.0, 3.0], focal=8.0),
}
FAR = Scene(
    (
        Charge(10.0, (0.0, 0.0, 0.0), 0.1, name="a"),
        Charge(1.0, (14.0, 5.0, 0.0), 0.2, name="b"),
        Charge(1.0, (0.0, 0.0, 0.0), np.inf, name="c"),
    ),
)


@jax.jit
def both(scene, rays, time):
    return (
        fireballs_seen(scene, rays, time, APPEARANCE),
        fireballs_in_window(scene, rays, time, APPEARANCE),
    )


@pytest.mark.parametrize("time", [0.05, 0.3])
@pytest.mark.parametrize("name", CAMERAS)
def test_it_shows_what_looking_everywhere_does(name, time):
    whole, part = both(FAR, pixel_rays(CAMERAS[name]), jnp.asarray(time))
    # the same numbers; another program may round them otherwise
    np.testing.assert_allclose(part, whole, rtol=1e-9, atol=1e-12)
