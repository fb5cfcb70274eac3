"""TDMS files of LabVIEW: channels in groups, with units and steps as properties."""

import logging
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, needed, shown
from jblast.observations.records.recording import (
    Piece,
    Recording,
    SampleClock,
    Scaling,
    epoch_and_start,
    even_clock,
    holds_pressure,
    left_out,
    recordings_of,
    time_factor,
)

UNIT, STEP = "unit_string", "wf_increment"
OFFSET, START = "wf_start_offset", "wf_start_time"
"""LabVIEW's names of the properties of a waveform."""
Properties = dict[str, Any]


def open_tdms(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the channels of pressure or volts of a TDMS file, read in segments.

    Their clock is that of the waveform's properties, or else a channel of time in the
    same group.

    Raises:
        InputError: npTDMS cannot read the file; no channel is a pressure; one has no
            clock, or volts without a sensitivity.
    """
    nptdms = needed("nptdms", "tdms", path, "TDMS is read")
    try:
        # npTDMS would print a warning for a truncated file, which is an error here
        nptdms.log.log_manager.set_level(logging.ERROR)
        with nptdms.TdmsFile.open(path) as file:
            if file.file_status.incomplete_final_segment:
                raise InputError(
                    f"{path}: is cut short: its last segment is incomplete"
                )
            found = [
                (channel.group_name, channel.name, dict(channel.properties))
                for group in file.groups()
                for channel in group.channels()
                # LabVIEW writes channels without samples, too
                if len(channel)
            ]
            wanted = [one for one in found if holds_pressure(str(one[2].get(UNIT, "")))]
            if not found:
                raise InputError(f"{path}: expected TDMS with channels, got none")
            if not wanted:
                raise InputError(
                    f"{path}: expected a channel of pressure or volts, got "
                    f"{shown(', '.join(_labelled(*one) for one in found))}"
                )
            pieces = [_piece(nptdms, path, file, *one) for one in wanted]
    except InputError:
        raise
    # npTDMS has no exception of its own
    except Exception as error:
        raise InputError(
            f"{path}: expected TDMS, got a file that npTDMS cannot read ({error})"
        ) from None
    others = [
        _labelled(*one) for one in found if one not in wanted and not _seconds(one[2])
    ]
    return recordings_of(path, pieces, scaling, left_out(others))


def _piece(
    nptdms: Any, path: Path, file: Any, group: str, name: str, properties: Properties
) -> Piece:
    def read(start: int, stop: int) -> Float[np.ndarray, "1 sample"]:
        with nptdms.TdmsFile.open(path) as opened:
            return opened[group][name][start:stop][None]

    return Piece(
        label=f"channel {group}/{name}",
        unit=str(properties.get(UNIT, "")),
        channels=1,
        length=len(file[group][name]),
        read=read,
        clock=_clock(path, file, group, name, properties),
    )


def _seconds(properties: Properties) -> float | None:
    """Return seconds per unit of a channel of time; None for other channels."""
    unit = str(properties.get(UNIT, ""))
    return time_factor(unit) if unit else None


def _labelled(group: str, name: str, properties: Properties) -> str:
    unit = properties.get(UNIT, "")
    return f"{group}/{name}" + (f" ({unit})" if unit else "")


def _clock(
    path: Path, file: Any, group: str, name: str, properties: Properties
) -> SampleClock:
    """Return the start of a channel [s], its rate [Hz], and its epoch."""
    step = properties.get(STEP)
    if step:
        offset, began = float(properties.get(OFFSET, 0.0)), properties.get(START)
        if began is None:
            return SampleClock(offset, 1.0 / float(step))
        nanoseconds = int(np.datetime64(began, "ns").astype(np.int64))
        epoch, start = epoch_and_start(nanoseconds)
        return SampleClock(start + offset, 1.0 / float(step), epoch)
    for other in file[group].channels():
        seconds = _seconds(dict(other.properties))
        if seconds is not None and len(other) == len(file[group][name]):
            times = seconds * np.asarray(other[:], np.float64)
            label = f"{path}: channel {group}/{other.name}"
            return SampleClock(
                *even_clock(times, lambda row, at=label: f"{at}, row {row + 1}")
            )
    raise InputError(
        f"{path}: channel {group}/{name}: expected its step as {STEP}, or a channel of "
        "time in its group, got neither"
    )
