"""`jblast detect`: what it finds, prints and writes."""

import json

import numpy as np
import pytest
import soundfile

from tests.cli.verbs.infer.detect.sounds import RATE, pulse, recording, template, write

KEYS = ("schema", "detected", "arrivals", "threshold_snr_db", "latency_s")


def answer(jblast, *words):
    """Ask for JSON; return the exit code and the document."""
    code, out, _ = jblast("detect", *words, "--json")
    return code, json.loads(out)


def test_a_bang_is_found_where_it_is(jblast):
    file = write(jblast, "one.wav", recording([[1.23456]]))
    code, found = answer(jblast, file, "--template", template(jblast))
    assert code == 0
    assert tuple(found)[: len(KEYS)] == KEYS
    assert found["detected"]
    (arrival,) = found["arrivals"]
    assert abs(arrival["time_s"] - 1.23456) < 4 * arrival["sigma_s"]
    assert arrival["sigma_s"] < 1e-4
    assert (arrival["channel"], arrival["sensor"]) == (1, "one")
    # 2E/N0 = sum of squares over the noise's variance
    clock = np.arange(4 * RATE) / RATE
    snr_db = 10 * np.log10(np.sum(pulse(clock, 1.0) ** 2) / 0.02**2)
    assert arrival["snr_db"] == pytest.approx(snr_db, abs=1.5)
    assert arrival["snr_db"] > found["threshold_snr_db"] > 10


def test_nothing_is_found_in_noise_and_the_code_says_so(jblast):
    file = write(jblast, "noise.wav", recording([[]]))
    code, found = answer(jblast, file, "--template", template(jblast))
    assert code == 3
    assert (found["detected"], found["arrivals"]) == (False, [])
    assert "0 arrivals in" in jblast("detect", file, "--template", template(jblast))[1]


def test_a_dead_channel_is_named_and_the_others_are_used(jblast):
    samples = recording([[1.0], [], [1.1]])
    samples[1] = 0.0
    file = write(jblast, "three.wav", samples)
    code, found = answer(jblast, file, "--template", template(jblast))
    assert code == 0
    assert found["dead_channels"] == ["three.2"]
    assert [a["channel"] for a in found["arrivals"]] == [1, 3]
    said = jblast("detect", file, "--template", template(jblast))[1]
    assert "three.2: constant" in said


@pytest.mark.slow
def test_without_a_template_a_drum_is_rejected_and_a_blast_is_not(jblast):
    samples = recording([[]], seconds=6.0)
    time = np.arange(samples.shape[1]) / RATE
    blast, late = time - 2.0, np.maximum(time - 4.0, 0.0)
    x = np.maximum(blast, 0.0) / 0.008
    samples[0] += np.where(blast >= 0, (1 - x) * np.exp(-x), 0.0)
    for f, quality, size in ((90, 12, 1.0), (143, 15, 0.4)):
        decay = np.exp(-np.pi * f * late / quality)
        samples[0] += 0.6 * size * decay * np.sin(2 * np.pi * f * late)
    file = write(jblast, "both.wav", samples)
    code, found = answer(jblast, file)
    assert code == 0
    (arrival,) = found["arrivals"]
    assert arrival["blast_form"]
    assert abs(arrival["time_s"] - 2.0) < 1e-3
    assert arrival["misfit"] < 0.5
    assert arrival["log_likelihood_ratio"] > np.log(100)
    assert 0.99 < arrival["fit_p"] <= 1.0
    assert arrival["fit_dof"] > 500
    assert found["rejected_arrivals"]
    assert all(3.9 < one["time_s"] < 4.6 for one in found["rejected_arrivals"])
    assert found["other_sounds"] == len(found["rejected_arrivals"])

    drum = write(jblast, "drum.wav", samples[:, round(3.0 * RATE) :])
    code, out, _ = jblast("detect", drum)
    assert code == 3
    assert "without the form of a blast" in out
    assert "(--all-sounds)" in out
    code, found = answer(jblast, drum, "--all-sounds")
    assert (code, found["rejected_arrivals"]) == (0, [])
    assert found["other_sounds"] == len(found["arrivals"])
    assert not found["arrivals"][0]["blast_form"]
    assert found["arrivals"][0]["log_likelihood_ratio"] < 0.0


def test_the_output_of_the_filter_is_written_and_a_picture(jblast):
    file = write(jblast, "two.wav", recording([[1.0], [2.0]]))
    shape, out = template(jblast), jblast.path("out")
    code, said, _ = jblast("detect", file, "--template", shape, "--out", out)
    assert code == 0
    assert "filtered.wav" in said
    filtered, rate = soundfile.read(f"{out}/filtered.wav")
    assert (filtered.shape, rate) == ((4 * RATE, 2), RATE)
    assert np.argmax(filtered, axis=0).tolist() == [RATE, 2 * RATE]
    quiet = filtered[: RATE // 2]
    assert quiet.std() == pytest.approx(1.0, abs=0.1)  # in sigmas of the noise
    assert json.loads(jblast.text("out/detect.json"))["detected"]
    assert 'src="data:image/png' in jblast.text("out/report.html")
    assert (jblast.directory / "out/detection.png").stat().st_size > 10_000
    assert jblast("detect", file, "--template", shape, "--out", out, "--force")[0] == 0
