r"""A bank of blasts by the laws: which charge, how far, says the one that fits best.

By the laws a pulse is known from $W^{1/3}$ and range. In pascals the bank compares the
likelihood of each member *as it is*: with the filter's output $s$ and the member's own
response $r = \sqrt{2E/N_0}$ it is, against noise alone,

$$\ln L = s\,r - r^2/2$$

(Kay II, eq. 4.4), and peak and duration together tell charge and range. Where the
recording's gain is not known the amplitude is free, $\ln L = s^2/2$, and only the form
is left: that is a duration, and nearly nothing else. Past Z = 5 or so every pair of
$W^{1/3}$ and range with the same duration has the same form. `Match.members` are all
that fit nearly as well, and their ranges say what has been learnt and what has not.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.detect.kernel import matched_kernel
from jblast.detect.matched_filter import filtered_by
from jblast.detect.peaks import Detection, detections
from jblast.detect.samples import checked_positive, checked_samples
from jblast.detect.templates import blast_templates
from jblast.detect.threshold import FALSE_ALARMS_PER_HOUR, threshold_for
from jblast.detect.whitening import NoiseSpectrum, noise_spectrum as measured_spectrum
from jblast.errors import InputError, argument

NEARLY = 3.0
"""Of the logarithm of the likelihood: what is 20 times less likely is not kept."""


class Member(NamedTuple):
    """One blast of a bank.

    Attributes:
        cube_root_kg: W^(1/3) [kg^(1/3)].
        range_m: Slant range [m].
        template: Samples from the front on [Pa].
    """

    cube_root_kg: float
    range_m: float
    template: Float[np.ndarray, " tap"]


class Match(NamedTuple):
    """What a bank made of the loudest blast in a recording.

    Attributes:
        detection: Of the best member.
        best: The member of the greatest likelihood.
        members: All that are nearly as likely, the best first.
        calibrated: Whether amplitudes counted; if not, only forms did, and what the
            members share is a duration, rather than a charge or a range.
    """

    detection: Detection
    best: Member
    members: tuple[Member, ...]
    calibrated: bool


def template_bank(
    cube_roots_kg: Iterable[float], ranges_m: Iterable[float], rate_hz: float
) -> tuple[Member, ...]:
    """Return the blasts of all pairs of W^(1/3) and range.

    Args:
        cube_roots_kg: Values of W^(1/3) [kg^(1/3)].
        ranges_m: Slant ranges [m].
        rate_hz: Sampling rate [Hz].
    """
    ranges = tuple(ranges_m)
    pairs = [(root, far) for root in cube_roots_kg for far in ranges]
    masses, far = [root**3 for root, _ in pairs], [there for _, there in pairs]
    rows = blast_templates(masses, far, rate_hz) if pairs else []
    return tuple(Member(*pair, row) for pair, row in zip(pairs, rows, strict=True))


def best_match(
    recording: ArrayLike,
    bank: Iterable[Member],
    rate_hz: float,
    *,
    noise_spectrum: NoiseSpectrum | None = None,
    calibrated: bool = False,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
) -> Match | None:
    """Return what a bank makes of the most likely blast in a recording; None if none.

    The false alarms are those of the whole bank: each member gets its share.

    Args:
        recording: Samples of one channel, in pascals if calibrated.
        bank: The blasts.
        rate_hz: Sampling rate of both [Hz].
        noise_spectrum: Of the noise; none to measure it in the recording.
        calibrated: Whether the recording is in pascals.
        false_alarms_per_hour: Of all members together [1/h].

    Raises:
        InputError: The bank is empty, or recording or rate are no good.
    """
    samples = checked_samples("recording", recording)
    members = tuple(bank)
    if not members:
        raise InputError(f"{argument('bank')}: expected one blast at least, got none")
    each = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    each /= len(members)
    if noise_spectrum is None:
        noise_spectrum = measured_spectrum(samples, rate_hz)
    heard: list[tuple[float, Member, Detection]] = []
    for member in members:
        kernel = matched_kernel(member.template, rate_hz, noise_spectrum)
        found = detections(filtered_by(samples, kernel), threshold_for(kernel, each))
        for one in found:
            free, size = one.statistic, kernel.response
            likely = free * size - size**2 / 2 if calibrated else free**2 / 2
            heard.append((likely, member, one))
    if not heard:
        return None
    best = max(heard, key=lambda entry: entry[0])
    near = [
        entry
        for entry in sorted(heard, key=lambda entry: -entry[0])
        if best[0] - entry[0] < NEARLY
        and abs(entry[2].time_s - best[2].time_s) * rate_hz < best[1].template.size
    ]
    return Match(best[2], best[1], tuple(entry[1] for entry in near), calibrated)
