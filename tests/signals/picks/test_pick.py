"""The pick of a record: exact without noise, with the errors that repetitions have."""

import subprocess
import sys

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.recording import PressureRecord
from jblast.signals.picks import NAMES, NOTES, pick, pick_records
from tests.signals.picks.simulated import RATE, SAMPLES, TIME, Truth, noisy, samples_of
from tests.signals.records import made

TRUTH = Truth()
MANY = 12
VALUES = dict(
    air_arrival_s=TRUTH.arrival,
    peak_overpressure_pa=TRUTH.peak,
    positive_duration_s=TRUTH.duration,
    positive_impulse_pa_s=TRUTH.impulse,
    decay=TRUTH.decay,
    rise_time_s=TRUTH.rise,
    negative_pressure_pa=TRUTH.suction,
    negative_duration_s=TRUTH.suction_duration,
)


@pytest.fixture(scope="module")
def repeated():
    """Picks of one pulse in noise of 1 % of its peak, drawn again and again."""
    return [pick(TIME, x) for x in noisy(TRUTH, 0.01 * TRUTH.peak, MANY)]


@pytest.fixture(scope="module")
def exact():
    """The pick of the pulse without noise."""
    return pick(TIME, samples_of(TRUTH))


@pytest.mark.parametrize("name", NAMES)
def test_without_noise_the_truth_is_found(name, exact):
    # means of 64 instants are off by 1e-4 of what changes within a sample; families of
    # forms next to the true one move the mean by 1e-3
    np.testing.assert_allclose(getattr(exact, name), VALUES[name], rtol=3e-3)
    assert exact.found


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_errors_are_those_of_repetitions(name, repeated):
    off = [(getattr(one, name) - VALUES[name]) / one.sd(name) for one in repeated]
    # 12 repetitions: the mean to 0.29, the standard deviation to 0.2; errors contain
    # forms next to the true one, so they are rather too large
    assert abs(np.mean(off)) < 4 * 0.29
    assert 0.2 < np.std(off) < 1.7


@pytest.mark.slow
def test_the_covariance_is_that_of_repetitions(repeated):
    values = np.array([[getattr(one, name) for name in NAMES[:4]] for one in repeated])
    values[:, 1:] = np.log(values[:, 1:])
    mean = np.mean([one.covariance for one in repeated], axis=0)
    sd = np.sqrt(np.diag(mean))
    # a correlation of 12 pairs has a standard error of 0.29 at most
    made = mean / np.outer(sd, sd)
    np.testing.assert_allclose(made, np.corrcoef(values.T), atol=4 * 0.29)


@pytest.mark.parametrize("level", [None, 101325.0])
def test_in_noise_alone_and_in_nothing_nothing_is_found(level):
    rng = np.random.default_rng(2)
    for _ in range(3 if level is None else 1):
        samples = rng.standard_normal(SAMPLES) if level is None else 0 * TIME + level
        found = pick(TIME, samples)
        assert not found.found
        assert np.isnan(found.air_arrival_s)


@pytest.mark.parametrize("seed", range(12))
def test_short_clipped_and_odd_records_are_picked_or_poor(seed):
    # windows may be empty here, and systems of equations singular
    rng = np.random.default_rng(seed)
    count = int(rng.choice([16, 17, 20, 33, 200]))
    time = np.arange(count, dtype=float)
    since = time - rng.uniform(-5, count + 2)
    long = np.exp(rng.uniform(0, np.log(count)))
    decay = np.exp(-np.maximum(since, 0) / long)
    pulse = np.where(since >= 0, (1 - since / long) * decay, 0.0)
    kinds = (
        *(pulse, -pulse, np.round(3 * pulse), np.minimum(pulse, 0.3)),
        *(1.0 * (since > 0), 1.0 * (time == count // 2)),
    )
    noise = 10.0 ** rng.uniform(-9, 0) * rng.standard_normal(count)
    samples = 10.0 ** rng.uniform(-12, 12) * (kinds[seed % len(kinds)] + noise)
    scale = float(np.abs(samples).max() * rng.choice([0.5, 1, 2]))
    found = pick(time, samples, full_scale_pa=scale if seed % 2 else None)
    assert found.quality == "poor" or np.isfinite(found.covariance).all()


@pytest.mark.slow
def test_a_faint_pulse_is_not_three_times_as_long_with_its_suction():
    off = []
    for samples in noisy(TRUTH, 0.25 * TRUTH.peak, 4):
        found = pick(TIME, samples)
        off.append(np.log(found.positive_duration_s / TRUTH.duration))
        sd = found.sd("positive_duration_s") / found.positive_duration_s
        # four standard deviations: once in 4,000 of 4 records
        assert abs(off[-1]) < 4 * sd
    assert np.median(np.abs(off)) < 0.25


def test_pressures_scale_and_shift_and_so_do_clocks():
    samples = noisy(TRUTH, 0.02 * TRUTH.peak, 1)[0]
    usual = pick(TIME, samples)
    found = pick(1e3 * (TIME + 7.0), 1e-6 * (samples + 4 * TRUTH.peak))
    # the search ends within some thousandths of a standard deviation
    sd = usual.sd("air_arrival_s")
    assert abs(1e-3 * found.air_arrival_s - 7.0 - usual.air_arrival_s) < 0.02 * sd
    for name, factor in (
        ("positive_duration_s", 1e3),
        ("peak_overpressure_pa", 1e-6),
        ("positive_impulse_pa_s", 1e-3),
    ):
        expected = factor * getattr(usual, name)
        close = 0.02 * usual.sd(name) * factor
        np.testing.assert_allclose(getattr(found, name), expected, atol=close)
        np.testing.assert_allclose(found.sd(name), factor * usual.sd(name), rtol=0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t, p: (t, np.where(t > 4e-3, np.nan, p)),
            r"pressure_pa: .* nan at \[4",
        ),
        (lambda t, p: (t[::-1], p), r"time_s\[1\]: expected a time after"),
        (lambda t, p: (t[:-1], p), "shapes .1024,. and .1023,"),
        (
            lambda t, p: (np.where(t > 4e-3, t + 1e-3, t), p),
            r"time_s\[401\]: expected .* a gap",
        ),
        (
            lambda t, p: (np.stack([t, t]), np.stack([p, p])),
            "got the shapes .2, 1024. and",
        ),
        (lambda t, p: (t[:9], p[:9]), "16 samples or more, got 9"),
    ],
)
def test_an_array_that_is_no_record_is_refused_by_name(change, message):
    with pytest.raises(InputError, match=message):
        pick(*change(TIME, samples_of(TRUTH)))


