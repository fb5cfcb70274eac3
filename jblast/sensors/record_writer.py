"""Files of the records of a scene's sensors, and the table of their true values.

Samples arrive in packets of any size and are written in constant memory. The files do
not depend on the size of the packets.
"""

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

import jblast
from jblast.files import replacing, table_text, write_text
from jblast.observations.records.sound import Bits, write_sound
from jblast.progress import each
from jblast.scene import Instrument, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.instrument import clipping_level
from jblast.sensors.listening import Listening, packets

TRUTH = "truth.csv"
CLOCK = "times are on each sensor's own clock; its file begins at 0 of that clock"
BITS = (8, 16, 24, 32)
"""Bit depths of a sound file; the least one that is not below the sensor's is used."""
LONGEST_NAME = 80
"""Largest number of characters of a file name from a sensor's name: file systems allow
255 bytes, and a character has up to three."""
Packets = Iterable[Float[np.ndarray, "sample component"]]


class RecordWriter:
    """Writer of one sensor's record, with numbers on the samples written so far.

    Attributes:
        sensor: The sensor.
        kind: Name of its kind.
        file: Name of its file.
        rate_hz: Sampling rate [1/s].
        samples: Number of samples.
        full_scale_pa: Pressure of a sample of 1 in a sound file; None in a table.
        largest: Largest magnitude, in the unit of its kind.
        clipped: By charge, whether a sample clipped between its first arrival and the
            next charge's.
        clipped_samples: Number of clipped samples.
    """

    def __init__(
        self, listening: Listening, sensor: Sensor, path: Path, comments: Sequence[str]
    ):
        """Prepare a record.

        Args:
            listening: Plan of the records.
            sensor: One of its sensors.
            path: The file.
            comments: Provenance of the records.
        """
        self.sensor, self.kind, self.file = sensor, sensor.kind, path.name
        self._path = path
        instrument = sensor.instrument or Instrument()
        self.rate_hz, self.samples, self._bits = instrument.rate, 0, instrument.bits
        self.full_scale_pa: float | None = None
        if SENSOR_KINDS[sensor.kind].file == ".wav":
            self.full_scale_pa = 1.0
            if self._bits is not None and instrument.full_scale is not None:
                self.full_scale_pa = float(instrument.full_scale)
        place, directions = sensor.position_m, "east, north, up"
        if sensor.mount:
            place = sensor.offset_m
            directions = f"forward, left, up from the middle of the {sensor.mount}"
        at = ", ".join(f"{x:g}" for x in np.asarray(place).tolist())
        self._comments = [
            *comments,
            f"{sensor.kind} {sensor.name!r} at ({at}) m {directions}",
        ]
        # rounding to 32 bits may leave a clipped sample 1e-7 below the limit
        self._limit = clipping_level(instrument) * (1 - 1e-6)
        self.largest, self.clipped_samples = 0.0, 0
        number = [other.name for other in listening.sensors].index(sensor.name)
        arrivals = (
            listening.truth.values[name][number]
            for name in ("air_arrival_s", "ground_arrival_s")
        )
        self._first = np.fmin(*arrivals)
        self.clipped: Bool[np.ndarray, " shot"] = np.zeros(self._first.shape, bool)

    def write(self, packets: Packets) -> None:
        """Write the samples as they arrive; if the stream breaks, the rest is kept."""
        seen = self._seen(packets)
        if self.full_scale_pa is None:
            columns = SENSOR_KINDS[self.kind].columns
            write_samples(self._path, seen, self.rate_hz, columns, self._comments)
            return
        bits: Bits = "float"
        if self._bits is not None:
            bits = next(most for most in BITS if most >= self._bits)
        scaled = (samples[:, 0] / self.full_scale_pa for samples in seen)
        write_sound(self._path, scaled, self.rate_hz, bits)

    def _seen(self, packets: Packets) -> Iterator[Float[np.ndarray, "sample part"]]:
        """Yield the packets, and count their samples."""
        # charges may be in any order; a sample belongs to the last arrival before it
        order = np.argsort(self._first)
        for packet in packets:
            magnitude = np.linalg.norm(packet, axis=1)
            self.largest = max(self.largest, float(magnitude.max(initial=0.0)))
            at = np.flatnonzero((np.abs(packet) >= self._limit).any(axis=1))
            self.clipped_samples += at.size
            # a sample is the mean over its interval, so its front may lie inside it
            ends = (self.samples + at + 1) / self.rate_hz
            came = np.searchsorted(self._first[order], ends)
            self.clipped[order[np.unique(came[came > 0]) - 1]] = True
            self.samples += len(packet)
            yield packet


