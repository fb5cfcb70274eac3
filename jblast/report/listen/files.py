"""Records as files: samples first, then the truth, then pictures."""

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import jblast
from jblast.files import write_text
from jblast.progress import each
from jblast.report.figure_files import write_drawn
from jblast.report.listen.document import CLOCK, truth_csv
from jblast.report.listen.figures import spectrogram_figure, waveform_figure
from jblast.report.listen.sensor_record import SensorRecord
from jblast.scene import Sensor
from jblast.sensors.listening.plan import Listening
from jblast.sensors.listening.recorders import packets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

JSON, TRUTH = "listen.json", "truth.csv"
FIGURES: dict[str, Callable[[Listening, Sequence[SensorRecord]], "Figure"]] = {
    "waveforms.png": waveform_figure,
    "spectrograms.png": spectrogram_figure,
}
LONGEST_NAME = 80
"""Characters of a file's name that come from a sensor's."""


def write_tracks(
    listening: Listening,
    directory: Path,
    comments: Sequence[str],
    packets_hz: float | None = None,
) -> list[SensorRecord]:
    """Write what every sensor records, and the truth behind it, into a directory.

    Args:
        listening: What is to be recorded.
        directory: Where to; made if it is not there.
        comments: Where the records come from.
        packets_hz: Packets a second that records are made of, in constant memory; None:
            each is made in one go.

    Raises:
        InputError: A record cannot be made so. Those made before are kept, and of one
            that broke what it had.
        OSError: The directory cannot be written to.
    """
    directory.mkdir(parents=True, exist_ok=True)
    names = file_names(listening.sensors)
    for name in (JSON, TRUTH, *FIGURES, *names.values()):  # would mislead
        (directory / name).unlink(missing_ok=True)
    records = []
    for sensor in each(listening.sensors, "sensors"):
        record = SensorRecord(listening, sensor, names[sensor.name])
        own = f"{sensor.kind} {sensor.name!r} {_standpoint(sensor)}"
        record.write(
            directory / record.file,
            packets(listening, sensor, packets_hz),
            [*comments, own],
        )
        records.append(record)
    write_text(directory / TRUTH, truth_csv(listening, records, comments))
    return records


def _standpoint(sensor: Sensor) -> str:
    """Return where a sensor is, in words."""
    place, axes = sensor.position_m, "east, north, up"
    if sensor.mount:
        place = sensor.offset_m
        axes = f"forward, left, up from the middle of the {sensor.mount}"
    at = ", ".join(f"{x:g}" for x in np.asarray(place).tolist())
    return f"at ({at}) m {axes}"


def write_pictures(
    listening: Listening, records: Sequence[SensorRecord], directory: Path
) -> list[str]:
    """Draw the records; return the names of the files.

    A picture that cannot be drawn costs nothing but itself: a warning names it.
    """
    written = []
    for name, draw in FIGURES.items():
        figure = write_drawn(partial(draw, listening, records), directory / name)
        if figure is not None:
            written.append(name)
    return written


def provenance(listening: Listening, source: str, seed: int) -> list[str]:
    """Return what the comments of every table say."""
    laws = ", ".join(f"{name} by {law}" for name, law in listening.truth.laws.items())
    return [
        f"SIMULATED, not measured: jblast {jblast.__version__}, {source}, seed {seed}",
        f"laws: {laws}",
        CLOCK,
        *listening.notes,
    ]


def file_names(sensors: Sequence[Sensor]) -> dict[str, str]:
    """Return the file of each sensor: its name, as far as any file may be called so.

    No two are alike, nor alike in capitals, nor those of the truth or the pictures.
    """
    taken = {name.lower() for name in (JSON, TRUTH, *FIGURES)}
    names: dict[str, str] = {}
    for sensor in sensors:
        suffix = ".wav" if sensor.kind == "microphone" else ".csv"
        stem = re.sub(r"[^\w .+-]", "_", sensor.name)[:LONGEST_NAME].strip(" .") or "_"
        name, number = f"{stem}{suffix}", 2
        while name.lower() in taken:
            name, number = f"{stem}_{number}{suffix}", number + 1
        taken.add(name.lower())
        names[sensor.name] = name
    return names
