"""TDMS files of LabVIEW: channels in groups, with units and steps as properties."""

import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, needed, shown
from jblast.observations.records.recording import (
    BILLION,
    NO_UNIT_WORDS,
    Piece,
    Recording,
    SampleClock,
    Scaling,
    epoch_and_start,
    even_clock,
    holds_pressure,
    left_out,
    plain_unit,
    recordings_of,
    time_factor,
    warned,
    word_and_unit,
)

UNITS, STEP = ("unit_string", "NI_UnitDescription"), "wf_increment"
OFFSET, START = "wf_start_offset", "wf_start_time"
"""LabVIEW's names of the properties of a waveform."""


def open_tdms(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the channels of pressure or volts of a TDMS file, read in segments.

    Their clock is that of the waveform's properties, or else a channel of time in the
    same group.

    Raises:
        InputError: npTDMS cannot read the file or scale a channel; no channel is a
            pressure; one has no clock, or volts without a sensitivity.
    """
    nptdms = needed("nptdms", "tdms", path, "TDMS is read")
    try:
        # npTDMS would print its warnings, which are notes or errors here
        nptdms.log.log_manager.console_handler.setLevel(logging.ERROR)
        with nptdms.TdmsFile.open(path) as file:
            if file.file_status.incomplete_final_segment:
                raise InputError(
                    f"{path}: is cut short: its last segment is incomplete"
                )
            channels = [
                channel
                for group in file.groups()
                for channel in group.channels()
                # LabVIEW writes channels without samples, too
                if len(channel)
            ]
            # npTDMS returns raw numbers if it does not know a scale, and warns once
            faults: dict[str, str] = {}
            for channel in channels:
                with warned() as warnings:
                    channel[:1]
                if warnings:
                    faults[channel.path] = warnings[0]
            found = [_labelled(channel) for channel in channels]
            wanted = [channel for channel in channels if _is_pressure(channel)]
            if not found:
                raise InputError(f"{path}: expected TDMS with channels, got none")
            if not wanted:
                raise InputError(
                    f"{path}: expected a channel of pressure or volts, got "
                    f"{shown(', '.join(found))}"
                )
            for channel in wanted:
                if channel.path in faults:
                    raise InputError(
                        f"{path}: channel {channel.group_name}/{channel.name}: "
                        "expected samples that npTDMS can scale, got raw numbers "
                        f"({faults[channel.path]}); write the file with scaled values"
                    )
            pieces = [_piece(nptdms, path, file[c.group_name], c) for c in wanted]
            others = [
                _labelled(channel)
                for channel in channels
                if channel not in wanted and not _is_clock(channel)
            ]
    except InputError:
        raise
    # npTDMS has no exception of its own
    except Exception as error:
        raise InputError(
            f"{path}: expected TDMS, got a file that npTDMS cannot read ({error})"
        ) from None
    return recordings_of(path, pieces, scaling, left_out(others))


def _piece(nptdms: Any, path: Path, group: Any, channel: Any) -> Piece:
    name = channel.name

    def read(start: int, stop: int) -> Float[np.ndarray, "1 sample"]:
        with nptdms.TdmsFile.open(path) as opened:
            return opened[group.name][name][start:stop][None]

    return Piece(
        label=f"channel {group.name}/{name}",
        unit=_unit(channel),
        channels=1,
        length=len(channel),
        read=read,
        clock=_clock(path, group, channel),
        name=word_and_unit(name)[0] or name,
    )


def _unit(channel: Any) -> str:
    """Return the unit of a channel: a property, or at the end of its name."""
    stated = [str(channel.properties.get(key, "")) for key in UNITS]
    unit = next((one for one in stated if plain_unit(one) not in NO_UNIT_WORDS), "")
    return unit or word_and_unit(channel.name)[1]


def _is_pressure(channel: Any) -> bool:
    """Return True for numbers that can be pressure."""
    is_number = np.issubdtype(channel.dtype, np.number)
    return is_number and holds_pressure(_unit(channel)) and not _is_clock(channel)


def _is_clock(channel: Any) -> bool:
    """Return True for a channel of times, also without a unit."""
    stamps = np.issubdtype(channel.dtype, np.datetime64)
    named = re.match(r"(elapsed|time|t)\b", word_and_unit(channel.name)[0].lower())
    unit = _unit(channel)
    return stamps or (time_factor(unit) is not None if unit else bool(named))


def _labelled(channel: Any) -> str:
    unit = _unit(channel)
    return f"{channel.group_name}/{channel.name}" + (f" ({unit})" if unit else "")


def _clock(path: Path, group: Any, channel: Any) -> SampleClock:
    """Return the start of a channel [s], its rate [Hz], and its epoch."""
    properties = channel.properties
    step = properties.get(STEP)
    if step:
        offset, began = float(properties.get(OFFSET, 0.0)), properties.get(START)
        if began is None:
            return SampleClock(offset, 1.0 / float(step))
        nanoseconds = int(np.datetime64(began, "ns").astype(np.int64))
        epoch, start = epoch_and_start(nanoseconds)
        return SampleClock(start + offset, 1.0 / float(step), epoch)
    clocks = [
        other
        for other in group.channels()
        if _is_clock(other) and len(other) == len(channel)
    ]
    for other in clocks:
        label = f"{path}: channel {group.name}/{other.name}"

        def place(row: int, at: str = label) -> str:
            return f"{at}, row {row + 1}"

        if np.issubdtype(other.dtype, np.datetime64):
            stamps = other[:].astype("datetime64[ns]").astype(np.int64)
            epoch, first = epoch_and_start(int(stamps[0]))
            start, rate = even_clock((stamps - stamps[0]) / BILLION, place)
            return SampleClock(first + start, rate, epoch)
        seconds = time_factor(_unit(other))
        if seconds is not None:
            times = seconds * np.asarray(other[:], np.float64)
            return SampleClock(*even_clock(times, place))
    got = f"{clocks[0].name} without a unit" if clocks else "neither"
    raise InputError(
        f"{path}: channel {group.name}/{channel.name}: expected its step as {STEP}, or "
        f"a channel of time in its group, got {got}"
    )
