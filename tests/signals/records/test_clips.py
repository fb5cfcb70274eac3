"""Sound tracks of clips: their clock, and one log of several clips."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations.records.formats import open_record
from jblast.signals.detect_files import (
    FilmDetections,
    detect,
)
from tests.test_mutations_of_files import clip

START = "2024-05-17T11:53:00Z"
STATIONS = "sensor,east_m,north_m,up_m\none,500,0,0\ntwo,0,500,0\n"


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".mov"])
def test_a_sound_track_has_the_clock_of_the_picture(tmp_path, suffix):
    path = clip(tmp_path / f"one{suffix}")
    (one,) = open_record(path)
    assert one.names == ("one",)
    assert one.rate_hz == 48000
    assert abs(one.start_s) < 0.03
    samples = np.abs(one.samples(0, one.length)[0])
    first = one.start_s + np.argmax(samples > 0.3) / one.rate_hz
    # the encoder's delay, 21 ms, is removed; Matroska rounds stamps to 1 ms
    assert first == pytest.approx(0.5, abs=2e-3)


def test_clips_and_arguments_that_do_not_fit_are_refused(tmp_path):
    paths = [clip(tmp_path / f"{name}.mp4") for name in ("one", "two")]
    table = tmp_path / "stations.csv"
    table.write_text(STATIONS.replace("two", "three"))
    with pytest.raises(
        InputError, match=r"station for two of .*two\.mp4, got one, three"
    ):
        detect(paths, positions=table)
    table.write_text(f"{STATIONS.splitlines()[0]},start_utc\none,0,0,0,{START}\n")
    with pytest.raises(InputError, match="column start_utc: expected no values"):
        detect(paths[0], positions=table)
    again = tmp_path / "again"
    again.mkdir()
    with pytest.raises(InputError, match="different names, got one twice"):
        detect([paths[0], clip(again / "one.mp4")])
    with pytest.raises(InputError, match="scene: expected it with one video only"):
        detect(paths, scene="scene.toml")
    with pytest.raises(InputError, match="size: expected it with events only"):
        detect(paths[0], size=(640, 480))
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(paths[0].read_bytes()[:900])
    with pytest.raises(InputError, match=r"cut\.mp4: expected a complete video"):
        open_record(cut)


@pytest.mark.parametrize("suffix", [".txt", ".h5"])
def test_a_record_of_pressure_is_refused_with_the_command_that_takes_it(
    tmp_path, suffix
):
    path = tmp_path / f"gate{suffix}"
    if suffix == ".txt":
        path.write_text("time_s,pressure_kpa\n0,1\n1,2\n")
    else:
        with h5py.File(path, "w") as file:
            file["time_s"], file["pressure_kpa"] = np.arange(9.0), np.zeros(9)
    with pytest.raises(InputError, match="got a record of pressure; use jblast pick"):
        detect(path)


def test_the_time_of_creation_is_named_with_the_option_that_uses_it(
    tmp_path, monkeypatch
):
    monkeypatch.setattr("jblast.signals.detect_files.has_sound", lambda _: False)
    path = clip(tmp_path / "one.mp4", created=START)
    found = detect(path)
    assert isinstance(found, FilmDetections)
    (note,) = found.notes
    assert "created at 2024-05-17T11:53:00" in note
    assert "start_utc" in note


@pytest.mark.slow
def test_a_varying_frame_rate_goes_by_the_time_stamps_of_the_file():
    # 30 frames a second, from 0.5 to 1.0 s 20: by even steps the flash is 0.15 s early
    film = detect("tests/data/vfr.mp4", fps=30.0)
    assert isinstance(film, FilmDetections)
    (flash,) = film.flashes.flashes
    assert flash.growth.time_s == pytest.approx(1.012, abs=2 * flash.growth.sigma_s)
    assert "the frame rate varies" in film.notes[0]
    bang = film.bang
    assert bang is not None
    assert bang.time_s == pytest.approx(2.4, abs=2 * bang.sigma_s)


@pytest.mark.parametrize(
    ("start_s", "said"),
    [(-2.0, "sound that ends before the first frame"), (1e9, "bytes of numbers")],
)
def test_sound_far_from_the_picture_is_not_searched(
    tmp_path, monkeypatch, start_s, said
):
    path = clip(tmp_path / "one.mp4")
    tracks = [replace(one, start_s=start_s) for one in open_record(path)]
    monkeypatch.setattr("jblast.signals.detect_files.open_record", lambda _: tracks)
    found = detect(path)
    assert isinstance(found, FilmDetections)
    assert said in found.notes[0]


def test_a_template_that_is_none_is_refused_with_clips_too(tmp_path):
    path = clip(tmp_path / "one.mp4")
    with pytest.raises(InputError, match=r"absent\.wav: no such file"):
        detect(path, template=tmp_path / "absent.wav")
