"""The jolt that an IMU gives is that of the forward model, within what is declared."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.jolts import LEVEL, OFFSET, PERFECT, SAMPLES, scene_of
from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu
from jblast.sensors import planned_layout, record
from jblast.sensors.imu import MODEL_SHARE, Felt, JoltPick, felt, pick_jolt, read
from jblast.vehicle import blast_load, hold_of, named, simulate, start_of

SCENE = scene_of("hummingbird", 10.0, 15.0)
assert SCENE.vehicle is not None
SPEC = SCENE.vehicle
START = start_of(SPEC)
EDGES = jnp.arange(SAMPLES + 1.0) / PERFECT.rate
VEHICLE = named("hummingbird")
STILL = replace(
    VEHICLE,
    rotor_drag=jnp.zeros(3),
    translational_lift=jnp.zeros(()),
    frame_drag=jnp.zeros(3),
)
"""What its own motion through the air does not push."""
TURNS = jnp.broadcast_to(START.rotor_speed_rad_s, (SAMPLES, 4))
PULSE = np.zeros((SAMPLES, 3))
PULSE[330:350, 0] = np.linspace(40.0, -10.0, 20)
PULSE[330:350, 2] = np.linspace(20.0, 0.0, 20)
HOVERING = Felt(
    jnp.broadcast_to(jnp.array([0.0, 0.0, FLIGHT_GRAVITY]), (SAMPLES, 3)),
    jnp.zeros((SAMPLES, 3)),
)
JOLTED = HOVERING._replace(force=HOVERING.force + PULSE)
EXACT = Imu(
    bits=None,
    accelerometer_noise=0.0,
    gyroscope_noise=0.0,
    accelerometer_walk=0.0,
    gyroscope_walk=0.0,
)


def picked(samples: Felt, imu: Imu, count: int = SAMPLES, **others) -> JoltPick:
    part = Felt(*(column[:count] for column in samples))
    told = {"vehicle": STILL, "turns": TURNS, "start": START} | others
    return pick_jolt(
        *(part, imu, told["vehicle"], told["start"], told["turns"][:count]),
        *(OFFSET, LEVEL),
    )


def test_a_known_pulse_gives_its_integral_whatever_the_bias_and_heading():
    turn = jnp.array([0.0, 0.0, math.sin(0.35), math.cos(0.35)])
    biased = JOLTED._replace(force=JOLTED.force + np.array([[0.2, -0.1, 0.3]]))
    pick = picked(biased, EXACT, start=replace(START, quaternion=turn))
    assert (pick.found, pick.clipped, pick.onset) == (True, False, 330)
    ahead, _, up = PULSE.sum(axis=0) / EXACT.rate
    heading = [math.cos(0.7) * ahead, math.sin(0.7) * ahead, up]
    np.testing.assert_allclose(pick.velocity_m_s, heading, rtol=1e-9, atol=1e-12)
    assert pick.bearing_rad[0] == pytest.approx(math.pi / 2 - 0.7)
    assert pick.elevation_rad[0] == pytest.approx(math.atan2(up, ahead))
    assert pick.speed_m_s[1] > MODEL_SHARE * math.hypot(ahead, up)


def test_noise_moves_a_jolt_by_what_it_says():
    imu = Imu(gyroscope_bias=0.0)  # which turns the whole: `ATTITUDE_RAD`
    truth, off = PULSE.sum(axis=0) / imu.rate, []
    for seed in range(40):
        pick = picked(read(jax.random.key(seed), imu, JOLTED), imu)
        assert pick.found
        off.append((pick.velocity_m_s - truth) / pick.sd_m_s)
    # 120 numbers tell an sd to 6.5 %: four of that, and noise of attitude beside
    assert 0.74 < np.sqrt(np.mean(np.square(off))) < 1.4


def test_calm_air_gives_no_jolt():
    pick = picked(read(jax.random.key(1), Imu(), HOVERING), Imu())
    assert (pick.found, pick.why) == (False, "no residual exceeds the noise")


def test_a_range_too_small_makes_it_a_lower_bound():
    imu = Imu(accelerometer_range=15.0)
    pick = picked(read(jax.random.key(1), imu, JOLTED), imu)
    assert (pick.found, pick.clipped) == (True, True)
    assert pick.speed_m_s[0] < np.linalg.norm(PULSE.sum(axis=0)) / imu.rate


@pytest.mark.parametrize(
    ("count", "why"),
    [
        (345, "the jolt does not end within the samples"),
        (20, "expected 40 or more samples, got 20"),
    ],
)
def test_a_stretch_that_ends_too_early_has_no_jolt(count, why):
    pick = picked(JOLTED, EXACT, count)
    assert (pick.found, pick.why) == (False, why)


def test_a_vehicle_that_was_lost_has_no_jolt():
    lost = JOLTED._replace(force=JOLTED.force.at[400:].set(jnp.nan))
    assert picked(lost, EXACT).why == "the residual is not finite"


@pytest.mark.slow
def test_the_jolt_of_a_flight_is_that_of_the_forward_model():
    flight = simulate(
        VEHICLE,
        START,
        duration_s=0.9,
        control=hold_of(SPEC, integral=False),
        loads=(blast_load(SCENE),),
    )
    middle = (EDGES[1:] + EDGES[:-1]) / 2
    turns = jax.vmap(jnp.interp, (None, None, 1), 1)(
        middle, flight.time_s, flight.rotor_speed_rad_s
    )
    true = felt(flight, EDGES, OFFSET, LEVEL)
    pick = picked(true, PERFECT, vehicle=VEHICLE, turns=turns)
    layout, _, _ = planned_layout(SCENE)
    laws = dict.fromkeys(layout.quantities(), "blast_load")
    speed, bearing, elevation = np.asarray(record(SCENE, layout, laws).value)
    assert (pick.found, pick.clipped) == (True, False)
    # turning and the hold, which the forward model leaves out: calibration/jolts.py
    assert pick.speed_m_s[0] == pytest.approx(speed, rel=MODEL_SHARE)
    assert pick.bearing_rad[0] == pytest.approx(bearing, abs=1e-3)
    assert pick.elevation_rad[0] == pytest.approx(elevation, abs=0.02)
    came = float(blast_load(SCENE).arrival_time_s(START.position_m)[0])
    # half a body, half a row of the flight, and the sample before, by whose rates the
    # lever's own way is taken off: without noise the least of a push is found
    assert came - 0.0025 < EDGES[pick.onset] <= came
