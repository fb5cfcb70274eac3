"""Arrivals of a search with the times of their picks.

A matched filter is most sensitive with a template that resembles the sound, but its
time is right only for the template's own form: behind a high-pass, an echo or a clipped
peak the best of a bank is a longer pulse that begins before the sound does, by up to
half of its own duration. The search therefore chooses the window, and the pick of its
samples (`picks`), as of a record, decides when a blast arrived. Its error contains that
of the form.

Where no pulse and no onset can be picked, the time of the search remains. Its error by
the form is that of a beginning anywhere within half of the template, to either side,
and the range of the times by all templates.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jblast.signals.detection import Detection
from jblast.signals.picks.record_picks import RecordPick
from jblast.signals.pulse_fit import pick_near

OTHER_FRONT = 0.5
"""Error of a pick by a sample that is an instant or the mean over an interval
[samples]."""


def picked_arrivals(
    arrivals: Sequence[Detection],
    samples: Float[np.ndarray, " sample"],
    rate_hz: float,
) -> tuple[Detection, ...]:
    """Return arrivals of a channel with the times of their picks.

    Args:
        arrivals: Arrivals.
        samples: The samples about them, in any unit.
        rate_hz: Sampling rate [Hz].
    """
    return tuple(
        timed(
            one,
            pick_near(one.time_s, one.template_s, samples, rate_hz, one.spread_s),
            rate_hz,
        )
        for one in arrivals
    )


def timed(
    arrival: Detection, picked: RecordPick | None, rate_hz: float, start_s: float = 0.0
) -> Detection:
    """Return an arrival with the time of its pick, or with a larger error.

    Args:
        arrival: The arrival.
        picked: Its pick; None without one.
        rate_hz: Sampling rate [Hz].
        start_s: Time of the first of the picked samples [s].
    """
    if picked is None:
        form_s = arrival.template_s / math.sqrt(12.0)
        sigma_s = math.hypot(arrival.sigma_s, arrival.spread_s, form_s)
        return arrival._replace(sigma_s=sigma_s)
    sigma_s = math.hypot(picked.pick.sd("air_arrival_s"), OTHER_FRONT / rate_hz)
    time_s = start_s + picked.pick.air_arrival_s
    return arrival._replace(time_s=time_s, sigma_s=sigma_s)
