"""Detectors of a run: sound and flashes, attributed to blasts."""

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import soundfile

from jblast.scene import Camera, Charge, Instrument, Scene, Sensor
from jblast.sensors.camera.geometry import CameraPath, carried_camera, project
from jblast.sensors.camera.image import linear_to_srgb
from jblast.signals import bank_of_pulses
from jblast.signals.flash import Flash
from jblast.signals.flash.fireball import Silhouette, growth
from jblast.study.run_detectors import RunDetectors
from jblast.study.running import Frames, Packet, Samples
from jblast.world import Arrivals
from tests.signals.flash.films import growing

RATE, FRAMES_HZ, PACKET_S, SECONDS, START_S = 8000.0, 100.0, 0.05, 6.0, 3.0
SHOTS = ("shot 1", "shot 2")
SOUNDS = Path(__file__).parents[2] / "calibration" / "data" / "sound"


@pytest.fixture(scope="module")
def scene():
    place, turn = np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 0.0, 1.0])
    camera = Camera(place, turn, np.full(2, 80.0), np.array([40.0, 30.0]), 80, 60)
    gate = np.array([0.0, 0.0, 1.0])
    ear = Sensor("gate", gate, kind="microphone", instrument=Instrument(RATE))
    geophone = Sensor("ground", (0.0, 0.0, 0.0), kind="geophone")
    return Scene(Charge(1.0, (50.0, 0.0, 0.0)), sensors=(ear, geophone), camera=camera)


def arrivals(air=(5.0, 7.5), ground=(np.inf, np.inf), flash=(4.9, 7.1)):
    """Of two blasts at the microphone and the camera."""
    times = {
        "air_arrival_s": np.array([air, (np.inf, np.inf)]),
        "ground_arrival_s": np.array([ground, (np.inf, np.inf)]),
        "flash_time_s": np.array([flash, flash]),
    }
    places = {wave: np.zeros((2, 2, 3)) for wave in times}
    return Arrivals(("gate", "camera"), times, places)


def run(detectors, sound, images=None):
    """All detections of a run in packets; the file's clock begins at `START_S`."""
    found, size, frames = [], round(PACKET_S * RATE), round(PACKET_S * FRAMES_HZ)
    for nth in range(round(SECONDS / PACKET_S)):
        start_s = START_S + nth * PACKET_S
        part = sound[nth * size :][:size, None]
        packet = Packet(start_s, start_s + PACKET_S)
        packet.samples = {
            "gate": Samples(start_s, RATE, part),
            "ground": Samples(start_s, RATE, 1e3 * part),
        }
        if images is not None:
            at = start_s + np.arange(frames) / FRAMES_HZ
            part = images[nth * frames :][:frames]
            packet.frames = Frames(at, lambda times, part=part: part)
        found += detectors.take(packet)
    return [*found, *detectors.finish()]


def sound_of(times, noise=0.02):
    sound = noise * np.random.default_rng(0).standard_normal(round(SECONDS * RATE))
    pulse = bank_of_pulses(RATE)[6]
    for time in times:
        at = round((time - START_S) * RATE)
        sound[at : at + pulse.size] += pulse / pulse.max()
    return sound


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_sounds_are_attributed_to_blasts_or_are_false_alarms(scene, noise):
    found = run(RunDetectors(scene, arrivals(), SHOTS), sound_of([5, 6.2, 7.5], noise))
    assert [(one.sensor, one.kind, one.shot) for one in found] == [
        ("gate", "sound", "shot 1"),
        ("gate", "sound", ""),
        ("gate", "sound", "shot 2"),
    ]
    for one, true_s in zip(found, (5.0, np.nan, 7.5), strict=True):
        np.testing.assert_equal(one.true_s, true_s)
    first = found[0]
    assert first.time_s == pytest.approx(5.0, abs=1e-3)
    assert 0 < first.sigma_s < 1e-3
    # twice the longest pulse, and a block
    assert 0.5 < first.latency_s < 0.8
    packets = (first.reported_s - START_S) / PACKET_S
    assert packets == pytest.approx(round(packets))


def test_a_wave_through_the_ground_is_no_false_alarm(scene):
    truth = arrivals(ground=(np.inf, 6.2))
    found = run(RunDetectors(scene, truth, SHOTS), sound_of([6.2]))
    assert [(one.kind, one.shot, one.true_s) for one in found] == [
        ("sound", "shot 2", 6.2)
    ]


def test_a_broken_microphone_ends_its_search(scene):
    sound = sound_of([5.0, 7.5])
    sound[round(3.5 * RATE) :] = np.nan
    found = run(RunDetectors(scene, arrivals(), SHOTS), sound)
    assert [one.shot for one in found] == ["shot 1"]


