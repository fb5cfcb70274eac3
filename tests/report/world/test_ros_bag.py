"""A run's packets as a ROS 2 bag, read back by rosbags, which has code of its own."""

import io
import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mcap.reader import make_reader
from PIL import Image
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from jblast.errors import InputError
from jblast.observations.places import Frame
from jblast.report.exports.ros_bag import DEFINITIONS, FULL_SCALE_PA, RosBag
from jblast.scene import (
    Air,
    Camera,
    Charge,
    Instrument,
    Place,
    Scene,
    Sensor,
    VehicleSpec,
)
from jblast.study.running import (
    CameraEvents,
    Frames,
    Packet,
    RunDetection,
    Samples,
)
from jblast.vehicle import Trajectory
from jblast.world import Perceived

PACKETS, LENGTH_S, SECONDS = 20, 0.1, 2.0
HEIGHT, WIDTH = 24, 32
FORWARD = np.array([-0.5, 0.5, -0.5, 0.5])
PLACE = Place(47.0, 8.0, 500.0)
PEAKS = {"mic": 2 * FULL_SCALE_PA}
YAW = [0.0, 0.0, math.sin(0.25), math.cos(0.25)]
"""Half a radian to the left."""
SCENE = Scene(
    air=Air(pressure=90_000.0),
    sensors=(
        Sensor("mic", [math.nan] * 3, kind="microphone", mount="vehicle"),
        Sensor(
            "gauge 1",
            [60.0, 0.0, 1.5],
            kind="pressure",
            instrument=Instrument(rate=8000.0),
        ),
        Sensor("gauge-1", [0.0, 60.0, 1.5], kind="pressure"),
        Sensor("3", [1.0, 2.0, 3.0], kind="anemometer"),
        Sensor("geo", [5.0, 0.0, 0.0], kind="geophone"),
        Sensor(
            "imu",
            [math.nan] * 3,
            kind="imu",
            mount="vehicle",
            offset_m=[0.01, 0.02, 0.03],
            quaternion=[0.0, 0.0, 2.0, 0.0],
        ),
        Sensor("nowhere", [math.nan] * 3),
    ),
    camera=Camera(
        np.array([0.1, 0.0, 0.05]),
        FORWARD,
        np.array([40.0, 41.0]),
        np.array([15.5, 11.5]),
        WIDTH,
        HEIGHT,
        distortion=np.array([0.1, 0.02, 0.003, 0.004, 0.005]),
        mount="vehicle",
    ),
    vehicle=VehicleSpec("hummingbird", np.array([5.0, 0.0, 3.0])),
)


def motion(start_s):
    """Rows of 500 Hz; the 25th of each packet has a jolt."""
    time = start_s + np.arange(50) / 500.0
    count = len(time)
    force = np.zeros((count, 3))
    force[24] = [30.0, 0.0, 0.0]
    rows = (
        time,
        np.stack([time, 2 * time, 3 + 0 * time], 1),
        np.tile([1.0, 2.0, 0.0], (count, 1)),
        np.tile(YAW, (count, 1)),
        np.tile([0.1, 0.2, 0.3], (count, 1)),
        np.full((count, 4), 500.0),
        force,
        np.tile([0.01, 0.02, 0.03], (count, 1)),
        np.bool(False),
        np.stack([time, 2 * time, 3.25 + 0 * time], 1),
        np.tile([5.5, 0.5, 3.5], (count, 1)),
    )
    return jax.tree.map(np.array, Trajectory(*map(jnp.asarray, rows)))


