"""Frames and events of a run, packet by packet, are those of a film."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Air, Camera, Charge, Scene
from jblast.scene.camera import FORWARD
from jblast.sensors.camera import film_events, joined, landscape
from jblast.sensors.camera.film import LEFT, RUN_ERROR, STAMP_ERROR, Film
from jblast.sensors.camera.geometry import CameraPath
from jblast.sensors.camera.pixel import NoiseModel
from jblast.sensors.camera.run_film import filmed_packets

HZ, BURST, KEY = 100.0, 0.2537, jax.random.key(0)
SCENE = Scene(
    (
        Charge(mass_kg=2.0, position_m=(-6.0, 40.0, 1.0), time_s=BURST, name="a"),
        Charge(mass_kg=5.0, position_m=(-8.0, 60.0, 1.0), time_s=0.05, name="b"),
        Charge(mass_kg=1.0, position_m=(0.0, -50.0, 1.0), time_s=0.02, name="behind"),
        Charge(mass_kg=1.0, position_m=(0.0, 50.0, 1.0), time_s=np.inf, name="never"),
    ),
    air=Air(wind_east=3.0),
)
LENS = {
    "focal": np.full(2, 90.0),
    "center": np.array([47.5, 39.5]),
    "width": 96,
    "height": 80,
}
CARRIED = Camera(
    position=np.array([0.1, 0.0, 0.0]),
    quaternion=np.array(FORWARD),
    mount="vehicle",
    **LENS,
)
PLACE = np.array([0.0, 0.0, 6.0])
BOUNDS = np.arange(5) / 10.0


def path():
    time = np.linspace(0.0, 1.0, 201)
    turn = np.pi / 4 + 0.02 * np.sin(7 * time)
    none, move = 0 * time, np.sin(5 * time)
    quaternion = np.stack([none, none, np.sin(turn), np.cos(turn)], axis=1)
    place = PLACE + np.stack([0.3 * move, 0.1 * move, 0.2 * move], axis=1)
    return CameraPath(*map(jnp.asarray, (time, place, quaternion)))


MOVING = Film(SCENE, CARRIED, np.arange(41) / HZ, landscape(), path=path())


def joined_packets(packets):
    """Return times of frames and the fields of the events of all packets."""
    times, events = zip(*packets, strict=True)
    columns = ((one.time, one.x, one.y, one.polarity) for one in events)
    return (np.concatenate(times), *map(np.concatenate, zip(*columns, strict=True)))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [None, NoiseModel(leak_hz=1.0)])
def test_the_division_into_packets_changes_nothing(noise):
    tenths = list(filmed_packets(MOVING, BOUNDS, noise=noise, key=KEY))
    for (frames, events), start, end in zip(tenths, BOUNDS, BOUNDS[1:], strict=False):
        assert len(frames) == 10
        for time in (frames, events.time):
            assert start - 1e-8 <= time.min() <= time.max() < end
        assert (np.diff(events.time) >= 0).all()
    assert sum(len(events.time) for _, events in tenths) > 1000
    whole, short = (
        joined_packets(filmed_packets(MOVING, bounds, noise=noise, key=KEY))
        for bounds in (BOUNDS[[0, -1]], np.linspace(0.0, 0.4, 97))
    )
    for cut in (joined_packets(tenths), short):
        for one, other in zip(cut, whole, strict=True):
            np.testing.assert_array_equal(one, other)


def by_pixel(time, x, y, sign):
    found = {}
    for when, *pixel, way in zip(time, x, y, sign, strict=True):
        found.setdefault(tuple(map(int, pixel)), []).append((when, int(way)))
    return found


@pytest.mark.slow
def test_events_are_those_of_the_film():
    """The same sequence in 99 % of the pixels, and the times within the bound."""
    known = joined(film_events(MOVING, bound_s=STAMP_ERROR))
    known = by_pixel(known.time, known.x, known.y, known.polarity)
    found = by_pixel(*joined_packets(filmed_packets(MOVING, BOUNDS))[1:])
    off, alike = [], 0
    for pixel, expected in known.items():
        seen = found.get(pixel, [])
        if [way for _, way in seen] == [way for _, way in expected]:
            alike += 1
            off += [a - b for (a, _), (b, _) in zip(seen, expected, strict=True)]
    assert len(off) > 5000
    assert alike >= 0.99 * len(known | found)
    assert np.quantile(np.abs(off), 1.0 - LEFT) < RUN_ERROR
