import os

import numpy as np
import pytest
import soundfile

from jblast.errors import InputError
from jblast.observations.records.formats import open_record
from jblast.observations.records.sound import (
    read_sound,
    resampled,
    write_sound,
)

SUBTYPES = (
    ("WAV", "PCM_U8", 8),
    ("WAV", "PCM_16", 16),
    ("WAV", "PCM_24", 24),
    ("WAV", "PCM_32", 32),
    ("WAV", "FLOAT", None),
    ("WAV", "DOUBLE", None),
    ("WAVEX", "PCM_24", 24),
    ("RF64", "PCM_16", 16),
    ("FLAC", "PCM_S8", 8),
    ("FLAC", "PCM_16", 16),
    ("FLAC", "PCM_24", 24),
)


def ramps(channels: int, n: int = 1000) -> np.ndarray:
    """Channels that differ, within full scale."""
    return np.linspace(-0.9, 0.8, channels * n).reshape(channels, n)


@pytest.mark.parametrize(("kind", "subtype", "bits"), SUBTYPES)
def test_what_another_program_wrote_is_read(tmp_path, kind, subtype, bits):
    path = tmp_path / "sound"  # what it is stands in it, not in its name
    for channels in (1, 2, 8):
        samples = ramps(channels)
        soundfile.write(path, samples.T, 8000, subtype=subtype, format=kind)
        record = read_sound(path)
        assert (record.rate_hz, record.samples.shape) == (8000, (channels, 1000))
        # libsndfile writes 1 as the largest whole number and reads that as one step
        # less: up to a step and a half
        step = 2.0 ** (1 - bits) if bits else 0.0
        np.testing.assert_allclose(record.samples, samples, atol=1.5 * step + 1e-7)


@pytest.mark.parametrize("bits", [8, 16, 24, 32])
def test_whole_numbers_come_back_as_they_were(tmp_path, bits):
    steps = 2.0 ** (bits - 1)
    samples = np.array([[-steps, 1 - steps, -1.0, 0.0, 1.0, steps - 1]]) / steps
    for name in ("a.wav", "a.flac"):
        path = tmp_path / name
        if name == "a.flac" and bits == 32:
            with pytest.raises(InputError, match="8, 16, 24"):
                write_sound(path, samples, 48000, bits)
            continue
        write_sound(path, samples, 48000, bits)
        np.testing.assert_array_equal(read_sound(path).samples, samples)
        write_sound(path, np.array([1.0, 0.4 / steps, 0.6 / steps]), 48000, bits)
        expected = [[1.0 - 1.0 / steps, 0.0, 1.0 / steps]]
        np.testing.assert_array_equal(read_sound(path).samples, expected)


