r"""Templates: recorded blasts, blasts by the laws, and banks of these.

A template begins with the sample at which the front arrives. The filter does not depend
on its scale. By the laws it is the mean of the pressure over each sample, as an
instrument records it, from the front to the end of the suction, without ground effects
and echoes.

A bank has a template for each pair of $W^{1/3}$ and range. In pascals the likelihood of
each member is compared *at its own amplitude*: with the filter's output $s$ and the
member's response $r = \sqrt{2E/N_0}$ it is, against noise alone,

$$\ln L = s\,r - r^2/2$$

(Kay II, eq. 4.4), and peak and duration together identify charge and range. Where the
recording's gain is unknown the amplitude is free, $\ln L = s^2/2$, and only the form
remains, which identifies little but the duration: beyond about Z = 5 all pairs of
$W^{1/3}$ and range with the same duration have the same form. `Match.members` are all
that fit nearly as well; the spread of their ranges shows what is identified.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.errors import InputError, argument
from jblast.signals.matched_filter import (
    FALSE_ALARMS_PER_HOUR,
    Detection,
    detections,
    filtered_by,
    matched_kernel,
    threshold_for,
)
from jblast.signals.noise import (
    NoiseSpectrum,
    checked_positive,
    checked_samples,
    checked_template,
    noise_spectrum as measured_spectrum,
)

LONGEST_S = 60.0
"""Longest duration of a template [s]: that of a nuclear blast; its samples and the
equations of its filter stay within memory."""
FADE = 0.2
"""Share of a recorded template over which its end fades; a cut would be another
front."""
LN_LIKELIHOOD_RANGE = 3.0
"""Largest difference in ln likelihood to the best member of a match: others are more
than 20 times less likely."""


def recorded_template(
    recording: ArrayLike, rate_hz: float, start_s: float, duration_s: float
) -> Float[np.ndarray, " tap"]:
    """Return an interval of a recording as a template.

    The mean of the recording before the interval is subtracted, and its end fades.

    Args:
        recording: Samples of one channel.
        rate_hz: Sampling rate [Hz].
        start_s: Arrival of the front [s].
        duration_s: Length of the interval [s].

    Raises:
        InputError: The interval is not within the recording, or silent.
    """
    samples = checked_samples("recording", recording)
    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    count = round(checked_positive("duration_s", duration_s, "s") * rate_hz)
    start = round(start_s * rate_hz)
    if not 0 <= start < start + count <= samples.size:
        raise InputError(
            f"{argument('start_s')}, {argument('duration_s')}: expected an interval "
            f"within the {samples.size / rate_hz:.6g} s of the recording, got "
            f"{start_s:g} to {start_s + duration_s:g} s"
        )
    stretch = samples[start : start + count]
    # as long an interval before it as the template, so that drift cancels best
    before = samples[max(start - count, 0) : start]
    if before.size:
        stretch = stretch - before.mean()
    fading = max(round(FADE * count), 1)
    fade = 0.5 + 0.5 * np.cos(np.pi * (np.arange(fading) + 1) / (fading + 1))
    return checked_template(np.r_[stretch[:-fading], stretch[-fading:] * fade])


def blast_template(
    mass_kg: float,
    range_m: float,
    rate_hz: float,
    *,
    ambient_pressure_pa: float = STANDARD_PRESSURE,
    sound_speed_m_s: float = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> Float[np.ndarray, " tap"]:
    """Return the blast of a charge at a range, by the laws, as a template [Pa].

    Args:
        mass_kg: TNT-equivalent mass [kg].
        range_m: Slant range [m].
        rate_hz: Sampling rate [Hz].
        ambient_pressure_pa: Ambient pressure [Pa].
        sound_speed_m_s: Speed of sound [m/s].
        burst: "surface" or "free-air".

    Raises:
        InputError: A number is not positive, or the blast is over within two samples.
    """
    mass = checked_positive("mass_kg", mass_kg, "kg")
    distance = checked_positive("range_m", range_m, "m")
    air = (ambient_pressure_pa, sound_speed_m_s)
    return blast_templates([mass], [distance], rate_hz, *air, burst)[0]


def blast_templates(
    masses_kg: Sequence[float],
    ranges_m: Sequence[float],
    rate_hz: float,
    ambient_pressure_pa: float = STANDARD_PRESSURE,
    sound_speed_m_s: float = STANDARD_SOUND_SPEED,
    burst: str = "surface",
) -> list[Float[np.ndarray, " tap"]]:
    """Return one template for each of several charges [Pa]; as `blast_template`.

    Args:
        masses_kg: TNT-equivalent masses [kg].
        ranges_m: Slant ranges [m], of the same number.
        rate_hz: Sampling rate [Hz].
        ambient_pressure_pa: Ambient pressure [Pa].
        sound_speed_m_s: Speed of sound [m/s].
        burst: "surface" or "free-air".
    """
    from jblast.signals.law_pulses import pulses_by_law, sampled

    rate_hz = checked_positive("rate_hz", rate_hz, "Hz")
    mass, distance = (np.asarray(part, float) for part in (masses_kg, ranges_m))
    pulses = pulses_by_law(mass, distance, ambient_pressure_pa, sound_speed_m_s, burst)
    whole_s = np.asarray(pulses.duration + pulses.suction_duration, float)
    short = ~(whole_s * rate_hz >= 2)
    if short.any():
        nth = int(np.argmax(short))
        raise InputError(
            f"{argument('rate_hz')}: expected two samples within the "
            f"{whole_s[nth]:.3g} s of the blast of {mass[nth]:g} kg at "
            f"{distance[nth]:g} m, got {rate_hz:g} Hz"
        )
    if (long := ~(whole_s <= LONGEST_S)).any():
        nth = int(np.argmax(long))
        raise InputError(
            f"{argument('mass_kg')}, {argument('range_m')}: expected a blast of "
            f"{LONGEST_S:g} s at most, got {whole_s[nth]:.3g} s of {mass[nth]:g} kg at "
            f"{distance[nth]:g} m"
        )
    counts = np.ceil(whole_s * rate_hz).astype(int)
    # one compiled program for each power of two, not for each length
    longest = 2 ** int(counts.max() - 1).bit_length()
    rows = np.asarray(sampled(pulses, rate_hz, longest), float)
    return [checked_template(row[:n]) for row, n in zip(rows, counts, strict=True)]


class Member(NamedTuple):
    """One blast of a bank.

    Attributes:
        cube_root_kg: W^(1/3) [kg^(1/3)].
        range_m: Slant range [m].
        template: Samples from the front onwards [Pa].
    """

    cube_root_kg: float
    range_m: float
    template: Float[np.ndarray, " tap"]


class Match(NamedTuple):
    """The loudest blast in a recording, by a bank of templates.

    Attributes:
        detection: Detection by the best member.
        best: Member of the largest likelihood.
        members: All members that are nearly as likely, the best first.
        calibrated: True if amplitudes counted; if only forms did, the members have a
            duration in common rather than a charge or a range.
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
    """Return the best match of a bank to a recording; None without a detection.

    Args:
        recording: Samples of one channel, in pascals if calibrated.
        bank: The blasts.
        rate_hz: Sampling rate of both [Hz].
        noise_spectrum: Spectrum of the noise; None to measure it in the recording.
        calibrated: True for a recording in pascals.
        false_alarms_per_hour: Mean rate of false alarms of all members together [1/h].

    Raises:
        InputError: The bank is empty, or recording or rate are invalid.
    """
    samples = checked_samples("recording", recording)
    members = tuple(bank)
    if not members:
        raise InputError(f"{argument('bank')}: expected at least one blast, got none")
    each = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    each /= len(members)
    if noise_spectrum is None:
        noise_spectrum = measured_spectrum(samples, rate_hz)
    matches: list[tuple[float, Member, Detection]] = []
    for member in members:
        kernel = matched_kernel(member.template, rate_hz, noise_spectrum)
        found = detections(filtered_by(samples, kernel), threshold_for(kernel, each))
        for one in found:
            free, size = one.statistic, kernel.response
            # Kay II, eq. 4.4, at the member's amplitude or maximized over it
            log_likelihood = free * size - size**2 / 2 if calibrated else free**2 / 2
            matches.append((log_likelihood, member, one))
    if not matches:
        return None
    best = max(matches, key=lambda entry: entry[0])
    near = [
        entry
        for entry in sorted(matches, key=lambda entry: -entry[0])
        # only members that match the same arrival are alternatives
        if best[0] - entry[0] < LN_LIKELIHOOD_RANGE
        and abs(entry[2].time_s - best[2].time_s) * rate_hz < best[1].template.size
    ]
    return Match(best[2], best[1], tuple(entry[1] for entry in near), calibrated)
