import numpy as np
import pytest

from calibration.cases import RATE
from jblast.errors import InputError
from jblast.signals import bank_of_pulses, blast_template
from jblast.signals.templates import BANK_SCALED_DISTANCE, DURATION_RATIO, DURATIONS
from jblast.waves.pulse import blast_pulse


def test_a_template_by_law_has_the_impulse_and_the_duration_of_the_law():
    row, law = blast_template(5.0, 100.0, RATE), blast_pulse(100.0, 5.0)
    positive = row[: round(float(law.duration) * RATE)]
    assert (positive[5:] > 0).all()
    assert row[positive.size + 2] < 0
    shape = 1 / law.decay - (1 - np.exp(-law.decay)) / law.decay**2
    impulse = float(law.peak * law.duration * shape)  # Friedlander's, Baker eq. 6-10
    # to the sample at whose middle the pressure changes its sign
    assert positive.sum() / RATE == pytest.approx(impulse, rel=1e-3)
    assert row.sum() / RATE == pytest.approx(
        impulse - 9 / 16 * float(law.suction * law.suction_duration),
        abs=2e-3 * impulse,
    )


def test_the_front_is_in_the_first_samples():
    row = blast_template(5.0, 30.0, RATE)
    assert int(np.argmax(row)) < 5


@pytest.mark.parametrize(
    ("mass", "distance", "rate", "said"),
    [
        (0.0, 10.0, RATE, "mass_kg: expected a positive number"),
        (1.0, -1.0, RATE, "range_m: expected a positive number"),
        (1.0, 10.0, 0.0, "rate_hz: expected a positive number"),
        (1.0, 10.0, 10.0, "rate_hz: expected two samples within"),
    ],
)
def test_blasts_without_samples_are_refused(mass, distance, rate, said):
    with pytest.raises(InputError, match=said):
        blast_template(mass, distance, rate)


def likeness(one, other):
    """Greatest correlation of two pulses, of any size and delay, in white noise."""
    n = 2 * max(one.size, other.size)
    product = np.fft.rfft(one, n) * np.conj(np.fft.rfft(other, n))
    return np.fft.irfft(product, n).max() / np.sqrt((one @ one) * (other @ other))


def test_a_bank_has_a_pulse_near_any_blast():
    bank = bank_of_pulses(RATE)
    positive = [np.argmax(samples < 0) / RATE for samples in bank]
    np.testing.assert_allclose(positive, DURATIONS, atol=1 / RATE)
    # half a step longer than a pulse of 5 kg
    size = 5 ** (1 / 3) * DURATION_RATIO**0.5
    between = blast_template(size**3, BANK_SCALED_DISTANCE * size, RATE)
    ratios = np.argmax(between < 0) / RATE / np.array(DURATIONS)
    steps = np.log(ratios) / np.log(DURATION_RATIO)
    best = max(likeness(between, samples) for samples in bank)
    assert np.abs(steps).min() < 0.51
    assert 0.92 < best <= 1.0


def test_a_pulse_of_minutes_is_no_template():
    with pytest.raises(InputError, match="a blast of 60 s at most"):
        blast_template(1e20, 5e6, RATE)
