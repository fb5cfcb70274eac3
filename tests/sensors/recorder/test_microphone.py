"""Background of a microphone: absorption, ambient sound, wind, loops and rotors."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from jblast.scene import Air, Ambient, Charge, Instrument, Scene, Sensor
from jblast.sensors import Track, recording, waves
from jblast.sensors.instrument import instrument_chain
from jblast.sensors.noise import BLOCK
from jblast.sensors.recorder import Recorder
from jblast.sensors.sources import Rotors, Sound, ambient_sound
from tests.waves.absorbing import absorb

RATE, KEY = 8000.0, jax.random.key(2)
MICROPHONE = Sensor(
    "m", np.array([300.0, 0.0, 20.0]), "microphone", instrument=Instrument(RATE)
)
NEVER = Scene(Charge(time_s=np.inf))


def recorded(scene, sensor=MICROPHONE, duration_s=0.4, **options):
    return np.asarray(recording(scene, sensor, KEY, **options).samples(duration_s))


def alone(*sources, start_s=0.0, rate=RATE):
    """Return a recorder of some sources."""
    chain = instrument_chain(Instrument(rate=rate), KEY)
    return Recorder(sources, (chain,), jnp.asarray(start_s), rate)


@pytest.mark.slow
def test_air_absorbs_where_the_scene_requests_it():
    scene = Scene(Charge(mass_kg=15.0), air=Air(relative_humidity=0.3))
    plain = recorded(scene, start_s=0.75)
    humid = replace(scene, air=replace(scene.air, absorption=True))
    absorbed, air = recorded(humid, start_s=0.75), humid.air
    distance = np.hypot(300.0, 20.0)
    numbers = (distance, air.temperature, air.pressure, air.relative_humidity)
    peak = np.abs(plain).max()
    assert np.abs(absorbed - plain).max() > 0.02 * peak
    # the two forget after 0.25 s each: e^-14 of the slowest relaxation
    known = np.asarray(absorb(plain, RATE, *numbers))
    assert absorbed == pytest.approx(known, abs=1e-5 * peak)


@pytest.mark.slow
def test_absorption_begins_without_a_step_where_laws_of_weak_shocks_end():
    scene, rate = Scene(Charge(mass_kg=0.2)), 48_000.0

    def near_front(z):
        place = jnp.array([0.2 ** (1 / 3) * z, 0.0, 0.0])
        sensor = Sensor("m", place, "microphone", instrument=Instrument(rate))
        start_s = waves(scene, place)[0].pulse.arrival_time - 0.001
        return recording(scene, sensor, KEY, start_s=start_s).samples(400 / rate)

    found = []
    for z in (250.0, 275.0, 299.0, 301.0, 325.0, 350.0):
        record = np.asarray(near_front(z))
        until = record[: record.argmax() + 1]
        low, high = np.interp([0.1, 0.9], until / until[-1], np.arange(until.size))
        found.append((until[-1], high - low))
    peaks, rises = np.log(found).T
    assert (np.diff(peaks) < 0).all()
    assert (np.diff(rises) > 0).all()
    # 2 of 300 in distance: the peak falls as Z^-1.1 and by absorption, rises grow
    assert peaks[2] - peaks[3] < 0.02
    assert rises[3] - rises[2] < 0.03
    for z in (299.0, 300.0, 301.0):
        slope = jax.grad(lambda z: jnp.sum(near_front(z) ** 2))(z)
        assert np.isfinite(slope)
        assert slope < 0.0


@pytest.mark.slow
def test_ambient_sound_falls_with_height_along_a_track():
    scene = replace(NEVER, ambient=Ambient(level=0.3, slope=0.0, height=20.0))
    low = replace(MICROPHONE, position_m=np.array([9.0, 9.0, 0.0]))
    ground = recorded(scene, low)
    assert ground.std() == pytest.approx(0.3, rel=5 / ground.size**0.5)
    climb = Track(np.array([0.0, 10.0]), np.array([[9.0, 9, 0], [9.0, 9, 100]]))
    middle = (np.arange(ground.size) + 0.5) / RATE
    moving = recorded(scene, low, track=climb)
    assert moving == pytest.approx(ground * np.exp(-middle * 10 / 20), rel=1e-9)


def test_wind_noise_is_proportional_to_the_square_of_the_wind():
    instrument = Instrument(RATE, wind_noise=0.1)
    sensor = replace(MICROPHONE, instrument=instrument)
    still, brisk, storm = (
        recorded(replace(NEVER, air=Air(wind_north=speed)), sensor).std()
        for speed in (0.0, 5.0, 10.0)
    )
    assert still == 0.0
    assert storm / brisk == pytest.approx(4.0, rel=1e-9)
    assert brisk == pytest.approx(0.1 * 1.2 * 25.0, rel=0.5)  # most of it below 20 Hz


def played(loop, loop_rate, rate, n):
    sound = ambient_sound(Ambient(loop=loop, loop_rate=loop_rate), rate, KEY)
    return np.asarray(alone(Sound(sound), rate=rate).samples(n / rate))


@pytest.mark.parametrize("size", [2, 30, BLOCK, 10_000])
def test_a_loop_repeats_and_follows_the_recording(size):
    loop = np.random.default_rng(0).normal(size=size)
    fade = max(1, min(200, size // 4))
    turn = size - fade
    samples = played(loop, 4000.0, 4000.0, 3 * size + BLOCK)
    assert np.array_equal(samples[turn:], samples[:-turn])
    assert np.array_equal(samples[fade:turn], loop[fade:turn])
    # the first sample follows the last one of the turn as it did in the recording
    assert samples[turn] == loop[turn]


TIME = np.array([1.0, 1.25, 1.5, 1.75])
SPEED = np.array([[300.0, 350.0], [500.0, 350.0], [250.0, 400.0], [260.0, 100.0]])
OFFSET = np.array([[0.3, 1.0], [2.0, -1.0]])
ROTORS = Rotors(TIME, SPEED, np.array([1.0, 0.5]), 300.0, OFFSET)
MIDDLE = (np.arange(2 * BLOCK) + 0.5) / RATE


def turning(rotors, start_s=0.9):
    return np.asarray(alone(rotors, start_s=start_s).samples(2 * BLOCK / RATE))


def test_rotor_tones_are_harmonics_of_a_phase_summed_step_by_step():
    samples = turning(ROTORS)
    fine = np.linspace(0.0, MIDDLE[-1] + 0.01, 400_001) + 0.9
    expected = np.zeros(MIDDLE.size)
    for rotor, offset in enumerate(OFFSET):
        speed = np.interp(fine, TIME, SPEED[:, rotor])
        turned = cumulative_trapezoid(speed, fine, initial=0.0)
        turned -= np.interp(TIME[0], fine, turned)  # phases are those at the first knot
        at = np.interp(MIDDLE + 0.9, fine, turned)
        now = np.interp(MIDDLE + 0.9, TIME, SPEED[:, rotor])
        for harmonic, amplitude in ((1, 1.0), (2, 0.5)):
            mean = np.sinc(2 * harmonic * now / (2 * np.pi) / RATE)
            tone = np.sin(2 * harmonic * at + offset[harmonic - 1])
            expected += (now / 300.0) ** 2 * amplitude * mean * tone
    # trapezia of 2.6 us miss each knot's kink by 1e-6 rad
    assert samples == pytest.approx(expected, abs=1e-4)
    later = turning(ROTORS, 0.9 + 4000 / RATE)
    assert later[:4192] == pytest.approx(samples[4000:], abs=1e-8)
    # a microphone adds them to its own sources
    made = recorded(NEVER, duration_s=2 * BLOCK / RATE, start_s=0.9, more=(ROTORS,))
    assert made == pytest.approx(samples, abs=1e-9)
