"""Picks of files of samples: names and clocks of the records, blasts and their picks.

A channel is named by its station, or by the stem of its file and its name in it. Names
are compared with the table of stations before any sample is read. Of files with equal
stems in several folders each folder is a shot, unless the table names FOLDER/STEM.

Files share the clock of the first one if they, or their stations, state the time of day
of the first sample. Each blast of each channel is picked as soon as it is read, so a
folder of any size needs bounded memory. A file that cannot be used is reported and does
not stop the others.
"""

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.errors import InputError, argument
from jblast.observations.records.formats import Scaling, open_channels, open_record
from jblast.observations.records.recording import PressureRecord, Recording
from jblast.observations.records.stations import Station, started
from jblast.progress import each
from jblast.signals.onsets import LEAST_PEAK_SHARE, Stretches, stretches
from jblast.signals.picks.pick import LEAST_SAMPLES
from jblast.signals.picks.record_picks import RecordPick, pick_records

MAX_PRESSURE_PA = 1e9
"""Largest range of a record's samples [Pa]. The largest pressure of a blast in air is
that of the reflection at the charge: 0.4 to 0.7 GPa, where the curves of Kingery and
Bulmash begin (Z = 0.067 m/kg^(1/3)). A sensitivity given as its reciprocal is off by
more than a factor of a million."""
EVERY_S = 10.0
"""Time between two calls with the picks so far [s]: about thirty records."""
MAX_NAMED, MAX_STATIONS = 3, 10
"""Files, and stations or channels, that a message names."""


class Gathered(NamedTuple):
    """Picks of files of samples.

    Attributes:
        picks: Picks in the order of files, channels and time.
        silent: Names of channels without a pick.
        quieter: Number of onsets by channel that were skipped, more than 20 dB below
            the loudest.
        refused: Errors of files that could not be read, one for each cause.
        epoch: UTC of time zero of all picks; None if no file states it.
        channels: Number of channels read; segments between gaps are one channel.
        triggered: True if the times of all files count from a common trigger.
    """

    picks: tuple[RecordPick, ...]
    silent: tuple[str, ...]
    quieter: dict[str, int]
    refused: tuple[InputError, ...]
    epoch: datetime | None
    channels: int
    triggered: bool = False

    @property
    def orders(self) -> tuple[int, ...]:
        """Number of each pick within its channel, from 1."""
        counts: Counter[str] = Counter()
        found = []
        for name in (_channel(one.record) for one in self.picks):
            counts[name] += 1
            found.append(counts[name])
        return tuple(found)

    def named(self) -> tuple[str, ...]:
        """Return the name of each pick's record; of several in a channel name#order."""
        names = [_channel(one.record) for one in self.picks]
        return tuple(
            name if names.count(name) == 1 else f"{name}#{order}"
            for name, order in zip(names, self.orders, strict=True)
        )


def _channel(record: PressureRecord) -> str:
    """Return the name of a channel, with its shot."""
    return f"{record.shot}/{record.name}" if record.shot else record.name


def gathered(
    files: Sequence[Path],
    scaling: Scaling | None = None,
    *,
    high_pass_hz: float | None = None,
    keep_samples: bool = True,
    stations: Mapping[str, Station] | None = None,
    trigger: bool = False,
    done: Callable[[Gathered], object] | None = None,
) -> Gathered:
    """Read files and pick their blasts.

    Args:
        files: Files of records.
        scaling: Scale of the recorders.
        high_pass_hz: Corner of their first-order high-pass [Hz].
        keep_samples: True to keep the samples in the picks, for figures.
        stations: Stations by name of record.
        trigger: True if the times of all files count from a common trigger, whatever
            their times of day.
        done: Function that is called with the picks so far, every `EVERY_S`.

    Raises:
        InputError: A channel has no station.
    """
    reading = _Reading(scaling or Scaling(), high_pass_hz, stations, trigger)
    found: list[RecordPick] = []
    last = time.monotonic()
    for record in reading.records(files):
        (one,) = pick_records([record])
        if not one.pick.found:
            continue
        if not keep_samples:
            one = replace(one, record=replace(record, samples=np.zeros(0)))
        found.append(one)
        if done is not None and time.monotonic() - last > EVERY_S:
            done(reading.gathered(found))
            last = time.monotonic()
    return reading.gathered(found)


