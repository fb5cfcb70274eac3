"""Each kind of sensor records what the laws predict; streams equal records."""

from dataclasses import replace
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Ambient, Charge, Instrument, Scene, Sensor
from jblast.sensors import Track, record_laws, recording
from jblast.waves import blast_wind
from tests.sensors.recorder.test_waves_met import readings

RATE, KEY = 20_000.0, jax.random.key(3)
SCENE = Scene(Charge(mass_kg=15.0, time_s=0.5))
PLACE = np.array([40.0, 30.0, 0.0])
AWAY = np.array([0.8, 0.6, 0.0])
IDEAL = Instrument(rate=RATE)
REAL = Instrument(RATE, 2e4, noise=0.02, bits=16, high_pass=5.0, low_pass=5e3)
every_kind = pytest.mark.parametrize("kind", ["microphone", "anemometer"])


def sensor_of(kind, instrument=IDEAL, place=PLACE, offset=0.0):
    return Sensor("s", place, kind, clock_offset_s=offset, instrument=instrument)


def recorded(scene, sensor, duration_s=0.3, **options):
    return np.asarray(recording(scene, sensor, KEY, **options).samples(duration_s))


@pytest.fixture(scope="module")
def law():
    return readings(SCENE, PLACE, record_laws(SCENE))


@pytest.mark.parametrize("kind", ["pressure", "microphone"])
def test_pressure_has_arrival_peak_and_impulse_of_the_laws(kind, law):
    start = law["air_arrival_s"] - 0.1 - 0.3 / RATE + 7.0
    sensor = sensor_of(kind, offset=7.0)
    samples = recorded(SCENE, sensor, start_s=start)
    # the ground's sound is over by then
    assert np.flatnonzero(np.abs(samples) > 1.0)[0] == 2000  # 0.1 s, 0.3 of a sample
    # some 500 samples of positive phase: half a sample on the way down
    assert samples.max() == pytest.approx(law["peak_overpressure_pa"], rel=0.01)
    impulse = samples[samples > 0].sum() / RATE
    assert impulse == pytest.approx(law["positive_impulse_pa_s"], rel=1e-3)


def test_a_geophone_has_arrival_velocity_and_displacement_of_the_laws(law):
    rate = 10 * RATE
    start = law["ground_arrival_s"] - 0.01 - 0.3 / rate
    sensor = sensor_of("geophone", Instrument(rate=rate))
    samples = recorded(SCENE, sensor, 0.05, start_s=start)
    assert np.flatnonzero(samples)[0] == 2000
    # a time constant of some 30 samples: half of the square of half of one over it
    assert samples.max() == pytest.approx(law["ground_peak_velocity_m_s"], rel=1e-3)
    moved = np.cumsum(samples) / rate
    assert moved.max() == pytest.approx(law["ground_displacement_m"], rel=1e-3)
    assert abs(moved[-1]) < 1e-6 * moved.max()


def test_a_microphone_records_the_ground_first_as_velocity_times_impedance(law):
    scene, rate = replace(SCENE, air=Air(temperature=293.15)), 10 * RATE
    start = law["ground_arrival_s"] - 0.01 - 0.3 / rate
    microphone = sensor_of("microphone", Instrument(rate=rate))
    samples = recorded(scene, microphone, 0.05, start_s=start)
    assert np.flatnonzero(samples)[0] == 2000
    # 413 kg/m2/s of air at 20 C, by its printed value to half a per cent
    loudest = 413.0 * law["ground_peak_velocity_m_s"]
    assert samples.max() == pytest.approx(loudest, rel=7e-3)


def test_a_wind_rises_to_rankine_and_hugoniots_away_from_the_charge_and_ends():
    scene = replace(SCENE, air=Air(wind_east=2.0, wind_north=-1.0))
    law = readings(scene, PLACE, record_laws(scene))
    start = law["air_arrival_s"] - 0.01
    wind = recorded(scene, sensor_of("anemometer"), 0.5, start_s=start)
    calm = np.array([2.0, -1.0, 0.0])
    np.testing.assert_array_equal(wind[:150], np.tile(calm, (150, 1)))
    blown = (wind - calm) @ AWAY
    np.testing.assert_allclose(np.outer(blown, AWAY), wind - calm, atol=1e-9)
    front = float(blast_wind(law["peak_overpressure_pa"], 101325.0, 340.29))
    # the rise's afterflow, and half a sample of decay
    assert blown.max() == pytest.approx(front, rel=0.01)
    assert blown.min() < 0
    assert not blown[-100:].any()
    # momentum: u lasts longer than p, so its integral is more than the plane wave's
    plane = 5 * 340.29 / 7 * law["positive_impulse_pa_s"] / 101325.0
    assert blown[blown > 0].sum() / RATE > plane


SILENT = Scene(Charge(time_s=np.inf), air=Air(wind_east=2.0, wind_north=-1.0))


def moving(velocity):
    """Return a track through PLACE at the detonation."""
    time = np.array([0.0, 0.3, 2.0])
    return Track(time, PLACE[None] + np.outer(time - 0.5, velocity))


