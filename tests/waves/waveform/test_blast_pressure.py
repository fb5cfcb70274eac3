import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.laws import kingery_bulmash as kb, negative_phase_ufc as ufc
from jblast.waves.laws.kingery_bulmash import ground_factor
from jblast.waves.laws.shock_kinematics import shock_kinematics_arrival_time
from jblast.waves.waveform import blast_pressure, blast_pulse, friedlander_impulse

BURSTS = ("surface", "free-air")
both_bursts = pytest.mark.parametrize("burst", BURSTS)
RANGE, MASS, AMBIENT, SPEED = 12.0, 15.0, 9e4, 332.0
# of JAX: its tables are within 1e-7 of the printed forms, which NumPy evaluates
AIR = tuple(jnp.asarray(x) for x in (RANGE, MASS, AMBIENT, SPEED))


def phases(burst):
    """Return arrival, duration, and length of the negative phase."""
    mass = MASS
    if burst == "surface":
        mass = ground_factor(*AIR[:3]) * MASS
    suction = ufc.ufc_negative_pressure(AIR[0], mass, AMBIENT)
    impulse = ufc.ufc_negative_impulse(AIR[0], mass, AMBIENT, SPEED)
    return (
        float(shock_kinematics_arrival_time(*AIR, burst)),
        float(kb.kingery_bulmash_duration(*AIR, burst)),
        float(suction),
        float(impulse),
    )


def area(burst, start, end):
    return quad(lambda t: float(blast_pressure(t, *AIR, burst)), start, end)[0]


@both_bursts
def test_it_is_silent_until_the_arrival_and_then_at_its_peak(burst):
    arrival = phases(burst)[0]
    time = np.array([-1.0, 0.0, arrival * (1 - 1e-12), arrival * (1 + 1e-12)])
    *before, first = blast_pressure(time, *AIR, burst).tolist()
    assert before == [0.0, 0.0, 0.0]
    peak = kb.kingery_bulmash_pressure(RANGE, MASS, AMBIENT, burst)
    # 1e-12 of the travel time later
    np.testing.assert_allclose(first, peak, rtol=2e-7)


@both_bursts
def test_both_phases_have_the_impulses_of_their_laws(burst):
    arrival, duration, suction, impulse = phases(burst)
    length = 16 / 9 * impulse / suction
    end = arrival + duration
    np.testing.assert_allclose(
        area(burst, arrival, end),
        kb.kingery_bulmash_impulse(*AIR, burst),
        rtol=1e-9,
    )
    np.testing.assert_allclose(area(burst, end, end + length), -impulse, rtol=1e-9)
    assert blast_pressure(end + 1.001 * length, *AIR, burst) == 0.0


@both_bursts
def test_it_is_lowest_by_the_law_of_the_negative_phase(burst):
    arrival, duration, suction, impulse = phases(burst)
    time = arrival + duration + 16 / 27 * impulse / suction
    np.testing.assert_allclose(blast_pressure(time, *AIR, burst), -suction, rtol=1e-12)


@both_bursts
def test_the_pressure_is_continuous_where_the_phases_meet(burst):
    arrival, duration, suction, _ = phases(burst)
    ends = arrival + duration + np.array([-1e-10, 1e-10])
    # slopes are of the order of P/t_d = 1e7 Pa/s: 1e-3 Pa
    left, right = blast_pressure(ends, *AIR, burst).tolist()
    assert 0 < left < 1e-7 * suction
    assert -1e-7 * suction < right < 0


@both_bursts
def test_no_pressure_falls_below_vacuum(burst):
    z = np.geomspace(0.05, 40.0, 60)[:, None]
    arrival = np.asarray(kb.kingery_bulmash_arrival_time(z, 1.0, burst=burst))
    time = arrival + np.linspace(0.0, 0.03, 400)
    pressure = np.asarray(blast_pressure(time, z, 1.0, burst=burst))
    assert pressure.min() > -STANDARD_PRESSURE
    assert pressure.min() < -0.95 * STANDARD_PRESSURE


@both_bursts
def test_far_past_the_tables_it_is_still_a_whole_record(burst):
    """From Z = 30 to 1e4: longer, weaker, its suctions what they were of its pushes."""
    z = np.geomspace(30.0, 1e4, 60)
    pulse = blast_pulse(z * MASS ** (1 / 3), MASS, burst=burst)
    assert np.all(np.diff(pulse.duration) > 0)
    assert np.all(np.diff(pulse.peak) < 0)
    assert np.all(np.diff(pulse.suction_impulse) < 0)
    far = z > 50.0  # past the last point of the suction, on the surface too
    for part, whole in (
        (pulse.suction, pulse.peak),
        (
            pulse.suction_impulse,
            friedlander_impulse(pulse.peak, pulse.duration, pulse.decay),
        ),
    ):
        share = np.asarray(part / whole)[far]
        np.testing.assert_allclose(share, share[0] * np.ones_like(share), rtol=1e-9)
    # decays of a triangle's neighbours: k from 0.42 to 0.48
    assert np.all((pulse.decay > 0.0) & (pulse.decay < 0.6))
