import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera.film import (
    LEFT,
    Film,
    subdivided,
)
from jblast.sensors.camera.pixel import Pixel
from jblast.sensors.camera.stream import event_stream, joined

BOTH = (0.2, 0.3)


def camera(width=20, height=15) -> Camera:
    position = jnp.array([0.0, -40.0, 2.0])
    return Camera(
        position=position,
        quaternion=look_at(position, jnp.array([0.0, 0.0, 4.0])),
        focal=jnp.full(2, 0.87 * width),
        center=jnp.array([(width - 1) / 2, (height - 1) / 2]),
        width=width,
        height=height,
        threshold=jnp.array(BOTH),
    )


SCENE = Scene(Charge(mass_kg=15.0, position_m=(0.0, 0.0, 1.0), time_s=2.0))


def filmed(fps=30.0, seconds=0.5, **options) -> Film:
    times = 2.0 + np.arange(round(seconds * fps)) / fps
    return Film(SCENE, camera(), times, **options)


def fields(parts):
    """Place and sign, and times, by pixel, sign and time."""
    events = joined(parts)
    order = np.lexsort((events.time, events.polarity, events.x, events.y))
    found = np.stack([events.x, events.y, events.polarity])[:, order]
    return found, events.time[order]


@pytest.mark.slow
def test_a_smaller_bound_takes_more_instants_and_is_kept():
    film = filmed(seconds=0.1)

    def at(bound):
        blocks = list(subdivided(film, 0.2, bound))
        times = np.concatenate([times for times, _ in blocks])
        assert (np.diff(times) > 0.0).all()
        assert times[0] == film.times[0]
        assert times[-1] == film.times[-1]
        assert {len(times) for times, _ in blocks[:-1]} <= {20}
        return len(times), fields(event_stream(blocks, Pixel(*BOTH)))

    (many, (known, when)), (few, (found, time)) = at(2e-6), at(1e-4)
    assert many > 2 * few
    np.testing.assert_array_equal(found, known)
    assert np.quantile(np.abs(time - when), 1.0 - LEFT) < 1e-4
