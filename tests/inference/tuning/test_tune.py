"""Tuning: what is refused, slopes, and the truth that comes back."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.tuning import recorded_sound, tune_sound
from jblast.inference.tuning.result import NothingHeardError
from jblast.inference.tuning.search import identified_and_null
from jblast.inference.tuning.tune_sight import paired, tune_events, tune_frames
from jblast.inference.tuning.tune_sound import RecordedSound
from jblast.inference.tuning.unknowns import Between
from jblast.observations.records.sound import write_sound
from jblast.report.tune import tune_answer
from jblast.report.view import terminal
from jblast.scene.reader import scene_from_document
from jblast.sensors.listening import packets, plan

MIC = {"name": "mic", "kind": "microphone", "position_m": [400.0, 0.0, 1.5]}
MIC |= {"rate_hz": 4000, "noise_pa": 0.002}
SOUND = {
    "charge": {"mass_kg": 15.0},
    "air": {"absorption": True, "absorption_scale": 1.4},
    "ambient": {"level_pa": 0.05},
    "sensor": [MIC],
}
CAMERA = {
    "charge": {"mass_kg": 15.0, "position_m": [0.0, 0.0, 1.0]},
    "camera": {
        "position_m": [0.0, -40.0, 2.0],
        "look_at_m": [0.0, 0.0, 3.0],
        "width": 16,
        "height": 12,
        "focal_px": 25.0,
    },
}


def scene_of(document, **tables):
    return scene_from_document(document | tables, "scene.toml")


def record_of(document, seed=0):
    listening = plan(scene_from_document(document, "true"), seed, 2.0)
    samples = next(packets(listening, listening.sensors[0]))[:, 0]
    return RecordedSound("mic.wav", np.asarray(samples), 0, 1.0, ())


def found(tuned, name):
    one = tuned.numbers[name]
    assert one.identified
    return one.value, one.sd


NOISE = RecordedSound("mic.wav", np.random.default_rng(0).normal(size=2048), 0, 1.0, ())


@pytest.mark.parametrize(
    ("names", "word"),
    [
        (["absorption"], "absorption_scale"),
        (["noise_pa", "noise_pa"], "once"),
        (["camera_threshold_darker"], "events"),
        ([], "nothing free"),
    ],
)
def test_names_that_a_record_of_sound_cannot_tell_are_refused(names, word):
    with pytest.raises(InputError, match=word):
        tune_sound(scene_of(SOUND), NOISE, names)


def test_a_scene_without_a_blast_is_refused():
    never = scene_of(SOUND)
    charge = dataclasses.replace(never.scene.charge, time_s=np.inf)
    scene = dataclasses.replace(never.scene, charges=(charge,))
    with pytest.raises(InputError, match="never happens"):
        tune_sound(dataclasses.replace(never, scene=scene), NOISE, ["noise_pa"])


def test_files_that_are_not_the_sensors_are_refused(tmp_path):
    two = scene_of(SOUND, sensor=[MIC, MIC | {"name": "other"}]).scene
    one, samples = scene_of(SOUND).scene, NOISE.samples / 10.0
    for name, values, rate, scene, sensor, word in (
        ("a.wav", samples, 8000, one, None, "rate_hz"),
        ("b.wav", samples, 4000, two, None, "mic, other"),
        ("b.wav", samples, 4000, two, "mik", "did you mean mic"),
        ("c.wav", 0.0 * samples, 4000, one, None, "throughout"),
        ("d.wav", samples[:100], 4000, one, None, "512"),
        ("e.wav", np.stack([samples, samples]), 4000, one, None, "one channel"),
        ("f.txt", None, 4000, one, None, "empty"),
        ("g.csv", np.nan * samples, 4000, one, None, "no number|finite|number"),
    ):
        path = tmp_path / name
        if values is None:
            path.write_text("")
        elif path.suffix == ".wav":
            write_sound(path, values, rate)
        else:
            rows = "".join(f"{n / 4000:.6f},nan\n" for n in range(values.size))
            path.write_text("time_s,overpressure_pa\n" + rows)
        with pytest.raises(InputError, match=word) as refused:
            recorded_sound(path, scene, "scene.toml", sensor)
        assert "\n" not in str(refused.value)
    assert recorded_sound(tmp_path / "b.wav", two, "s", "other").sensor == 1


def test_whole_numbers_ask_what_they_stand_for(tmp_path):
    path = tmp_path / "mic.wav"
    write_sound(path, NOISE.samples / 10.0, 4000, 16)
    with pytest.raises(InputError, match="full_scale"):
        recorded_sound(path, scene_of(SOUND).scene, "scene.toml")
    known = scene_of(SOUND, sensor=[MIC | {"full_scale_pa": 20.0}]).scene
    assert recorded_sound(path, known, "scene.toml").pascals is None
    assert recorded_sound(path, known, "s", full_scale_pa=2.0).pascals == 1.0


def test_films_of_nothing_are_refused():
    scene, times = scene_of(CAMERA), np.arange(4) * 1e-3
    still = np.full((4, 12, 16), 118.0)
    with pytest.raises(InputError, match="nothing changes"):
        tune_frames(scene, still, times, ["camera_daylight_lux"])
    with pytest.raises(InputError, match="after the first blast"):
        tune_frames(scene, still, times - 1.0, ["camera_daylight_lux"])
    nothing = np.zeros(0, int)
    none = paired(nothing, nothing, nothing, nothing, 0.0)
    with pytest.raises(InputError, match="expected some"):
        tune_events(scene, none, ["camera_threshold_darker"])
    with pytest.raises(InputError, match="camera"):
        tune_frames(scene_of(SOUND), still, times, ["camera_daylight_lux"])
    with pytest.raises(InputError, match="expected a record of events"):
        tune_frames(scene, still, times, ["camera_threshold_darker"])


def test_events_are_paired_with_those_before_them_at_their_pixel():
    x, y = np.array([1, 2, 1, 1]), np.array([0, 0, 0, 1])
    time = np.array([0.1, 0.2, 0.3, 0.4])
    pairs = paired(x, y, time, np.ones(4, int), 0.0)
    np.testing.assert_array_equal(pairs.before, [0.0, 0.0, 0.1, 0.0])


@pytest.mark.parametrize("value", [0.05, 0.5, 0.95])
def test_a_number_between_bounds_comes_back_from_its_coordinate(value):
    for belief in (Between(0.0, 1.0), Between(0.01, 1.0, True)):
        z = belief.unconstrain(jnp.asarray(value))
        assert float(belief.constrain(z)) == pytest.approx(value, rel=1e-12)
        assert 0.0 <= float(belief.constrain(jnp.asarray(-50.0))) <= value


def test_a_direction_of_which_little_is_known_is_not_told():
    told, null, covariance = identified_and_null(np.array([[50.0, 50.0], [50.0, 50.0]]))
    np.testing.assert_allclose(np.abs(null), [[0.5**0.5, 0.5**0.5]])
    # 100 is known of their sum; of their difference it counts as 1/4
    np.testing.assert_allclose(covariance, [[2.005, -1.995], [-1.995, 2.005]])
    assert len(told) == 1


@pytest.mark.slow
def test_air_and_noise_come_back_and_what_one_microphone_cannot_tell_is_named():
    high = SOUND | {"sensor": [MIC | {"position_m": [400.0, 0.0, 30.0]}]}
    wrong = scene_of(high, air={"absorption": True}, ambient={"level_pa": 0.3})
    names = ["absorption_scale", "ambient_level_pa", "ambient_height_m"]
    tuned = tune_sound(wrong, record_of(high), names)
    value, sd = found(tuned, "absorption_scale")
    # within five standard deviations, of which a right one needs not even three
    assert abs(value - 1.4) < 5.0 * sd < 0.01
    assert not tuned.numbers["ambient_level_pa"].identified
    assert not tuned.numbers["ambient_height_m"].identified
    (direction,) = tuned.null_directions
    assert set(direction.parameters) == {"ambient_level_pa", "ambient_height_m"}
    answer = tune_answer(tuned, "scene.toml", "mic.wav")
    assert not answer.document.to_dict()["identifiable"]
    assert answer.exit_code == 4
    said = terminal(answer.view)
    assert "does not separate ambient_level_pa and ambient_height_m" in said


@pytest.mark.slow
def test_slopes_are_those_of_differences():
    tuned = tune_sound(scene_of(SOUND), record_of(SOUND), ["absorption_scale"])
    problem, evidence = tuned.problem, tuned.problem.evidence

    def expected(z):
        return evidence.predicted(problem.scene_at(z))

    z, step = jnp.asarray(tuned.z), 1e-4
    slope = jax.jacfwd(expected)(z)[:, 0]
    by_difference = (expected(z + step) - expected(z - step)) / (2.0 * step)
    # central differences are off by the square of the step, a 1e-8 part, and rounding
    scale = float(jnp.abs(slope).max())
    np.testing.assert_allclose(slope, by_difference, atol=1e-5 * scale)


@pytest.mark.slow
def test_a_clock_is_found_and_its_absence_is_said():
    late = SOUND | {"sensor": [MIC | {"clock_offset_s": 0.3}]}
    names = ["clock_offset_s.mic"]
    tuned = tune_sound(scene_of(SOUND), record_of(late), names)
    value, sd = found(tuned, "clock_offset_s.mic")
    assert abs(value - 0.3) < 5.0 * sd < 1e-4
    noise = NOISE._replace(samples=0.05 * NOISE.samples)
    with pytest.raises(NothingHeardError, match="no blast stands out"):
        tune_sound(scene_of(SOUND), noise, names)
