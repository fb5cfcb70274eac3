"""A law, a kind of sensor and a controller, each of one file, from outside the package.

CONTRIBUTING names these files. They are registered for a test alone.
"""

import csv
import json
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast
from calibration.thesis.loads import coded_load
from jblast.cli.main import main
from jblast.environments import environment_params
from jblast.errors import InputError
from jblast.registry import LAWS
from jblast.report.flights import fly_answer
from jblast.report.view import terminal
from jblast.scene import SENSOR_KINDS, Charge, Normal, Scene, Sensor, read_scene
from jblast.sensors import recording
from jblast.sensors.listening import packets, plan
from jblast.study.flights import fly
from jblast.study.gains import TuningSettings, tune_gains
from jblast.vehicle import CONTROLLERS
from jblast.waves.propagation import ambient
from tests.study.flights.scenes import SHORT, scene

HERE = Path(__file__).parent
SCENE = """
[charge]
mass_kg = 2.0
position_m = [0.0, 0.0, 1.0]
[[sensor]]
name = "probe"
kind = "thermometer"
position_m = [30.0, 0.0, 1.0]
rate_hz = 4096
offset_k = 0.5
"""


@pytest.fixture
def extension():
    """Return a function that imports an extension; what it registers is taken back."""
    tables: list[dict[Any, Any]] = [LAWS, SENSOR_KINDS._records, CONTROLLERS._records]
    before = [dict(table) for table in tables]

    def registered(name):
        sys.modules.pop(f"tests.extensions.{name}", None)
        return import_module(f"tests.extensions.{name}")

    yield registered
    for table, records in zip(tables, before, strict=True):
        table.clear()
        table.update(records)


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a scene file."""

    def write(text):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return path

    return write


def test_a_law_is_calculated(extension):
    own = extension("straight_sound")
    found = jblast.calculate(Scene(), [20.0], [15.0])["air_arrival_s"]
    speed = float(Scene().air.sound_speed or 340.0)
    value = float(np.ravel(found["straight_sound"].value)[0])
    assert value == pytest.approx((20.0 - own.LEAD_M) / speed, rel=0.02)


def test_a_scene_file_has_a_kind_and_its_keys_once_it_is_registered(extension, written):
    path = written(SCENE)
    with pytest.raises(InputError, match=r"kind: expected one of .* got 'thermometer'"):
        read_scene(path)
    extension("thermometer")
    (sensor,) = read_scene(path).scene.sensors
    assert {k: float(v) for k, v in sensor.settings.items()} == {"offset_k": 0.5}
    path = written(SCENE.replace("offset_k = 0.5\n", ""))
    (sensor,) = read_scene(path).scene.sensors
    assert float(sensor.settings["offset_k"]) == 0.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("offset_k = 0.5", "offset_k = 9.0", "between -5 and 5, got 9.0"),
        ("offset_k = 0.5", "noise_pa = 1.0", "noise_pa: expected one of .*noise_k"),
        ('"thermometer"', '"thermomter"', "geophone, flash, imu, thermometer, got"),
        (
            '"thermometer"',
            '"pressure"',
            "offset_k: expected one of .* for kind 'pressure'",
        ),
        (
            "position_m = [30.0, 0.0, 1.0]",
            'mount = "vehicle"\n[vehicle]\nmodel = "iris"\n[[sensor]]\nname = "b"',
            "whose cable ends on the ground",
        ),
    ],
)
def test_messages_are_those_of_all_kinds(extension, written, old, new, message):
    extension("thermometer")
    with pytest.raises(InputError, match=message):
        read_scene(written(SCENE.replace(old, new)))


@pytest.mark.slow
def test_listen_writes_the_file_of_a_kind(extension, written, tmp_path, capsys):
    extension("thermometer")
    out = tmp_path / "out"
    words = ["listen", str(written(SCENE)), "--out", str(out), "--seconds", "0.25"]
    assert main([*words, "--json"], progress=False) == 0
    answer = json.loads(capsys.readouterr().out)["sensors"]["probe"]
    lines = (out / "probe.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if line[0] != "#"))
    kelvin = np.array([float(row["air_temperature_k"]) for row in rows])
    assert kelvin.size == answer["samples"] == 1024
    assert answer["file"] == "probe.csv"
    still = float(ambient(Scene().air)[0]) + 0.5
    arrival = round(answer["air_arrival_s"] * 4096)
    np.testing.assert_allclose(kelvin[: arrival - 1], still, rtol=1e-6)
    # at the peak, within the samples' mean of a falling front
    rise = 1.0 + answer["peak_overpressure_pa"] / float(ambient(Scene().air)[1])
    peak = (still - 0.5) * rise ** (2 / 7) + 0.5
    assert peak - 1.0 < answer["largest_air_temperature_k"] <= peak
    assert (out / "waveforms.png").exists()


def test_a_stream_is_the_record_and_goes_through_the_instrument(extension, written):
    extension("thermometer")
    more = "full_scale_k = 512.0\nnoise_k = 0.1\nbits = 16\n"
    listening = plan(read_scene(written(SCENE + more)), seconds=0.25)
    (sensor,) = listening.sensors
    (whole,) = packets(listening, sensor)
    parts = np.concatenate([*packets(listening, sensor, 100.0)])
    np.testing.assert_array_equal(parts, whole)
    steps = whole / (512.0 / 2**15)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    # 100 samples before the blast: the sd of their sd is 7 %
    assert np.std(whole[:100]) == pytest.approx(0.1, rel=0.3)


@pytest.mark.slow
def test_a_record_is_differentiable_and_batched(extension):
    extension("thermometer")
    probe = Sensor("probe", (30.0, 0.0, 1.0), "thermometer", settings={"offset_k": 0.0})

    def mean(mass):
        made = Scene(Charge(mass_kg=mass), sensors=(probe,))
        return jnp.mean(recording(made, probe, jax.random.key(0)).samples(0.1))

    values = jax.jit(jax.vmap(mean))(jnp.asarray([2.0 - 1e-3, 2.0, 2.0 + 1e-3]))
    assert float(values[1]) == pytest.approx(float(mean(jnp.asarray(2.0))), rel=1e-12)
    slope = float(jax.grad(mean)(jnp.asarray(2.0)))
    # central differences over 1e-3 of the mass: relative error about 1e-6
    assert slope == pytest.approx(float(values[2] - values[0]) / 2e-3, rel=1e-4)


@pytest.mark.slow
def test_a_controller_is_flown_by_its_name(extension):
    with pytest.raises(InputError, match="controller 'brake': expected one of"):
        fly(scene(), **SHORT, controllers=("brake",))
    extension("brake")
    flights = fly(scene(), **SHORT, controllers=("brake", "hold"))
    assert tuple(flights.holds) == ("brake", "with_integral")
    assert "by a brake" in terminal(fly_answer(flights).view)
    peaks = [float(one.metrics.peak_deviation_m) for one in flights.holds.values()]
    assert peaks[0] != peaks[1]
    assert 0 < min(peaks) < max(peaks) < np.inf


@pytest.mark.slow
def test_a_users_load_is_flown():
    flown = fly(scene(), seconds=0.1, step_s=2e-3, load=coded_load).first
    # 5.39 m at 300 m/s; from the laws of the package no other number is known
    assert float(flown.encounter.arrival_s[0]) == pytest.approx(29**0.5 / 300.0)
    assert np.isnan(flown.encounter.scaled_distance).all()
    # an impulse of 4 (2.2116^2 5.39^-2.16 + 0.0196) N s on 30 g
    assert float(flown.metrics.peak_deviation_m) > 0.2


def test_gains_and_environments_take_controllers_with_the_loops_of_the_hold(extension):
    extension("brake")
    message = "expected a controller with the gains .* .with_integral, without"
    spread = scene(beliefs={"charge_mass_kg": Normal(1.0, 0.1)})
    with pytest.raises(InputError, match=message):
        tune_gains(spread, TuningSettings(controller="brake"))
    with pytest.raises(InputError, match=message):
        environment_params(controller="brake")
    own = replace(CONTROLLERS["without_integral"], name="own")
    CONTROLLERS.register(own)
    made = environment_params(controller="own")
    assert np.all(made.gains.position == environment_params().gains.position)
