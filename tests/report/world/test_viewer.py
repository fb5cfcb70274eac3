"""The view of a run, read back from its file."""

import io
from itertools import pairwise

import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from jblast.errors import InputError
from jblast.report.exports.rerun import Viewer
from jblast.scene import Camera, Charge, Scene, Sensor, VehicleSpec, look_at
from jblast.study.running import (
    CameraEvents,
    Frames,
    Packet,
    RunDetection,
    Samples,
)
from jblast.study.thinning import extremes
from jblast.vehicle import Trajectory
from jblast.world import Perceived

rerun = pytest.importorskip("rerun")

SECONDS, PACKET_S, SPEED = 2.0, 0.2, 340.0
MOTION_HZ, SOUND_HZ, FRAMES_HZ = 1000, 8000, 100
WIDTH, HEIGHT = 32, 24
CHARGE = Charge(mass_kg=8.0, position_m=(30.0, 0.0, 0.0), time_s=0.5, name="1")
MIC = "mic 1/a"
"""With characters that a path of an entity escapes."""
PLOTS = r"/waveforms/mic\ 1\/a"
ARRIVAL_S = 0.6


def scene_of():
    """Return a scene with a vehicle, a camera, a microphone and a mounted sensor."""
    place = np.array([-20.0, 0.0, 5.0])
    turned = look_at(place, np.array([0.0, 0.0, 5.0]))
    focal, center = np.array([30.0, 30.0]), np.array([16.0, 12.0])
    camera = Camera(place, turned, focal, center, WIDTH, HEIGHT)
    sensors = (
        Sensor(MIC, (0.0, 30.0, 1.5), kind="microphone"),
        Sensor("imu", (np.nan,) * 3, kind="imu", mount="vehicle"),
    )
    vehicle = VehicleSpec("hummingbird", np.array([0.0, 0.0, 10.0]))
    return Scene(CHARGE, sensors=sensors, camera=camera, vehicle=vehicle)


def packet_of(start, end):
    """Return all that is recorded in an interval."""
    now, heard, exposed = (
        np.arange(round(start * rate), round(end * rate)) / rate
        for rate in (MOTION_HZ, SOUND_HZ, FRAMES_HZ)
    )
    zero = np.zeros((now.size, 3))
    position = np.stack([now, 0.0 * now, 10.0 + 0.0 * now], axis=1)
    turned = np.tile([0.0, 0.0, 0.0, 1.0], (now.size, 1))
    error = np.where(np.abs(now - ARRIVAL_S) < 1e-9, 0.7, 0.01 * now)
    force = np.stack([now, -now, 2.0 * now], axis=1)
    aim = position - np.stack([error, 0.0 * now, 0.0 * now], axis=1)
    rows = (now, position, zero, turned, zero, turned, force, zero, np.bool(False))
    motion = Trajectory(*map(jnp.asarray, (*rows, aim, position)))
    sound = np.where(np.abs(heard - ARRIVAL_S) < 1e-9, 100.0, np.sin(heard))
    levels = np.rint(100.0 * exposed).astype(np.uint8)[:, None, None, None]
    images = np.tile(levels, (1, HEIGHT, WIDTH, 3))
    first, inside = start == 0.0, start <= CHARGE.time_s < end
    events = CameraEvents(
        np.array([0.01, 0.02, 0.06] if first else []),
        np.array([3, 4, 5] if first else [], int),
        np.array([1, 1, 2] if first else [], int),
        np.array([1, -1, 1] if first else [], int),
    )
    found = (
        RunDetection(MIC, "sound", ARRIVAL_S, 1e-3, end, 9.0, "1", ARRIVAL_S),
        RunDetection(MIC, "sound", 0.65, 1e-3, end, 5.0, "", float("nan")),
    )
    return Packet(
        start,
        end,
        blasts=(CHARGE,) if inside else (),
        perceived=(Perceived("1", "camera", "flash", 0.5),) if inside else (),
        motion=motion,
        samples={
            MIC: Samples(start, float(SOUND_HZ), sound[:, None]),
            "imu": Samples(start, float(MOTION_HZ), np.zeros((now.size, 6))),
        },
        frames=Frames(exposed, lambda times: images),
        events=events,
        detections=found if start == 0.6 else (),
    )


@pytest.fixture(scope="module")
def packets():
    starts = np.round(np.arange(0.0, SECONDS, PACKET_S), 9)
    return [packet_of(float(s), float(np.round(s + PACKET_S, 9))) for s in starts]


def write(path, packets, **options):
    """Show all packets, and return the viewer."""
    viewer = Viewer(
        scene=scene_of(), sound_speed_m_s=SPEED, recording_id="r", save=path, **options
    )
    for packet in packets:
        viewer.take(packet)
    viewer.finish()
    return viewer


def read(path):
    """Return rows of time in s (None: always) and value, by entity and component."""
    found = {}
    for chunk in rerun.chunk.RrdReader(path).stream():
        assert set(chunk.timeline_names) <= {"time"}
        batch = chunk.to_record_batch()
        times = [None] * chunk.num_rows
        if chunk.timeline_names:
            nanoseconds = batch.column("time").cast("int64").to_pylist()
            times = [1e-9 * one for one in nanoseconds]
        for name, values in batch.to_pydict().items():
            if name not in ("time", "rerun.controls.RowId"):
                rows = found.setdefault((chunk.entity_path, name), [])
                rows += zip(times, values, strict=True)
    return found


