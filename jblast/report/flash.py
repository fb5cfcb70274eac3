"""The answer of `jblast detect` for film."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Literal

from jblast.report.detect import SoundArrival, sound_arrivals
from jblast.results import Document, among
from jblast.signals.detect_files import Film, FilmDetections
from jblast.signals.flash.fireball import Direction, Growth, Silhouette
from jblast.signals.flash.search import SLOW_HZ, Candidate, Flash
from jblast.signals.matched_filter import in_decibels

CAUSES = {
    "faint": "below the threshold",
    "grows_on": "its growth did not slow down as a fireball's of up to 1 t does",
    "flicker": "its size changed without an order, as on glittering water",
}
"""Reasons for which a bright spot is not reported as a blast."""
MAX_LISTED = 5
"""Largest number of such spots in the text; the document has all of them."""


def slow_film(frames_hz: float) -> str:
    """Return the warning for a film with a low frame rate."""
    return (
        f"{frames_hz:g} frames/s: a fireball grows within a few milliseconds, and the "
        "test is calibrated at 1,000 frames/s; at lower rates a lamp looks like a "
        "blast, and the false-alarm rate is not the requested one"
    )


def candidate_lines(candidates: Sequence[Candidate], threshold: float) -> list[str]:
    """Return a line for each of the strongest other bright spots."""
    strongest = sorted(candidates, key=lambda one: -one.statistic)[:MAX_LISTED]
    lines = [
        f"frame {one.frame} ({one.time_s:.5g} s) at x {one.x_px:.0f}, "
        f"y {one.y_px:.0f} px: {CAUSES[one.cause]}, statistic {one.statistic:.3g} of "
        f"{threshold:.3g}"
        for one in strongest
    ]
    more = len(candidates) - len(lines)
    return lines + [f"and {more} fainter ones"] * (more > 0)


@dataclass(frozen=True)
class Arrival:
    """A flash, in short.

    Attributes:
        time_s: First light, since frame 0 or the first event.
        snr_db: Test statistic at the detection.
        sigma_s: Standard error of the time.
        pixel: Position of the burst, x and y [px].
        frame: First frame with the flash; for events the millisecond.
    """

    time_s: float
    snr_db: float
    sigma_s: float
    pixel: tuple[float, float]
    frame: int


@dataclass(frozen=True)
class GrownTo:
    """A silhouette.

    Attributes:
        silhouette: The silhouette.
    """

    silhouette: Silhouette = field(
        metadata=among("time_s", "radius_px", "x_px", "y_px", "cut")
    )


@dataclass(frozen=True)
class FlashSeen:
    """A flash, in full.

    Attributes:
        grown: First light, position and growth.
        alarm: First frame and alarm.
        direction: Direction from the camera; null without a scene.
        growth: Its silhouettes.
    """

    grown: Growth = field(
        metadata=among(
            *("time_s", "sigma_s", "x_px", "x_sigma_px", "y_px", "y_sigma_px"),
            *("radius_px", "radius_sigma_px", "growth_s", "growth_sigma_s"),
        )
    )
    alarm: Flash = field(metadata=among("frame", "alarm_s", "statistic"))
    direction: Direction | None
    growth: tuple[GrownTo, ...]


@dataclass(frozen=True)
class Method:
    """Method of the search.

    Attributes:
        name: Name of the test.
        false_alarms_per_hour: False-alarm rate in scenes that look like a blast.
        threshold: Threshold of the statistic.
    """

    name: Literal["growth_cusum"]
    false_alarms_per_hour: float
    threshold: float


@dataclass(frozen=True)
class FlashAnswer(Document):
    """The answer of `jblast detect` for film.

    Attributes:
        detected: Whether a flash was detected.
        arrivals: Flashes in order of time.
        threshold_snr_db: The threshold, in the unit of `snr_db`.
        latency_s: Largest delay from first light to detection; without a flash the
            least possible one.
        method: Method of the search.
        recording: The searched film.
        flashes: Each flash in full.
        warnings: Warnings, as sentences.
        sound_arrivals: Arrivals in the sound track of a video, from the first frame.
        bang_s: Time of the loudest arrival after the flash; null without one.
        candidates: Bright spots that are not reported as blasts, in order of time.
    """

    detected: bool
    arrivals: tuple[Arrival, ...]
    threshold_snr_db: float
    latency_s: float
    method: Method
    recording: Film
    flashes: tuple[FlashSeen, ...]
    warnings: tuple[str, ...]
    sound_arrivals: tuple[SoundArrival, ...] = ()
    bang_s: float | None = None
    candidates: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class ClipsAnswer(Document):
    """The answer of `jblast detect` for several videos.

    Attributes:
        detected: Whether any clip has a flash or a bang.
        clips: The answer for each clip.
    """

    detected: bool
    clips: tuple[FlashAnswer, ...]


def flash_text(answer: FlashAnswer) -> str:
    """Return the flashes, for the terminal."""
    count = len(answer.flashes)
    nothing = "No blast" if answer.bang_s is None else "No flash"
    head = f"{count} {'blast' if count == 1 else 'blasts'}" if count else nothing
    rate = answer.method.false_alarms_per_hour
    lines = [f"{head} detected in {_film_words(answer.recording)}"]
    for number, flash in enumerate(answer.flashes, 1):
        lines += ["", *_lines(flash, number if count > 1 else None)]
    if answer.bang_s is not None:
        lines += ["", f"bang         {answer.bang_s:.4f} s in the sound track"]
        if answer.arrivals:
            later = answer.bang_s - answer.arrivals[0].time_s
            lines[-1] += f", {later:.4f} s after the first light"
    others = candidate_lines(answer.candidates, answer.method.threshold)
    if others:
        lines += ["", "other bright spots:", *(f"  {line}" for line in others)]
    lines += [
        "",
        "search target: a bright spot that grows in all directions and stays; "
        f"false-alarm rate {rate:g} per hour",
    ]
    lines += [f"\nWarning: {warning}" for warning in answer.warnings]
    return "\n".join(lines) + "\n"


def _film_words(film: Film) -> str:
    size = f"{film.width} x {film.height} pixels"
    if film.kind == "events":
        return f"{film.seconds:.6g} s of events of {size}"
    return (
        f"{film.frames:,} frames of {size}, {film.seconds:.6g} s at "
        f"{film.frames_hz:g} frames/s"
    )


def _lines(flash: FlashSeen, number: int | None) -> list[str]:
    grown, seen_from = flash.grown, flash.direction
    # a time is printed to the second significant digit of its standard error
    digits = min(max(1 - math.floor(math.log10(grown.sigma_s)), 1), 9)
    late = 1e3 * (flash.alarm.alarm_s - grown.time_s)
    lines = [f"Blast {number}"] if number else []
    lines += [
        f"first light  {grown.time_s:.{digits}f} ± {grown.sigma_s:.2g} s, frame "
        f"{flash.alarm.frame}, detected {late:.3g} ms later",
        f"position     x {grown.x_px:.1f} ± {grown.x_sigma_px:.1f} px, "
        f"y {grown.y_px:.1f} ± {grown.y_sigma_px:.1f} px",
    ]
    if seen_from is not None:
        east, east_sd, up, up_sd = seen_from
        lines.append(
            f"direction    bearing {math.degrees(east):.2f} ± "
            f"{math.degrees(east_sd):.2g} degrees, elevation {math.degrees(up):.2f} ± "
            f"{math.degrees(up_sd):.2g} degrees"
        )
    if grown.radius_px is not None and grown.growth_s is not None:
        tau, tau_sd = 1e3 * grown.growth_s, 1e3 * (grown.growth_sigma_s or 0.0)
        lines.append(
            f"radius       {grown.radius_px:.1f} ± {grown.radius_sigma_px:.1f} px, "
            f"time constant {tau:.2f} ± {tau_sd:.2g} ms"
        )
    else:
        last = flash.alarm.silhouettes[-1]
        lines.append(
            f"radius       {last.radius_px:.1f} px at {last.time_s:.6g} s; the growth "
            "could not be fitted"
        )
    return lines


def flash_answer(found: FilmDetections) -> FlashAnswer:
    """Return the answer on a film."""
    watched, hz, bang = found.flashes, found.film.frames_hz, found.bang
    late = [f.alarm_s - f.growth.time_s for f in watched.flashes]
    return FlashAnswer(
        detected=found.detected,
        arrivals=tuple(_arrival(flash) for flash in watched.flashes),
        threshold_snr_db=in_decibels(watched.threshold),
        latency_s=max(late, default=watched.latency_s),
        method=Method("growth_cusum", found.false_alarms_per_hour, watched.threshold),
        recording=found.film,
        flashes=tuple(
            FlashSeen(flash.growth, flash, to, tuple(map(GrownTo, flash.silhouettes)))
            for flash, to in zip_longest(watched.flashes, found.directions)
        ),
        warnings=((slow_film(hz),) if hz < SLOW_HZ else ()) + found.notes,
        sound_arrivals=sound_arrivals(found.sound.searched) if found.sound else (),
        bang_s=bang and bang.time_s,
        candidates=watched.candidates,
    )


def _arrival(flash: Flash) -> Arrival:
    grown = flash.growth
    decibels = in_decibels(flash.statistic)
    pixel = grown.x_px, grown.y_px
    return Arrival(grown.time_s, decibels, grown.sigma_s, pixel, flash.frame)
