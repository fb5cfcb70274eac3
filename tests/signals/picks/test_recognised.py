"""Effects next to one pulse are recognised, and errors allow for them."""

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter

from jblast.signals.picks import pick
from tests.signals.picks.simulated import (
    FINE,
    RATE,
    SAMPLES,
    TIME,
    Truth,
    pressure_at,
    samples_of,
)

TRUTH = Truth()
SIGMA = 100.0
FULL_SCALE = 2e4
RESONANCE_HZ, DAMPING = 12e3, 0.03
SLOW = TRUTH._replace(rise=7.6e-5)
HIDDEN_HZ, HIDDEN_DAMPING, HIDDEN_SIGMA = 19.5e3, 0.05, 770.0
SECOND = TRUTH._replace(arrival=TRUTH.arrival + 1.1e-3, peak=1.5e4, suction=3e3)
SHARP = TRUTH._replace(rise=5e-6)
NEAR = TRUTH._replace(arrival=TRUTH.arrival + 1e-4, peak=9e3, suction=2e3)
CORNER_HZ = 30.0


def fine_pressure(truth=TRUTH):
    """Return the pressure at instants, many a sample."""
    time = ((np.arange(SAMPLES * FINE) + 0.5) / FINE - 0.5) / RATE
    return pressure_at(truth, time)


def filtered(above, below, truth=TRUTH):
    """Return samples of what an analogue filter makes of the pressure."""
    through = lfilter(*bilinear(above, below, fs=RATE * FINE), fine_pressure(truth))
    return np.asarray(through).reshape(SAMPLES, FINE).mean(axis=1)


def records():
    """Return one record of each kind."""
    rng = np.random.default_rng(3)
    noise = SIGMA * rng.standard_normal((32, SAMPLES))
    plain, omega = samples_of(TRUTH), 2 * np.pi * RESONANCE_HZ
    hidden = 2 * np.pi * HIDDEN_HZ
    slow = filtered([hidden**2], [1.0, 2 * HIDDEN_DAMPING * hidden, hidden**2], SLOW)
    white = np.random.default_rng(13).standard_normal(SAMPLES)
    return {
        "plain": plain + noise[0],
        "clipped": np.clip(plain + noise[1], None, FULL_SCALE),
        "rings": filtered([omega**2], [1.0, 2 * DAMPING * omega, omega**2]) + noise[2],
        "second": plain + samples_of(SECOND) + noise[3],
        "near": samples_of(SHARP) + samples_of(NEAR) + noise[7],
        "high_passed": filtered([1.0, 0.0], [1.0, 2 * np.pi * CORNER_HZ]) + noise[4],
        "cut": samples_of(TRUTH._replace(arrival=(SAMPLES - 90) / RATE)) + noise[5],
        "drifts": plain + noise[6] + 0.2 * TRUTH.peak * np.cos(2 * np.pi * TIME / 0.04),
        "coarse": samples_of(TRUTH._replace(duration=6e-5, rise=5e-6)) + noise[8],
        "clipped_low": np.clip(plain + noise[9], -4e3, None),
        "hidden_ring": slow + HIDDEN_SIGMA * white,
        "shifted": plain + noise[10] + 0.1 * TRUTH.peak * (TRUTH.arrival < TIME),
    }


@pytest.fixture(scope="module")
def found():
    """The pick of each."""
    return {kind: pick(TIME, samples) for kind, samples in records().items()}


def apart(found, kind: str, name: str, truth: float) -> float:
    """Return how far a value is off, in its standard deviations."""
    return (getattr(found[kind], name) - truth) / found[kind].sd(name)


@pytest.mark.parametrize(
    "kind", ["plain", "clipped", "rings", "high_passed", "drifts", "shifted"]
)
def test_values_are_within_their_errors(kind, found):
    # four standard deviations: once in 15,000 by chance
    assert abs(apart(found, kind, "air_arrival_s", TRUTH.arrival)) < 4
    assert abs(apart(found, kind, "peak_overpressure_pa", TRUTH.peak)) < 4
    assert abs(apart(found, kind, "positive_duration_s", TRUTH.duration)) < 4
    assert abs(apart(found, kind, "positive_impulse_pa_s", TRUTH.impulse)) < 4


