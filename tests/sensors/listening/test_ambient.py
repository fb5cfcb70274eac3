import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.sound import write_sound
from jblast.scene import Ambient, Scene, UncertainScene
from jblast.sensors.listening import with_ambient

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


def test_without_a_recording_nothing_is_read():
    noise = UncertainScene(Scene(ambient=Ambient(level=0.1)))
    assert with_ambient(noise) == (noise, [])
    with pytest.raises(InputError, match="no such file"):
        with_ambient(noise, "nowhere.wav")


def test_silence_and_a_recording_too_short_are_told(tmp_path):
    path = tmp_path / "a.wav"
    write_sound(path, np.zeros(10), 4000)
    _, notes = with_ambient(UncertainScene(Scene()), str(path))
    assert notes[1] == "the ambient recording is silent"
    write_sound(path, np.ones(1), 4000)
    with pytest.raises(InputError, match="two or more samples"):
        with_ambient(UncertainScene(Scene()), str(path))
