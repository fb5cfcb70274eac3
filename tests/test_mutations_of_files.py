"""Damaged files of every binary format end in an `InputError` or in numbers."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from jblast.errors import InputError
from jblast.observations.records.formats import open_record
from jblast.observations.records.sound import read_sound, write_sound
from jblast.sensors.camera.files.event_files import read_events, write_events
from tests.sensors.camera.files.test_events import events_of

MUTATIONS = 2000


def made(folder: Path, suffix: str) -> Path:
    """Write a small valid file."""
    path = folder / f"a{suffix}"
    rng = np.random.default_rng(0)
    samples = rng.normal(0.0, 0.1, 400)
    if suffix in (".wav", ".flac"):
        write_sound(path, samples, 8000, 16)
    elif suffix == ".nc":
        with h5py.File(path, "w") as file:
            file["pressure_pa"] = samples
            file.attrs["rate_hz"] = 8000.0
    elif suffix == ".mseed":
        import obspy

        header = {"station": "A", "channel": "BDF", "sampling_rate": 100.0}
        obspy.Trace(samples.astype(np.float32), header).write(str(path), "MSEED")
    elif suffix == ".tdms":
        import nptdms

        of = {"unit_string": "Pa", "wf_increment": 1e-4, "wf_start_offset": 0.0}
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment([nptdms.ChannelObject("g", "p", samples, of)])
    elif suffix == ".mat":
        scipy.io.savemat(path, {"rate_hz": 8000.0, "pressure_pa": samples})
    elif suffix == ".mp4":
        clip(path)
    else:
        t = np.cumsum(rng.integers(0, 300, 300))
        x, y = rng.integers(0, 32, (2, 300))
        write_events(path, [events_of(x, y, t, t % 2)], 32, 32)
    return path


def clip(path: Path, light=None, samples=None, created=None) -> Path:
    """Write a clip of 30 frames a second by FFmpeg; without arguments black, a click.

    Args:
        path: Its file.
        light: Values of grey from 0 to 1, shape (frame, height, width).
        samples: Sound at 48 kHz, shares of full scale.
        created: Time of creation that it states.
    """
    import av

    if light is None:
        light = np.zeros((30, 32, 32))
    if samples is None:
        samples = np.zeros(48000)
        samples[24000:24200] = 0.9
    values = np.rint(255 * light).astype(np.uint8)
    with av.open(str(path), "w") as file:
        if created is not None:
            file.metadata["creation_time"] = created
        video, sound = file.add_stream("mpeg4", 30), file.add_stream("aac", 48000)
        video.height, video.width = values.shape[1:]
        video.pix_fmt, sound.layout = "yuv420p", "mono"
        for image in values:
            grey = np.repeat(image[..., None], 3, axis=2)
            file.mux(video.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")))
        file.mux(video.encode())
        for at in range(0, len(samples) - 1023, 1024):
            part = samples[None, at : at + 1024].astype(np.float32)
            frame = av.AudioFrame.from_ndarray(part, format="fltp", layout="mono")
            frame.sample_rate, frame.pts = 48000, at
            file.mux(sound.encode(frame))
        file.mux(sound.encode(None))
    return path


def read_all(path: Path) -> None:
    for one in open_record(path):
        one.samples(0, one.length)


READERS = {
    **{s: read_events for s in (".h5", ".npz", ".raw", ".aedat4", ".txt")},
    ".wav": read_sound,
    ".flac": read_sound,
    **{s: read_all for s in (".nc", ".mseed", ".tdms", ".mp4", ".mat")},
}


def mutate(folder: Path, suffix: str, count: int) -> int:
    """Return the number of mutations that were refused; others were read."""
    path = made(folder, suffix)
    data, rng, refused = path.read_bytes(), np.random.default_rng(1), 0
    READERS[suffix](path)
    for _ in range(count):
        changed = bytearray(data)
        for at in rng.integers(0, len(data), rng.integers(1, 6)):
            changed[at] = rng.integers(256)
        if rng.random() < 0.1:
            del changed[rng.integers(1, len(data)) :]
        path.write_bytes(changed)
        try:
            READERS[suffix](path)
        except InputError:
            refused += 1
    return refused


@pytest.mark.slow
@pytest.mark.parametrize("suffix", READERS)
def test_mutations_are_read_or_refused(tmp_path, suffix):
    # AEDAT4 and .mat are read by a process of their own
    count = MUTATIONS // 20 if suffix in (".aedat4", ".mat") else MUTATIONS
    # in a process of its own: libraries may end it, and its memory is measured
    script = (
        "import sys; from pathlib import Path\n"
        "from tests.test_mutations_of_files import mutate\n"
        "print(mutate(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])))\n"
        # of this program alone: ru_maxrss is at least that of the process it came from
        "peak = Path('/proc/self/status').read_text().partition('VmHWM:')[2]\n"
        "print(peak.split()[0])"
    )
    words = [sys.executable, "-c", script, str(tmp_path), suffix, str(count)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    refused, kilobytes = map(int, done.stdout.split()[-2:])
    assert refused > 0
    assert kilobytes < 700_000
