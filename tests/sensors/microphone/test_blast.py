"""A blast is heard by each of its paths as that path alone says."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest

from jblast.scene import Air, Charge, Instrument, Scene, Sensor
from jblast.sensors import microphone
from jblast.sensors.microphone import WavePaths
from tests.waves.absorbing import absorb

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
