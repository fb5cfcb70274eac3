"""The answer of `jblast detect` for sound."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from jblast.report.words import aligned, joined
from jblast.results import AMONG, Document, among
from jblast.signals.arrival_log import (
    LEAST_PLANE_PROBABILITY,
    MAX_ARRAY_WIDTH,
    ArrayFinding,
    Log,
)
from jblast.signals.detect_files import SoundDetections
from jblast.signals.matched_filter import Detection
from jblast.signals.pulse_fit import PulseFit
from jblast.signals.sound_watch import Searched

LAYOUTS = {
    "coplanar": "microphones in one plane",
    "spatial": "microphones in space",
    "collinear": "microphones in a line",
    "two": "two microphones",
}
ANGLES = {"bearing_rad": "the bearing", "elevation_rad": "the elevation"}


def detection_text(found: SoundDetections) -> str:
    """Return the arrivals as a table, with notes, for the terminal."""
    searched, dead, target, log = found
    count = sum(len(one.detections) for one in searched)
    names = len(searched)
    head = (
        f"{count} {'arrival' if count == 1 else 'arrivals'}" if count else "No arrival"
    )
    seconds = sum(one.channel.samples.size / one.channel.rate_hz for one in searched)
    lines = [
        f"{head} in {names} {'channel' if names == 1 else 'channels'}, "
        f"{seconds:.6g} s of sound",
    ]
    if count:
        lines += ["", *_table(searched), ""]
    levels = [one.threshold_snr_db for one in searched]
    low, high = min(levels), max(levels)
    # the difference of one printed digit
    span = f"{high:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"
    latency = max(one.latency_s for one in searched)
    lines += [
        f"search target: {target.words}",
        f"threshold {span} dB (2E/N0); detection delay {1e3 * latency:.3g} ms "
        "from the first sample",
    ]
    if dead:
        noun = "constant channel" if len(dead) == 1 else "constant channels"
        lines.append(f"{noun} skipped: {joined(list(dead))}")
    if others := sum(not found.is_blast for found in _sounds(searched)):
        sounds = "impulsive sound" if others == 1 else "impulsive sounds"
        listed = any(one.others for one in searched)
        lines.append(
            f"{others} other {sounds} without the form of a blast, such as doors, "
            f"clicks, thunder, or reverberant blasts{' (--all-sounds)' * listed}"
        )
    if log is not None:
        lines += _of_log(log)
    return "\n".join(lines) + "\n"


def _sounds(searched: Sequence[Searched]) -> list[Detection]:
    """Return all sounds above the threshold."""
    return [found for one in searched for found in one.detections + one.others]


def _table(searched: Sequence[Searched]) -> list[str]:
    rows, tested = [], any(found.fit for found in _sounds(searched))
    for one in searched:
        for found in one.detections:
            # a time is printed to the second significant digit of its standard error
            digits = min(max(1 - math.floor(math.log10(found.sigma_s)), 1), 9)
            row = (
                one.channel.sensor,
                f"{found.time_s:.{digits}f}",
                f"{found.sigma_s:.2g}",
                f"{found.snr_db:.1f}",
            )
            if fit := found.fit:
                row += (f"{fit.misfit:.2f}", f"{fit.log_likelihood_ratio:.1f}")
            rows.append(row)
    rows.sort(key=lambda row: float(row[1]))
    head = ("sensor", "arrival [s]", "sigma [s]", "SNR [dB]")
    head += ("misfit", "ln LR") if tested else ()
    return aligned([head, *rows], right=set(range(1, len(head))))


def _of_log(log: Log) -> list[str]:
    """Return sentences on arrays, and on arrivals that the log does not contain."""
    lines = [""]
    for finding in log.arrays:
        lines += _of_array(finding)
    for sensor, found in log.left_out:
        lines.append(
            f"{sensor}: the arrival at {found.time_s:.6g} s is not in the log: weaker "
            "than another one of the same bang, possibly an echo"
        )
    return lines if len(lines) > 1 else []


def _of_array(finding: ArrayFinding) -> list[str]:
    came = finding.direction
    name = f"Array {finding.array}, bang {finding.bang + 1}"
    if came is None:
        return [f"{name}: no common wave was found; each microphone has its own row"]
    sds = came.covariance.diagonal() ** 0.5
    angles = [
        f"{word} {math.degrees(value):.2f} ± {math.degrees(sd):.2g} degrees"
        for word, value, sd in (
            ("bearing", came.bearing, sds[0]),
            ("elevation", came.elevation, sds[1]),
        )
        if math.isfinite(value)
    ]
    text = f"{name} ({LAYOUTS[came.layout]}): {', '.join(angles) or 'no direction'}"
    lost = [ANGLES[key] for key in came.undetermined]
    if lost:
        text += f"; not identified: {joined(lost)}"
    if not finding.used and finding.probability <= LEAST_PLANE_PROBABILITY:
        text += (
            f"; the times contradict a plane wave (p = {finding.probability:.1g}), so "
            "each microphone has its own row"
        )
    elif finding.used:
        text += (
            f"; within {MAX_ARRAY_WIDTH:g} m of each other, so one arrival row for all"
        )
    return [text]


@dataclass(frozen=True)
class SoundArrival:
    """An arrival in a channel.

    Attributes:
        found: The arrival.
        channel: Number of the channel in its file, from 1.
        sensor: Name of the sensor.
        form: Test of its form; absent in a search with a template.
    """

    found: Detection = field(metadata=among("time_s", "snr_db", "sigma_s"))
    channel: int
    sensor: str
    form: PulseFit | None = field(metadata=AMONG)


@dataclass(frozen=True)
class SearchedChannel:
    """A searched channel.

    Attributes:
        sensor: Name of the sensor.
        record: Name of the record.
        channel: Number of the channel in its file, from 1.
        rate_hz: Sampling rate [1/s].
        seconds: Length [s].
        threshold_snr_db: Detection threshold [dB].
    """

    sensor: str
    record: str
    channel: int
    rate_hz: float
    seconds: float
    threshold_snr_db: float


@dataclass(frozen=True)
class ArrayDirection:
    """Direction of the source by an array.

    Attributes:
        layout: Arrangement of the microphones.
        bearing_rad: Bearing, clockwise from north.
        bearing_sd_rad: Its standard deviation.
        elevation_rad: Elevation.
        elevation_sd_rad: Its standard deviation.
        undetermined: Angles that are not identified.
        mirror_rad: Bearing and elevation of an equally possible direction; null for
            none.
        p_plane_wave: Probability of a larger chi-squared for a plane wave.
    """

    layout: str
    bearing_rad: float
    bearing_sd_rad: float
    elevation_rad: float
    elevation_sd_rad: float
    undetermined: tuple[str, ...]
    mirror_rad: tuple[float, float] | None
    p_plane_wave: float


@dataclass(frozen=True)
class ArrayAnswer:
    """A bang at an array.

    Attributes:
        array: Name of its recorder.
        bang: Number of the bang, from 1.
        in_log: Whether the log has one row for the array.
        direction: Direction of the source; absent without a common wave.
    """

    array: str
    bang: int
    in_log: bool
    direction: ArrayDirection | None = field(metadata=AMONG)


@dataclass(frozen=True)
class DetectionAnswer(Document):
    """The answer of `jblast detect` for sound.

    Attributes:
        detected: Whether a blast was detected.
        arrivals: Arrivals in order of time; the keys on the form of the pulse are
            absent in a search with a template.
        threshold_snr_db: Detection threshold, maximum over all channels [dB].
        latency_s: Time from the first sample of a blast to its report, maximum over all
            channels.
        method: Search target.
        channels: The searched channels.
        dead_channels: Names of constant channels, which were skipped.
        arrays: Bangs at arrays, in a search with positions; the keys on the direction
            are absent without a common wave.
        other_sounds: Number of sounds above the threshold that do not have the form of
            a blast pulse, or have equally loud noise before them.
        rejected_arrivals: These sounds; with `--all-sounds` they are among the
            arrivals.
    """

    detected: bool
    arrivals: tuple[SoundArrival, ...]
    threshold_snr_db: float
    latency_s: float
    method: Mapping[str, Any]
    channels: tuple[SearchedChannel, ...]
    dead_channels: tuple[str, ...]
    arrays: tuple[ArrayAnswer, ...]
    other_sounds: int
    rejected_arrivals: tuple[SoundArrival, ...]


def detection_answer(found: SoundDetections) -> DetectionAnswer:
    """Return the arrivals as a document."""
    searched, dead, target, log = found
    arrivals = sound_arrivals(searched)
    return DetectionAnswer(
        detected=bool(arrivals),
        arrivals=arrivals,
        threshold_snr_db=max(one.threshold_snr_db for one in searched),
        latency_s=max(one.latency_s for one in searched),
        method=target.keys,
        channels=tuple(
            SearchedChannel(
                one.channel.sensor,
                one.channel.record,
                one.channel.number,
                one.channel.rate_hz,
                one.channel.samples.size / one.channel.rate_hz,
                one.threshold_snr_db,
            )
            for one in searched
        ),
        dead_channels=dead,
        arrays=tuple(map(_array, log.arrays)) if log else (),
        other_sounds=sum(not found.is_blast for found in _sounds(searched)),
        rejected_arrivals=sound_arrivals(searched, others=True),
    )


def sound_arrivals(
    searched: Sequence[Searched], *, others: bool = False
) -> tuple[SoundArrival, ...]:
    """Return the arrivals of all channels, or the other sounds, in order of time."""
    arrivals = [
        SoundArrival(found, one.channel.number, one.channel.sensor, found.fit)
        for one in searched
        for found in (one.others if others else one.detections)
    ]
    return tuple(sorted(arrivals, key=lambda arrival: arrival.found.time_s))


def _array(finding: ArrayFinding) -> ArrayAnswer:
    came, direction = finding.direction, None
    if came is not None:
        bearing_sd, elevation_sd = came.covariance.diagonal() ** 0.5
        direction = ArrayDirection(
            layout=came.layout,
            bearing_rad=came.bearing,
            bearing_sd_rad=bearing_sd,
            elevation_rad=came.elevation,
            elevation_sd_rad=elevation_sd,
            undetermined=tuple(came.undetermined),
            mirror_rad=came.mirror,
            p_plane_wave=finding.probability,
        )
    return ArrayAnswer(finding.array, finding.bang + 1, finding.used, direction)
