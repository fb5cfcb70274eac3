"""TDMS files of LabVIEW: channels in groups, with units and steps as properties."""

import logging
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Num

from jblast.errors import InputError, needed
from jblast.observations.records.recording import Clock, Column, Group, warned
from jblast.units import NO_UNITS, word_and_unit

UNITS, STEP = ("unit_string", "NI_UnitDescription"), "wf_increment"
OFFSET, START = "wf_start_offset", "wf_start_time"
"""LabVIEW's names of the properties of a waveform."""
STAMPS = "ns since 1970-01-01"
"""Unit of a channel of times of day."""


def open_tdms(path: Path) -> tuple[Group, ...]:
    """Return the channels of a TDMS file by group, read in segments.

    Their clock is that of the waveform's properties, or else a channel of time.

    Raises:
        InputError: npTDMS cannot read the file, or it is cut short.
    """
    nptdms = needed("nptdms", "tdms", path, "TDMS is read")
    # npTDMS would print its warnings, which are notes or errors here
    nptdms.log.log_manager.console_handler.setLevel(logging.ERROR)
    with nptdms.TdmsFile.open(path) as file:
        cut = file.file_status.incomplete_final_segment
        # LabVIEW writes channels without samples, too
        held = [[c for c in group.channels() if len(c)] for group in file.groups()]
        names = [channel.name for group in held for channel in group]
        columns = [
            tuple(
                _column(path, c, f"{c.group_name}." * (names.count(c.name) > 1))
                for c in group
            )
            for group in held
        ]
    if cut:
        raise InputError(f"{path}: is cut short: its last segment is incomplete")
    return tuple(map(Group, columns))


def _column(path: Path, channel: Any, prefix: str) -> Column:
    """Return a channel; numbers without a unit are counts, unless named as times."""
    of, name = channel.properties, channel.name
    stated = [str(of.get(key, "")) for key in UNITS]
    unit = next((one for one in stated if one.strip().lower() not in NO_UNITS), "")
    stamps = np.issubdtype(channel.dtype, np.datetime64)
    is_number = np.issubdtype(channel.dtype, np.number)
    word, in_name = word_and_unit(name)
    if stamps:
        unit = STAMPS
    elif not is_number:
        unit = "text"
    elif not (unit or in_name or re.match(r"(elapsed|time|t)\b", word.lower())):
        unit = "count"
    clocks = ()
    if of.get(STEP):
        began = of.get(START)
        zero = (
            None if began is None else int(np.datetime64(began, "ns").astype(np.int64))
        )
        clocks = (Clock(1.0 / float(of[STEP]), float(of.get(OFFSET, 0.0)), zero),)
    read = partial(_read, path, channel.group_name, name)
    return Column(f"{prefix}{name}", unit, len(channel), read, clocks=clocks)


def _read(
    path: Path, group: str, name: str, start: int, stop: int
) -> Num[np.ndarray, " sample"]:
    """Return scaled samples; times of day in nanoseconds.

    Raises:
        InputError: npTDMS does not know the scale.
    """
    import nptdms

    # it returns raw numbers then, and warns
    with warned() as warnings, nptdms.TdmsFile.open(path) as opened:
        samples = opened[group][name][start:stop]
    if warnings:
        raise InputError(
            f"{path}: channel {name}: expected samples that npTDMS can scale, got raw "
            f"numbers ({warnings[0]}); write the file with scaled values"
        )
    if np.issubdtype(samples.dtype, np.datetime64):
        return samples.astype("datetime64[ns]").astype(np.int64)
    return samples
