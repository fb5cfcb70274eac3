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
        if file.file_status.incomplete_final_segment:
            raise InputError(f"{path}: is cut short: its last segment is incomplete")
        names = [one.name for group in file.groups() for one in group.channels()]
        # LabVIEW writes channels without samples, too
        return tuple(
            Group(
                tuple(
                    _column(path, one, f"{group.name}." * (names.count(one.name) > 1))
                    for one in group.channels()
                    if len(one)
                )
            )
            for group in file.groups()
        )


def _column(path: Path, channel: Any, prefix: str) -> Column:
    """Return a channel; numbers without a unit are counts, unless named as times."""
    of, name = channel.properties, channel.name
    stated = [str(of.get(key, "")) for key in UNITS]
    unit = next((one for one in stated if one.strip().lower() not in NO_UNITS), "")
    word, in_name = word_and_unit(name)
    if channel.dtype.kind == "M":
        unit = STAMPS
    elif not np.issubdtype(channel.dtype, np.number):
        unit = "text"
    elif not (unit or in_name or re.match(r"(elapsed|time|t)\b", word.lower())):
        unit = "count"
    clocks = ()
    if of.get(STEP):
        zero = None
        if START in of:
            zero = int(np.datetime64(of[START], "ns").astype(np.int64))
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
    if samples.dtype.kind == "M":
        return samples.astype("datetime64[ns]").astype(np.int64)
    return samples
