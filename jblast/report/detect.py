"""The answer of `jblast detect` for sound."""

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from jblast.report.words import aligned, joined
from jblast.results import plain
from jblast.signals.arrival_log import (
    LEAST_PLANE_PROBABILITY,
    MAX_ARRAY_WIDTH,
    ArrayFinding,
    Log,
)
from jblast.signals.matched_filter import Detection
from jblast.signals.pulse_fit import PulseFit
from jblast.signals.search import Searched

LAYOUTS = {
    "coplanar": "microphones in one plane",
    "spatial": "microphones in space",
    "collinear": "microphones in a line",
    "two": "two microphones",
}
ANGLES = {"bearing_rad": "the bearing", "elevation_rad": "the elevation"}


def detection_text(
    searched: Sequence[Searched],
    dead: Sequence[str],
    target: str,
    log: Log | None = None,
) -> str:
    """Return the arrivals as a table, with notes, for the terminal.

    Args:
        searched: Channels that were searched.
        dead: Names of constant channels, which were skipped.
        target: Search target: a template, the pulse of a charge, or a bank of pulses.
        log: Rows of the arrivals, if there are any.
    """
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
    lines += [f"search target: {target}", *_thresholds(searched)]
    if dead:
        noun = "constant channel" if len(dead) == 1 else "constant channels"
        lines.append(f"{noun} skipped: {joined(list(dead))}")
    lines += _forms(searched)
    if rejected := sum(len(one.rejected) for one in searched):
        sounds = "impulsive sound" if rejected == 1 else "impulsive sounds"
        lines.append(f"{rejected} {sounds} rejected: not the form of a blast pulse")
    if log is not None:
        lines += _of_log(log)
    return "\n".join(lines) + "\n"


def _thresholds(searched: Sequence[Searched]) -> list[str]:
    """Return the line with the threshold and the delay of a detection."""
    levels = [one.threshold_snr_db for one in searched]
    low, high = min(levels), max(levels)
    span = f"{high:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"
    latency = max(one.latency_s for one in searched)
    return [
        f"threshold {span} dB (2E/N0); detection delay {1e3 * latency:.3g} ms "
        "from the first sample"
    ]


def _forms(searched: Sequence[Searched]) -> list[str]:
    """Return the number of arrivals with the form of a blast, if that was tested."""
    fits = [fit for one in searched for fit in one.fits]
    other = sum(not fit.blast_form for fit in fits)
    if not other:
        return []
    return [
        f"{len(fits) - other} of {len(fits)} have the form of a blast pulse; the "
        "remaining ones can be doors, clicks, thunder,",
        "or distant or reverberant blasts (--blast-form removes them)",
    ]


def _table(searched: Sequence[Searched]) -> list[str]:
    rows, tested = [], any(one.fits for one in searched)
    for one in searched:
        for found, fit in zip_longest(one.detections, one.fits):
            digits = min(max(1 - math.floor(math.log10(found.sigma_s)), 1), 9)
            rows.append(
                (
                    one.channel.sensor,
                    f"{found.time_s:.{digits}f}",
                    f"{found.sigma_s:.2g}",
                    f"{found.snr_db:.1f}",
                    *(
                        (f"{fit.misfit:.2f}", f"{fit.log_likelihood_ratio:.1f}")
                        if fit
                        else ()
                    ),
                )
            )
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


def detection_document(
    searched: Sequence[Searched],
    dead: Sequence[str],
    method: dict[str, Any],
    arrays: Sequence[ArrayFinding] = (),
) -> dict[str, Any]:
    """Return the arrivals as a document.

    Args:
        searched: Channels that were searched.
        dead: Names of constant channels, which were skipped.
        method: Parameters of the search, by key.
        arrays: Results of arrays.
    """
    arrivals = [
        _arrival(one, found, fit)
        for one in searched
        for found, fit in zip_longest(one.detections, one.fits)
    ]
    rejected = [_arrival(one, *pair) for one in searched for pair in one.rejected]
    for entries in (arrivals, rejected):
        entries.sort(key=lambda arrival: arrival["time_s"])
    document = {
        "schema": 1,
        "detected": bool(arrivals),
        "arrivals": arrivals,
        "threshold_snr_db": max(one.threshold_snr_db for one in searched),
        "latency_s": max(one.latency_s for one in searched),
        "method": method,
        "channels": [
            {
                "sensor": one.channel.sensor,
                "record": one.channel.record,
                "channel": one.channel.number,
                "rate_hz": one.channel.rate_hz,
                "seconds": one.channel.samples.size / one.channel.rate_hz,
                "threshold_snr_db": one.threshold_snr_db,
            }
            for one in searched
        ],
        "dead_channels": list(dead),
        "arrays": [_array(finding) for finding in arrays],
        "rejected_arrivals": rejected,
    }
    return plain(document)


def _arrival(one: Searched, found: Detection, fit: PulseFit | None) -> dict[str, Any]:
    entry = {
        "time_s": found.time_s,
        "snr_db": found.snr_db,
        "sigma_s": found.sigma_s,
        "channel": one.channel.number,
        "sensor": one.channel.sensor,
    }
    if fit is not None:
        entry |= {
            "blast_form": fit.blast_form,
            "misfit": fit.misfit,
            "log_likelihood_ratio": fit.log_likelihood_ratio,
            "fit_p": fit.p,
            "fit_dof": fit.dof,
            "noise_level": fit.level,
        }
    return entry


def _array(finding: ArrayFinding) -> dict[str, Any]:
    came = finding.direction
    document = {
        "array": finding.array,
        "bang": finding.bang + 1,
        "in_log": finding.used,
    }
    if came is None:
        return document
    sds = came.covariance.diagonal() ** 0.5
    return document | {
        "layout": came.layout,
        "bearing_rad": came.bearing,
        "bearing_sd_rad": sds[0],
        "elevation_rad": came.elevation,
        "elevation_sd_rad": sds[1],
        "undetermined": list(came.undetermined),
        "mirror_rad": came.mirror,
        "p_plane_wave": finding.probability,
    }