@pytest.mark.parametrize(("kind", "subtype", "_"), SUBTYPES)
def test_a_file_cut_short_is_read_as_far_as_it_goes(tmp_path, kind, subtype, _):
    path = tmp_path / "a"
    samples = ramps(2)
    soundfile.write(path, samples.T, 8000, subtype=subtype, format=kind)
    whole, all_of_it = path.read_bytes(), read_sound(path).samples
    for length in (3, 9, 12, 21, 30, 43):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"a: .* cut short") as refusal:
            read_sound(path)
        assert "\n" not in str(refusal.value)
    for length in (len(whole) * 4 // 5, len(whole) - 1):
        path.write_bytes(whole[:length])
        if kind == "FLAC":
            with pytest.raises(InputError, match=r"a: .*is cut short"):
                read_sound(path)
            continue
        record = read_sound(path)
        n = record.samples.shape[1]
        assert 0.6 * samples.shape[1] < n < samples.shape[1]
        np.testing.assert_array_equal(record.samples, all_of_it[:, :n])
        (note,) = record.notes
        assert note.startswith(f"cut short: {n / 8000:.6g} s are read, and at least")
        (part,) = open_record(path.rename(tmp_path / "a.wav"))  # whole again below
        assert (part.length, part.notes) == (n, record.notes)
        np.testing.assert_array_equal(part.samples(n - 50, n), all_of_it[:, n - 50 : n])


@pytest.mark.parametrize("kind", ["WAV", "RF64", "stream"])
def test_a_file_without_its_size_is_read_to_its_end(tmp_path, kind):
    path, form = tmp_path / "a.wav", "RF64" if kind == "RF64" else "WAV"
    soundfile.write(path, ramps(2).T, 8000, subtype="PCM_16", format=form)
    whole, samples = bytearray(path.read_bytes()), read_sound(path).samples
    at = whole.index(b"data") + 4
    if kind == "RF64":
        ds64 = whole.index(b"ds64") + 8
        whole[ds64 : ds64 + 16] = bytes(16)
    else:
        unknown = b"\xff" * 4 if kind == "stream" else bytes(4)
        whole[4:8] = whole[at : at + 4] = unknown
    path.write_bytes(whole)
    record = read_sound(path)
    np.testing.assert_array_equal(record.samples, samples)
    note = "its header has no size: read to the end of the file"
    assert record.notes == (() if kind == "stream" else (note,))
    (recording,) = open_record(path)
    np.testing.assert_array_equal(recording.samples(900, 1000), samples[:, 900:])


@pytest.mark.parametrize(("law", "largest"), [("ULAW", 32124), ("ALAW", 32256)])
def test_telephone_sound_is_read(tmp_path, law, largest):
    path = tmp_path / "a.wav"
    loud = np.concatenate([ramps(1)[0], [1.0, -1.0]])
    soundfile.write(path, loud, 8000, subtype=law)
    record = read_sound(path)
    # steps of the laws are at most a sixteenth of a sample
    np.testing.assert_allclose(
        record.samples[0, :1000], loud[:1000], rtol=0.04, atol=1e-3
    )
    (recording,) = open_record(path)
    assert recording.full_scale == record.samples.max() == largest / 2**15


def broken(path):
    """Files that cannot be used, and what is said of each."""
    empty = path / "empty.wav"
    empty.touch()
    text = path / "text.wav"
    text.write_text("no sound at all, but long enough to hold some " * 9)
    header = path / "header.wav"
    soundfile.write(header, np.zeros((0, 1)), 8000)
    nine = path / "nine.wav"
    soundfile.write(nine, np.zeros((10, 9)), 8000)
    lossy = path / "lossy.wav"
    soundfile.write(lossy, np.zeros(1000), 8000, subtype="IMA_ADPCM")
    ogg = path / "a.ogg"
    soundfile.write(ogg, np.zeros(1000), 8000)
    samples = ramps(2)
    samples[1, 400], samples[0, 700] = np.nan, np.inf
    nan = path / "nan.wav"
    soundfile.write(nan, samples.T, 8000, subtype="FLOAT")
    samples[1, 400] = -np.inf
    infinite = path / "infinite.wav"
    soundfile.write(infinite, samples.T, 8000, subtype="DOUBLE")
    return {
        path / "none.wav": "no such file; expected a sound file",
        path: "is a directory",
        empty: "is empty",
        text: "WAV or FLAC, got one that is cut short, damaged or",
        header: "WAV or FLAC, with samples, got none",
        nine: "at most 8 channels, got WAV PCM_16 with 9",
        lossy: "8 to 32 bits or float, with at most 8 channels, got WAV IMA_ADPCM",
        ogg: "got OGG VORBIS",
        nan: "nan.2, sample 401 (0.05 s): expected a finite sample, got nan",
        infinite: "infinite.2, sample 401 (0.05 s): expected a finite sample, got -inf",
    }


def test_what_is_no_recording_is_refused_in_one_message(tmp_path):
    for path, words in broken(tmp_path).items():
        with pytest.raises(InputError) as refusal:
            read_sound(path)
        assert str(refusal.value).startswith(f"{path}: ")
        assert words in str(refusal.value)


def test_what_cannot_be_written_is_refused_and_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.wav"
    write_sound(path, ramps(1), 8000)
    before = path.read_bytes()
    one = np.ones((1, 4))
    cases: tuple[tuple, ...] = (
        ("samples to write, got none", path, one[:, :0], 8000, "float"),
        ("got the shape (1, 1, 1)", path, np.ones((1, 1, 1)), 8000, "float"),
        ("at most 8 channels, got the shape", path, np.ones((9, 4)), 8000, "float"),
        ("from -1 to 1, got 1.5", path, 1.5 * one, 8000, 16),
        ("finite", path, np.nan * one, 8000, "float"),
        ("finite", path, 1e39 * one, 8000, "float"),
        ("whole number of samples a second, got 0.5 Hz", path, one, 0.5, "float"),
        ("whole number of samples a second, got -8000 Hz", path, one, -8e3, "float"),
        ("got nan Hz", path, one, float("nan"), "float"),
        (
            "32, float or .flac of 8, 16, 24 bits, got 12",
            path,
            one,
            8000,
            12,
        ),
        ("got 'float'", tmp_path / "a.flac", one, 8000, "float"),
        ("expected .wav of", tmp_path / "a.mp3", one, 8000, "float"),
    )
    for words, file, samples, rate_hz, bits in cases:
        with pytest.raises(InputError) as refusal:
            write_sound(file, samples, rate_hz, bits)
        assert words in str(refusal.value)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.wav"]


def packets_of(samples: np.ndarray, size: int, end: BaseException | None = None):
    """Cut samples into packets, after which something may go wrong."""
    for start in range(0, samples.shape[-1], size):
        yield samples[..., start : start + size]
    if end is not None:
        raise end


@pytest.mark.slow
@pytest.mark.parametrize("end", [RuntimeError("broke"), KeyboardInterrupt()])
def test_a_stream_that_breaks_keeps_what_it_had(tmp_path, end):
    path = tmp_path / "a.wav"
    samples = ramps(1)
    with pytest.raises(type(end)):
        write_sound(path, packets_of(samples, 77, end), 8000)
    np.testing.assert_allclose(read_sound(path).samples, samples, atol=1e-7)
    with pytest.raises(type(end)):  # none had come: what was there stays
        write_sound(path, packets_of(samples[:, :0], 77, end), 8000)
    assert read_sound(path).samples.shape == (1, 1000)
    assert os.listdir(tmp_path) == ["a.wav"]


@pytest.mark.parametrize(("from_hz", "to_hz"), [(44100, 48000), (96000, 48000)])
def test_another_rate_leaves_a_tone_as_it_was(from_hz, to_hz):
    tone = np.sin(2 * np.pi * 997.0 * np.arange(from_hz // 5) / from_hz)
    tone = np.stack([tone, tone])
    got = resampled(tone, from_hz, to_hz)
    assert got.shape == (2, to_hz // 5)
    expected = np.sin(2 * np.pi * 997.0 * np.arange(to_hz // 5) / to_hz)
    # the passband of the Kaiser window (beta 5) ripples by 0.3 %; ends see silence
    inner = slice(200, -200)
    np.testing.assert_allclose(got[0, inner], expected[inner], atol=3e-3)


def test_the_same_rate_changes_nothing_and_no_rate_is_refused():
    samples = ramps(2)
    assert resampled(samples, 8000, 8000) is samples
    for rates in ((0, 8000), (8000, -1), (8000, 0.5), (8000, float("inf"))):
        with pytest.raises(InputError, match="whole number of samples a second"):
            resampled(samples, *rates)
