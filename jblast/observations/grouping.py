"""Logs divided by shot, combined, and referred to another origin or epoch.

Recordings of one event are combined into one log in which each file has its own clock
and the clock of the first file is the common one. All files must then have positions in
degrees or all in metres, and clock times as UTC or all in seconds. Positions are moved
to another origin through geodetic coordinates, clock times to another epoch by whole
microseconds.
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, argument, shown
from jblast.observations.places import MAX_DISTANCE, Frame
from jblast.observations.table import Observations, rows_by, some_rows, stacked
from jblast.quantities import CLOCK_TIMES
from jblast.scene import UncertainScene


def by_shot(observations: Observations) -> dict[str, Observations]:
    """Return one log for each shot of a log, in order of appearance."""
    return {
        shot: some_rows(observations, np.array(rows))
        for shot, rows in rows_by(observations.shot).items()
    }


def one_event(logs: Sequence[Observations]) -> tuple[Observations, tuple[str, ...]]:
    """Combine recordings of one event, each with the clock of its file.

    Args:
        logs: Recordings, each by one recorder; the clock of the first is the common
            one.

    Returns:
        One log, and the names of all clocks but the first, whose offsets are unknown.

    Raises:
        InputError: Two files have the same name, one names clocks of its own, or one
            has several shots.
    """
    event, clocked = argument("one_event"), []
    names = [Path(log.source).stem or f"recorder {i}" for i, log in enumerate(logs, 1)]
    recorded = [name for log in logs for name in {of.record for of in log.covariances}]
    for log, name in zip(logs, names, strict=True):
        # the name of the file becomes that of the clock, and must identify it
        if names.count(name) > 1:
            raise InputError(
                f"{log.source}: {event} names clocks after the files; expected each "
                f"name once, got {shown(name)} twice"
            )
        if any(log.clock):
            raise InputError(
                f"{log.source}: column clock: expected no such column, as {event} "
                "gives each file one clock; got one"
            )
        if len(shots := dict.fromkeys(log.shot)) > 1:
            raise InputError(
                f"{log.source}: column shot: {event} is of one shot; expected one "
                f"name, got {', '.join(map(shown, shots))}"
            )
        # records of one name in two logs get that of their log, too
        start = f"{name}/" if len(set(recorded)) < len(recorded) else ""
        record = tuple(f"{start}{of}" if of else "" for of in log.records())
        its = [replace(of, record=f"{start}{of.record}") for of in log.covariances]
        clocked.append(
            replace(
                log,
                clock=(name,) * len(log),
                shot=("",) * len(log),
                record=record,
                covariances=tuple(its),
            )
        )
    there, frame, epoch = _on_one_earth(clocked)
    # line numbers of several files have no meaning
    joined: dict[str, Any] = {**stacked(there), "line": ()}
    return Observations(
        **joined,
        source=" + ".join(log.source for log in logs),
        comments=tuple(line for log in logs for line in log.comments),
        understood=tuple(found for log in logs for found in log.understood),
        frame=frame,
        epoch=epoch,
        covariances=tuple(of for log in there for of in log.covariances),
    ), tuple(names[1:])


def _on_one_earth(
    logs: Sequence[Observations],
) -> tuple[list[Observations], Frame | None, datetime | None]:
    """Return logs with one origin of positions and one epoch.

    Raises:
        InputError: One log has latitudes, or dates, and another has metres, or seconds.
    """
    framed_logs, dated = ([x for x in logs if x.frame], [x for x in logs if x.epoch])
    # logs without positions or clock times fit any frame and epoch
    metric = [x for x in logs if not (x.frame or np.isnan(x.position).all())]
    timed = [x for x in logs if not x.epoch and set(CLOCK_TIMES) & set(x.quantity)]
    for what, has, lacks in (
        ("lat_deg, lon_deg", framed_logs, metric),
        ("value_utc", dated, timed),
    ):
        if has and lacks:
            raise InputError(
                f"{lacks[0].source}: expected {what} as in {has[0].source}, got none"
            )
    frame = framed_logs[0].frame if framed_logs else None
    # the earliest epoch, so that times count forward from it
    epoch = min((log.epoch for log in logs if log.epoch), default=None)
    there = [framed(log, frame) if frame else log for log in logs]
    return [since(log, epoch) if epoch else log for log in there], frame, epoch


def framed(observations: Observations, frame: Frame) -> Observations:
    """Return a log whose positions count from a frame's origin.

    Positions in metres are unchanged, since their origin on the Earth is not given.

    Args:
        observations: The log.
        frame: Where east, north, up are zero.
    """
    if observations.frame is None or observations.frame == frame:
        return replace(observations, frame=frame)
    position = observations.position.copy()
    known = ~np.isnan(position).any(axis=1)
    # through the ellipsoid, as the axes of two frames are not parallel
    there = observations.frame.to_geodetic(position[known])
    position[known] = frame.to_enu(*there.T)
    return replace(observations, position=position, frame=frame)


def located(observations: Observations, uncertain: UncertainScene) -> Observations:
    """Return a log whose positions count from the place of its scene, if that has one.

    Raises:
        InputError: The log is on another continent.
    """
    if uncertain.place is None:
        return observations
    there = framed(observations, Frame(*uncertain.place))
    away = np.linalg.norm(there.position, axis=1)
    for row in np.flatnonzero(away > MAX_DISTANCE).tolist():
        raise observations.fault(
            row,
            f"expected a sensor within {MAX_DISTANCE / 1e3:g} km of [place] of "
            f"{uncertain.source or 'the scene'}, got one {away[row] / 1e3:.4g} km away",
        )
    return there


def since(observations: Observations, epoch: datetime) -> Observations:
    """Return a log of clock times whose clock times count from an epoch.

    Args:
        observations: The log; without an epoch of its own it is unchanged.
        epoch: UTC of clock time zero.
    """
    if observations.epoch is None or observations.epoch == epoch:
        return observations
    # in whole microseconds, the resolution of an epoch
    later = (observations.epoch - epoch) // timedelta(microseconds=1) / 1e6
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    return replace(
        observations,
        value=np.where(timed, observations.value + later, observations.value),
        time=observations.time + later,
        epoch=epoch,
    )
