"""Tuning: what is refused, slopes, and the truth that comes back."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import butter, sosfreqz

from jblast.errors import InputError
from jblast.inference.tuning import recorded_sound, tune_sound
from jblast.inference.tuning.result import NothingHeardError
from jblast.inference.tuning.search import identified_and_null
from jblast.inference.tuning.sound import (
    filled,
    filling,
    noise_spectrum,
    padded_places,
    passed_power,
)
from jblast.inference.tuning.tune_sight import (
    camera_of,
    look_of,
    paired,
    tune_events,
    tune_frames,
)
from jblast.inference.tuning.tune_sound import RecordedSound
from jblast.inference.tuning.unknowns import Between
from jblast.observations.records.sound import write_sound
from jblast.report.tune import tune_answer
from jblast.scene import Ambient, Charge, Instrument, Scene, Sensor
from jblast.scene.reader import scene_from_document
from jblast.sensors import recording
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.image import linear_to_srgb, luminance, srgb_to_linear
from jblast.sensors.camera.rendering import render
from jblast.sensors.camera.scene_events import film_events
from jblast.sensors.camera.stream import joined
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


STILL, TIMES = np.full((4, 12, 16), 118.0), np.arange(4) * 1e-3
NONE = np.zeros(0, int)
NOTHING = paired(NONE, NONE, NONE.astype(float), NONE, 0.0)


@pytest.mark.parametrize(
    ("tune", "scene", "seen", "name", "word"),
    [
        (tune_frames, CAMERA, (STILL, TIMES), "daylight_lux", "nothing changes"),
        (tune_frames, CAMERA, (STILL, TIMES - 1), "daylight_lux", "after the first"),
        (tune_frames, SOUND, (STILL, TIMES), "daylight_lux", "camera"),
        (tune_frames, CAMERA, (STILL, TIMES), "threshold_darker", "record of events"),
        (tune_events, CAMERA, (NOTHING,), "threshold_darker", "expected some"),
    ],
)
def test_films_of_nothing_are_refused(tune, scene, seen, name, word):
    with pytest.raises(InputError, match=word):
        tune(scene_of(scene), *seen, [f"camera_{name}"])


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


TRUE = {
    "charge": {"mass_kg": 15.0, "position_m": [0.0, 0.0, 1.0]},
    "law": {"fireball_growth_s": 0.004},
    "camera": {
        "position_m": [0.0, -40.0, 2.0],
        "look_at_m": [0.0, 0.0, 3.0],
        "width": 24,
        "height": 18,
        "focal_px": 38.0,
        "threshold": [0.25, 0.3],
        "daylight_lux": 5e4,
    },
}
WRONG = TRUE | {
    "law": {"fireball_growth_s": 0.0022},
    "camera": TRUE["camera"] | {"threshold": [0.2, 0.2], "daylight_lux": 9e4},
}


def within(tuned, name, truth):
    one = tuned.numbers[name]
    assert one.identified
    return abs(one.value - truth) < 5.0 * one.sd


def true_events():
    truth = scene_from_document(TRUE, "t").scene
    camera = camera_of(truth)
    film = Film(truth, camera, np.array([0.0, 0.06]), appearance=look_of(camera))
    events = joined(film_events(film))
    return paired(events.x, events.y, np.round(events.time, 6), events.polarity, 0.0)


@pytest.mark.slow
def test_frames_tell_growth_and_exposure():
    truth = scene_from_document(TRUE, "t").scene
    camera, times = camera_of(truth), np.arange(30) * 2e-3
    frames = np.asarray(render(truth, camera, times, appearance=look_of(camera)))
    stored = np.stack([srgb_bytes(frame) for frame in frames]) / 255.0
    light = luminance(srgb_to_linear(stored))
    values = 255.0 * linear_to_srgb(np.asarray(light))
    names = ["fireball_growth_s", "camera_daylight_lux"]
    tuned = tune_frames(scene_from_document(WRONG, "w"), values, times, names)
    assert tuned.converged
    assert not tuned.explained.is_poor
    assert within(tuned, "fireball_growth_s", 0.004)
    assert within(tuned, "camera_daylight_lux", 5e4)
    assert tuned.numbers["fireball_growth_s"].sd < 1e-5


@pytest.mark.slow
def test_events_tell_thresholds_and_growth():
    pairs = true_events()
    names = ["fireball_growth_s", "camera_threshold_brighter"]
    names += ["camera_threshold_darker"]
    camera_as_exposed = WRONG["camera"] | {"daylight_lux": 5e4}
    wrong = scene_from_document(WRONG | {"camera": camera_as_exposed}, "w")
    tuned = tune_events(wrong, pairs, names)
    assert not tuned.explained.is_poor
    assert within(tuned, "camera_threshold_brighter", 0.25)
    assert within(tuned, "camera_threshold_darker", 0.3)
    assert within(tuned, "fireball_growth_s", 0.004)


@pytest.mark.slow
def test_events_of_another_exposure_than_is_supposed_are_poorly_explained():
    pairs = true_events()
    names = ["camera_threshold_brighter", "camera_threshold_darker"]
    tuned = tune_events(scene_from_document(WRONG, "w"), pairs, names)
    assert tuned.explained.is_poor


COUNT = 96
CLIPPED = np.isin(np.arange(COUNT), [20, 21, 22, 23, 24, 40, 41, 70])


@pytest.fixture(scope="module")
def noise():
    """Noise of a red spectrum, and its inverse covariance as a dense matrix."""
    sd = 1.0 / np.sqrt(1.0 + np.arange(COUNT // 2 + 1.0))
    kernel = np.fft.irfft(sd**-2.0, COUNT)
    gaps = np.subtract.outer(np.arange(COUNT), np.arange(COUNT)) % COUNT
    return jnp.asarray(sd), kernel[gaps]


@pytest.fixture(scope="module")
def left():
    return np.random.default_rng(0).normal(size=COUNT)


@jax.jit
def fill(left, places, sd):
    return filled(left, places, sd, filling(places, sd, COUNT))


def test_it_is_the_mean_of_a_normal_given_the_others(noise, left):
    sd, inverse = noise
    places = jnp.asarray(padded_places(CLIPPED))
    found = fill(jnp.asarray(left), places, sd)
    covariance = np.linalg.inv(inverse)
    across = covariance[np.ix_(CLIPPED, ~CLIPPED)]
    own = covariance[np.ix_(~CLIPPED, ~CLIPPED)]
    expected = across @ np.linalg.solve(own, left[~CLIPPED])
    np.testing.assert_allclose(found[CLIPPED], expected, atol=1e-10)
    np.testing.assert_array_equal(found[~CLIPPED], left[~CLIPPED])


def test_its_squares_are_those_of_the_others_alone(noise, left):
    sd, inverse = noise
    places = jnp.asarray(padded_places(CLIPPED))
    own = np.linalg.inv(inverse)[np.ix_(~CLIPPED, ~CLIPPED)]
    alone = np.linalg.inv(own)

    def squares(left):
        found = fill(left, places, sd)
        return found @ jnp.asarray(inverse) @ found

    of = jnp.asarray(left)
    expected = left[~CLIPPED] @ alone @ left[~CLIPPED]
    np.testing.assert_allclose(squares(of), expected, rtol=1e-10)
    # so a sample at the limit says nothing of what is looked for, and others all
    slopes = np.asarray(jax.grad(squares)(of))
    np.testing.assert_allclose(slopes[CLIPPED], 0.0, atol=1e-12)
    np.testing.assert_allclose(
        slopes[~CLIPPED], 2.0 * alone @ left[~CLIPPED], rtol=1e-9
    )


RATE = 8000.0


def test_the_filters_power_is_that_of_the_filter():
    count, high_pass, low_pass = 65, 30.0, 900.0
    frequency = np.linspace(0.0, 0.5 * RATE, count)[1:-1]
    sections: Any = [
        butter(2, corner, side, fs=RATE, output="sos")
        for corner, side in ((high_pass, "high"), (low_pass, "low"))
    ]
    _, known = sosfreqz(np.concatenate(sections), frequency, fs=RATE)
    power = passed_power(RATE, high_pass, low_pass, count)[1:-1]
    # the grid stands 1e-6 of the rate short of its half
    np.testing.assert_allclose(power, np.square(np.abs(known)), rtol=2e-3, atol=1e-9)


@pytest.mark.slow
def test_what_a_microphone_draws_has_the_spectrum_that_is_expected():
    instrument = Instrument(RATE, noise=0.01, high_pass=30.0, low_pass=2000.0)
    sensor = Sensor("mic", (100.0, 0.0, 20.0), "microphone", instrument=instrument)
    never = Charge(time_s=np.inf)
    ambient = Ambient(level=0.1, slope=-3.0)
    scene = Scene(never, sensors=(sensor,), ambient=ambient)
    samples = recording(scene, sensor, jax.random.key(1)).samples(16.0)
    rows = np.asarray(samples)[:122880].reshape(-1, 512) * np.hanning(512)
    power = np.square(np.abs(np.fft.rfft(rows, axis=1))).mean(axis=0)
    power /= np.square(np.hanning(512)).sum()
    expected = np.asarray(noise_spectrum(scene, sensor))[:: (4096 // 256)]
    ratio = power[8:-2] / expected[8:-2]
    # 240 pieces: each ratio is known to 1/sqrt(240) = 6 %; their mean to 0.5 %
    assert abs(ratio.mean() - 1.0) < 0.02
    assert np.abs(ratio - 1.0).max() < 0.3
