"""What was heard, as JSON."""

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from jblast.detect.array.log import ArrayFinding
from jblast.detect.peaks import Detection
from jblast.detect.pulse_fit import PulseFit
from jblast.detect.search import Searched
from jblast.json_values import plain


def detection_document(
    searched: Sequence[Searched],
    dead: Sequence[str],
    method: dict[str, Any],
    arrays: Sequence[ArrayFinding] = (),
) -> dict[str, Any]:
    """Return the document of what was heard.

    Args:
        searched: Channels that were searched.
        dead: Names of those that could not be.
        method: How, as keys and values.
        arrays: What arrays told.
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
