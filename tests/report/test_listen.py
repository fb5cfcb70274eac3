"""Records in figures: read back from their files."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.sound import write_sound
from jblast.report.listen import (
    RecordAnswer,
    Recordings,
    listen_view,
    read_samples,
)
from jblast.report.output import page_of
from jblast.report.view import terminal
from jblast.sensors.record_writer import write_samples

SAMPLES = np.random.default_rng(3).normal(size=65_636)
VALUES = {
    "air_arrival_s": 0.5,
    "ground_arrival_s": np.nan,
    "peak_overpressure_pa": 2e3,
    "positive_duration_s": 0.1,
}


def record(kind, file, column, **numbers) -> RecordAnswer:
    """Return the numbers of a record."""
    own: dict[str, Any] = {
        "largest": {f"largest_{column}": 4.0},
        "full_scale_pa": None,
        "blasts": None,
    }
    own |= {"clipped": False, "clipped_samples": 0} | numbers
    return RecordAnswer(kind, file, 1000.0, SAMPLES.size, VALUES, **own)


@pytest.fixture
def recordings(tmp_path) -> Recordings:
    write_sound(tmp_path / "mic.wav", SAMPLES / 10.0, 1000.0)
    columns = ("wind_east_m_s", "wind_north_m_s", "wind_up_m_s")
    wind = np.outer(SAMPLES[:500], [3.0, 0.0, 4.0])
    write_samples(tmp_path / "wind.csv", iter([wind]), 1000.0, columns, ["made up"])
    sensors = {
        "mic <b>": record(
            "microphone", "mic.wav", "overpressure_pa", full_scale_pa=10.0
        ),
        "wind": record("anemometer", "wind.csv", "wind_speed_m_s", clipped_samples=3),
    }
    return Recordings(65.6, {}, sensors, {}, ("note: a note",))


def test_samples_are_those_written(tmp_path, recordings):
    mic, wind = (read_samples(tmp_path, of) for of in recordings.sensors.values())
    np.testing.assert_allclose(mic, SAMPLES, atol=1e-6)
    np.testing.assert_allclose(wind, 5.0 * np.abs(SAMPLES[:500]), rtol=1e-6)
    nothing = SimpleNamespace(kind="pressure", file="a.csv", full_scale_pa=None)
    (tmp_path / "a.csv").write_text("time_s,overpressure_pa\n")
    assert read_samples(tmp_path, nothing).size == 0


def test_a_broken_file_is_named(tmp_path, recordings):
    (tmp_path / "mic.wav").write_bytes(b"RIFF")
    (tmp_path / "wind.csv").unlink()
    messages = ("mic.wav: expected sound", "wind.csv: expected a table")
    for of, message in zip(recordings.sensors.values(), messages, strict=True):
        with pytest.raises(InputError, match=message):
            read_samples(tmp_path, of)


def test_text_and_page_have_the_records(tmp_path, recordings):
    view = listen_view(recordings, tmp_path)
    text = terminal(view)
    assert text.startswith("Records of 2 sensors, 1 blast\n65.6 s each, from 0")
    assert "mic <b>  microphone  mic.wav" in text
    assert "never  500 ms  2 kPa" in text
    assert "a note" in text
    page = page_of(view)
    assert page.count("data:image/png;base64,") == 2
    assert "mic &lt;b&gt;" in page
