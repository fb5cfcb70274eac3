"""A microphone's record is the blast of the laws, and its stream is its record."""

from dataclasses import replace
from itertools import islice
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast
from jblast.errors import InputError
from jblast.scene import Ambient, Charge, Instrument, Scene, Sensor
from jblast.sensors import microphone
from jblast.sensors.arrivals import Track
from jblast.sensors.wave_paths import DEFAULT_RECORD_LAWS

RATE, KEY = 20_000.0, jax.random.key(3)
AIR = microphone.WavePaths(ground=False)
IDEAL = Instrument(rate=RATE)
SCENE = Scene(Charge(mass_kg=15.0, time_s=0.5))
MICROPHONE = Sensor("m", np.array([40.0, 30.0, 1.5]), "microphone", instrument=IDEAL)
LATE = replace(MICROPHONE, clock_offset_s=np.array(7.25))
DURATION_S = 0.4
LOUD = Scene(
    Charge(mass_kg=15.0, time_s=0.5),
    air=jblast.scene.Air(wind_east=8.0),
    ambient=Ambient(loop=np.sin(np.arange(5000.0) ** 1.5), loop_rate=16_000.0),
)
REAL = replace(
    MICROPHONE,
    instrument=Instrument(
        rate=RATE,
        full_scale=500.0,
        noise=0.02,
        high_pass=10.0,
        low_pass=8000.0,
        bits=16,
        noise_slope=-3.0,
        wind_noise=0.1,
        saturation="compress",
    ),
)
ROTORS = microphone.Rotors(
    time=np.array([0.4, 0.6]),
    speed=np.array([[500.0, 520.0], [600.0, 480.0]]),
    amplitude=np.array([0.2, 0.1]),
    reference_speed=500.0,
)


def read_off(scene, sensor):
    """Return what `sensors.record` says of the same scene, by the sensor's clock."""
    laws = {str(quantity): law for quantity, law in DEFAULT_RECORD_LAWS.items()}
    sensor = replace(sensor, records=tuple((name, 0.01) for name in laws))
    layout, *_ = jblast.sensors.planned_layout(replace(scene, sensors=(sensor,)))
    recording = jblast.record(replace(scene, sensors=(sensor,)), layout, laws)
    return dict(zip(layout.quantity, np.asarray(recording.value), strict=True))


def test_the_record_has_arrival_peak_duration_and_impulse_of_the_laws():
    law = read_off(SCENE, LATE)
    start = law["air_arrival_s"] - 0.1 - 0.3 / RATE
    samples = np.asarray(
        microphone.record(SCENE, LATE, DURATION_S, KEY, start_s=start, wave_paths=AIR)
    )
    assert samples.shape == (round(DURATION_S * RATE),)
    first = np.flatnonzero(samples)[0]
    assert first == np.floor((law["air_arrival_s"] - start) * RATE)
    # the positive phase spans some 500 samples, so its mean over one falls by 2/500
    assert samples.max() == pytest.approx(law["peak_overpressure_pa"], rel=0.01)
    over = first + int(law["positive_duration_s"] * RATE)
    assert (samples[first : over - 1] > 0).all()
    assert (samples[over + 2 : over + 200] < 0).all()
    impulse = samples[first : over + 1].sum() / RATE
    # what the last sample holds of the suction, whose slope is that of the pulse's end
    assert impulse == pytest.approx(law["positive_impulse_pa_s"], rel=1e-4)


@pytest.mark.slow
def test_a_stream_is_the_record_to_the_last_bit_whatever_is_heard():
    for scene, sensor, rotors in (
        (SCENE, MICROPHONE, None),
        (LOUD, REAL, ROTORS),
        (replace(LOUD, ambient=Ambient(level=0.3, slope=-3.0)), REAL, None),
    ):
        options: dict[str, Any] = {"start_s": 0.5, "rotors": rotors}
        whole = microphone.record(scene, sensor, DURATION_S, KEY, **options)
        assert np.isfinite(whole).all()
        for packets_hz in (2.5, 100.0, 333.0):
            made = microphone.stream(
                scene, sensor, KEY, packets_hz=packets_hz, **options
            )
            some = list(islice(made, int(packets_hz * DURATION_S)))
            samples = np.concatenate([one.samples for one in some])
            assert np.array_equal(samples, whole[: samples.size])
            assert samples.size > 0.9 * whole.size
            assert some[-1].start_s == 0.5 + some[-1].first_sample / RATE


def heard_of(mass, place, time, dtype: Any = float, start_s=0.55, wave_paths=AIR):
    charge = Charge(mass_kg=mass, time_s=time)
    sensor = Sensor("m", jnp.asarray(place, dtype), "microphone", instrument=IDEAL)
    options: dict[str, Any] = {"start_s": start_s, "wave_paths": wave_paths}
    return microphone.record(Scene(charge), sensor, 0.2, KEY, **options)


