import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera.explosion import ExplosionViews
from jblast.sensors.camera.files.backgrounds import background_frames
from jblast.sensors.camera.files.images import write_png
from jblast.sensors.camera.film import (
    LEFT,
    LIGHT_ERROR,
    STAMP_ERROR,
    Film,
    first_instants,
    subdivided,
)
from jblast.sensors.camera.pixel import NoiseModel, Pixel, noisy_pixel
from jblast.sensors.camera.scene_events import film_events
from jblast.sensors.camera.stream import event_stream, joined
from jblast.waves.fireball import fireball_duration

BOTH = (0.2, 0.3)
KEY = jax.random.key(0)


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


def test_times_are_within_the_bound_at_any_frame_rate():
    film = filmed(seconds=0.1)
    known, when = fields(film_events(film))
    assert known.shape[1] > 150
    for frames in (2, 400):
        times = np.linspace(film.times[0], film.times[-1], frames)
        other = dataclasses.replace(film, times=times)
        found, time = fields(film_events(other, bound_s=STAMP_ERROR))
        np.testing.assert_array_equal(found, known)
        assert np.quantile(np.abs(time - when), 1.0 - LEFT) < STAMP_ERROR


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


@pytest.mark.slow  # two films at a fine pace
def test_a_real_camera_s_times_are_within_the_bound_of_those_in_finer_light():
    """Its references are taken from the light: errors of one event move the next."""
    film = filmed(seconds=0.5)
    noise = NoiseModel(shot_hz=None)  # shot noise is drawn block by block
    pixel = noisy_pixel(KEY, (0.2, 0.2), noise, (15, 20))

    def real(bound, light_error):
        blocks = subdivided(film, 0.2, bound, light_error)
        return fields(event_stream(blocks, pixel))

    finer, when = real(0.2 * STAMP_ERROR, 0.01 * LIGHT_ERROR * 0.2)
    found, time = real(STAMP_ERROR, LIGHT_ERROR * 0.2)
    np.testing.assert_array_equal(found, finer)
    off = np.abs(time - when)
    assert off.size > 200
    assert np.quantile(off, 1.0 - LEFT) < STAMP_ERROR
    # by the bound of fixed levels alone most are farther off
    found, time = real(STAMP_ERROR, np.inf)
    assert found.shape != finer.shape or np.median(np.abs(time - when)) > STAMP_ERROR


def test_pictures_and_moving_backgrounds_are_looked_at_when_they_change(tmp_path):
    count = 4  # three frames at 10 Hz, and a blank one
    views = ExplosionViews(
        frames=jnp.zeros((1, count, 9, 9, 5), jnp.uint8),
        direction=np.array([[0.0, -1.0, 0.0]]),
        up=np.array([[0.0, 0.0, 1.0]]),
        radius=np.ones((1, count)),
        spread=np.tile([0.0, 1.0], (1, count, 1)),
        box=np.zeros((1, count, 4)),
        height=np.zeros(count),
        phase=0.1 * np.arange(count) / float(fireball_duration(15.0)),
        anchor=np.full((1, 2), 4.0),
        hot=False,
    )
    shown = filmed(views=views)
    # milliseconds apart: not exact to the microsecond of an ideal camera
    assert shown.stamp_error_s(noise=False) == STAMP_ERROR
    assert filmed().stamp_error_s(noise=True) == STAMP_ERROR
    assert filmed().stamp_error_s(noise=False) == 1e-6
    instants = first_instants(shown)
    for k in range(4):
        assert np.abs(instants - 2.0 - 0.1 * k).min() < 1e-9
    files = []
    for k in range(15):
        files.append(tmp_path / f"{k}.png")
        write_png(files[-1], np.full((15, 20, 3), 0.1 + 0.05 * k))
    film = filmed()
    pictures = background_frames(files, film.times - film.times[0], film.camera)
    film = dataclasses.replace(film, background=pictures)
    looked = first_instants(film)
    for time in film.times:
        assert np.abs(looked - time).min() < 1e-9
    # half way between two frames, before the blast is anywhere near the corner
    grey = film.light(np.array([2.0, 2.0 + 0.5 / 30.0, 2.0 + 1.0 / 30.0]))[:, 0, 0]
    np.testing.assert_allclose(grey[1], 0.5 * (grey[0] + grey[2]))
    assert grey[2] > 1.2 * grey[0]
