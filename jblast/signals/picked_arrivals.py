"""Arrivals of a search with the times of their picks.

A matched filter is most sensitive with a template that resembles the sound, but its
time is right only for the template's own form: behind a high-pass, an echo or a clipped
peak the best of a bank is a longer pulse that begins before the sound does, by up to
half of its own duration. The search therefore decides that there is a blast, and the
pick of the samples about it (`picks`) when it arrived. Its error contains that of the
form.

Where no pulse and no onset can be picked, the time of the search remains. Its error by
the form is that of a beginning anywhere within half of the template, to either side,
and the range of the times of the bank's templates.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from jblast.observations.records.recording import PressureRecord
from jblast.signals.matched_filter import Detection
from jblast.signals.picks import pick_records
from jblast.signals.picks.pick import LEAST_SAMPLES
from jblast.signals.sound_watch import OTHER_FRONT

BEFORE_S, AFTER_S = 0.25, 0.75
"""Interval before and after an arrival that is picked [s]: enough quiet to measure the
noise, and the longest pulses of the bank with their suction, 0.3 s. Between two
arrivals it ends midway."""


def picked_arrivals(
    arrivals: Sequence[Detection],
    samples: Float[np.ndarray, " sample"],
    rate_hz: float,
    start_s: float = 0.0,
) -> tuple[Detection, ...]:
    """Return arrivals of a channel with the times of their picks.

    Args:
        arrivals: Arrivals in order of time.
        samples: The samples about them, in any unit.
        rate_hz: Sampling rate [Hz].
        start_s: Time of the first sample, on the clock of the arrivals [s].
    """
    times = [arrival.time_s for arrival in arrivals]
    middles = [0.5 * (one + other) for one, other in pairwise(times)]
    bounds = pairwise([-math.inf, *middles, math.inf])
    found = []
    for arrival, (last, following) in zip(arrivals, bounds, strict=False):
        first_s = max(arrival.time_s - BEFORE_S, last)
        last_s = min(arrival.time_s + AFTER_S, following)
        whole = (np.array([first_s, last_s]) - start_s) * rate_hz
        begin, end = np.clip(whole, 0, samples.size).astype(int).tolist()
        record = PressureRecord(
            name="",
            samples=samples[begin:end],
            rate_hz=rate_hz,
            start_s=start_s + begin / rate_hz,
            calibrated=False,
        )
        found.append(_timed(arrival, record))
    return tuple(found)


def _timed(arrival: Detection, record: PressureRecord) -> Detection:
    """Return an arrival with the time of its pick, or with a larger error."""
    if record.samples.size >= LEAST_SAMPLES and np.ptp(record.samples) > 0:
        (picked,) = pick_records([record])
        time_s = picked.pick.air_arrival_s
        # a short pulse can be loudest within a longer sound, at which others begin
        reach_s = max(arrival.template_s, arrival.spread_s)
        near = abs(time_s - arrival.time_s) <= reach_s
        if picked.quality != "poor" and near:
            # a sample may be an instant or the mean over an interval
            unknown_s = OTHER_FRONT / record.rate_hz
            sigma_s = math.hypot(picked.pick.sd("air_arrival_s"), unknown_s)
            return arrival._replace(time_s=time_s, sigma_s=sigma_s)
    form_s = arrival.template_s / math.sqrt(12.0)
    sigma_s = math.hypot(arrival.sigma_s, arrival.spread_s, form_s)
    return arrival._replace(sigma_s=sigma_s)
