"""What is no record is refused in one message that names the file."""

import os

import numpy as np
import pytest
import soundfile

from jblast.errors import InputError
from jblast.observations.records.formats import Scaling, open_record


def test_what_is_not_there_or_of_no_format_is_refused(tmp_path):
    for name, held, said in (
        ("a.wav", None, "a.wav: no such file"),
        ("a", None, "a: no such file"),
        ("a.mp3", b"ID3", r"a.mp3: expected a record of samples, its name ending in"),
        ("a.wave", b"RIFF", r"did you mean \.wav"),
        ("a.csv", b"", "a.csv: is empty"),
        ("a.wav", b"time_s,p_pa\n0,1\n", "a.wav: expected a sound file"),
        ("b.mseed", b"time_s,p_pa\n0,1\n", "b.mseed: expected a complete .mseed"),
        ("b.tdms", b"time_s,p_pa\n0,1\n", "b.tdms: expected pressure"),
        ("b.nc", b"time_s,p_pa\n0,1\n", "b.nc: expected a complete .nc file"),
        ("b.mat", b"time_s,p_pa\n0,1\n" * 20, "b.mat: expected a .mat file"),
        ("b.csv", b"\x00\x01\xff" * 50, "b.csv: line 1: expected"),
    ):
        path = tmp_path / name
        if held is not None:
            path.write_bytes(held)
        with pytest.raises(InputError, match=said):
            open_record(path)


def test_a_mistaken_extension_is_told_from_what_the_file_begins_with(tmp_path):
    path = tmp_path / "a.csv"
    soundfile.write(path, np.zeros(9), 8000, format="WAV")
    with pytest.raises(InputError, match=r"begins like \.wav or \.flac; rename it"):
        open_record(path)


def test_ten_gigabytes_of_text_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,p_pa\n0,1\n")
    os.truncate(path, 10**10)  # sparse: takes no room
    with pytest.raises(InputError, match=r"at most 2 GB of \.csv.* got 10 GB"):
        open_record(path)


def test_a_sample_that_is_no_number_is_named_when_it_is_read(tmp_path):
    path = tmp_path / "a.wav"
    samples = np.zeros((100, 2), np.float32)
    samples[40, 1] = np.nan
    soundfile.write(path, samples, 1000, subtype="FLOAT")
    (recording,) = open_record(path, Scaling(full_scale_pa=1.0))
    recording.samples(0, 40)
    with pytest.raises(InputError, match=r"a.wav: channel a.2, sample 41 \(0.04 s\)"):
        recording.samples(20, 60)
    samples[:, 0] = np.nan
    soundfile.write(path, samples, 1000, subtype="FLOAT")
    with pytest.raises(InputError, match=r"a\.1: expected samples, got no finite"):
        recording.samples(0, 100)
