"""Gauges write down what the laws say of one moment, and streams are their records."""

from dataclasses import replace
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast
from jblast.errors import InputError
from jblast.scene import Air, Charge, Instrument, Scene, Sensor
from jblast.sensors import anemometer, geophone, pressure_gauge
from jblast.sensors.wave_paths import DEFAULT_RECORD_LAWS
from jblast.waves import blast_wind

RATE, KEY = 20_000.0, jax.random.key(3)
SCENE = Scene(Charge(mass_kg=15.0, time_s=0.5))
PLACE = np.array([40.0, 30.0, 0.0])
IDEAL = Instrument(rate=RATE)
REAL = Instrument(
    rate=RATE, full_scale=2e4, noise=0.02, high_pass=5.0, low_pass=5e3, bits=16
)
GROUND_LAWS = {
    "ground_arrival_s": "wu_hao",
    "ground_displacement_m": "ground_motion",
    "ground_peak_velocity_m_s": "ground_motion",
}
GAUGES = {
    "pressure": pressure_gauge,
    "anemometer": anemometer,
    "geophone": geophone,
}
every_gauge = pytest.mark.parametrize("kind", GAUGES)


def sensor_of(kind, instrument=IDEAL, offset=0.0):
    return Sensor("s", PLACE, kind, clock_offset_s=offset, instrument=instrument)


def read_off(laws, scene=SCENE):
    """Return what `sensors.record` says at the place, on the common clock."""
    sensor = Sensor("s", PLACE, records=tuple((name, 0.01) for name in laws))
    scene = replace(scene, sensors=(sensor,))
    layout, *_ = jblast.sensors.planned_layout(scene)
    value = jblast.record(scene, layout, dict(laws)).value
    return dict(zip(layout.quantity, np.asarray(value), strict=True))


@pytest.fixture(scope="module")
def air():
    return read_off(DEFAULT_RECORD_LAWS)


def test_a_pressure_gauge_has_arrival_peak_and_impulse_of_the_laws(air):
    start = air["air_arrival_s"] - 0.1 - 0.3 / RATE + 7.0
    sensor = sensor_of("pressure", offset=7.0)
    samples = pressure_gauge.record(SCENE, sensor, 0.3, KEY, start_s=start)
    samples = np.asarray(samples)
    assert np.flatnonzero(samples)[0] == 2000  # 0.1 s, and 0.3 of a sample
    # some 500 samples of positive phase: half a sample on the way down
    assert samples.max() == pytest.approx(air["peak_overpressure_pa"], rel=0.01)
    assert samples[samples > 0].sum() / RATE == pytest.approx(
        air["positive_impulse_pa_s"], rel=1e-3
    )


def test_a_wind_rises_to_rankine_and_hugoniots_away_from_the_charge_and_ends(air):
    scene = replace(SCENE, air=Air(wind_east=2.0, wind_north=-1.0))
    law = read_off(DEFAULT_RECORD_LAWS, scene)
    start = law["air_arrival_s"] - 0.01
    wind = np.asarray(
        anemometer.record(scene, sensor_of("anemometer"), 0.5, KEY, start_s=start)
    )
    calm = np.array([2.0, -1.0, 0.0])
    np.testing.assert_array_equal(wind[:150], np.tile(calm, (150, 1)))
    blown = (wind - calm) @ np.array([0.8, 0.6, 0.0])
    np.testing.assert_allclose(blown[:, None] * [0.8, 0.6, 0.0], wind - calm, atol=1e-9)
    front = float(blast_wind(law["peak_overpressure_pa"], 101325.0, 340.29))
    # the rise's afterflow, and half a sample of decay
    assert blown.max() == pytest.approx(front, rel=0.01)
    assert blown[1000] > 0 or blown.min() < 0
    assert np.abs(blown[-100:]).max() < 1e-6 * front
    # momentum: u lasts longer than p, so its integral is more than the plane wave's
    plane = 5 * 340.29 / 7 * air["positive_impulse_pa_s"] / 101325.0
    assert blown[blown > 0].sum() / RATE > plane


def test_a_geophone_has_arrival_velocity_and_displacement_of_the_laws():
    law = read_off(GROUND_LAWS)
    rate = 10 * RATE
    start = law["ground_arrival_s"] - 0.01 - 0.3 / rate
    sensor = sensor_of("geophone", Instrument(rate=rate))
    samples = np.asarray(geophone.record(SCENE, sensor, 0.05, KEY, start_s=start))
    assert np.flatnonzero(samples)[0] == 2000
    # a time constant of some 30 samples: half of the square of half of one over it
    assert samples.max() == pytest.approx(law["ground_peak_velocity_m_s"], rel=1e-3)
    moved = np.cumsum(samples) / rate
    assert moved.max() == pytest.approx(law["ground_displacement_m"], rel=1e-3)
    assert abs(moved[-1]) < 1e-6 * moved.max()


@every_gauge
def test_a_stream_is_the_record_to_the_last_bit(kind):
    small = replace(REAL, full_scale=np.array(0.01), noise=np.array(1e-6))
    gauge = GAUGES[kind]
    sensor = sensor_of(kind, small if kind == "geophone" else REAL)
    whole = np.asarray(gauge.record(SCENE, sensor, 0.5, KEY, start_s=0.45))
    made = gauge.stream(SCENE, sensor, KEY, packets_hz=33.0, start_s=0.45)
    some = list(islice(made, 16))
    samples = np.concatenate([one.samples for one in some])
    assert samples.shape[1:] == whole.shape[1:]
    np.testing.assert_array_equal(samples, whole[: len(samples)])
    assert some[-1].start_s == 0.45 + some[-1].first_sample / RATE
    assert np.isfinite(whole).all()
    assert np.abs(whole).max() > 0


@pytest.mark.parametrize(
    "kind",
    [k if k == "pressure" else pytest.param(k, marks=pytest.mark.slow) for k in GAUGES],
)
def test_what_never_happens_is_silence_with_slopes(kind):
    def loudness(mass, time):
        scene = Scene(Charge(mass_kg=mass, time_s=time))
        return jnp.sum(GAUGES[kind].record(scene, sensor_of(kind), 0.01, KEY) ** 2)

    value, slopes = jax.value_and_grad(loudness, (0, 1))(
        jnp.asarray(15.0), jnp.asarray(jnp.inf)
    )
    assert (float(value), *map(float, slopes)) == (0.0, 0.0, 0.0)


@every_gauge
def test_sensors_of_another_kind_or_on_the_other_side_of_the_ground_are_refused(kind):
    other = replace(sensor_of(kind), kind="microphone")
    with pytest.raises(InputError, match=f"kind {kind}, got 'microphone'"):
        GAUGES[kind].record(SCENE, other, 0.1, KEY)
    up = 1.0 if kind == "geophone" else -1.0
    wrong = replace(sensor_of(kind), position_m=np.array([9.0, 0.0, up]))
    with pytest.raises(InputError, match=f"'s': expected a {kind} on the ground or"):
        GAUGES[kind].record(SCENE, wrong, 0.1, KEY)
    if kind == "anemometer":
        ranged = Scene(Charge(mass_kg=15.0, range_m=50.0))
        with pytest.raises(InputError, match="defines the direction of the wind"):
            anemometer.record(ranged, sensor_of(kind), 0.1, KEY)
