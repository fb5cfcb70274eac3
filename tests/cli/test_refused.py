"""What each verb refuses: one message that names the cause, exit 2, no file written."""

import socket
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from jblast.missions import grid_plan, write_plan
from jblast.scene import Place
from tests.cli.cli_files import SENSORS, says, table

CHARGE = "[charge]\nmass_kg = 15.0\nposition_m = [0, 0, 1]\ntime_s = 2.0\n"
CAMERA = """[camera]
position_m = [0, -40, 2]
look_at_m = [0, 0, 4]
width = 24
height = 18
focal_px = 24
frames_hz = 500
threshold = [0.2, 0.3]
"""
CARRIED = """[vehicle]
model = "hummingbird"
position_m = [0, -30, 6]
[camera]
mount = "vehicle"
width = 24
height = 18
focal_px = 24
frames_hz = 250
"""
FLIGHT = """time_s,\
east_m,north_m,up_m,quaternion_i,quaternion_j,quaternion_k,quaternion_w
0.0,0,-30,6,0,0,0.70710678,0.70710678
2.5,0,-18,6,0,0,0.70710678,0.70710678
"""
VEHICLE = '[vehicle]\nmodel = "crazyflie"\nposition_m = [5.0, 0.0, 2.0]\n'
MISSION = """[charge]
mass_kg = 0.5
position_m = [1.0, 4.0, 0.0]
time_s = 8.0
[vehicle]
model = "crazyflie"
mission = "short.plan"
"""
BLAST = """[charge]
mass_kg = { uniform = [0.3, 1.0] }
position_m = [0.0, 0.0, 0.0]
time_s = 0.3
[vehicle]
model = "iris"
position_m = [4.0, 0.0, 3.0]
control = { integral = true }
"""
MICROPHONE = """[[sensor]]
name = "phone"
kind = "microphone"
rate_hz = 8000
position_m = [60.0, 0.0, 1.5]
"""
WORLD = """[world]
count = 1
region_m = { box = [[-10, -10, 0], [10, 10, 0]] }
time_s = [0.2, 0.4]
"""
STUDY = """scene = "scene.toml"
samples = 16
outcomes = ["peak_overpressure_pa"]
[axes]
charge_east_m = [-50.0, 50.0]
"""


class Refused(NamedTuple):
    """Commands that are refused.

    Attributes:
        words: Of each; a row's own words follow. The scene is `scene.toml`.
        scene: Its text.
        rows: A change of the scene `old -> new;` if there is one, and own words.
    """

    words: str
    scene: str
    rows: str