@pytest.mark.parametrize(
    ("note", "kinds"),
    [
        ("resonating", {"rings", "hidden_ring"}),
        ("clipped", {"clipped", "clipped_low"}),
        ("zero_shift", {"shifted"}),
        ("high_passed", {"high_passed"}),
    ],
)
def test_each_is_named_and_no_other_is(note, kinds, found):
    assert {kind for kind, one in found.items() if note in one.notes} == kinds


def test_a_further_front_or_a_short_record_is_named(found):
    assert "cut_short" in found["cut"].notes
    assert "under_sampled" in found["coarse"].notes
    later = {kind for kind, one in found.items() if "later_arrival" in one.notes}
    assert "second" in later
    assert not later & {"plain", "clipped", "rings", "drifts"}


def test_a_ring_has_its_frequency(found):
    np.testing.assert_allclose(found["rings"].resonance_hz, RESONANCE_HZ, rtol=1e-2)


def test_a_further_front_has_its_time_and_leaves_the_first_as_it_was(found):
    one = found["second"]
    np.testing.assert_allclose(one.later_arrival_s, SECOND.arrival, atol=2e-5)
    assert abs(apart(found, "second", "air_arrival_s", TRUTH.arrival)) < 4
    np.testing.assert_allclose(one.peak_overpressure_pa, TRUTH.peak, rtol=0.03)


def test_an_echo_within_the_positive_phase_leaves_arrival_and_peak(found):
    assert "later_arrival" in found["near"].notes
    assert abs(apart(found, "near", "air_arrival_s", TRUTH.arrival)) < 4
    np.testing.assert_allclose(
        found["near"].peak_overpressure_pa, TRUTH.peak, rtol=0.03
    )


def test_a_clipped_record_has_its_level_and_a_larger_error(found):
    one, name = found["clipped"], "peak_overpressure_pa"
    np.testing.assert_allclose(one.clipped_at_pa, FULL_SCALE, rtol=1e-2)
    assert one.sd(name) > 1.5 * found["plain"].sd(name)


def test_a_record_that_ends_early_hardly_determines_its_duration(found):
    name = "positive_duration_s"
    assert found["cut"].sd(name) > 5 * found["plain"].sd(name)


def test_a_ring_that_a_slow_front_hides_does_not_move_the_arrival(found):
    one = found["hidden_ring"]
    assert one.resonance_hz == pytest.approx(HIDDEN_HZ, rel=0.05)
    # one pulse alone is a sample late
    assert abs(one.air_arrival_s - SLOW.arrival) < 0.5 / RATE
    assert abs(apart(found, "hidden_ring", "air_arrival_s", SLOW.arrival)) < 4.0


def test_a_front_of_two_samples_is_not_a_sharp_one_that_rings():
    # positions within a sample at which a search from a rise of half a sample once
    # ended 0.4 to 0.7 samples early
    rng = np.random.default_rng(3)
    for rise, place in ((2.3, 0.625), (2.3, 0.75), (2.3, 0.875), (3.1, 0.375)):
        truth = Truth(
            rise=rise / RATE,
            arrival=(300.0 + place) / RATE,
            duration=2.2e-3,
            suction_duration=4.4e-3,
            suction=9e3,
            decay=0.5,
        )
        noise = truth.peak / 184.0 * rng.standard_normal(SAMPLES)
        one = pick(TIME, samples_of(truth) + noise)
        off = abs(one.air_arrival_s - truth.arrival)
        assert "resonating" not in one.notes
        assert off * RATE < 0.25
        assert off < 4.0 * one.sd("air_arrival_s")


@pytest.mark.parametrize("seed", [7, 112])
def test_a_faint_front_is_not_a_step_of_slow_noise_before_it(seed):
    # the noise of these seeds steps up 10 to 20 samples before the front
    truth, memory = Truth(rise=3e-5, duration=2.5e-3), 0.75
    white = np.random.default_rng(seed).standard_normal(SAMPLES + 400)
    slow = np.asarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white))
    one = pick(TIME, samples_of(truth) + truth.peak / 6.0 * slow[400:])
    off = abs(one.air_arrival_s - truth.arrival)
    assert off * RATE < 8.0
    assert off < 3.0 * one.sd("air_arrival_s")