def _by_cause(refused: Sequence[tuple[Path, InputError]]) -> tuple[InputError, ...]:
    """Return one error for each cause, with the files that it concerns."""
    causes: dict[str, list[str]] = {}
    for file, error in refused:
        text = error.worded(argument).removeprefix(f"{file}: ")
        causes.setdefault(text, []).append(str(file))
    return tuple(InputError(f"{_listed(own)}: {text}") for text, own in causes.items())


def _listed(names: Sequence[str], most: int = MAX_NAMED) -> str:
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


@dataclass
class _Reading:
    """Findings of reading the records of files."""

    scaling: Scaling
    high_pass_hz: float | None
    stations: Mapping[str, Station] | None
    trigger: bool
    channels: list[str] = field(default_factory=list)
    quieter: dict[str, int] = field(default_factory=dict)
    refused: list[tuple[Path, InputError]] = field(default_factory=list)
    epoch: datetime | None = None
    # sensor of each channel, and folder of each file if the folders are shots, else ""
    sensors: dict[tuple[Path, str], str] = field(default_factory=dict)
    shots: dict[Path, str] = field(default_factory=dict)
    # source of the first recording, and whether it has a time of day
    first: tuple[str, str] | None = None

    def records(self, files: Sequence[Path]) -> Iterator[PressureRecord]:
        """Yield intervals with a signal, those of a channel in order of time."""
        self._name_channels(files)
        for file in each(list(self.shots), "records"):
            try:
                recordings = _long_enough(open_record(file, self.scaling))
                begin = min(one.own_start_s for one in recordings)
                recordings = [self._timed(one, file, begin) for one in recordings]
                runs = [(one, stretches(one)) for one in recordings]
                for one, channels in runs:
                    _check_scale(one, channels, self.scaling)
            except InputError as error:
                self.refused.append((file, error))
                continue
            by_channel: dict[str, list[Stretches]] = {}
            for recording, channels in runs:
                for name, channel in zip(recording.names, channels, strict=True):
                    by_channel.setdefault(name, []).append(channel)
            shot = self.shots[file]
            for name, segments in by_channel.items():
                label = f"{shot}/{name}" if shot else name
                self.channels.append(label)
                records, quieter = _loud(segments)
                if quieter:
                    self.quieter[label] = quieter
                for record in records:
                    # a constant interval is a dead channel, not a quiet one
                    if np.ptp(record.samples) > 0:
                        yield replace(record, high_pass_hz=self.high_pass_hz, shot=shot)

    def gathered(self, found: Sequence[RecordPick]) -> Gathered:
        """Return picks with the findings of reading their files."""
        names = {_channel(one.record) for one in found}
        return Gathered(
            picks=tuple(found),
            silent=tuple(name for name in self.channels if name not in names),
            quieter=self.quieter,
            refused=_by_cause(self.refused),
            epoch=self.epoch,
            channels=len(self.channels),
            triggered=self.trigger,
        )

    def _name_channels(self, files: Sequence[Path]) -> None:
        """Find the sensor of each channel, before any of them is read.

        Raises:
            InputError: A channel has no station.
        """
        held: dict[Path, Path] = {}
        channels: list[tuple[Path, str, tuple[str, ...]]] = []
        for file in files:
            try:
                found = open_channels(file)
                key = file.resolve().with_suffix("")
                if key in held.values():
                    raise InputError(
                        f"{file}: expected records with different names, got "
                        f"{file.stem} twice"
                    )
            except InputError as error:
                self.refused.append((file, error))
                continue
            held[file] = key
            channels += [(file, name, tuple(aliases)) for name, *aliases in found]
        folders = _folders(list(held))
        # a name that several channels have is the name of none
        shared = Counter(
            (folders[file], one)
            for file, name, aliases in channels
            for one in (name, *aliases)
        )
        for file, name, aliases in channels:
            folder = folders[file]
            options = [f"{folder}/{name}"] * bool(folder) + [name]
            options += [alias for alias in aliases if shared[folder, alias] == 1]
            stations = (name,) if self.stations is None else self.stations
            sensor = next((one for one in options if one in stations), "")
            self.sensors[file, name] = sensor
        absent = dict.fromkeys(name for (_, name), of in self.sensors.items() if not of)
        if absent:
            got = _listed(tuple(self.stations or ()), MAX_STATIONS)
            raise InputError(
                f"{next(iter(held))}: expected a station for "
                f"{_listed(list(absent), MAX_STATIONS)}, got {got}"
            )
        both = {(folders[file], of) for (file, _), of in self.sensors.items()}
        shots = len({sensor for _, sensor in both}) < len(both)
        self.shots = {file: folders[file] * shots for file in held}

    def _timed(self, recording: Recording, file: Path, begin: float) -> Recording:
        """Return a recording of a sensor on the clock of the first.

        Args:
            recording: The recording.
            file: Its file.
            begin: Time of the first sample of the file on its own clock [s].

        Raises:
            InputError: Only one of the two has a time of day, or one was made by a
                clock that was not set and is not that of its station.
        """
        sensors = tuple(self.sensors[file, name] for name in recording.names)
        recording = replace(recording, names=sensors)
        stations = self.stations or {}
        recording = started(recording, stations, recording.own_start_s - begin)
        if self.trigger:
            return replace(recording, epoch=None, start_s=recording.own_start_s)
        kind = "given" if recording.epoch else "none"
        kind += ", as its clock was not set" * (not recording.clock_is_set)
        if self.first is None:
            self.epoch, self.first = recording.epoch, (recording.source, kind)
        first, first_kind = self.first
        own_clock = all(
            name in stations and stations[name].clock for name in recording.names
        )
        is_shared = "not set" not in kind + first_kind or own_clock
        if (self.epoch is None) != (recording.epoch is None) or (
            recording.source != first and not is_shared
        ):
            raise InputError(
                f"{recording.source}: expected a start on the clock of {first} (time "
                f"of day: {first_kind}), got a time of day: {kind}; add the time of "
                "the first sample of each file without one to column start_utc of the "
                "table of stations, or pick the files separately, or name the clock of "
                "each recorder in column clock"
            )
        if self.epoch is None or recording.epoch is None:
            return recording
        later = (recording.epoch - self.epoch).total_seconds()
        start = recording.start_s + later
        return replace(recording, epoch=self.epoch, start_s=start)