CASES = (
    Refused(
        "bound scene.toml",
        '[charge]\nmass_kg = "free"\n' + SENSORS,
        """
 => --at charge_mass_kg=VALUE
--at charge_mas_kg=3 => did you mean charge_mass_kg?
--at charge_mass_kg=15,charge_up_m=3 => or --free charge_up_m beside it
--free charge_up_m --at charge_mass_kg=3 => --at charge_up_m=VALUE
--free nobody --at charge_mass_kg=3 => --free nobody
--at charge_mass_kg => PARAMETER=VALUE
--at charge_mass_kg=x => PARAMETER=VALUE
--at charge_mass_kg=nan => finite
--at charge_mass_kg=3,charge_mass_kg=4 => got several
--at charge_mass_kg=0 => positive
--at charge_mass_kg=3 --map map.jpg => .png, .svg, .pdf
--at charge_mass_kg=3 --law nobody => nobody
"free" -> 15.0; => nothing to bound
"free" -> 15.0;--free clock_offset_s.z --at clock_offset_s.z=0 => no such clock
SENSORS ->;--at charge_mass_kg=3 => no sensor records anything
""",
    ),
    Refused(
        "choose scene.toml --quantity",
        CHARGE + SENSORS,
        """
hight => unknown quantity 'hight'
air_arrival_s --tolerance 0 => a positive number
flash_time_s => no sensor of the scene records flash_time_s
""",
    ),
    Refused(
        "simulate scene.toml",
        CHARGE + SENSORS,
        """
mass_kg = 15.0 -> mass_kg = "free";--out o.csv =>\
 charge_mass_kg: expected a value or a prior, got a number that is free
mass_kg = 15.0 -> ;--out o.csv => charge_mass_kg: expected a value or a prior
15.0 -> { normal = [1e-3, 8.0] };--out o.csv => sd above zero
SENSORS ->;--out o.csv => no sensor records anything
position_m = [30.0, 0.0, 1.0] ->;--out o.csv => position_m
--out scene.toml => exists already
--out o.csv --seed -1 => --seed: expected a whole number from 0
""",
    ),
    Refused(
        "listen scene.toml --out o",
        CHARGE + MICROPHONE,
        """
--seconds -1 => --seconds: expected a positive number, got -1
--seconds 1e9 => --seconds: expected 1 to
--packets 0 => expected a positive number
--ambient none.wav => no such file
--ambient empty.wav => is empty
--seed x => whole number
MICROPHONE ->; => got no sensor
"microphone" / rate_hz = 8000 -> "flash"; => kind flash writes no samples
position_m = [60.0, 0.0, 1.5] ->; => 'phone': expected position_m
mass_kg = 15.0 ->; => charge_mass_kg: expected a
""",
    ),
    Refused(
        "plan a.plan",
        "",
        """
--home 1,2 => --grid
--orbit 5 --home 95,2 => between -90 and 90
--grid 5,5,0 --home 5,2 => SPACING
--orbit 5,0 --home 5,2 => TURNS
""",
    ),
    Refused(
        "fly scene.toml",
        "[charge]\nmass_kg = 1.0\n" + VEHICLE,
        """
2.0] -> -2.0]; => scene.toml: [vehicle] position_m | -2 m
crazyflie -> crazyfly; => [vehicle] model | did you mean crazyflie?
mass_kg = 1.0 -> mass_kg = "free"; => scene.toml: charge_mass_kg: expected a value or
[charge] / mass_kg = 1.0 ->; => or --seconds for a flight without a blast
VEHICLE ->; => [vehicle] | got none
--step 0.3 => step_s: expected at most
--step 0 => --step | positive
--seconds x => --seconds
--seconds 0.001 => seconds: expected more than
--tolerance -0.1 => --tolerance | positive
--vehicles 9 => expected a prior to sample
--vehicles 0 => vehicles | got 0
--backend cuda --seconds 1 => backend | 'cuda'
--profile none.csv => none.csv: no such file
--profile-moments-about 1,0,0 => expected it with --profile only
--plan-out a.plan => --plan-out: expected a scene whose [vehicle] has a mission
""",
    ),
    Refused(
        "fly scene.toml",
        MISSION,
        """
short.plan -> a.plan; => a.plan | no such file
--vehicles 3 => --vehicles | expected 1
--estimator ekf --step 0.03 => expected at most 0.02 s
position_m = [1.0, 4.0, 0.0] -> range_m = 5.0; => range_m
model -> position_m = [0, 0, 3] / model; => starts in the air
--plan-out short.plan => exists already
--plan-out b.kml => b.kml | .plan
""",
    ),
    Refused(
        "tune scene.toml --gains",
        BLAST,
        """
--free noise_pa => --free: expected no recording with
--fps 9 => --fps: expected no recording with
--vehicles 1 => vehicles: expected two blasts
--margin-deg 0 => expected a positive number
--delay -1 => delay: expected a time of 0 s or more
model = "iris" -> model = "iris" / mission = "short.plan"; => [vehicle] mission
{ uniform = [0.3, 1.0] } -> 1.0; => prior
mass_kg = { uniform = [0.3, 1.0] } ->; => charge_mass_kg: expected a value or a prior
[vehicle] -> [world] / count = 2 / [vehicle]; => [world]
""",
    ),
    Refused(
        "tune scene.toml",
        CHARGE + CAMERA,
        """
empty.wav --gains => RECORDED: expected no recording with
--gains => expected a vehicle with its model
none.wav --free fireball_growth_s => none.wav: no such file or directory
empty.wav --margin-db 6 => --margin-db: expected it with --g
junk.mp4 --free fireball_growth_s => junk.mp4: expected a complete video
junk.h5 --free fireball_growth_s => junk.h5: expected a complete .h5 file
junk.mp4 --sensor mic => --sensor
junk.h5 --free fireball_growth_s --fps 100 => --fps
empty.wav --free fireball_growth_s --start 1 => --start
junk.mp4 --free fireball_growth_s --fps 0 => --fps: expected a positive
""",
    ),
    Refused(
        "world scene.toml --out run",
        WORLD + SENSORS,
        """
WORLD ->; => scene.toml: [world]: expected a table of random blasts, got none
count = 1 -> count = 0; => [world] count: expected a whole number, 1 to
count = 1 -> rate_hz = -1; => [world] rate_hz: expected a number that is p
[-10, -10, 0] -> [10, -10, 0]; => region_m box: expected a box with an area
count = 1 -> count = 9; => count: expected at most 1, which fit between
position_m = [30.0, 0.0, 1.0] -> mount = "vehicle"; => mount: expected [vehic
""",
    ),
    Refused(
        "serve scene.toml",
        "[world]\ncount = 2\n",
        """
--listen 0.0.0.0:1 => --listen: expected a loopback
--listen 127.0.0.1 => --listen: expected HOST:PORT
--listen 127.0.0.1:0 --rate 1001 => --rate: expected 1 to 1000
--listen 127.0.0.1:0 --rate 0.5 => --rate: expected 1 to 1000
--listen 127.0.0.1:0 --rate 0 => --rate: expected a positive number
--listen 127.0.0.1:0 --speed -1 => --speed: expected a positive number
--listen 127.0.0.1:0 --lead nan => --lead: expected a finite number
--listen 127.0.0.1:TAKEN => --listen: expected a free port of this machine, got 127
--tlog a.tlog => --tlog: expected no such option with
""",
    ),
    Refused(
        "serve scene.toml",
        CHARGE + '[vehicle]\nmodel = "iris"\nposition_m = [0, 0, 0]\n',
        """
--mavlink tcp:0.0.0.0:4560 => --mavlink: expected a loopback address
--mavlink com:1 => --mavlink: expected tcp:HOST:PORT or udp
--mavlink ANY --listen 127.0.0.1:0 => --listen: expected no such option with a server
--mavlink ANY --rate 9 => --rate: expected no such option with a server over --mavlink
--mavlink ANY --lead 1 => --lead: expected no such option with a server over --mavlink
--mavlink ANY --speed 2 => --speed: expected no such option with a server
--ground-station ANY --rate 9 => --rate: expected no such option with a server over
--ground-station ANY --patience 1 => --patience: expected no such option with a server
--ground-station ANY --tlog a.tlog => --tlog: expected no such option with a server
--mavlink ANY --ground-station => --ground-station: expected no such
--ground-station udp:10.0.0.1:14550 => --ground-station: expected a loopback address
""",
    ),
    Refused(
        "study",
        CHARGE + SENSORS,
        """
 => study run: expected one STUDY.toml, got nothing
a.toml b.toml => study run: expected one STUDY.toml, got a.toml b.toml
study.toml => --out: expected the folder of the store, got nothing
study.toml --out store --force => --force: expected no such option of study run
report => study report: expected one store, got nothing
report store --limit 5 => --limit: expected no such option of study report
report store --resume => --resume: expected no such option of study report
report none.zarr => none.zarr: no such store; expected a store of jblast study
--list --out store => --out: expected no such option of study list
study.toml --out store --devices 0 => --devices: expected all, or a
study.toml --out store --devices 1.5 => --devices: expected all, or a
study.toml --out store --devices ² => --devices: expected all, or a
""",
    ),
    Refused(
        "render scene.toml --out out",
        CHARGE + CAMERA,
        """
CAMERA ->; => expected a [camera], got none
focal_px = 24 -> focal_px = 0; => [camera] focal_px: expected a number that is positive
focal_px = 24 -> focal_px = nan; => [camera] focal_px: expected a finite number
0.3] -> -0.3]; => [camera] threshold[1]: expected a number that is positive, got -0.3
frames_hz = 500 -> frames_hz = 0; => [camera] frames_hz: expected a number that is
width = 24 ->; => [camera] width: expected a whole number
mass_kg = 15.0 -> mass_kg = "free"; => charge_mass_kg: expected a value or a prior, got
mass_kg = 15.0 ->; => charge_mass_kg: expected a value or a prior
position_m = [0, 0, 1] -> range_m = 5.0; => [charge] range_m: expected position_m
[0, -40, 2] -> [0, -40, -2]; => position on or above the ground, up = 0, got up = -2 m
[0, 0, 4] -> [0, -80, 2]; => the blast is towards 0 degrees from north, -1 degrees up
[0, 0, 4] -> [0, -80, 2]; => looks towards 180 degrees from north, 0 degrees up
--fps 0 => --fps: expected a positive number, got '0'
--fps nan => --fps: expected a positive number
--times 3 => --times: expected START:STOP
--times now:then => --times: expected START:STOP
--times 2.1:2.0 => expected START before STOP, got '2.1:2.0'
--times 2:3 --seconds 1 => either --times or --seconds
--seconds 0 => --seconds: expected a positive number
--seconds 0.001 => --seconds: expected 2 to 1,000,000 frames
--seconds 1e9 => got 500,000,000,000 of 500 Hz
--threshold=-0.2 => --threshold: expected a positive number
--background night => --background: expected a grey
--views nowhere => nowhere: expected a directory of views with views.toml, got no such
--seconds 0.02 --video a.gif => a.gif: expected a name of a video ending in .mp4
--seconds 0.02 --video a.mp4 --mode events => --video: expected --mode rgb
--seconds 0.02 --video-fps 30 => --video-fps: expected --video with it
""",
    ),
    Refused(
        "render scene.toml --out out --flight flight.csv",
        CHARGE + CARRIED,
        """
--times 2.0:2.1 --background field.png => for a moving camera
--times 2.0:2.1 --depth wall.npy => --depth: expected a fixed camera
--times 2.0:2.1 --background 0.2 --ground field.png:1 => no --background but
--times 2.0:2.1 --ground field.png => expected IMAGE.png:METRES_PER_PIXEL
--times 2.0:2.1 --ground field.png:0 => expected IMAGE.png:METRES_PER_PIXEL
--times 2:3 => expected a flight as long as the film, 2 to 2.996
""",
    ),
    Refused(
        "events frames --fps 1000",
        "",
        """
--out events.gif => events.gif
--out events.h5 --threshold 0 => --threshold: expected a positive
--out events.h5 --darkest 2 => --darkest
""",
    ),
    Refused(
        "detect",
        CHARGE + CAMERA,
        """
frames => expected --fps HZ
empty --fps 1000 => at least two PNG frames, got 0
one --fps 1000 => at least two PNG frames, got 1
frames empty.wav => , without sound;
empty.wav frames => , without sound;
frames --fps 1000 --template empty.wav => --template: expected it with
frames --fps 1000 --all-sounds => --all-sounds: expected it with video or sound only
nowhere --fps 1000 => nowhere: no such file or directory
width = 24 -> width = 90;frames --fps 1000 --scene scene.toml => expected 24 x 18
CAMERA ->;frames --fps 1000 --scene scene.toml => expected the [camera]
empty.h5 => got an empty file
none.npz => no such file
""",
    ),
)
PARTS = {"VEHICLE": VEHICLE, "SENSORS": SENSORS, "CAMERA": CAMERA}
PARTS |= {"MICROPHONE": MICROPHONE, "WORLD": WORLD}


