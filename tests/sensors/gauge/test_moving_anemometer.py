"""An anemometer that moves measures the air relative to itself."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Air, Charge, Instrument, Scene, Sensor
from jblast.sensors import Track, anemometer, heard

RATE, KEY = 20_000.0, jax.random.key(3)
SCENE = Scene(Charge(mass_kg=2.0, time_s=0.5, burst="surface"))
SILENT = Scene(Charge(time_s=np.inf), air=Air(wind_east=2.0, wind_north=-1.0))
PLACE, VELOCITY = np.array([40.0, 30.0, 5.0]), np.array([12.0, -9.0, 2.0])


def sensor_of(instrument=None, offset=0.0):
    instrument = instrument or Instrument(rate=RATE)
    return Sensor(
        "s", PLACE, "anemometer", clock_offset_s=offset, instrument=instrument
    )


def moving(velocity):
    """Return a track through PLACE at the detonation."""
    time = np.array([0.0, 0.3, 2.0])
    return Track(time, PLACE[None] + jnp.outer(time - 0.5, jnp.asarray(velocity)))


def recorded(track, scene=SCENE, seconds=0.3, **options):
    made = anemometer.record(
        scene, sensor_of(), seconds, KEY, start_s=0.45, track=track, **options
    )
    return np.asarray(made)


@pytest.mark.slow
def test_a_sensor_at_rest_on_a_track_is_a_fixed_one():
    still = recorded(moving(np.zeros(3)))
    fixed = recorded(None)
    assert np.abs(fixed).max() > 1.0
    # the meeting is found to a rounding of the clock, over a sample
    np.testing.assert_allclose(still, fixed, atol=1e-6 * np.abs(fixed).max())


def test_its_own_velocity_is_subtracted_from_the_wind_by_its_own_clock():
    track = moving(VELOCITY)
    calm = recorded(track, replace(SILENT, air=Air()), 0.1)
    np.testing.assert_allclose(calm, np.tile(-VELOCITY, (2000, 1)), atol=1e-9)
    windy = recorded(track, SILENT, 0.1) - calm
    np.testing.assert_allclose(windy, np.tile([2.0, -1.0, 0.0], (2000, 1)), atol=1e-9)
    # at rest, then moving from 1.00001 s on: a fifth of a sample is still at rest
    bend = PLACE + np.outer([0.0, 0.0, 0.99999], [1.0, 0.0, 0.0])
    track = Track(np.array([0.0, 1.00001, 2.0]), bend)
    sensor = sensor_of(offset=7.0)
    east = anemometer.record(SILENT, sensor, 0.1, KEY, start_s=7.95, track=track)[:, 0]
    np.testing.assert_allclose(east[:1000], 2.0, atol=1e-9)
    np.testing.assert_allclose(east[1000:1002], [2.0 - 0.8, 1.0], atol=1e-9)


@pytest.mark.parametrize("speed", [-30.0, 30.0])
def test_the_blast_wind_is_that_of_the_meeting_position(speed):
    away = PLACE / np.linalg.norm(PLACE)
    track = moving(speed * away)
    (wave,) = heard(SCENE, track)
    met = float(wave.pulse.arrival_time)
    place = np.asarray(track.at(jnp.asarray(met)))
    (there,) = heard(SCENE, place)
    assert float(there.pulse.arrival_time) == pytest.approx(met, abs=1e-9)
    blown = recorded(track) + speed * away
    np.testing.assert_allclose(blown, np.outer(blown @ away, away), atol=1e-6)
    fixed = anemometer.record(
        SCENE, replace(sensor_of(), position_m=place), 0.3, KEY, start_s=0.45
    )
    first = np.flatnonzero(np.abs(blown @ away) > 1e-6)[0]
    assert first == int((met - 0.45) * RATE)
    u, v = blown @ away, np.asarray(fixed) @ away
    # the rise of the front falls differently into its samples
    assert u.max() == pytest.approx(v.max(), rel=0.01)
    # the phase advances faster or slower: the wind's path is as much shorter or longer
    passed = u.cumsum().max() / v.cumsum().max() * float(wave.pace)
    assert float(wave.pace) == pytest.approx(1.0 - speed / 345.0, rel=0.01)
    assert passed == pytest.approx(1.0, rel=2e-3)
