"""When a recording began whose file does not say so, by the table of stations."""

from collections.abc import Mapping
from dataclasses import replace

from jblast.errors import InputError, shown
from jblast.observations.records.recording import Recording
from jblast.observations.records.stations import START, Station
from jblast.observations.times.instant import SECOND, moment


def started(recording: Recording, stations: Mapping[str, Station]) -> Recording:
    """Return a recording whose first sample is at the time that its station tells.

    Args:
        recording: A file's.
        stations: By name of channel.

    Raises:
        InputError: The file tells the time of day itself, or its channels are told to
            begin at several times.
    """
    starts = {stations[name].start for name in recording.names if name in stations}
    if starts <= {None}:
        return recording
    if recording.epoch is not None:
        raise InputError(
            f"{recording.source}: tells the time of day itself; expected nothing in "
            f"column {START} of {shown(recording.names[0])}"
        )
    start = starts.pop()
    if starts or start is None:
        raise InputError(
            f"{recording.source}: expected one {START} for all channels of a file, got "
            "several"
        )
    whole = start // SECOND * SECOND  # an epoch holds microseconds, samples finer ones
    return replace(recording, epoch=moment(whole), start_s=(start - whole) / SECOND)
