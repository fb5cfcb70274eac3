"""Frames made in batches are those that `render` makes one by one."""

import jax.numpy as jnp
import numpy as np
import pytest

from calibration.benchmark_views import batched, fire_window
from calibration.cases import BACKGROUND, filmed
from jblast.sensors.camera import explosion_views, render


@pytest.mark.slow  # three programs
def test_batches_show_what_render_shows():
    film = filmed(4, width=96, height=72, flash=False)
    views = explosion_views(towards=np.asarray(film.camera.position))
    expected = render(
        *(film.scene, film.camera, film.times),
        views=views,
        background=BACKGROUND,
        appearance=film.appearance,
    )
    rows, columns = fire_window(views, film)
    assert (rows.stop - rows.start) * (columns.stop - columns.start) < 96 * 72
    whole = batched(views, film, window=False)(jnp.asarray(film.times))
    np.testing.assert_allclose(whole, expected, atol=1e-9)
    found = batched(views, film)(jnp.asarray(film.times))
    assert found.shape == (4, 72, 96, 3)
    # how wide a pixel is on a picture is told in another cell of 16 pixels, a tenth of
    # the focal length from the other: by perspective its low pass is 1 % another
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=1e-4)
    assert np.ptp(np.asarray(found)) > 0.5
