"""miniSEED and SAC: traces with the time of day of their first sample, by ObsPy."""

from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, needed
from jblast.observations.records.recording import (
    Piece,
    Recording,
    SampleClock,
    Scaling,
    epoch_and_start,
    recordings_of,
)

IDEP = {6: "ground displacement", 7: "ground velocity", 8: "ground acceleration"}
"""Codes of SAC's header for other quantities than pressure (IDISP, IVEL, IACC)."""
IDEP_VOLTS = 50
"""Code of SAC's header for a velocity in volts (IVOLTS), the only one for volts."""
SINGLE_SPACING = 2.0**-23
"""Relative spacing of floats of 32 bits, the precision of SAC's step."""


def open_seismic(path: Path, scaling: Scaling) -> tuple[Recording, ...]:
    """Return the traces of a file of miniSEED or SAC.

    The samples are counts, whose scale is in another file: the user specifies the
    pascals per count.

    Raises:
        InputError: ObsPy cannot read the file; a trace has gaps or overlaps, or is a
            ground motion, or volts without a sensitivity.
    """
    obspy = needed("obspy", "seismic", path, "miniSEED or SAC is read")
    try:
        # by default ObsPy rounds SAC's step to a microsecond: 1.4 % at 44.1 kHz
        traces = list(obspy.read(str(path), round_sampling_interval=False))
    # each of ObsPy's parsers has exceptions of its own
    except Exception as error:
        raise InputError(
            f"{path}: expected miniSEED or SAC, got a file that ObsPy cannot read "
            f"({str(error) or type(error).__name__})"
        ) from None
    if not any(len(trace.data) for trace in traces):
        raise InputError(f"{path}: expected samples, got none")
    before: dict[str, Any] = {}
    for trace in sorted(traces, key=lambda trace: trace.stats.starttime.ns):
        last = before.get(trace.id)
        if last is not None:
            # the next sample is due one step after the last one
            apart = trace.stats.starttime - last.stats.endtime - last.stats.delta
            what = "a gap" if apart > 0 else "an overlap"
            raise InputError(
                f"{path}: trace {trace.id}: expected one segment, got {what} of "
                f"{abs(apart):.6g} s after {last.stats.endtime}; cut the record there"
            )
        before[trace.id] = trace
    notes = tuple(
        f"trace {trace.id}: its header's factor of {trace.stats.calib:g} is not applied"
        for trace in traces
        if trace.stats.calib not in (0.0, 1.0)
    )
    return recordings_of(
        path, [_piece(path, trace) for trace in traces], scaling, notes
    )


def _piece(path: Path, trace: Any) -> Piece:
    label = f"trace {trace.id}"
    samples = np.asarray(trace.data)[None]
    epoch, start_s = epoch_and_start(int(trace.stats.starttime.ns))
    # SAC's step has 32 bits: the rate with the fewest digits that it cannot distinguish
    rate_hz = trace.stats.sampling_rate
    roundings = (float(f"{rate_hz:.{digits}g}") for digits in range(1, 17))
    rate_hz = next(r for r in roundings if abs(r / rate_hz - 1.0) < SINGLE_SPACING)
    return Piece(
        label=label,
        unit=_unit(path, label, trace.stats),
        channels=1,
        length=samples.shape[1],
        read=lambda start, stop: samples[:, start:stop],
        clock=SampleClock(start_s, rate_hz, epoch),
    )


def _unit(path: Path, label: str, stats: Any) -> str:
    """Return the unit in a header; only SAC has one."""
    kind = int(stats["sac"].get("idep", 5)) if "sac" in stats else 5
    if kind in IDEP:
        raise InputError(
            f"{path}: {label}: expected pressure, got {IDEP[kind]} (idep {kind})"
        )
    return "V" if kind == IDEP_VOLTS else ""