@pytest.mark.slow
def test_the_velocity_of_an_anemometer_is_subtracted_by_its_own_clock():
    velocity = np.array([12.0, -9.0, 2.0])
    track = Track(moving(velocity).time, moving(velocity).position + 9.0)
    sensor = sensor_of("anemometer")
    wind = recorded(SILENT, sensor, 0.1, start_s=0.45, track=track)
    known = np.array([2.0, -1.0, 0.0]) - velocity
    np.testing.assert_allclose(wind, np.tile(known, (2000, 1)), atol=1e-9)
    # at rest, then moving from 1.00001 s on: a fifth of a sample is still at rest
    bend = PLACE + np.outer([0.0, 0.0, 0.99999], [1.0, 0.0, 0.0])
    track = Track(np.array([0.0, 1.00001, 2.0]), bend)
    late = sensor_of("anemometer", offset=7.0)
    east = recorded(SILENT, late, 0.1, start_s=7.95, track=track)[:, 0]
    np.testing.assert_allclose(east[:1000], 2.0, atol=1e-9)
    np.testing.assert_allclose(east[1000:1002], [2.0 - 0.8, 1.0], atol=1e-9)


@pytest.mark.slow
@every_kind
def test_a_stream_is_the_record_to_the_last_bit(kind):
    later = Charge(mass_kg=1.0, position_m=(5.0, 0.0, 0.0), time_s=0.75, name="b")
    scene = replace(
        SCENE, charges=(*SCENE.charges, later), ambient=Ambient(level=0.3, slope=-3.0)
    )
    small = replace(REAL, full_scale=np.array(0.01), noise=np.array(1e-6))
    loud = replace(REAL, noise_slope=-3.0, wind_noise=0.1)
    sensor = sensor_of(kind, small if kind == "geophone" else loud)
    made = recording(scene, sensor, KEY, start_s=0.3)
    whole = np.asarray(made.samples(0.9))
    assert np.isfinite(whole).all()
    assert np.abs(whole).max() > 0
    assert whole.shape[1:] == ((3,) if kind == "anemometer" else ())
    samples = np.concatenate(list(islice(made.packets(33.0), 29)))
    np.testing.assert_array_equal(samples, whole[: len(samples)])


@pytest.mark.slow
@every_kind
def test_a_blast_that_never_happens_is_silence_with_slopes(kind):
    def loudness(mass, time):
        scene = Scene(Charge(mass_kg=mass, time_s=time))
        return jnp.sum(recording(scene, sensor_of(kind), KEY).samples(0.01) ** 2)

    value, slopes = jax.value_and_grad(loudness, (0, 1))(
        jnp.asarray(15.0), jnp.asarray(jnp.inf)
    )
    assert (float(value), *map(float, slopes)) == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_slopes_by_mass_position_and_time_are_those_of_finite_differences():
    weight = np.random.default_rng(0).normal(size=4000)

    def told(numbers):
        mass, east, up, time = numbers
        place = jnp.stack([east, jnp.full_like(east, 30.0), up])
        scene, sensor = Scene(Charge(mass, time_s=time)), sensor_of("pressure")
        sensor = replace(sensor, position_m=place)
        return jnp.dot(recording(scene, sensor, KEY, start_s=0.55).samples(0.2), weight)

    numbers, step = jnp.array([15.0, 40.0, 1.5, 0.5]), 1e-6
    steps = step * np.concatenate([np.eye(4), -np.eye(4), np.zeros((1, 4))])
    both = jax.jit(jax.vmap(jax.value_and_grad(told)))
    values, slopes = both(numbers[None, :] + steps)
    measured = (values[:4] - values[4:8]) / (2 * step)
    # the front moves by less than a sample, in which its mean is smooth
    assert np.asarray(slopes[-1]) == pytest.approx(np.asarray(measured), rel=1e-4)


RANGED = Scene(Charge(mass_kg=15.0, range_m=50.0))
UNREAD = replace(SCENE, ambient=Ambient(file="loop.wav"))
ABOVE, BELOW = np.array([9.0, 9.0, 1.0]), np.array([9.0, 9.0, -1.0])
TRACK = {"track": moving(np.zeros(3))}
REJECTED = {
    "no kind": (SCENE, sensor_of(""), {}, "kind of sensor ''"),
    "no samples": (SCENE, sensor_of("flash"), {}, "'s': expected a kind that samples"),
    "above": (SCENE, sensor_of("geophone", place=ABOVE), {}, "on the ground or in it"),
    "below": (SCENE, sensor_of("pressure", place=BELOW), {}, "above it, got -1 m up"),
    "nowhere": (SCENE, sensor_of("pressure", place=ABOVE * np.nan), {}, "got nan m up"),
    "at the charge": (SCENE, sensor_of("pressure", place=0 * ABOVE), {}, "away from"),
    "mounted": (
        SCENE,
        sensor_of("geophone"),
        TRACK,
        "expected a fixed sensor, got one",
    ),
    "range only": (RANGED, sensor_of("anemometer"), {}, "the direction of the wind"),
    "no loop": (UNREAD, sensor_of("microphone"), {}, r"samples of loop\.wav"),
    "no start": (SCENE, sensor_of("pressure"), {"start_s": np.nan}, "finite start_s"),
}


@pytest.mark.parametrize(
    ("scene", "sensor", "options", "said"), REJECTED.values(), ids=REJECTED
)
def test_invalid_sensors_are_rejected(scene, sensor, options, said):
    with pytest.raises(InputError, match=said):
        recording(scene, sensor, KEY, **options)
