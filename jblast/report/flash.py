"""The answer of `jblast detect` for film."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from jblast.results import Document, among
from jblast.signals.flash.fireball import Direction, Growth, Silhouette
from jblast.signals.flash.search import Flash, FlashDetections, Rejected
from jblast.signals.matched_filter import in_decibels

Kind = Literal["frames", "video", "events"]


def slow_film(frames_hz: float) -> str:
    """Return what to know of a film whose frames are far apart."""
    return (
        f"{frames_hz:g} frames/s: a fireball grows within a few milliseconds, and the "
        "test was set for 1,000 frames/s; slower films show a lamp and a blast alike, "
        "and false alarms are not those asked for"
    )


def rejected_alarms(rejected: Sequence[Rejected]) -> list[str]:
    """Return a note for each reason for which alarms were rejected."""
    notes = []
    for reason in dict.fromkeys(one.reason for one in rejected):
        times = [f"{one.time_s:.3g} s" for one in rejected if one.reason == reason]
        more = f" and {len(times) - 1} more" if len(times) > 1 else ""
        notes.append(f"no blast at {times[0]}{more}: {reason}")
    return notes


@dataclass(frozen=True)
class Arrival:
    """A flash in a line.

    Attributes:
        time_s: First light, since frame 0 or the first event.
        snr_db: Of the test's statistic, when it was told.
        sigma_s: Of the time.
        pixel: Where the burst is, x and y.
        frame: The first that shows it; of events the millisecond.
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
    """All that is known of a flash.

    Attributes:
        grown: First light, place and growth.
        alarm: First frame and alarm.
        direction: From the camera; null without a scene.
        growth: Its silhouettes.
    """

    grown: Growth = field(
        metadata=among(
            *("time_s", "sigma_s", "x_px", "x_sigma_px", "y_px", "y_sigma_px"),
            *("radius_px", "radius_sigma_px", "growth_s", "growth_sigma_s"),
        )
    )
    alarm: Flash = field(metadata=among("frame", "told_s", "statistic"))
    direction: Direction | None
    growth: tuple[GrownTo, ...]


@dataclass(frozen=True)
class Method:
    """How it was searched.

    Attributes:
        name: The test.
        false_alarms_per_hour: Of scenes that look like a blast.
        threshold: Of the statistic.
    """

    name: Literal["growth_cusum"]
    false_alarms_per_hour: float
    threshold: float


@dataclass(frozen=True)
class Searched:
    """What was searched.

    Attributes:
        path: Folder or file.
        kind: Of which kind.
        width: In pixels.
        height: In pixels.
        frames: How many; of events milliseconds.
        frames_hz: A second.
        seconds: How long.
    """

    path: str
    kind: Kind
    width: int
    height: int
    frames: int
    frames_hz: float
    seconds: float


@dataclass(frozen=True)
class FlashAnswer(Document):
    """What was seen.

    Attributes:
        detected: Whether anything was.
        arrivals: In order of time.
        threshold_snr_db: The same of the threshold as `snr_db`.
        latency_s: From first light to being told, of the slowest; the least there can
            be where nothing was seen.
        method: How it was searched.
        recording: What was searched.
        flashes: All that is known of each arrival.
        warnings: Warnings, a sentence each.
    """

    detected: bool
    arrivals: tuple[Arrival, ...]
    threshold_snr_db: float
    latency_s: float
    method: Method
    recording: Searched
    flashes: tuple[FlashSeen, ...]
    warnings: tuple[str, ...]


def flash_text(answer: FlashAnswer) -> str:
    """Return what was seen."""
    count = len(answer.flashes)
    head = f"{count} {'blast' if count == 1 else 'blasts'}" if count else "No blast"
    rate = answer.method.false_alarms_per_hour
    lines = [
        f"{head} seen in {_searched(answer.recording)}",
        f"looked for: a bright spot that grows to both sides and stays; {rate:g} false "
        f"{'alarm' if rate == 1 else 'alarms'} an hour of what looks like one",
    ]
    for number, flash in enumerate(answer.flashes, 1):
        lines += ["", *_lines(flash, number if count > 1 else None)]
    lines += [f"\nNote: {warning}" for warning in answer.warnings]
    return "\n".join(lines) + "\n"


def _searched(what: Searched) -> str:
    size = f"{what.width} x {what.height} pixels"
    if what.kind == "events":
        return f"{what.seconds:.6g} s of events of {size}"
    return (
        f"{what.frames:,} frames of {size}, {what.seconds:.6g} s at "
        f"{what.frames_hz:g} frames/s"
    )


def _lines(flash: FlashSeen, number: int | None) -> list[str]:
    grown, seen_from = flash.grown, flash.direction
    digits = min(max(1 - math.floor(math.log10(grown.sigma_s)), 1), 9)
    late = 1e3 * (flash.alarm.told_s - grown.time_s)
    lines = [f"Blast {number}"] if number else []
    lines += [
        f"first light  {grown.time_s:.{digits}f} ± {grown.sigma_s:.2g} s, frame "
        f"{flash.alarm.frame}, told {late:.3g} ms later",
        f"where        x {grown.x_px:.1f} ± {grown.x_sigma_px:.1f} px, "
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
            f"grew to      {grown.radius_px:.1f} ± {grown.radius_sigma_px:.1f} px, "
            f"time constant {tau:.2f} ± {tau_sd:.2g} ms"
        )
    else:
        last = flash.alarm.silhouettes[-1]
        lines.append(
            f"grew to      {last.radius_px:.1f} px at {last.time_s:.6g} s; no growth "
            "could be fitted"
        )
    return lines


def flash_answer(
    watched: FlashDetections,
    searched: Searched,
    false_alarms: float,
    directions: Sequence[Direction] = (),
    warnings: Sequence[str] = (),
) -> FlashAnswer:
    """Return the answer on a film.

    Args:
        watched: What was seen in it.
        searched: What it is.
        false_alarms: For how many an hour the threshold was set.
        directions: Of each flash; none without a scene.
        warnings: Warnings, a sentence each.
    """
    late = [f.told_s - f.growth.time_s for f in watched.flashes]
    return FlashAnswer(
        detected=bool(watched.flashes),
        arrivals=tuple(_arrival(flash) for flash in watched.flashes),
        threshold_snr_db=in_decibels(watched.threshold),
        latency_s=max(late, default=watched.latency_s),
        method=Method("growth_cusum", false_alarms, watched.threshold),
        recording=searched,
        flashes=tuple(
            FlashSeen(
                flash.growth,
                flash,
                directions[i] if directions else None,
                tuple(map(GrownTo, flash.silhouettes)),
            )
            for i, flash in enumerate(watched.flashes)
        ),
        warnings=tuple(warnings),
    )


def _arrival(flash: Flash) -> Arrival:
    grown = flash.growth
    decibels = in_decibels(flash.statistic)
    pixel = grown.x_px, grown.y_px
    return Arrival(grown.time_s, decibels, grown.sigma_s, pixel, flash.frame)
