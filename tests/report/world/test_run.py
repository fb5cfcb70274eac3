"""A run in packets: what is written does not depend on who watches."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.posterior.parameters import Estimate
from jblast.missions import grid_plan, write_plan
from jblast.report.exports.rerun import Viewer
from jblast.report.exports.ros_bag import RosBag
from jblast.report.world import FitRow, run_world
from jblast.scene import Place
from jblast.sensors.listening import packets
from jblast.study.run_files import frames_in_view
from jblast.study.running import (
    packets_of,
    prepare_run,
    record_run,
)

HOVERING = """
[world]
count = 2
region_m = { ring = [15, 20] }
about = "vehicle"
time_s = [0.3, 0.9]
gap_s = 0.2
mass_kg = 0.5
[vehicle]
model = "crazyflie"
position_m = [0, 0, 8]
[[sensor]]
name = "mic"
kind = "microphone"
mount = "vehicle"
rate_hz = 8000
noise_pa = 0.1
[[sensor]]
name = "wind"
kind = "anemometer"
mount = "vehicle"
rate_hz = 500
clock_offset_s = 0.25
[[sensor]]
name = "imu"
kind = "imu"
mount = "vehicle"
rate_hz = 250
[camera]
position_m = [0, -60, 3]
look_at_m = [0, 0, 3]
width = 48
height = 24
focal_px = 30
frames_hz = 50
[law]
scatter = false
"""
MISSION = """
[world]
count = 2
region_m = { ring = [8, 12] }
about = "world"
time_s = [6, 14]
gap_s = 2
mass_kg = 0.2
[vehicle]
model = "crazyflie"
mission = "short.plan"
[[sensor]]
name = "mic"
kind = "microphone"
mount = "vehicle"
rate_hz = 4000
"""
SECONDS = 2.3
"""No whole number of packets."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def scene(folder):
    path = folder / "hovering.toml"
    path.write_text(HOVERING)
    return path


@pytest.fixture(scope="module")
def run(scene):
    return prepare_run(scene, seconds=SECONDS, seed=4)


@pytest.fixture(scope="module")
def parts(run):
    return [*packets_of(run)]


@pytest.mark.slow
def test_frames_are_stored_while_a_fireball_is_in_view(run):
    stored = frames_in_view(run, run.film)
    assert 2 < stored.size < run.film.times.size
    behind = replace(run, unseen=run.world.shots)
    np.testing.assert_array_equal(frames_in_view(behind, run.film), [0, 1])


def files_of(path: Path) -> dict[str, bytes]:
    """Contents of all files; of run.json without its date and command."""
    found = {
        str(one.relative_to(path)): one.read_bytes()
        for one in sorted(path.rglob("*"))
        if one.is_file()
    }
    document = json.loads(found.pop("run.json"))
    for name in ("date", "command", "detections"):
        del document[name]
    # their only number that depends on the detectors
    found.pop("detections.csv", None)
    # HDF5 has times of its own: its events are compared
    events = found.pop("camera/events.h5", b"")
    return found | {"run": json.dumps(document).encode(), "size": b"%d" % len(events)}


@pytest.mark.slow
def test_packets_follow_each_other_from_zero_to_the_end(run, parts):
    assert parts[0].start_s == 0.0
    assert parts[-1].end_s == SECONDS
    for one, after in pairwise(parts):
        assert one.end_s == after.start_s
    assert [c.name for p in parts for c in p.blasts] == list(run.world.shots)
    assert tuple(x for p in parts for x in p.perceived) == run.perceived


@pytest.mark.slow
def test_samples_of_packets_are_those_of_the_whole_record(run, parts):
    for sensor in run.listening.sensors:
        (whole,) = packets(run.listening, sensor)
        some = [p.samples[sensor.name] for p in parts if sensor.name in p.samples]
        np.testing.assert_array_equal(np.concatenate([x.values for x in some]), whole)
        offset = float(sensor.clock_offset_s)
        counts = np.cumsum([0, *(len(x.values) for x in some)])[:-1]
        starts = [x.start_s for x in some]
        np.testing.assert_allclose(starts, counts / some[0].rate_hz - offset)