def film_of(light):
    values = np.round(255 * linear_to_srgb(light)).astype(np.uint8)
    return np.repeat(values[..., None], 3, axis=3)


@pytest.mark.slow
@pytest.mark.parametrize("radius_px", [2.5, 15.0])
def test_a_flash_is_seen_in_frames_of_8_bits(scene, radius_px):
    frames = round(SECONDS * FRAMES_HZ)
    _, light = growing(
        burst_s=1.9004, last=radius_px, frames=frames, rate=FRAMES_HZ, noise=0.002
    )
    detectors = RunDetectors(scene, arrivals(), SHOTS)
    found = run(detectors, sound_of([]), film_of(light))
    assert [(one.sensor, one.kind, one.shot) for one in found] == [
        ("camera", "flash", "shot 1")
    ]
    assert abs(found[0].time_s - 4.9004) < 3 * found[0].sigma_s < 0.02
    # 60 frames after the alarm
    assert 0.6 < found[0].latency_s < 0.75


def test_a_flash_has_its_direction_though_the_camera_turns(scene):
    time_s = np.linspace(0.0, 10.0, 201)
    yaw = 0.5 * 0.8 * time_s
    path = CameraPath(
        jnp.asarray(time_s),
        jnp.stack([2 * time_s, 0 * time_s, 3 + 0 * time_s], axis=1),
        jnp.stack([0 * yaw, 0 * yaw, np.sin(yaw), np.cos(yaw)], axis=1),
    )
    forward = np.array([-0.5, 0.5, -0.5, 0.5])
    camera = replace(
        scene.camera, position=np.zeros(3), quaternion=forward, mount="vehicle"
    )
    first_s, seen = 1.0, []
    # to the left of the vehicle, which has turned by 0.8 rad from east
    at = carried_camera(camera, path, jnp.asarray(first_s))
    place = np.asarray(at.position) + 30 * np.array([np.cos(0.9), np.sin(0.9), -0.1])
    for since_s in 0.01 * np.arange(1, 6):
        there = carried_camera(camera, path, jnp.asarray(first_s + since_s))
        x_px, y_px = np.asarray(project(there, place).pixel).tolist()
        seen.append(Silhouette(first_s + since_s, 3.0, x_px, y_px, 28.0, False))
    flash = Flash(9.0, 1.06, 101, growth(seen, first_s), tuple(seen), None)
    carried = replace(scene, camera=camera)
    found = RunDetectors(carried, arrivals(), SHOTS, path=path).direction(flash)
    assert found is not None
    # 0.04 rad of the turn are between first light and the last silhouette
    assert found.bearing_rad == pytest.approx(np.pi / 2 - 0.9, abs=2e-3)
    assert found.elevation_rad == pytest.approx(-np.arctan(0.1), abs=2e-3)
    assert RunDetectors(carried, arrivals(), SHOTS).direction(flash) is None
    # an edge of the image cuts it: its middle is not that of the fireball
    cut = flash._replace(silhouettes=(seen[0]._replace(y_px=2.0), *seen[1:]))
    assert RunDetectors(carried, arrivals(), SHOTS, path=path).direction(cut) is None


AMBIENT = "birds", "boat", "coffee_shop", "fireplace", "summer_night", "wind"


@pytest.mark.slow
@pytest.mark.parametrize("name", AMBIENT)
def test_blasts_in_recorded_ambient_sound_have_the_times_of_their_picks(scene, name):
    recorded, _ = soundfile.read(SOUNDS / f"ambient_{name}.ogg", always_2d=True)
    ambient = recorded[::2, 0][: round(SECONDS * RATE)]
    # three times as loud as the loudest ambient sound
    sound = 3.0 * sound_of([5.0, 7.5], noise=0.0) + ambient / np.abs(ambient).max()
    found = run(RunDetectors(scene, arrivals(), SHOTS), sound)
    # what a recording begins with is judged by the noise of its first second
    found = [one for one in found if one.time_s > START_S + 1.0]
    # a bird that is 15 dB louder follows the second blast within 0.1 s
    assert [one.shot for one in found] == ["shot 1", "shot 2"][: 1 + (name != "birds")]
    for one in found:
        assert abs(one.time_s - one.true_s - 0.5 / RATE) < 3 * one.sigma_s < 1e-3


def test_the_edge_of_a_bright_sky_is_no_flash(scene):
    frames = round(SECONDS * FRAMES_HZ)
    # the horizon before a camera that turns and shakes, by up to 20 px a frame
    edge = np.random.default_rng(0).uniform(20.0, 40.0, (frames, 1, 1))
    light = np.where(np.arange(60)[:, None] < edge, 0.9, 0.1) * np.ones((1, 1, 80))
    assert (
        run(RunDetectors(scene, arrivals(), SHOTS), sound_of([]), film_of(light)) == []
    )