def packet(number):
    start = number * LENGTH_S
    end = start + LENGTH_S
    draw = np.random.default_rng(number)
    sound = draw.normal(0.0, 0.3 * FULL_SCALE_PA, (800, 1))
    sound[13] = -2 * FULL_SCALE_PA
    stirred = np.sort(draw.uniform(start, end, 40)).round(6)
    images = draw.integers(0, 256, (2, HEIGHT, WIDTH, 3)).astype(np.uint8)
    return Packet(
        start,
        end,
        motion=motion(start),
        samples={
            "mic": Samples(start, 8000.0, sound),
            "gauge 1": Samples(start, 8000.0, draw.normal(0.0, 5.0, (800, 1))),
            # its clock is ahead
            "gauge-1": Samples(start - 0.25, 8000.0, np.zeros((800, 1))),
            "3": Samples(start, 100.0, draw.normal(0.0, 5.0, (10, 3))),
            "geo": Samples(start, 500.0, draw.normal(0.0, 1e-3, (50, 1))),
            "imu": Samples(start, 1000.0, draw.normal(0.0, 5.0, (100, 6))),
        },
        frames=Frames(start + np.arange(2) / 20.0, lambda times: images),
        events=CameraEvents(
            stirred if number != 7 else np.zeros(0),
            draw.integers(0, WIDTH, 40)[: 40 * (number != 7)],
            draw.integers(0, HEIGHT, 40)[: 40 * (number != 7)],
            draw.choice([-1, 1], 40)[: 40 * (number != 7)],
        ),
    )


def packets():
    every = [packet(number) for number in range(PACKETS)]
    every[5].blasts = (Charge(8.0, (10.0, -4.0, 1.0), time_s=0.51, name="1"),)
    every[6].perceived = (Perceived("1", "mic", "sound", 0.63),)
    true = RunDetection("mic", "sound", 0.6301, 1e-4, 0.7, 9.0, "1", 0.63)
    false = RunDetection("camera", "flash", 1.65, 1e-3, 1.7, 6.0, "", math.nan)
    every[6].detections, every[16].detections = (true,), (false,)
    return every


def written(path, scene=SCENE, place=PLACE):
    bag = RosBag(path=path, scene=scene, seconds=SECONDS, place=place, peaks_pa=PEAKS)
    for one in packets():
        bag.take(one)
    bag.finish()
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return written(tmp_path_factory.mktemp("bag") / "run.mcap")


@pytest.fixture(scope="module")
def bag(path):
    """Pairs of log time [ns] and message by topic, as rosbags reads them."""
    found = {}
    with AnyReader([path]) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, message))
    return found


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def xyzw(quaternion):
    return [*xyz(quaternion), quaternion.w]


def test_topics_have_these_types_and_counts(path):
    with AnyReader([path]) as reader:
        found = {c.topic: (c.msgtype, c.msgcount) for c in reader.connections}
    assert found == {
        "/clock": ("rosgraph_msgs/msg/Clock", 200),
        "/tf": ("tf2_msgs/msg/TFMessage", 220),
        "/vehicle/pose": ("geometry_msgs/msg/PoseStamped", 200),
        "/vehicle/twist": ("geometry_msgs/msg/TwistStamped", 200),
        "/vehicle/wrench": ("geometry_msgs/msg/WrenchStamped", 200),
        "/vehicle/set_point": ("geometry_msgs/msg/PoseStamped", 200),
        "/vehicle/estimate": ("geometry_msgs/msg/PointStamped", 200),
        "/vehicle/path_error": ("std_msgs/msg/Float64", 200),
        "/vehicle/path": ("nav_msgs/msg/Path", 2),
        "/vehicle/fix": ("sensor_msgs/msg/NavSatFix", 2),
        "/camera/image_raw/compressed": ("sensor_msgs/msg/CompressedImage", 40),
        "/camera/camera_info": ("sensor_msgs/msg/CameraInfo", 40),
        "/camera/events": ("event_camera_msgs/msg/EventPacket", 19),
        "/mic/audio": ("foxglove_msgs/msg/RawAudio", 20),
        "/mic/pressure": ("sensor_msgs/msg/FluidPressure", 2000),
        "/gauge_1/pressure": ("sensor_msgs/msg/FluidPressure", 2000),
        "/gauge_1_/pressure": ("sensor_msgs/msg/FluidPressure", 1750),
        "/sensor_3/wind": ("geometry_msgs/msg/Vector3Stamped", 200),
        "/geo/velocity": ("geometry_msgs/msg/Vector3Stamped", 1000),
        "/imu/imu": ("sensor_msgs/msg/Imu", 2000),
        "/jblast/origin": ("sensor_msgs/msg/NavSatFix", 1),
        "/jblast/blasts": ("visualization_msgs/msg/MarkerArray", 1),
        "/jblast/log": ("rcl_interfaces/msg/Log", 5),
        "/jblast/records": ("std_msgs/msg/String", 5),
    }


