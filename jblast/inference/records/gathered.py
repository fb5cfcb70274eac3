"""The picks of files of samples: each bang of each channel, in one batch after another.

What one file is refused for costs the others nothing: it is named, and they are picked.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.detect.onsets import stretches
from jblast.errors import InputError
from jblast.inference.picks import RecordPick, pick_records
from jblast.inference.picks.pick import LEAST_SAMPLES
from jblast.observations.records.formats import Scaling, open_record
from jblast.observations.records.recording import PressureRecord, Recording
from jblast.observations.records.stations import Station, started
from jblast.progress import each

BATCH = 2**22
"""Samples that are held before they are picked: 32 megabytes."""


class Gathered(NamedTuple):
    """What files of samples hold.

    Attributes:
        picks: Those that were found, in the order of files, channels and time.
        orders: Which bang of its channel each is, from 1.
        silent: Names of channels in which nothing was found.
        quieter: How many onsets were not looked at, by channel: 20 dB below its
            loudest.
        refused: Why files could not be read, a message each.
        epoch: UTC of time zero of all picks; None where no file says.
        channels: How many channels were read.
    """

    picks: tuple[RecordPick, ...]
    orders: tuple[int, ...]
    silent: tuple[str, ...]
    quieter: dict[str, int]
    refused: tuple[InputError, ...]
    epoch: datetime | None
    channels: int

    def named(self) -> tuple[str, ...]:
        """Name each pick's record: name#order where a channel has several bangs."""
        names = [one.record.name for one in self.picks]
        return tuple(
            name if names.count(name) == 1 else f"{name}#{order}"
            for name, order in zip(names, self.orders, strict=True)
        )


def gathered(
    files: Sequence[Path],
    scaling: Scaling | None = None,
    *,
    high_pass_hz: float | None = None,
    keep_samples: bool = True,
    stations: Mapping[str, Station] | None = None,
) -> Gathered:
    """Read files and pick their bangs.

    Files that tell the time of day they began at, or whose stations do, share one
    clock, that of the first.

    Args:
        files: Records.
        scaling: What the user says of the recorders' scale.
        high_pass_hz: Corner of their first-order high-pass [Hz].
        keep_samples: Whether picks keep their samples, to be drawn.
        stations: By name of record; their `start` is looked at.
    """
    reading = _Reading(files, scaling, high_pass_hz, stations or {})
    found: list[RecordPick] = []
    heard: set[str] = set()
    for batch in _batches(reading):
        for one in pick_records(batch):
            if not one.pick.found:
                continue
            heard.add(one.record.name)
            if not keep_samples:
                empty = replace(one.record, samples=np.zeros(0))
                one = replace(one, record=empty)
            found.append(one)
    return Gathered(
        picks=tuple(found),
        orders=_orders([one.record.name for one in found]),
        silent=tuple(name for name in reading.channels if name not in heard),
        quieter=reading.quieter,
        refused=tuple(reading.refused),
        epoch=reading.epoch,
        channels=len(reading.channels),
    )


class _Reading:
    """Goes through files, and keeps what is to be told of them."""

    def __init__(
        self,
        files: Sequence[Path],
        scaling: Scaling | None,
        high_pass_hz: float | None,
        stations: Mapping[str, Station],
    ):
        self.files, self.scaling, self.high_pass_hz = files, scaling, high_pass_hz
        self.stations = stations
        self.channels: list[str] = []
        self.quieter: dict[str, int] = {}
        self.refused: list[InputError] = []
        self.epoch: datetime | None = None
        self._first: Path | None = None

    def __iter__(self) -> Iterator[PressureRecord]:
        """Give stretches, those of a channel in order of time."""
        seen: set[str] = set()
        for file in each(self.files, "records"):
            try:
                if file.stem in seen:
                    raise InputError(
                        f"{file}: expected records of names that differ, got "
                        f"{file.stem} twice"
                    )
                recordings = open_record(file, self.scaling)
                _check_lengths(recordings)
                runs = [(one, stretches(self._timed(one))) for one in recordings]
            except InputError as error:
                self.refused.append(error)
                continue
            seen.add(file.stem)
            for recording, channels in runs:
                for name, channel in zip(recording.names, channels, strict=True):
                    self.channels.append(name)
                    if channel.quieter:
                        self.quieter[name] = channel.quieter
                    for record in channel.records:
                        if np.ptp(record.samples) > 0:
                            yield replace(record, high_pass_hz=self.high_pass_hz)

    def _timed(self, recording: Recording) -> Recording:
        """Return a recording on the clock of the first.

        Raises:
            InputError: It tells the time of day and the first does not, or otherwise.
        """
        recording = started(recording, self.stations)
        if self._first is None:
            self._first, self.epoch = Path(recording.source), recording.epoch
        if (self.epoch is None) != (recording.epoch is None):
            one, other = "a time of day", "none"
            if recording.epoch is None:
                one, other = other, one
            raise InputError(
                f"{recording.source}: expected to begin at {other}, as {self._first} "
                f"does, got {one}; say when the first sample of each file without one "
                "was, in the column start_utc of the table of stations, or pick them "
                "apart from each other"
            )
        if self.epoch is None or recording.epoch is None:
            return recording
        later = (recording.epoch - self.epoch).total_seconds()
        start = recording.start_s + later
        return replace(recording, epoch=self.epoch, start_s=start)


def _check_lengths(recordings: Sequence[Recording]) -> None:
    """Refuse what has too few samples for a pulse and the noise before it."""
    for one in recordings:
        if one.length < LEAST_SAMPLES:
            raise InputError(
                f"{one.source}: {one.labels[0]}: expected {LEAST_SAMPLES} samples or "
                f"more, got {one.length}"
            )


def _batches(records: _Reading) -> Iterator[list[PressureRecord]]:
    """Put records together until they hold so many samples."""
    batch, samples = [], 0
    for record in records:
        batch.append(record)
        samples += record.samples.size
        if samples >= BATCH:
            yield batch
            batch, samples = [], 0
    if batch:
        yield batch


def _orders(names: list[str]) -> tuple[int, ...]:
    """Return which of its name each is, from 1."""
    count: dict[str, int] = {}
    orders = []
    for name in names:
        count[name] = count.get(name, 0) + 1
        orders.append(count[name])
    return tuple(orders)