@pytest.fixture(scope="module")
def data(tmp_path_factory, packets):
    path = tmp_path_factory.mktemp("run") / "run.rrd"
    write(path, packets)
    return read(path)


def series(data, path):
    """Return times [s] and values of a plot."""
    rows = data[path, "Scalars:scalars"]
    return np.array([time for time, _ in rows]), np.array([v for _, (v,) in rows])


def pictures(data, path):
    """Return times [s] and pixels of the pictures of an entity."""
    rows = data[path, "EncodedImage:blob"]
    images = [Image.open(io.BytesIO(bytes(blob))) for _, (blob,) in rows]
    return [t for t, _ in rows], [np.asarray(i.convert("RGB"), int) for i in images]


def test_a_plot_keeps_the_extremes_at_their_times(data):
    time, error = series(data, "/flight/path_error")
    # 200 columns a second, of 5 rows: the first and the last row of each
    assert time.size == 2 * 200 * SECONDS
    assert error.max() == 0.7
    assert time[error.argmax()] == pytest.approx(ARRIVAL_S)
    usual = error < 0.7
    np.testing.assert_allclose(error[usual], 0.01 * time[usual], atol=1e-12)
    for axis, factor in (("east", 1.0), ("north", -1.0), ("up", 2.0)):
        time, force = series(data, f"/flight/force/{axis}")
        assert time.size == 2 * 200 * SECONDS
        np.testing.assert_allclose(force, factor * time, atol=1e-9)


def test_a_waveform_contains_its_peak_and_the_marks_of_detections(data):
    time, sound = series(data, f"{PLOTS}/overpressure_pa")
    assert time.size <= 2 * 200 * SECONDS
    assert sound.max() == 100.0
    assert time[sound.argmax()] == pytest.approx(ARRIVAL_S)
    assert series(data, f"{PLOTS}/detections")[0] == pytest.approx([ARRIVAL_S])
    assert series(data, f"{PLOTS}/false_alarms")[0] == pytest.approx([0.65])


def test_camera_events_are_shown_at_the_end_of_their_interval(data):
    time, images = pictures(data, "/events")
    np.testing.assert_allclose(time, 0.05 * np.arange(1, 41), atol=1e-9)
    assert np.argwhere((images[0] != 150).any(axis=2)).tolist() == [[1, 3], [1, 4]]
    brighter, darker = images[0][1, 3], images[0][1, 4]
    assert brighter[0] > brighter[2]
    assert darker[0] < darker[2]
    assert np.argwhere((images[1] != 150).any(axis=2)).tolist() == [[2, 5]]
    assert all((image == 150).all() for image in images[2:])


def test_a_shock_front_grows_at_the_sound_speed_until_it_has_passed_all(data):
    rows = data["/world/shocks", "Ellipsoids3D:half_sizes"]
    np.testing.assert_allclose([t for t, _ in rows], 0.05 * np.arange(1, 41))
    # farthest is the camera
    farthest, shown = np.linalg.norm([50.0, 0.0, 5.0]), 0
    for time, sizes in rows:
        radius = SPEED * (time - CHARGE.time_s)
        if 1e-3 < radius < farthest:
            np.testing.assert_allclose(sizes, [[radius] * 3], rtol=1e-5)
            shown += 1
        else:
            assert sizes == []
    assert shown == 2


def test_the_path_is_continuous_and_follows_the_vehicle(data):
    strips = [strip for _, (strip,) in data["/world/path", "LineStrips3D:strips"]]
    assert len(strips) == SECONDS / PACKET_S
    for before, after in pairwise(strips):
        assert before[-1] == after[0]
    rows = data["/world/vehicle", "Transform3D:translation"]
    np.testing.assert_allclose([t for t, _ in rows], 0.02 * np.arange(100), atol=1e-9)
    np.testing.assert_allclose([p[0] for _, (p,) in rows], 0.02 * np.arange(100))


def test_a_mounted_sensor_is_shown_in_the_frame_of_the_vehicle(data):
    assert data["/world/vehicle/imu", "Points3D:positions"] == [(None, [[0.0] * 3])]
    # no unit fits all of the components of an IMU
    plots = [path for path, name in data if name == "Scalars:scalars"]
    assert not [path for path in plots if path.startswith("/waveforms/imu")]


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match=r"run\.rrd: expected a file to write"):
        write(tmp_path / "nowhere" / "run.rrd", [])


@pytest.mark.parametrize("count", [0, 1, 7, 10, 23])
def test_extremes_are_those_of_every_column(count):
    values = np.random.default_rng(count).normal(size=count)
    rows, size = extremes(values, 5), max(1, -(-count // 5))
    assert np.all(np.diff(rows) > 0)
    for start in range(0, count, size):
        inside = rows[(rows >= start) & (rows < start + size)]
        part = values[start : start + size]
        assert set(values[inside]) == {part.min(), part.max()}
