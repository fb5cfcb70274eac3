"""A blast is heard by each of its paths as that path alone says."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest

import jblast
from jblast.scene import Air, Charge, Instrument, Scene, Sensor
from jblast.sensors import Track, microphone
from jblast.sensors.microphone import WavePaths
from jblast.sensors.wave_paths import DEFAULT_GROUND_LAWS
from tests.waves.propagation.absorbing import absorb

RATE, KEY = 20_000.0, jax.random.key(3)
SCENE = Scene(Charge(mass_kg=15.0))
MICROPHONE = Sensor(
    "m", np.array([300.0, 0.0, 20.0]), "microphone", instrument=Instrument(RATE)
)
AIR = WavePaths(ground=False)


def heard(scene=SCENE, wave_paths=AIR, duration_s=0.2, start_s=0.75, **options: Any):
    given: dict[str, Any] = {"start_s": start_s, "wave_paths": wave_paths, **options}
    samples = microphone.record(scene, MICROPHONE, duration_s, KEY, **given)
    return np.asarray(samples)


def test_the_wave_in_the_ground_comes_first_as_the_laws_of_ground_motion_say():
    quantities = ("ground_arrival_s", "ground_peak_velocity_m_s")
    sensor = replace(MICROPHONE, records=tuple((q, 0.01) for q in quantities))
    for path in ("head", "thesis"):
        ground = replace(SCENE.ground, path=path)
        scene = replace(SCENE, sensors=(sensor,), ground=ground)
        layout, *_ = jblast.sensors.planned_layout(scene)
        arrival, _ = np.asarray(jblast.record(scene, layout, DEFAULT_GROUND_LAWS).value)
        both = heard(scene, WavePaths(), 0.2, 0.0)
        first = np.flatnonzero(both)[0]
        assert first == np.floor(arrival * RATE)
        # the ground's pressure is rho c v, some 415 Pa s/m, a mean over the sample: of
        # a pulse of five samples the largest mean is up to 4 % below the peak
        below = replace(
            sensor, position_m=sensor.position_m * np.array([1.0, 1.0, 0.0])
        )
        layout, *_ = jblast.sensors.planned_layout(replace(scene, sensors=(below,)))
        velocity = jblast.record(scene, layout, DEFAULT_GROUND_LAWS).value[1]
        assert both.max() / float(velocity) == pytest.approx(1.225 * 340.3, rel=0.04)


def test_air_and_ground_add_up():
    both = heard(wave_paths=WavePaths(), duration_s=0.9, start_s=0.0)
    air = heard(wave_paths=AIR, duration_s=0.9, start_s=0.0)
    soil = both - air
    assert np.flatnonzero(soil)[0] < np.flatnonzero(air)[0]
    assert np.abs(soil).max() < 0.01 * np.abs(air).max()


@pytest.mark.slow
def test_air_absorbs_where_the_scene_says_so_and_the_stream_forgets_nothing():
    plain = heard()
    assert np.array_equal(
        heard(wave_paths=WavePaths(ground=False, absorption=False)), plain
    )
    humid = replace(SCENE, air=Air(absorption=True, relative_humidity=0.3))
    absorbed = heard(humid)
    whole = absorb(
        heard(replace(humid, air=replace(humid.air, absorption=False))),
        RATE,
        np.hypot(300.0, 20.0),
        humid.air.temperature,
        humid.air.pressure,
        humid.air.relative_humidity,
    )
    peak = np.abs(plain).max()
    assert np.abs(absorbed - plain).max() > 0.02 * peak
    # the two forget after 0.25 s each: e^-14 of the slowest relaxation
    assert absorbed == pytest.approx(np.asarray(whole), abs=1e-5 * peak)
    packets = microphone.stream(
        humid, MICROPHONE, KEY, packet_s=0.2, start_s=0.75, wave_paths=AIR
    )
    assert np.array_equal(next(packets).samples, absorbed)


@pytest.mark.slow
def test_inside_jit_air_absorbs_as_much_or_nothing():
    def inside(scene):
        options: dict[str, Any] = {"start_s": 0.75, "wave_paths": AIR}
        return microphone.record(scene, MICROPHONE, 0.2, KEY, **options)

    for absorption in (True, False):
        scene = replace(SCENE, air=Air(absorption=absorption))
        alone = heard(scene)
        traced = np.asarray(jax.jit(inside)(scene))
        assert traced == pytest.approx(alone, abs=1e-8 * np.abs(alone).max())


@pytest.mark.slow  # test_track.py hears air alone so
def test_one_who_comes_nearer_hears_all_of_it_sooner_and_shorter():
    def passing(speed, way):
        knots = np.array([[300.0, 0.0, 20.0], [300.0 - 2 * speed, 0.0, 20.0]])
        track = Track(np.array([0.0, 2.0]), knots)
        return heard(wave_paths=way, duration_s=0.9, start_s=0.0, track=track)

    stands, flies = (passing(speed, AIR) for speed in (0.0, 20.0))
    at_rest = heard(duration_s=0.9, start_s=0.0)
    peak = np.abs(at_rest).max()
    assert np.abs(stands - at_rest).max() < 1e-6 * peak
    first, sooner = (np.flatnonzero(x)[0] for x in (stands, flies))
    sound = 340.3
    # both start out 300 m away; who flies at 20 m/s meets it v/(c + v) of the way on
    assert sooner / first == pytest.approx(sound / (sound + 20.0), rel=0.005)
    assert flies.max() > stands.max()
    ground = passing(20.0, WavePaths()) - flies
    still = passing(0.0, WavePaths()) - stands
    assert 0 <= np.flatnonzero(still)[0] - np.flatnonzero(ground)[0] < 0.01 * RATE


@pytest.mark.slow  # each way is a program; test_overpressure.py has that of the air
def test_never_is_never_by_any_way():
    never = Scene(Charge(time_s=np.inf), air=Air(absorption=True))
    assert not heard(never, WavePaths()).any()
    track = Track(np.array([0.0, 1.0]), np.tile(MICROPHONE.position_m, (2, 1)))
    assert not heard(never, WavePaths(), track=track).any()
