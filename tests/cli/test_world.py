"""jblast world: one clock in all its files; what goes into a fit comes out again."""

import csv
import json
from typing import Any

import h5py
import jax.numpy as jnp
import numpy as np
import pytest
import soundfile

from jblast.observations import read
from jblast.scene import read_world
from jblast.sensors import Track, record
from jblast.sensors.layout import layout_of
from jblast.world import draw_world

RATE_HZ = 8000
BY_AIR = """
[world]
count = 2
region_m = { ring = [15, 20] }
about = "vehicle"
time_s = [0.3, 0.9]
gap_s = 0.2
mass_kg = 0.5
[vehicle]
model = "hummingbird"
position_m = [0, 0, 8]
velocity_m_s = [12, 4, 0]
[[sensor]]
name = "mic"
kind = "microphone"
mount = "vehicle"
offset_m = [0.2, 0.0, 0.1]
rate_hz = 8000
[[sensor]]
name = "ear"
mount = "vehicle"
offset_m = [0.2, 0.0, 0.1]
records = { air_arrival_s = 1e-9 }
[[sensor]]
name = "mate"
kind = "pressure"
mount = "vehicle"
rate_hz = 8000
[[sensor]]
name = "ground"
kind = "geophone"
position_m = [30, 0, 0]
rate_hz = 8000
[camera]
position_m = [0, -80, 3]
look_at_m = [0, 0, 3]
width = 48
height = 24
focal_px = 36
frames_hz = 50
[law]
scatter = false
"""


def rows(text: str) -> list[dict[str, str]]:
    """Rows of a table, comments left out."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


@pytest.mark.slow
def test_every_stamp_of_a_run_is_within_a_sample_of_the_forward_model(jblast):
    scene = jblast.file("scene.toml", BY_AIR)
    run = jblast.path("run")
    code, out, err = jblast("world", scene, "--out", run, "--json")
    assert (code, err) == (0, ""), err
    told = json.loads(out)
    there = draw_world(*read_world(scene), 0).scene
    shots = [charge.name for charge in there.charges]
    seen = {
        (r["entity"], r["sense"], r["shot"]): float(r["time_s"])
        for r in rows(jblast.text("run/perceived.csv"))
    }
    flight = rows(jblast.text("run/flight.csv"))
    time = np.array([float(r["time_s"]) for r in flight])
    place = np.array(
        [[float(r[f"{a}_m"]) for a in ("east", "north", "up")] for r in flight]
    )
    middle = Track(jnp.asarray(time), jnp.asarray(place))

    # the log: each reading is what `record` says of its own place; of those picked from
    # samples the arrivals are, to a sample
    log = read(jblast.path("run/observations.csv"))
    forward = np.asarray(record(there, layout_of(log, there), dict(there.law)).value)
    names, quantities = np.array(log.sensor), np.array(log.quantity)
    arrives = quantities == "air_arrival_s"
    assert sorted(names[arrives]) == sorted(2 * ["ear", "mic", "mate"])
    exact = np.flatnonzero(names == "ear")
    np.testing.assert_allclose(log.value[exact], forward[exact], rtol=0, atol=3e-8)
    late = (log.value - forward)[arrives]
    assert np.abs(late).max() < 1 / RATE_HZ
    for row in exact:
        shot, value = log.shot[row], log.value[row]
        assert seen["ear", "pressure", shot] == pytest.approx(value, abs=3e-8)
        assert seen["mic", "sound", shot] == pytest.approx(value, abs=3e-8)
        # 0.22 m from the vehicle's middle, where it was just then
        away = log.position[row] - np.asarray(middle.at(jnp.asarray(value)))
        assert np.linalg.norm(away) == pytest.approx(np.hypot(0.2, 0.1), abs=1e-3)

    # sound: silence, then the front in the sample in which it comes
    pascals, rate_hz = soundfile.read(jblast.path("run/sound/mic.wav"))
    assert rate_hz == RATE_HZ
    pressure = rows(jblast.text("run/sound/mate.csv"))
    felt = np.array([float(r["overpressure_pa"]) for r in pressure])
    for samples, who, sense in ((pascals, "mic", "sound"), (felt, "mate", "pressure")):
        for shot in shots:
            stamp = seen[who, sense, shot] * RATE_HZ
            front = int(stamp)
            # its first sample holds but a part of the front, the next the peak
            before = np.abs(samples[front - 3 : front]).max()
            assert samples[front : front + 2].max() > 20.0 * before
    velocity = rows(jblast.text("run/sound/ground.csv"))
    moved = np.array([float(r["ground_velocity_m_s"]) for r in velocity])
    first = np.flatnonzero(moved)[0]
    stamp = min(seen["ground", "ground motion", shot] for shot in shots)
    assert 0 <= stamp * RATE_HZ - first <= 1

    # the vehicle: the load is there from the row on in which the front comes
    force = np.array(
        [[float(r[f"force_{a}_n"]) for a in ("east", "north", "up")] for r in flight]
    )
    jump = np.linalg.norm(np.diff(force, axis=0), axis=1)
    for shot in shots:
        stamp = seen["vehicle", "force", shot]
        after = np.searchsorted(time, stamp)
        near = slice(after - 8, after + 8)
        # rotors stand 0.17 m from the middle, half a millisecond, a step, of sound
        assert abs(near.start + int(np.argmax(jump[near])) + 1 - after) <= 2
    blasts = {one["charge"]: one["arrival_s"] for one in told["flight"]["blasts"]}
    for shot in shots:
        # `fly` says it of the row before
        step = time[1] - time[0]
        assert blasts[shot] == pytest.approx(seen["vehicle", "force", shot], abs=step)

    # the camera: light as it comes, in events and in frames
    with h5py.File(jblast.path("run/camera/events.h5")) as file:
        held: Any = file
        stamps = 1e-6 * (np.asarray(held["events/t"]) + float(held["t_offset"][()]))
    flash = {shot: seen["camera", "flash", shot] for shot in shots}
    # the fireball grows past the first pixel's threshold within its time constant
    begins = min(flash.values())
    assert 0 <= stamps.min() - begins < 2e-3
    frames = rows(jblast.text("run/camera/frames.csv"))
    assert float(frames[0]["time_s"]) == 0.0
    assert told["camera"]["frames"] == len(frames) < told["camera"]["filmed"]
    for one in frames:
        assert (jblast.directory / "run" / "camera" / "frames" / one["file"]).exists()
        assert float(one["time_s"]) * 50 == pytest.approx(
            round(float(one["time_s"]) * 50), abs=1e-9
        )