def test_definitions_are_those_of_ros_2(path):
    """Types that rosbags has of its own: the hash of REP 2011 is that of the layout."""
    known = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([path]) as reader:
        for connection in reader.connections:
            if connection.msgtype in known.fielddefs:
                own = reader.typestore.hash_rihs01(connection.msgtype)
                assert own == known.hash_rihs01(connection.msgtype)
            else:
                assert connection.topic in ("/camera/events", "/mic/audio")
    assert (
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp" in DEFINITIONS.read_text()
    )


def test_a_stamp_is_the_log_time_and_messages_are_in_order_of_time(path, bag):
    for topic, rows in bag.items():
        for time, message in rows:
            header = getattr(message, "header", None)
            if header is not None:
                assert header.stamp.sec * 10**9 + header.stamp.nanosec == time, topic
    with path.open("rb") as file:
        order = [
            (message.log_time, message.publish_time)
            for _, channel, message in make_reader(file).iter_messages(
                log_time_order=False
            )
            if channel.topic != "/gauge_1_/pressure"  # its clock is ahead
        ]
    assert order == sorted(order)
    assert all(log == publish for log, publish in order)
    ticks = [10_000_000 * n for n in range(200)]
    assert [time for time, _ in bag["/clock"]] == ticks
    stamps = [round(1e9 * seconds(message.clock)) for _, message in bag["/clock"]]
    assert stamps == ticks


def test_the_vehicle_has_its_pose_in_the_world_and_velocity_and_load_in_its_axes(bag):
    _, pose = bag["/vehicle/pose"][150]
    assert pose.header.frame_id == "map"
    assert xyz(pose.pose.position) == pytest.approx([1.5, 3.0, 3.0])
    assert xyzw(pose.pose.orientation) == pytest.approx(YAW)
    _, twist = bag["/vehicle/twist"][150]
    c, s = math.cos(0.5), math.sin(0.5)
    ahead = [c * 1.0 + s * 2.0, -s * 1.0 + c * 2.0, 0.0]
    assert twist.header.frame_id == "base_link"
    assert xyz(twist.twist.linear) == pytest.approx(ahead)
    assert xyz(twist.twist.angular) == [0.1, 0.2, 0.3]
    moves = [m.transforms[0] for _, m in bag["/tf"] if len(m.transforms) == 1]
    moved = moves[150]
    assert (moved.header.frame_id, moved.child_frame_id) == ("map", "base_link")
    assert xyz(moved.transform.translation) == xyz(pose.pose.position)
    assert xyzw(moved.transform.rotation) == pytest.approx(YAW)
    assert xyz(bag["/vehicle/set_point"][0][1].pose.position) == [0.0, 0.0, 3.25]
    assert xyz(bag["/vehicle/estimate"][0][1].point) == [5.5, 0.5, 3.5]
    assert bag["/vehicle/path_error"][0][1].data == 0.25


def test_thinned_loads_keep_the_largest_at_its_own_time(bag):
    jolts = [
        (time, message)
        for time, message in bag["/vehicle/wrench"]
        if message.wrench.force.x
    ]
    times = [round(1e8 * n) + 48_000_000 for n in range(PACKETS)]
    assert [time for time, _ in jolts] == times
    force = [30 * math.cos(0.5), -30 * math.sin(0.5), 0.0]
    assert xyz(jolts[0][1].wrench.force) == pytest.approx(force)
    assert xyz(jolts[0][1].wrench.torque) == [0.01, 0.02, 0.03]


def test_latitudes_are_those_of_the_place(bag):
    _, origin = bag["/jblast/origin"][0]
    assert (origin.latitude, origin.longitude) == (47.0, 8.0)
    _, fix = bag["/vehicle/fix"][1]
    east = Frame(*PLACE).to_enu(fix.latitude, fix.longitude, fix.altitude)
    np.testing.assert_allclose(east, [1.0, 2.0, 3.0], atol=1e-3)