@pytest.mark.slow
def test_slopes_by_mass_place_and_time_are_those_of_finite_differences():
    weight = np.random.default_rng(0).normal(size=4000)

    def told(numbers):
        mass, east, up, time = numbers
        place = jnp.stack([east, jnp.full_like(east, 30.0), up])
        return jnp.dot(heard_of(mass, place, time), weight)

    numbers, step = jnp.array([15.0, 40.0, 1.5, 0.5]), 1e-6
    value_and_slope = jax.jit(jax.vmap(jax.value_and_grad(told)))
    steps = step * np.concatenate([np.eye(4), -np.eye(4), np.zeros((1, 4))])
    shifted = numbers[None, :] + steps
    values, slopes = value_and_slope(shifted)
    measured = (values[:4] - values[4:8]) / (2 * step)
    # the front moves by less than a sample, in which its mean is smooth
    assert np.asarray(slopes[-1]) == pytest.approx(np.asarray(measured), rel=1e-4)


def test_ambient_sound_falls_with_height_and_wind_is_as_its_speed_squared():
    def level(scene, sensor):
        samples = microphone.record(scene, sensor, DURATION_S, KEY, start_s=-10.0)
        return float(np.std(np.asarray(samples)))

    noisy = replace(SCENE, ambient=Ambient(level=0.3, slope=0.0, height=20.0))
    low, high = (
        level(noisy, replace(MICROPHONE, position_m=np.array([40.0, 30.0, up])))
        for up in (0.0, 40.0)
    )
    assert low == pytest.approx(0.3, rel=5 / (DURATION_S * RATE) ** 0.5)
    assert high / low == pytest.approx(np.exp(-2), rel=1e-12)
    still, brisk, storm = (
        level(
            replace(SCENE, air=jblast.scene.Air(wind_north=speed)),
            replace(MICROPHONE, instrument=Instrument(RATE, wind_noise=0.1)),
        )
        for speed in (0.0, 5.0, 10.0)
    )
    assert still == 0.0
    assert storm / brisk == pytest.approx(4.0, rel=1e-9)


@pytest.mark.slow
def test_a_track_that_stands_still_is_a_place_and_ambient_sound_follows_one():
    options: dict[str, Any] = {"start_s": 0.55}
    track = Track(np.array([0.0, 1.0]), np.tile(MICROPHONE.position_m, (2, 1)))
    stands = microphone.record(SCENE, MICROPHONE, 0.2, KEY, **options)
    moves = microphone.record(SCENE, MICROPHONE, 0.2, KEY, track=track, **options)
    peak = np.abs(stands).max()
    assert np.abs(moves - stands).max() < 1e-6 * peak
    noisy = Scene(Charge(time_s=np.inf), ambient=Ambient(level=0.3, height=20.0))
    climb = Track(np.array([0.0, 10.0]), np.array([[9.0, 9, 0], [9.0, 9, 100]]))
    samples = np.asarray(
        microphone.record(noisy, MICROPHONE, DURATION_S, KEY, start_s=0.0, track=climb)
    )
    alone = replace(MICROPHONE, position_m=np.array([9.0, 9.0, 0.0]))
    ground = np.asarray(microphone.record(noisy, alone, DURATION_S, KEY))
    middle = (np.arange(samples.size) + 0.5) / RATE
    assert samples == pytest.approx(ground * np.exp(-middle * 10 / 20), rel=1e-9)


def test_what_is_no_microphone_or_in_no_place_for_one_is_refused():
    for sensor, said in (
        (replace(MICROPHONE, kind="geophone"), "'m': expected .* microphone, got 'geo"),
        (replace(MICROPHONE, position_m=np.array([9.0, 9.0, -1.0])), "got -1 m up"),
        (replace(MICROPHONE, position_m=np.full(3, np.nan)), "got nan m up"),
        (replace(MICROPHONE, position_m=np.zeros(3)), "a position away"),
    ):
        with pytest.raises(InputError, match=said):
            microphone.record(SCENE, sensor, 0.1, KEY)
    unread = replace(SCENE, ambient=Ambient(file="loop.wav"))
    with pytest.raises(InputError, match=r"samples of loop\.wav"):
        microphone.record(unread, MICROPHONE, 0.1, KEY)
    with pytest.raises(InputError, match="a finite start_s, got nan s"):
        microphone.record(SCENE, MICROPHONE, 0.1, KEY, start_s=np.nan)
    with pytest.raises(ValueError, match="duration_s"):
        microphone.record(SCENE, MICROPHONE, -1.0, KEY)
