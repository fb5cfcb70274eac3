"""A pick beside its samples: both as means over the same few stretches of time."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.inference.picks import Pick, RecordPick
from jblast.kept_programs import kept
from jblast.waves.waveform.pulse import Pulse, pulse_mean

BINS = 320
"""What a picture of a record shows."""
BEFORE, AFTER = 0.6, 1.4
"""Drawn before the front, in positive phases; and after it, in lengths of the wave."""


class Curve(NamedTuple):
    """What is drawn of a pick, a value for each bin.

    Attributes:
        time: Middle of each bin [s].
        samples: Mean of the samples in it.
        low: Least of them.
        high: Largest of them.
        fitted: Mean of the fitted pulse over it, above the baseline at the arrival.
    """

    time: Float[np.ndarray, " bin"]
    samples: Float[np.ndarray, " bin"]
    low: Float[np.ndarray, " bin"]
    high: Float[np.ndarray, " bin"]
    fitted: Float[np.ndarray, " bin"]


def curves(picks: Sequence[RecordPick]) -> list[Curve]:
    """Return what is drawn of picks that keep their samples."""
    edges = [_edges(one) for one in picks]
    padded = np.array([np.pad(e, (0, BINS + 1 - e.size), mode="edge") for e in edges])
    start = np.array([one.record.start_s for one in picks])[:, None]
    rate = np.array([one.record.rate_hz for one in picks])[:, None]
    arrival = np.array([float(one.pick.air_arrival_s) for one in picks])[:, None]
    # a sample is a mean about its time; from the arrival, so that no digits are lost
    since = (start - arrival) + (padded - 0.5) / rate
    pulses = _pulses([one.pick for one in picks])
    fitted = np.asarray(_means(pulses, jax.device_put(since)))
    return [
        _curve(one, edge, means)
        for one, edge, means in zip(picks, edges, fitted, strict=True)
    ]


@kept
def _means(pulses: Pulse, edges: Float[Array, "pick edge"]) -> Float[Array, "pick bin"]:
    return jax.vmap(pulse_mean)(pulses, edges[:, :-1], edges[:, 1:])


def _pulses(picks: Sequence[Pick]) -> Pulse:
    """Return pulses that arrive at zero."""

    def of(name: str) -> Float[Array, "pick 1"]:
        return jax.device_put(
            np.array([[getattr(pick, name)] for pick in picks], float)
        )

    zero = jax.device_put(np.zeros((len(picks), 1)))
    return Pulse(
        arrival_time=zero,
        peak=of("peak_overpressure_pa"),
        rise_time=of("rise_time_s"),
        duration=of("positive_duration_s"),
        decay=of("decay"),
        suction=of("negative_pressure_pa"),
        suction_duration=of("negative_duration_s"),
        hold_time=zero,
    )


def _edges(one: RecordPick) -> Int[np.ndarray, " edge"]:
    """Return the samples that bins begin and end at: at most `BINS` bins of a size."""
    pick, record = one.pick, one.record
    arrival, duration = float(pick.air_arrival_s), float(pick.positive_duration_s)
    if np.isnan(duration):  # an onset alone: all of the record
        arrival, duration = record.start_s, record.seconds
    wave = duration + float(np.nan_to_num(pick.negative_duration_s))
    first = int((arrival - BEFORE * duration - record.start_s) * record.rate_hz) - 1
    last = int((arrival + AFTER * wave - record.start_s) * record.rate_hz) + 2
    first, last = max(first, 0), min(last, record.samples.size)
    first = max(min(first, last - 2), 0)
    size = -(-(last - first) // BINS)
    return np.arange(first, last + 1, size)


def _curve(
    one: RecordPick,
    edges: Int[np.ndarray, " edge"],
    fitted: Float[np.ndarray, " bins"],
) -> Curve:
    record = one.record
    own = record.samples[edges[0] : edges[-1]] - float(one.pick.baseline_pa)
    bins = own.reshape(edges.size - 1, -1)
    middle = 0.5 * (edges[:-1] + edges[1:] - 1)
    return Curve(
        record.start_s + middle / record.rate_hz,
        bins.mean(axis=1),
        bins.min(axis=1),
        bins.max(axis=1),
        _through_high_pass(one, fitted[: len(bins)], int(edges[1] - edges[0])),
    )


def _through_high_pass(
    one: RecordPick, fitted: Float[np.ndarray, " bin"], samples: int
) -> Float[np.ndarray, " bin"]:
    """Return the pulse as the recorder's first-order high-pass shows it, if it has one.

    Args:
        one: The pick.
        fitted: The pulse in bins, still at the first.
        samples: Of a bin.
    """
    if not one.record.high_pass_hz:
        return fitted
    from scipy.signal import lfilter

    step = samples / one.record.rate_hz
    kept = np.exp(-2.0 * np.pi * one.record.high_pass_hz * step)
    gain = 0.5 * (1.0 + kept)
    return np.asarray(lfilter([gain, -gain], [1.0, -kept], fitted))