def test_fixed_transforms_place_mounted_sensors_on_the_body_and_others_in_the_world(
    bag,
):
    time, message = bag["/tf"][0]
    found = {one.child_frame_id: one for one in message.transforms}
    frames = {name: one.header.frame_id for name, one in found.items()}
    assert time == 0
    assert frames == {
        "mic": "base_link",
        "imu": "base_link",
        "camera_optical_frame": "base_link",
        "gauge_1": "map",
        "gauge_1_": "map",
        "sensor_3": "map",
        "geo": "map",
    }
    imu, lens = found["imu"].transform, found["camera_optical_frame"].transform
    assert xyz(imu.translation) == [0.01, 0.02, 0.03]
    assert xyzw(imu.rotation) == [0.0, 0.0, 1.0, 0.0]
    assert xyz(lens.translation) == [0.1, 0.0, 0.05]
    # Hamilton's product, q (0, 0, 1) q*: the camera's third axis is the body's first
    x, y, z, w = xyzw(lens.rotation)
    ahead = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    assert ahead == pytest.approx([1.0, 0.0, 0.0])
    assert xyz(found["gauge_1_"].transform.translation) == [0.0, 60.0, 1.5]


def test_images_are_those_of_the_frames_and_have_the_calibration(bag):
    for number in (0, 11):
        time, image = bag["/camera/image_raw/compressed"][number]
        _, info = bag["/camera/camera_info"][number]
        frames = packet(number // 2).frames
        assert frames is not None
        assert time == round(1e9 * frames.time_s[number % 2])
        assert image.header == info.header
        assert image.header.frame_id == "camera_optical_frame"
        pixels = np.asarray(Image.open(io.BytesIO(image.data.tobytes())))
        np.testing.assert_array_equal(pixels, frames.images[number % 2])
    assert image.format == "rgb8; png compressed bgr8"
    assert (info.width, info.height) == (WIDTH, HEIGHT)
    assert info.distortion_model == "plumb_bob"
    assert info.d.tolist() == [0.1, 0.02, 0.003, 0.004, 0.005]
    assert info.k.tolist() == [40, 0, 15.5, 0, 41, 11.5, 0, 0, 1]
    assert info.r.tolist() == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert info.p.tolist() == [40, 0, 15.5, 0, 0, 41, 11.5, 0, 0, 0, 1, 0]


def decoded(data):
    """Decode EVT 3.0 word by word; as any decoder, from a message's own beginning."""
    high, low, row, found = -1, -1, -1, []
    for word in np.frombuffer(data, "<u2").tolist():
        kind, value = word >> 12, word & 0xFFF
        if kind == 0x8:
            high, low = value, -1
        elif kind == 0x6:
            low = value
        elif kind == 0x0:
            row = value & 0x7FF
        else:
            assert kind == 0x2
            assert -1 not in (high, low, row)
            found.append((high * 4096 + low, value & 0x7FF, row, value >> 11))
    return found


def test_each_message_of_events_can_be_decoded_alone(bag):
    rows = bag["/camera/events"]
    numbers = [number for number in range(PACKETS) if number != 7]
    for (time, message), number in zip(rows, numbers, strict=True):
        events = packet(number).events
        assert events is not None
        micro = np.round(1e6 * events.time_s).astype(int)
        expected = [micro, events.x, events.y, events.polarity > 0]
        found = np.array(decoded(message.events.tobytes())).T
        np.testing.assert_array_equal(found, expected)
        assert time == 1000 * micro[0]
        assert (message.width, message.height) == (WIDTH, HEIGHT)
    assert [message.seq for _, message in rows] == [*range(19)]
    assert rows[0][1].encoding == "evt3"


def test_audio_is_pcm_of_16_bits_with_a_stated_full_scale(bag):
    records = [json.loads(message.data) for _, message in bag["/jblast/records"]]
    scale = FULL_SCALE_PA + PEAKS["mic"]
    assert records[0]["audio_full_scale_pa"] == {"mic": scale}
    time, message = bag["/mic/audio"][4]
    assert seconds(message.timestamp) == pytest.approx(0.4)
    assert time == 400_000_000
    assert (message.format, message.sample_rate) == ("pcm-s16", 8000)
    assert message.number_of_channels == 1
    pressure = packet(4).samples["mic"].values[:, 0]
    heard = np.frombuffer(message.data.tobytes(), "<i2") * scale / 32767
    # half a step of 16 bits: no blast is clipped
    np.testing.assert_allclose(heard, pressure, atol=0.5 * scale / 32767 + 1e-9)


def test_pressure_is_absolute_and_the_largest_of_each_millisecond(bag):
    for topic, name in (("/mic/pressure", "mic"), ("/gauge_1/pressure", "gauge 1")):
        values = packet(4).samples[name].values[:, 0].reshape(100, 8)
        largest = np.abs(values).argmax(1)
        rows = bag[topic][400:500]
        found = [message.fluid_pressure for _, message in rows]
        expected = 90_000.0 + values[np.arange(100), largest]
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        times = 0.4 + (8 * np.arange(100) + largest) / 8000.0
        np.testing.assert_allclose([1e-9 * time for time, _ in rows], times, atol=1e-9)
    assert rows[0][1].header.frame_id == "gauge_1"


def test_wind_ground_motion_and_inertial_samples_are_in_their_frames(bag):
    _, wind = bag["/sensor_3/wind"][57]
    assert wind.header.frame_id == "map"
    assert xyz(wind.vector) == packet(5).samples["3"].values[7].tolist()
    _, ground = bag["/geo/velocity"][57]
    assert ground.header.frame_id == "geo"
    assert xyz(ground.vector) == [0.0, 0.0, packet(1).samples["geo"].values[7, 0]]
    time, imu = bag["/imu/imu"][1234]
    row = packet(12).samples["imu"].values[34]
    assert time == 1_234_000_000
    assert imu.header.frame_id == "imu"
    assert xyz(imu.linear_acceleration) == row[:3].tolist()
    assert xyz(imu.angular_velocity) == row[3:].tolist()
    assert imu.orientation_covariance.tolist() == [-1.0, *[0.0] * 8]


def test_blasts_perceptions_and_detections_are_shown_logged_and_recorded(bag):
    ((time, message),) = bag["/jblast/blasts"]
    (marker,) = message.markers
    assert (time, marker.type, marker.action) == (510_000_000, marker.SPHERE, 0)
    assert marker.header.frame_id == "map"
    assert xyz(marker.pose.position) == [10.0, -4.0, 1.0]
    assert xyz(marker.scale) == pytest.approx([4.0] * 3)  # 2 m for 8 kg
    assert (marker.color.a > 0, seconds(marker.lifetime)) == (True, 2.0)
    text = [(time, line.msg) for time, line in bag["/jblast/log"]]
    assert text == [
        (0, "run of 2 s"),
        (510_000_000, "blast 1: 8 kg of TNT"),
        (630_000_000, "mic: sound of blast 1"),
        (700_000_000, "mic: sound at 0.630100 s detected, blast 1"),
        (1_700_000_000, "camera: flash at 1.650000 s detected, a false alarm"),
    ]
    rows = [json.loads(message.data) for _, message in bag["/jblast/records"]]
    assert [row["type"] for row in rows] == [
        *("run", "blast", "perception", "detection", "detection")
    ]
    assert rows[1]["position_m"] == [10.0, -4.0, 1.0]
    assert rows[2] == {
        "type": "perception",
        "shot": "1",
        "entity": "mic",
        "sense": "sound",
        "time_s": 0.63,
    }
    assert rows[3]["true_s"] == 0.63
    assert "true_s" not in rows[4]


def test_a_lost_vehicle_is_left_out_and_a_run_without_anything_is_a_file(tmp_path):
    # 10 rows at 500 Hz, and none in the next packet
    lost, gone = motion(0.0).at(slice(10)), motion(0.1).at(slice(0))
    bag = RosBag(path=tmp_path / "a.mcap", scene=Scene(), seconds=1.0)
    bag.take(Packet(0.0, 0.1, motion=lost))
    bag.take(Packet(0.1, 0.2, motion=gone))
    bag.take(Packet(0.2, 0.3))
    bag.finish()
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert counts["/vehicle/pose"] == 2
    assert counts["/clock"] == 30
    assert "/vehicle/fix" not in counts


def test_a_large_camera_is_refused_before_a_file(tmp_path):
    large = Camera(np.zeros(3), FORWARD, np.ones(2), np.zeros(2), 2049, 10)
    with pytest.raises(InputError, match=r"at most 2048 by 2048 px.* got 2049 by 10"):
        RosBag(path=tmp_path / "a.mcap", scene=Scene(camera=large), seconds=1.0)
    assert not [*tmp_path.iterdir()]
