"""A sensor's instrument and the ambient sound, from the file to the scene."""

import tomllib

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from docs.generate.scene_schema import scene_schema
from jblast.errors import InputError
from jblast.scene import Ambient, Imu, Instrument
from jblast.scene.reader.scene import scene_from_document

MICROPHONE = {
    "name": '"m"',
    "kind": '"microphone"',
    "position_m": "[60, 0, 1.5]",
    "rate_hz": "44100",
    "full_scale_pa": "200",
    "noise_pa": "0.02",
    "bits": "24",
    "filter_hz": "[20, 20000]",
    "saturation": '"compress"',
}


def document(heading="[[sensor]]", **entries):
    lines = [f"{key} = {value}" for key, value in entries.items() if value]
    return tomllib.loads("\n".join([heading, *lines, ""]))


def instrument(**changed):
    read = document(**{**MICROPHONE, **changed})
    return scene_from_document(read, "scene.toml").scene.sensors[0].instrument


def ambient(**entries):
    read = document("[ambient]", **entries)
    return scene_from_document(read, "there/scene.toml").scene.ambient


def test_every_key_of_an_instrument_arrives_where_it_belongs():
    one = instrument()
    assert one == Instrument(44100.0, 200.0, 0.02, 24, 20.0, 20000.0, "compress")
    assert Draft202012Validator(scene_schema()).is_valid(document(**MICROPHONE))


def test_an_instrument_of_which_nothing_is_said_is_none_and_one_key_makes_it_ideal():
    silent = dict.fromkeys([*MICROPHONE][3:])
    assert instrument(**silent) is None
    assert instrument(**silent | {"rate_hz": "8000"}) == Instrument(rate=8000.0)
    one = instrument(**silent | {"bits": '"float"', "filter_hz": '["none", 300]'})
    assert one == Instrument(bits=None, high_pass=None, low_pass=300.0)


def test_a_geophone_has_its_full_scale_and_noise_in_metres_a_second():
    of_pressure = {"full_scale_pa": None, "noise_pa": None}
    of_velocity = {"full_scale_m_s": "0.1", "noise_m_s": "1e-6"}
    one = instrument(kind='"geophone"', **of_pressure, **of_velocity)
    assert one == Instrument(44100.0, 0.1, 1e-6, 24, 20.0, 20000.0, "compress")


def test_every_key_of_the_ambient_sound_arrives_where_it_belongs():
    noise = ambient(level_pa="0.1", slope_db_octave="-3", height_m="20")
    assert noise == Ambient(0.1, -3.0, 20.0)
    recorded = Ambient(file="there/loop.wav", full_scale=3.0, height=30.0)
    assert ambient(file='"loop.wav"', full_scale_pa="3") == recorded
    assert scene_from_document({}, "scene.toml").scene.ambient is None


def test_air_absorbs_within_the_range_of_a_law_where_the_file_says_so():
    for said in (True, False):
        read = {"air": {"absorption": said, "temperature_k": 280.0}}
        air = scene_from_document(read, "scene.toml").scene.air
        assert air.absorption is said
        assert float(air.temperature) == 280.0


def test_values_that_no_instrument_has_are_refused_in_python_too():
    for wrong, said in (
        (lambda: Instrument(rate=0.0), "rate must be positive"),
        (lambda: Instrument(bits=7, full_scale=1.0), "bits must be 8 to 32"),
        (lambda: Instrument(bits=16), "full_scale"),
    ):
        with pytest.raises(ValueError, match=said):
            wrong()
    with pytest.raises(ValueError, match="two samples or more"):
        Ambient(loop=np.ones(1), loop_rate=100.0)
    with pytest.raises(ValueError, match="loop_rate must be positive"):
        Ambient(loop=np.ones(2))


BROKEN = {
    "negative rate": ({"rate_hz": "-48000"}, ["'m' rate_hz", "positive", "-48000"]),
    "free rate": ({"rate_hz": '"free"'}, ["'m' rate_hz", "not supported yet"]),
    "no full scale": ({"full_scale_pa": "0"}, ["full_scale_pa", "positive", "got 0"]),
    "negative noise": ({"noise_pa": "-1"}, ["noise_pa", "not negative", "got -1"]),
    "seven bits": ({"bits": "7"}, ["bits", "8 to 32", "got 7"]),
    "bits without a range": (
        {"full_scale_pa": None},
        ["'m' bits", "full_scale_pa", "24 bits alone"],
    ),
    "one corner": ({"filter_hz": "[20]"}, ["filter_hz", "[high-pass, low-pass]"]),
    "corners reversed": (
        {"filter_hz": "[2000, 20]"},
        ["filter_hz", "below the low-pass one", "[2000, 20]"],
    ),
    "a corner above half the rate": (
        {"filter_hz": "[20, 22050]"},
        ["filter_hz[1]", "below 22050", "got 22050"],
    ),
    "saturation": ({"saturation": '"clipp"'}, ["saturation", "did you mean clip?"]),
    "underground": (
        {"position_m": "[0, 0, -1]"},
        ["'m' position_m[2]", "microphone on the ground or above", "got -1 m"],
    ),
    "an instrument of light": (
        {"kind": '"flash"'},
        ["'m' rate_hz", "writes samples", "got kind 'flash'"],
    ),
    "pascals of a geophone": (
        {"kind": '"geophone"'},
        ["'m' full_scale_pa", "expected full_scale_m_s", "'geophone'"],
    ),
}