def _folders(files: Sequence[Path]) -> dict[Path, str]:
    """Return the folder of each file, "" if no two files have one stem."""
    parents = {file: file.resolve().parent for file in files}
    if len({file.stem for file in files}) == len(files):
        return dict.fromkeys(files, "")
    common = os.path.commonpath(list(parents.values()))
    return {
        file: parent.name if str(parent) == common else os.path.relpath(parent, common)
        for file, parent in parents.items()
    }


def _check_scale(
    recording: Recording, channels: Sequence[Stretches], scaling: Scaling
) -> None:
    """Raise an error for pressures that no blast has.

    Raises:
        InputError: The range of samples in pascals exceeds `MAX_PRESSURE_PA`.
    """
    if not recording.calibrated:
        return
    largest = max(
        (np.ptp(one.samples) for channel in channels for one in channel.records),
        default=0.0,
    )
    if largest <= MAX_PRESSURE_PA:
        return
    remedy = "check the unit and the scale of the samples"
    if scaling.sensitivity is not None:
        remedy = (
            f"{argument('sensitivity')} is in pascals per volt or count: write "
            f"{1 / scaling.sensitivity:.6g} if {scaling.sensitivity:g} is in volts or "
            "counts per pascal"
        )
    raise InputError(
        f"{recording.source}: expected pressures below {MAX_PRESSURE_PA / 1e9:g} GPa, "
        f"more than a blast in air has at the charge, got {largest / 1e9:.4g} GPa; "
        f"{remedy}"
    )


def _long_enough(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings that may contain a pulse and the noise before it.

    Short segments of a channel with longer ones are left out.

    Raises:
        InputError: All segments of a channel are too short.
    """
    long = [one for one in recordings if one.length >= LEAST_SAMPLES]
    names = {one.names for one in long}
    for one in recordings:
        if one.names not in names:
            raise InputError(
                f"{one.source}: channel {one.names[0]}: expected {LEAST_SAMPLES} "
                f"samples or more, got {one.length}"
            )
    return long


def _loud(segments: Sequence[Stretches]) -> tuple[list[PressureRecord], int]:
    """Return the intervals of a channel to pick, and the number of quieter onsets.

    Each segment between gaps has an interval about its loudest sample, which may be
    noise next to another segment.
    """
    records = [record for one in segments for record in one.records]
    quieter = sum(one.quieter for one in segments)
    if len(segments) == 1:
        return records, quieter
    sizes = [np.abs(one.samples - np.median(one.samples)).max() for one in records]
    loud = [
        record
        for record, size in zip(records, sizes, strict=True)
        if size >= LEAST_PEAK_SHARE * max(sizes)
    ]
    return loud, quieter + len(records) - len(loud)
