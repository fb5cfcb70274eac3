import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera.events.exact import implicit_times
from jblast.sensors.camera.events.ideal import ideal_events, log_intensity
from jblast.sensors.camera.events.scene import pixel_light, render_events
from jblast.sensors.camera.image import LUMINANCE
from jblast.sensors.camera.rendering import render

pytestmark = pytest.mark.slow  # one program, compiled for half a minute

WIDTH, HEIGHT = 10, 8
END = 0.25
CLOSE = 2e-9


def samples(fps):
    return np.linspace(0.0, END, round(fps * END) + 1)


@pytest.fixture(scope="module")
def camera():
    position = jnp.array([0.0, -80.0, 3.0])
    return Camera(
        position=position,
        quaternion=look_at(position, jnp.array([0.0, 0.0, 4.0])),
        focal=jnp.array([40.0, 40.0]),
        center=jnp.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        width=WIDTH,
        height=HEIGHT,
        threshold=jnp.array([0.2, 0.3]),
    )


@pytest.fixture(scope="module")
def scene():
    return Scene(Charge(mass_kg=100.0, position_m=(0.0, 0.0, 1.5), time_s=0.0103))


def fields(events):
    """Place, sign and time of the events, by pixel, sign and time."""
    count = int(events.count)
    x, y, sign, time = (
        np.asarray(field)[:count]
        for field in (events.x, events.y, events.polarity, events.time)
    )
    order = np.lexsort((time, sign, x, y))
    return np.stack([x, y, sign])[:, order], time[order]


@pytest.fixture(scope="module")
def solved(scene, camera):
    return render_events(scene, camera, samples(300))


def test_the_first_samples_do_not_decide_the_times(scene, camera, solved):
    known, when = fields(solved)
    assert (known[2] == 1).sum() > 300
    assert (known[2] == -1).sum() > 100
    assert when.min() > 0.0103
    where, time = fields(render_events(scene, camera, samples(30)))
    np.testing.assert_array_equal(where, known)
    np.testing.assert_allclose(time, when, rtol=0, atol=CLOSE)


def test_events_of_frames_come_nearer_by_the_square_of_their_interval(
    scene, camera, solved
):
    known, when = fields(solved)

    @jax.jit
    def of_frames(times):
        light = render(scene, camera, times) @ jnp.asarray(LUMINANCE)
        both = camera.threshold[0], camera.threshold[1]
        return ideal_events(log_intensity(light), times, both, capacity=1 << 13)

    middle = []
    for fps in (4000, 8000):
        where, time = fields(of_frames(jnp.asarray(samples(fps))))
        np.testing.assert_array_equal(where, known)
        middle.append(np.median(np.abs(time - when)))
    # 4, less what is too near to the flash for its second order
    assert middle[0] / middle[1] == pytest.approx(4.0, rel=0.3)
    assert middle[1] < 10e-6


def test_times_have_gradients_in_the_charge(scene, camera, solved):
    def moved(mass):
        charge = dataclasses.replace(scene.charge, mass_kg=jnp.asarray(mass))
        return dataclasses.replace(scene, charges=(charge,))

    def by_newton(mass):
        light = pixel_light(moved(mass), camera)
        return implicit_times(light, solved, 0.0, tuple(camera.threshold))

    _, slopes = jax.jvp(by_newton, (jnp.asarray(100.0),), (jnp.asarray(1.0),))
    places, sides = [], []
    for mass in (100.0 - 1e-3, 100.0 + 1e-3):
        where, time = fields(render_events(moved(mass), camera, samples(100)))
        places.append(where)
        sides.append(time)
    np.testing.assert_array_equal(*places)
    order = np.lexsort((solved.time, solved.polarity, solved.x, solved.y))
    numeric = (sides[1] - sides[0]) / 2e-3
    # times are good to 1e-9 s, and some are of pixels about to turn
    off = np.abs(np.asarray(slopes)[order] - numeric)
    assert np.quantile(off / np.abs(numeric), 0.9) < 1e-3
    assert np.median(np.abs(numeric)) > 1e-6


def test_nothing_before_the_background_and_nothing_below_the_ground(scene, camera):
    near = jnp.full((HEIGHT, WIDTH), 50.0)
    events = render_events(scene, camera, samples(100), depth=near)
    assert int(events.count) == 0
    buried = dataclasses.replace(
        scene, charges=(Charge(mass_kg=1.0, position_m=(0.0, 0.0, -20.0)),)
    )
    assert int(render_events(buried, camera, samples(100)).count) == 0