@pytest.mark.slow
def test_each_row_of_the_flight_and_each_frame_is_in_one_packet(run, parts):
    rows = np.concatenate([p.motion.time_s for p in parts])
    np.testing.assert_array_equal(rows, run.flight.time_s)
    for p in parts:
        assert np.all((p.motion.time_s >= p.start_s) & (p.motion.time_s <= p.end_s))
    frames = np.concatenate([p.frames.time_s for p in parts])
    np.testing.assert_array_equal(frames, run.film.times)
    events = np.concatenate([p.events.time_s for p in parts])
    assert events.size > 0
    assert np.all(np.diff(events) >= 0.0)


@pytest.mark.slow
def test_who_watches_changes_nothing_recorded(scene, folder):
    alone, watched = folder / "alone", folder / "watched"
    arguments = {"seconds": SECONDS, "seed": 4}
    run_world(scene, alone, **arguments)

    def watchers(run):
        kept = {"scene": run.world.scene, "recording_id": "x"}
        viewer = Viewer(**kept, sound_speed_m_s=340.0, save=folder / "x.rrd")
        bag = RosBag(path=folder / "x.mcap", scene=run.world.scene, seconds=run.seconds)
        return viewer, bag

    run_world(scene, watched, **arguments, detect=True, watched=watchers)
    assert files_of(alone) == files_of(watched)
    assert (folder / "x.rrd").stat().st_size > 10_000
    assert (folder / "x.mcap").stat().st_size > 10_000
    found = json.loads((watched / "run.json").read_text())["detections"]
    # both bangs at the vehicle; the camera sees both fireballs
    assert found["detected"] >= 2
    assert found["false_alarms"] == 0


@pytest.mark.slow
def test_subscribers_are_finished_after_an_error(run):
    ended = []

    class Broken:
        def take(self, packet):
            raise InputError("broken")

        def finish(self):
            ended.append("broken")

    with pytest.raises(InputError, match="broken"):
        record_run(run, [Broken(), Broken()])
    assert ended == ["broken", "broken"]


def test_an_estimator_without_a_vehicle_is_refused(folder):
    scene = folder / "bare.toml"
    scene.write_text("[charge]\nmass_kg = 1\nposition_m = [0, 0, 0]\n")
    with pytest.raises(InputError, match=r"estimator: expected .* \[vehicle\]"):
        prepare_run(scene, estimator="ekf")


@pytest.mark.slow
def test_a_mission_flies_through_random_blasts_with_an_estimator(folder):
    plan = grid_plan(
        Place(35.3, -80.7, 200.0), width_m=6.0, depth_m=0.0, spacing_m=1.0, up_m=3.0
    )
    write_plan(plan, folder / "short.plan")
    scene = folder / "mission.toml"
    scene.write_text(MISSION)
    out = folder / "flown"
    came = run_world(scene, out, seed=2, estimator="ekf", detect=True)
    document = json.loads((out / "run.json").read_text())
    assert document["flight"] is None
    mission = document["mission"]
    assert mission["completed"]
    assert mission["estimator"] == "ekf"
    # the run lasts until the vehicle is disarmed, and each blast is met on the way
    assert document["seconds"] >= mission["disarmed_s"]
    assert [one["charge"] for one in mission["disturbances"]] == list(came.world.shots)
    assert document["detections"]["missed"] == 0
    motion = came.run.flight
    assert motion is not None
    assert motion.estimate_m is not None
    off = np.linalg.norm(motion.estimate_m - motion.position_m, axis=1)
    assert 0.0 < off.max() < 3.0


def test_of_two_places_either_may_contain_the_truth():
    near = Estimate(value=3.0, sd=2.0, q05=-1.0, q95=6.0)
    far = Estimate(value=-6.0, sd=2.0, q05=-9.0, q95=-2.0)
    for truth, contained in ((4.0, True), (-3.0, True), (-1.5, False)):
        row = FitRow("1", "charge_north_m", truth, (near, far))
        assert row.contains is contained
    assert FitRow("1", "charge_north_m", 4.0, (near, Estimate())).contains is None
