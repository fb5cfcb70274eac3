"""The plan of records: sensors, duration, true values, and the ambient recording."""

import math
import os
from dataclasses import replace

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.sound import write_sound
from jblast.scene import (
    Ambient,
    Charge,
    Instrument,
    Scene,
    Sensor,
    UncertainScene,
)
from jblast.sensors.listening import packets, plan, with_ambient
from jblast.sensors.record_writer import record_names, write_samples

NAMES = ("air_arrival_s", "peak_overpressure_pa", "positive_impulse_pa_s")
RECORDS = tuple((name, 1e-9) for name in NAMES)
PHONE = Sensor(
    "phone",
    np.array([20.0, 0.0, 1.5]),
    "microphone",
    clock_offset_s=0.125,
    records=RECORDS,
)
GAUGE = Sensor("gauge", np.array([5.0, 12.0, 0.0]), "pressure", records=RECORDS)
FLASH = Sensor("light", np.array([9.0, 9.0, 0.0]), "flash")


def scene_of(*sensors: Sensor, **others) -> UncertainScene:
    charge = Charge(mass_kg=15.0, time_s=0.25, position_m=(1.0, 2.0, 0.0))
    return UncertainScene(Scene(charge, sensors=sensors, scatter=False, **others))


@pytest.mark.slow
def test_a_record_lasts_until_the_blast_has_passed():
    listening = plan(scene_of(PHONE, GAUGE))
    values = listening.truth.values
    last = values["air_arrival_s"] + 10 * values["positive_duration_s"]
    assert last.max() < listening.seconds < last.max() + 0.5
    (record,) = packets(listening, PHONE)
    assert record.shape == (48_000 * listening.seconds, 1)
    assert plan(scene_of(PHONE), seconds=2.5).seconds == 2.5
    never = replace(scene_of(PHONE).scene.charge, time_s=math.inf)
    listening = plan(UncertainScene(replace(scene_of(PHONE).scene, charges=(never,))))
    assert listening.seconds == 1.0
    assert np.isinf(listening.truth.values["air_arrival_s"]).all()


def test_invalid_plans_are_rejected():
    nowhere = Sensor("lost", np.full(3, math.nan), "microphone")
    odd = replace(PHONE, instrument=Instrument(rate=44100.5))
    ranged = replace(
        scene_of(PHONE).scene, charges=(Charge(mass_kg=15.0, range_m=30.0),)
    )
    late = replace(scene_of(PHONE).scene, charges=(Charge(mass_kg=15.0, time_s=1e5),))
    cases = {
        "at least one [[sensor]] of kind pressure, microphone": (scene_of(), None),
        "sensor 'light': kind flash writes": (scene_of(FLASH), None),
        "it has no kind": (scene_of(replace(FLASH, kind="")), None),
        "'lost': expected position_m": (scene_of(nowhere), None),
        "rate_hz: expected a whole number": (scene_of(odd), None),
        "range_m: expected position_m": (UncertainScene(ranged), None),
        "expected seconds, or a charge's time_s": (UncertainScene(late), None),
        "seconds: expected 1 to 1,073,725,440 samples": (scene_of(PHONE), 1e6),
        "got 1e-06 s": (scene_of(PHONE), 1e-6),
    }
    for words, (scene, seconds) in cases.items():
        with pytest.raises(InputError) as refusal:
            plan(scene, seconds=seconds)
        assert words in str(refusal.value)


SOUND = np.stack([np.linspace(-0.5, 0.5, 100), np.ones(100)])


def test_a_recording_is_pascals_by_its_full_scale(tmp_path):
    path = tmp_path / "village.wav"
    write_sound(path, SOUND, 4000, 24)
    said = Ambient(file="birds.wav", full_scale=3.0, height=10.0)
    scene, notes = with_ambient(UncertainScene(Scene(ambient=said)), str(path))
    heard = scene.scene.ambient
    assert heard is not None
    assert heard.loop is not None
    assert (float(heard.height), heard.loop_rate) == (10.0, 4000.0)
    # half a step of 24 bits, times three
    np.testing.assert_allclose(heard.loop, 3.0 * SOUND[0], atol=2e-7)
    assert notes[1] == "the first of its 2 channels is used"
    named = UncertainScene(Scene(ambient=Ambient(file=str(path))))
    again, _ = with_ambient(named)
    assert again.scene.ambient is not None
    assert again.scene.ambient.loop is not None
    np.testing.assert_allclose(again.scene.ambient.loop, SOUND[0], atol=1e-7)


def test_unusable_ambient_recordings_are_reported(tmp_path):
    noise, path = UncertainScene(Scene(ambient=Ambient(level=0.1))), tmp_path / "a.wav"
    assert with_ambient(noise) == (noise, [])
    with pytest.raises(InputError, match="no such file"):
        with_ambient(noise, str(path))
    write_sound(path, np.zeros(10), 4000)
    assert with_ambient(noise, str(path))[1][1] == "the ambient recording is silent"
    write_sound(path, np.ones(1), 4000)
    with pytest.raises(InputError, match="two or more samples"):
        with_ambient(noise, str(path))


def numbers_in_packets(*sizes: int, end: BaseException | None = None):
    """Packets of numbers in a row."""
    start = 0
    for size in sizes:
        yield np.arange(start, start + size)[:, None] / np.array([3.0, -1.0])
        start += size
    if end is not None:
        raise end


def test_every_sensor_has_a_file_of_its_own_whatever_its_name():
    called = ["a", "A", "truth", "../b", "c/d", "c_d", "...", "x" * 300, "Ö 1", "con\n"]
    sensors = [Sensor(name, np.zeros(3), "pressure") for name in called]
    names = record_names([*sensors, Sensor("phone", np.zeros(3), "microphone")])
    assert [*names.values()] == [
        *("a.csv", "A_2.csv", "truth_2.csv", "_b.csv", "c_d.csv", "c_d_2.csv"),
        *("_.csv", "x" * 80 + ".csv", "Ö 1.csv", "con_.csv", "phone.wav"),
    ]


def test_packets_make_the_file_that_the_whole_makes(tmp_path):
    one, many = tmp_path / "one.csv", tmp_path / "many.csv"
    comments = ["made up", "of two\nlines"]
    write_samples(one, numbers_in_packets(7), 4.0, ("a_pa", "b_pa"), comments)
    write_samples(many, numbers_in_packets(2, 0, 4, 1), 4.0, ("a_pa", "b_pa"), comments)
    assert one.read_bytes() == many.read_bytes()
    first, second, head, *_, last = one.read_text().splitlines()
    assert (first, second) == ("# made up", "# of two lines")
    assert (head, last) == ("time_s,a_pa,b_pa", "1.500000000,2,-6")


@pytest.mark.parametrize("end", [RuntimeError("broke"), KeyboardInterrupt()])
def test_a_stream_that_breaks_keeps_the_samples_before(tmp_path, end):
    path = tmp_path / "a.csv"
    with pytest.raises(type(end)):
        write_samples(
            path, numbers_in_packets(3, 2, end=end), 4.0, ("a_pa", "b_pa"), []
        )
    before = path.read_text()
    assert len(before.splitlines()) == 6
    with pytest.raises(type(end)):  # none had come: what was there stays
        write_samples(path, numbers_in_packets(0, end=end), 4.0, ("a_pa", "b_pa"), [])
    assert path.read_text() == before
    assert os.listdir(tmp_path) == ["a.csv"]