def write_records(
    listening: Listening,
    directory: Path,
    comments: Sequence[str],
    packets_hz: float | None = None,
) -> list[RecordWriter]:
    """Write the record of every sensor, and the table of true values.

    Args:
        listening: Plan of the records.
        directory: Output directory; created if missing.
        comments: Provenance of the records.
        packets_hz: Packets per second, for constant memory; None: each record at once.

    Raises:
        InputError: A record cannot be made. Earlier ones are kept, and of a broken one
            the part before the error.
        OSError: The directory cannot be written to.
    """
    writers = record_writers(listening, directory, comments)
    for one in each(writers, "sensors"):
        one.write(packets(listening, one.sensor, packets_hz))
    write_text(directory / TRUTH, truth_csv(listening, writers, comments))
    return writers


def record_writers(
    listening: Listening, directory: Path, comments: Sequence[str]
) -> list[RecordWriter]:
    """Return the writer of every sensor's record; earlier files are removed.

    Args:
        listening: Plan of the records.
        directory: Output directory; created if missing.
        comments: Provenance of the records.
    """
    directory.mkdir(parents=True, exist_ok=True)
    names = record_names(listening.sensors)
    for name in (TRUTH, *names.values()):  # would mislead
        (directory / name).unlink(missing_ok=True)
    return [
        RecordWriter(listening, sensor, directory / names[sensor.name], comments)
        for sensor in listening.sensors
    ]


def record_names(sensors: Sequence[Sensor]) -> dict[str, str]:
    """Return the file name of each sensor: its name with safe characters only.

    Names are unique even without regard to case, and differ from the table's.
    """
    taken, names = {TRUTH}, {}
    for sensor in sensors:
        suffix = SENSOR_KINDS[sensor.kind].file
        stem = re.sub(r"[^\w .+-]", "_", sensor.name)[:LONGEST_NAME].strip(" .") or "_"
        name, number = f"{stem}{suffix}", 2
        while name.lower() in taken:
            name, number = f"{stem}_{number}{suffix}", number + 1
        taken.add(name.lower())
        names[sensor.name] = name
    return names


def record_comments(listening: Listening, source: str, seed: int) -> list[str]:
    """Return the provenance of the records, for the comments of every table."""
    laws = ", ".join(f"{name} by {law}" for name, law in listening.truth.laws.items())
    return [
        f"SIMULATED, not measured: jblast {jblast.__version__}, {source}, seed {seed}",
        f"laws: {laws}",
        CLOCK,
        *listening.notes,
    ]


def write_samples(
    path: str | os.PathLike[str],
    packets: Packets,
    rate_hz: float,
    columns: Sequence[str],
    comments: Sequence[str],
) -> None:
    """Write samples against time as CSV, in constant memory.

    If the packets end with an error or an interrupt, the file with the samples so far
    is kept, and the error is raised.

    Args:
        path: Output file; an existing one is replaced.
        packets: Packets of consecutive samples.
        rate_hz: Sampling rate [1/s]; the first sample is at 0.
        columns: Names of the components, with units.
        comments: Comment lines, such as the provenance.
    """
    written, broken = 0, None
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(table_text([["time_s", *columns]], comments))
        try:
            for packet in packets:
                times = (written + np.arange(len(packet))) / rate_hz
                rows = np.column_stack([times, packet]).tolist()
                # a time to the nanosecond, and samples with the digits of 32 bits
                cells = (
                    [f"{time:.9f}", *(f"{sample:.9g}" for sample in samples)]
                    for time, *samples in rows
                )
                file.write(table_text(cells))
                written += len(packet)
        except BaseException as error:
            # without a sample the error leaves `replacing`, and an old file stays
            if not written:
                raise
            broken = error
    if broken is not None:
        raise broken


def truth_csv(
    listening: Listening, records: Sequence[RecordWriter], comments: Sequence[str]
) -> str:
    """Return a row for each sensor and blast: predictions of the laws, and clipping."""
    truth = listening.truth
    head = ["sensor", "kind", "shot", "east_m", "north_m", "up_m", *truth.values]
    head += ["law_valid", "clipped", "file", "rate_hz", "samples", "full_scale_pa"]
    rows: list[list[str]] = [head]
    for number, record in enumerate(records):
        for n, shot in enumerate(truth.shots):
            place = truth.places["air_arrival_s"][number, n].tolist()
            values = [column[number, n] for column in truth.values.values()]
            valid = all(column[number, n] for column in truth.valid.values())
            flags = ["true" if x else "false" for x in (valid, record.clipped[n])]
            scale = record.full_scale_pa
            rows.append(
                [record.sensor.name, record.kind, shot]
                + [f"{x:.12g}" for x in (*place, *values)]
                + [*flags, record.file, f"{record.rate_hz:g}", str(record.samples)]
                + ["" if scale is None else f"{scale:.12g}"]
            )
    return table_text(rows, comments)