@pytest.mark.parametrize("name", ["full_scale_pa", "high_pass_hz"])
def test_a_scale_or_corner_that_is_not_positive_is_refused(name):
    with pytest.raises(InputError, match=f"{name}: expected a positive"):
        pick(TIME, samples_of(TRUTH), **{name: 0.0})


def test_a_stated_high_pass_is_part_of_the_pulse():
    from scipy.signal import bilinear, lfilter

    corner, rng = 60.0, np.random.default_rng(4)
    through = lfilter(
        *bilinear([1.0, 0.0], [1.0, 2 * np.pi * corner], RATE), samples_of(TRUTH)
    )
    samples = np.asarray(through) + 0.005 * TRUTH.peak * rng.standard_normal(SAMPLES)
    found = pick(TIME, samples, high_pass_hz=corner)
    assert "high_passed" not in found.notes
    for name in NAMES[:4]:
        assert abs(getattr(found, name) - VALUES[name]) < 4 * found.sd(name)
    # without it the phase is a tenth shorter or not written
    wrong = pick(TIME, samples)
    off = abs(wrong.positive_duration_s - TRUTH.duration) / TRUTH.duration
    assert off > 0.05 or set(wrong.notes) & {"high_passed", "zero_shift"}


def test_files_are_picked_without_jax(tmp_path):
    samples = noisy(TRUTH, 0.01 * TRUTH.peak, 1)[0]
    rows = zip(TIME.tolist(), samples.tolist(), strict=True)
    text = "time_s,pressure_pa\n" + "".join(f"{t:.6f},{p:.3f}\n" for t, p in rows)
    (tmp_path / "gate.csv").write_text(text)
    program = (
        "import sys, jblast\n"
        f"found = jblast.pick_files({str(tmp_path / 'gate.csv')!r})\n"
        "print(len(found.log.observations), 'jax' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "4 False\n"


def test_a_note_makes_a_pick_as_bad_as_its_row():
    for kind, row in NOTES.items():
        assert made.pick(notes=(kind,)).quality == row.quality
    assert made.pick().quality == "good"
    assert made.pick(notes=("sharp_front", "clipped")).quality == "doubtful"


def test_a_full_scale_is_used_if_stated():
    samples = noisy(TRUTH, 0.02 * TRUTH.peak, 2, seed=5)
    cut = np.minimum(samples[1], 0.5 * TRUTH.peak)
    stated = PressureRecord(
        "stated", samples[0], rate_hz=RATE, full_scale=0.6 * TRUTH.peak
    )
    unstated = PressureRecord("unstated", samples[0], rate_hz=RATE)
    equal = PressureRecord("equal", cut, rate_hz=RATE)
    found = [one.pick for one in pick_records([stated, unstated, equal])]
    assert [np.isfinite(one.clipped_at_pa) for one in found] == [True, False, True]
    alone = pick(TIME, samples[0], full_scale_pa=0.6 * TRUTH.peak)
    assert found[0].peak_overpressure_pa == alone.peak_overpressure_pa
