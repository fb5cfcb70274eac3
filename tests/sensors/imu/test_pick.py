"""The jolt in samples of an IMU is that of the forward model, within its error."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.jolts import LEVEL, OFFSET, PERFECT, SAMPLES, picked, scene_of
from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu
from jblast.sensors import planned_layout, record
from jblast.sensors.imu import Inertial, with_errors, with_wave_rows
from jblast.sensors.jolt_pick import MODEL_SHARE, JoltPick, pick_jolt
from jblast.vehicle import blast_load, named, simulate, start_of, vehicle_of

SCENE = scene_of("hummingbird", 10.0, 15.0)
assert SCENE.vehicle is not None
START = start_of(SCENE.vehicle)
WITHOUT_DRAG = replace(
    named("hummingbird"),
    rotor_drag=jnp.zeros(3),
    translational_lift=jnp.zeros(()),
    frame_drag=jnp.zeros(3),
)
ROTORS = jnp.broadcast_to(START.rotor_speed_rad_s, (SAMPLES, 4))
PULSE = np.zeros((SAMPLES, 3))
PULSE[330:350, 0] = np.linspace(40.0, -10.0, 20)
PULSE[330:350, 2] = np.linspace(20.0, 0.0, 20)
HOVERING = Inertial(
    jnp.broadcast_to(jnp.array([0.0, 0.0, FLIGHT_GRAVITY]), (SAMPLES, 3)),
    jnp.zeros((SAMPLES, 3)),
)
JOLTED = HOVERING._replace(force=HOVERING.force + PULSE)
LOST = JOLTED._replace(force=JOLTED.force.at[400:].set(jnp.nan))
EARLY = JOLTED._replace(force=jnp.roll(JOLTED.force, -330, axis=0))
EXACT = Imu(
    bits=None,
    accelerometer_noise=0.0,
    gyroscope_noise=0.0,
    accelerometer_walk=0.0,
    gyroscope_walk=0.0,
)


def pick_of(
    samples: Inertial, imu: Imu, count: int = SAMPLES, start=START
) -> JoltPick | str:
    part = Inertial(*(column[:count] for column in samples))
    return pick_jolt(part, imu, WITHOUT_DRAG, start, ROTORS[:count], OFFSET, LEVEL)


@pytest.mark.slow
def test_rows_within_a_wave_are_those_of_a_fine_flight():
    assert SCENE.vehicle is not None
    load, vehicle = blast_load(SCENE), vehicle_of(SCENE.vehicle)
    coarse, fine = (
        simulate(vehicle, START, duration_s=0.4, step_s=step_s, loads=(load,))
        for step_s in (0.004, 0.0005)
    )
    comes = np.asarray(load.arrival_time_s(START.position_m))
    dense = with_wave_rows(coarse, load, vehicle, comes, 0.001)
    steps = np.diff(dense.time_s[np.searchsorted(dense.time_s, comes[0]) :])
    np.testing.assert_allclose(steps, 0.001, atol=1e-9)
    for name, least, share in (
        ("velocity_m_s", 0.3, 0.1),
        ("body_rate_rad_s", 0.1, 0.1),
        ("quaternion", 1e-3, 0.3),  # of four rows, by trapezoids
    ):
        bows = []
        for path in (dense, fine):
            column, time = np.asarray(getattr(path, name)), np.asarray(path.time_s)
            of_rows = column[np.searchsorted(time, coarse.time_s - 1e-6)]
            lines = [np.interp(dense.time_s, coarse.time_s, x) for x in of_rows.T]
            at = np.searchsorted(time, np.asarray(dense.time_s) - 1e-6)
            bows.append(column[at] - np.transpose(lines))
        found, true = bows
        # the course of the wave within steps of 4 ms
        assert np.abs(found - true).max() < share * np.abs(true).max()
        assert np.ptp(getattr(fine, name), axis=0).max() > least


def test_a_pulse_gives_its_integral_for_any_bias_and_heading():
    turn = jnp.array([0.0, 0.0, math.sin(0.35), math.cos(0.35)])
    biased = JOLTED._replace(force=JOLTED.force + np.array([[0.2, -0.1, 0.3]]))
    pick = pick_of(biased, EXACT, start=replace(START, quaternion=turn))
    assert isinstance(pick, JoltPick)
    assert (pick.clipped, pick.onset) == (False, 330)
    ahead, _, up = PULSE.sum(axis=0) / EXACT.rate
    expected = [math.cos(0.7) * ahead, math.sin(0.7) * ahead, up]
    np.testing.assert_allclose(pick.velocity_m_s, expected, rtol=1e-9, atol=1e-12)
    assert pick.bearing_rad[0] == pytest.approx(math.pi / 2 - 0.7)
    assert pick.elevation_rad[0] == pytest.approx(math.atan2(up, ahead))
    assert pick.speed_m_s[1] > MODEL_SHARE * math.hypot(ahead, up)


@pytest.mark.slow
def test_noise_changes_a_jolt_by_its_standard_error():
    imu = Imu(gyroscope_bias=0.0)  # `ATTITUDE_RAD` stands for it
    truth, off = PULSE.sum(axis=0) / imu.rate, []
    for seed in range(40):
        pick = pick_of(with_errors(jax.random.key(seed), imu, JOLTED), imu)
        assert isinstance(pick, JoltPick)
        off.append((pick.velocity_m_s - truth) / pick.sd_m_s)
    # 120 numbers estimate an sd to 6.5 %: four of that, and the noise of the attitude
    assert 0.74 < np.sqrt(np.mean(np.square(off))) < 1.4


def test_a_clipped_jolt_is_a_lower_bound():
    imu = Imu(accelerometer_range=15.0)
    pick = pick_of(with_errors(jax.random.key(1), imu, JOLTED), imu)
    assert isinstance(pick, JoltPick)
    assert pick.clipped
    assert pick.speed_m_s[0] < np.linalg.norm(PULSE.sum(axis=0)) / imu.rate


@pytest.mark.parametrize(
    ("samples", "count", "reason"),
    [
        (JOLTED, 345, "the jolt does not end within the samples"),
        (JOLTED, 20, "expected 40 or more samples, got 20"),
        (LOST, SAMPLES, "the residual is not finite"),
        (HOVERING, SAMPLES, "no residual exceeds the noise"),
        (EARLY, SAMPLES, "the samples begin within a jolt"),
    ],
)
def test_samples_without_a_jolt_have_a_reason(samples, count, reason):
    found = pick_of(samples, EXACT, count)
    assert isinstance(found, str)
    assert reason in found


@pytest.mark.slow
def test_the_jolt_of_a_flight_is_that_of_the_forward_model():
    (pick,) = picked(SCENE, 0)
    layout, _, _ = planned_layout(SCENE)
    laws = dict.fromkeys(layout.quantities(), "blast_load")
    speed, bearing, elevation = np.asarray(record(SCENE, layout, laws).value)
    assert isinstance(pick, JoltPick)
    # turning and the controller, which the forward model omits: calibration/jolts.py
    assert pick.speed_m_s[0] == pytest.approx(speed, rel=MODEL_SHARE)
    assert pick.bearing_rad[0] == pytest.approx(bearing, abs=1e-3)
    assert pick.elevation_rad[0] == pytest.approx(elevation, abs=0.02)
    arrival = float(blast_load(SCENE).arrival_time_s(START.position_m)[0])
    # half a body, half a row of the flight, and the sample before
    assert arrival - 0.0025 < pick.onset / PERFECT.rate <= arrival
