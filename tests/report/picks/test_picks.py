"""What was picked, in words, JSON and pictures."""

import json
from dataclasses import replace

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.formats import Scaling
from jblast.observations.records.recording import PressureRecord
from jblast.report.output import write_answer
from jblast.report.pick_figures import BINS, curve_of, records_figure
from jblast.report.picks import FILES, picks_answer, picks_report
from jblast.report.provenance import provenance_of
from jblast.report.view import terminal
from jblast.signals.picks import Gathered, PickedFiles, log_of
from jblast.signals.picks.pick import FittedPulse
from jblast.signals.picks.pulse import CONTINUED, CUBIC, SMOOTH
from tests.signals.records.made import record_pick

RATE, START = 1e4, 5.0
RIFF = "a40ff3d5900fb7698b8c865041347cb49eccedc8f93945f89629ad104aaecce4"


def friedlander(samples: int = 2000) -> np.ndarray:
    """The pulse of `made.pick`, at 5.05 s: its samples are means over a hundred."""
    fine = (np.arange(100 * samples) + 0.5) / 100 - 0.5
    since = fine / RATE - 0.05 - 1e-4
    s, q = since / (0.01 - 1e-4), (since + 1e-4 - 0.01) / 0.03
    rise = np.clip(since / 1e-4 + 1.0, 0.0, 1.0)
    pressure = 1000.0 * (3 * rise**2 - 2 * rise**3)
    decay = 1000.0 * (1 - np.clip(s, 0, 1)) * np.exp(-np.clip(s, 0, 1))
    suction = -6.75 * 300.0 * np.clip(q, 0, 1) * (1 - np.clip(q, 0, 1)) ** 2
    pressure = np.where(since > 0, decay + suction, pressure)
    return pressure.reshape(samples, 100).mean(axis=1) + 5.0  # the baseline


def pulse_of(negative: int, corner: float | None = None) -> FittedPulse:
    """The same pulse, or one with another negative phase, in samples from 5.05 s."""
    duration, rise, fall = 0.01 * RATE, 1e-4 * RATE, 0.03 * RATE
    free = rise / (1 - rise / duration)
    shape = np.log([duration, 2.0, free, fall / duration])
    forms = np.array([SMOOTH]), np.array([negative])
    unknowns = np.array([[0.5 * rise, *shape]])  # a smooth rise has its centre midway
    amounts = np.array([1.0, 0.3, 0, 0, 0, 0, 0])
    return FittedPulse(unknowns, *forms, amounts, corner, 5.05, 1 / RATE, 1000.0)


def found(*changes) -> Gathered:
    """Picks of the pulse, each with what is changed."""
    picks = []
    for k, changed in enumerate(changes):
        changed = {"pulse": pulse_of(CUBIC)} | changed
        calibrated = changed.pop("calibrated", True)
        record = PressureRecord(
            f"g{k}",
            friedlander(),
            rate_hz=RATE,
            start_s=START,
            calibrated=calibrated,
            source=f"g{k}.wav",
        )
        picks.append(record_pick(record, **({"air_arrival_s": 5.05} | changed)))
    return Gathered(tuple(picks), ("dead",), {"g0": 2}, (), None, len(picks) + 1)


def test_the_fitted_curve_is_the_pulse_that_the_samples_hold():
    curve = curve_of(found({}).picks[0])
    assert curve.time.size <= BINS
    # means over bins of a few samples; a hundred instants a sample, and the decay's
    # join behind the rise
    np.testing.assert_allclose(curve.fitted, curve.samples, atol=2.0)
    assert curve.samples.max() > 900.0
    assert (curve.low <= curve.samples).all()
    assert (curve.samples <= curve.high).all()


def test_the_fitted_curve_has_the_form_of_the_fit():
    # decay 1 behind a rise of one sample, without an end
    (one,) = found({"pulse": pulse_of(CONTINUED)}).picks
    fine = (np.arange(100 * 2000) + 0.5) / 100 - 0.5
    since = fine / RATE - 0.05 - 1e-4
    s = since / (0.01 - 1e-4)
    x = np.clip(since / 1e-4 + 1.0, 0.0, 1.0)
    pressure = np.where(since > 0, (1 - s) * np.exp(-s), 3 * x**2 - 2 * x**3)
    samples = 1000.0 * pressure.reshape(2000, 100).mean(axis=1) + 5.0
    curve = curve_of(replace(one, record=replace(one.record, samples=samples)))
    np.testing.assert_allclose(curve.fitted, curve.samples, atol=2.0)


def test_the_document_is_json_and_holds_what_was_picked():
    one = found({"later_arrival_s": 5.08, "calibrated": False})
    document = json.loads(picks_answer(one, log_of(one)).to_json())
    (told,) = document["picks"]
    assert (told["record"], told["file"], told["bang"]) == ("g0", "g0.wav", 1)
    assert told["air_arrival_s"] == {"value": 5.05, "sd": pytest.approx(0.01)}
    assert told["peak_overpressure_pa"] is None
    assert [later["value"] for later in told["later_arrivals_s"]] == [5.08]
    assert document["not_in_log"][0]["reason"] == "uncalibrated"


def picked(some: Gathered) -> PickedFiles:
    """Return picks with their log, as `pick_files` does."""
    return PickedFiles(some, log_of(some), (), (), ("g",), Scaling(), None)


def test_figures_and_page_are_written_and_clipped_samples_have_no_residual(tmp_path):
    some = found({}, {"clipped_at_pa": 800.0, "lower_bound": True}, {})
    figure = records_figure(some.named(), some.picks)
    residual = figure.axes[3].lines[-1].get_ydata()
    assert np.isnan(np.asarray(residual, float)).any()
    record = tmp_path.parent / "g0.wav"
    record.write_bytes(b"RIFF")
    made = provenance_of([record], command=["jblast", "pick", "g0.wav"])
    fault = InputError("bad.wav: expected a header")
    answer = picks_report(picked(some._replace(refused=(fault,))), made)
    written = write_answer(answer, tmp_path, "picks", names=FILES)
    assert written == ["picks.json", "records_1.png", "report.html"]
    page = (tmp_path / "report.html").read_text()
    assert str(fault) in page
    assert "Command: jblast pick g0.wav" in page
    # by `printf RIFF | sha256sum`
    assert f"g0.wav, SHA-256 {RIFF}" in page
    assert page.count('<th scope="row"') == 3


def test_a_note_is_printed_once_and_a_doubtful_pick_marked():
    some = found({"notes": ("faint", "sharp_front")}, {"notes": ("faint",)}, {})
    answer = picks_report(picked(some))
    text = terminal(answer.view)
    assert text.startswith("3 picks in 4 records\n")
    assert text.count("the pulse is faint") == 1
    assert "g0 and g1: the pulse is faint" in text
    assert text.count("quality: doubtful") == 2
    assert "nothing found in dead" in text
    assert "g0: 2 quieter onsets ignored" in text
    assert answer.exit_code == 0


def test_a_high_pass_takes_the_mean_of_a_long_pulse():
    corner = 2 * np.pi * 20.0 / RATE
    picks = found({}, {"pulse": pulse_of(CUBIC, corner)}).picks
    without, with_it = map(curve_of, picks)
    # dy/dt = dp/dt - 2 pi f y by Euler's method, a step a bin
    step = without.time[1] - without.time[0]
    y, before = 0.0, without.fitted[0]
    for p, told in zip(without.fitted[1:], with_it.fitted[1:], strict=True):
        y, before = (y + p - before) / (1 + 2 * np.pi * 20.0 * step), p
        assert told == pytest.approx(y, abs=0.05 * 1000.0)