@pytest.fixture(scope="module")
def taken():
    with socket.create_server(("127.0.0.1", 0)) as other:
        yield str(other.getsockname()[1])


@pytest.fixture
def files(jblast, monkeypatch):
    """Files that rows name, in the present folder."""
    monkeypatch.chdir(jblast.directory)
    plan = grid_plan(
        Place(35.3, -80.7, 200.0), width_m=6.0, depth_m=0.0, spacing_m=1.0, up_m=3.0
    )
    write_plan(plan, "short.plan")
    for name, content in (
        ("study.toml", STUDY),
        ("flight.csv", FLIGHT),
        *((f"empty.{end}", "") for end in ("wav", "h5")),
        *((f"junk.{end}", "junk") for end in ("mp4", "h5")),
    ):
        jblast.file(name, content)
    np.save("wall.npy", np.ones((18, 24)))
    for folder, count in (("frames", 3), ("one", 1), ("empty", 0)):
        (jblast.directory / folder).mkdir()
        for i in range(count):
            Image.new("RGB", (24, 18)).save(f"{folder}/{i}.png")
    Image.new("RGB", (24, 18)).save("field.png")


@pytest.mark.parametrize(
    ("words", "scene", "row", "said"),
    [(case.words, case.scene, *row) for case in CASES for row in table(case.rows)],
)
def test_bad_input_is_one_message(jblast, files, taken, words, scene, row, said):
    change, _, own = row.rpartition(";")
    if change:
        old, new = (part.strip() for part in change.replace(" / ", "\n").split("->"))
        old = PARTS.get(old, old)
        assert old in scene
        scene = scene.replace(old, new)
    jblast.file("scene.toml", scene)
    words = f"{words} {own}".replace("TAKEN", taken).replace("ANY", "tcp:127.0.0.1:0")
    before = {path for path in jblast.directory.rglob("*") if path.is_file()}
    says(jblast.refused(*words.split()), said)
    assert {path for path in jblast.directory.rglob("*") if path.is_file()} == before