SILENT = {
    "neither": ({"height_m": "3"}, ["level_pa", "either level_pa or file", "neither"]),
    "both": ({"level_pa": "1", "file": '"a.wav"'}, ["level_pa", "both"]),
    "slope of a file": (
        {"slope_db_octave": "1", "file": '"a.wav"'},
        ["slope_db_octave", "got both"],
    ),
    "scale of a level": ({"level_pa": "1", "full_scale_pa": "1"}, ["full_scale_pa"]),
    "negative level": ({"level_pa": "-1"}, ["level_pa", "not negative", "got -1"]),
    "no height": ({"level_pa": "1", "height_m": "0"}, ["height_m", "positive"]),
    "steep": ({"level_pa": "1", "slope_db_octave": "99"}, ["-12 to 12", "got 99"]),
    "file that is a number": ({"file": "3"}, ["file", "a name in quotes", "got 3"]),
    "misspelt": ({"levl_pa": "1"}, ["levl_pa", "did you mean level_pa?"]),
}


IMU = {
    "name": '"i"',
    "kind": '"imu"',
    "mount": '"vehicle"',
    "rate_hz": "800",
    "full_scale_m_s2": "160",
    "full_scale_rad_s": "17.5",
    "noise_m_s2_sqrt_hz": "1e-3",
    "noise_rad_s_sqrt_hz": "2e-4",
    "bias_m_s2": "0.1",
    "bias_rad_s": "0",
    "bias_walk_m_s2_sqrt_s": "1e-4",
    "bias_walk_rad_s_sqrt_s": "1e-5",
    "bits": '"float"',
}
"""Every key of an imu."""


def imu(**changed):
    vehicle = tomllib.loads('[vehicle]\nmodel = "iris"\nposition_m = [0, 0, 5]')
    read = vehicle | document(**{**IMU, **changed})
    return scene_from_document(read, "scene.toml").scene.sensors[0].imu


def test_every_key_of_an_imu_arrives_where_it_belongs():
    assert imu() == Imu(800, 160, 17.5, 1e-3, 2e-4, 0.1, 0.0, 1e-4, 1e-5, None)
    assert Draft202012Validator(scene_schema()).is_valid(document(**IMU))
    silent = dict.fromkeys([*IMU][3:])
    assert imu(**silent) is None
    assert imu(**silent | {"rate_hz": "500"}) == Imu(rate=500)


BROKEN_IMU = {
    "no rate": ({"rate_hz": "0"}, ["rate_hz", "is positive"]),
    "far too fast": ({"rate_hz": "1e9"}, ["rate_hz", "at most 100000"]),
    "negative noise": ({"noise_m_s2_sqrt_hz": "-1"}, ["noise_m_s2", "not negative"]),
    "half a bit": ({"bits": "12.5"}, ["bits", "whole number"]),
    "a gauge's noise": ({"noise_pa": "1"}, ["noise_pa", "for an imu"]),
    "not an imu": (
        {"kind": '"microphone"', "rate_hz": None, "bits": None},
        ["full_scale_m_s2", 'kind = "imu"'],
    ),
    "standing still": (
        {"mount": None, "position_m": "[0, 0, 1]"},
        ["rate_hz", 'mount = "vehicle"', "got no mount"],
    ),
}


REFUSED = [
    *((instrument, "scene.toml: [[sensor]] ", *case) for case in BROKEN.values()),
    *((ambient, "there/scene.toml: [ambient] ", *case) for case in SILENT.values()),
    *((imu, "scene.toml: [[sensor]] 'i' ", *case) for case in BROKEN_IMU.values()),
]


@pytest.mark.parametrize(
    ("read", "where", "entries", "said"), REFUSED, ids=[*BROKEN, *SILENT, *BROKEN_IMU]
)
def test_what_is_broken_is_refused_by_file_table_and_key(read, where, entries, said):
    with pytest.raises(InputError) as caught:
        read(**entries)
    message = str(caught.value)
    assert message.startswith(where)
    for words in said:
        assert words in message, message
