"""The answer of `jblast detect` for film."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from jblast.json_values import entries
from jblast.signals.flash.search import Flash, FlashDetections, Rejected
from jblast.signals.matched_filter import in_decibels

if TYPE_CHECKING:  # it brings JAX
    from jblast.signals.flash.fireball import Direction
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
        time_s: When.
        radius_px: Of the disc or half disc whose columns spread as much.
        x_px: Mean column.
        y_px: Mean row.
        cut: Whether an edge of the image cuts it.
    """

    time_s: float
    radius_px: float
    x_px: float
    y_px: float
    cut: bool


@dataclass(frozen=True)
class FlashSeen:
    """All that is known of a flash.

    Attributes:
        time_s: First light, since frame 0 or the first event.
        sigma_s: Its standard deviation.
        frame: The first that shows it; of events the millisecond.
        told_s: When it was told.
        statistic: Of the test then.
        x_px: The burst in the image.
        x_sigma_px: Its standard deviation.
        y_px: Down from the top.
        y_sigma_px: Its standard deviation.
        radius_px: Of the fireball when it has grown; null where it is not told.
        radius_sigma_px: Its standard deviation.
        growth_s: Time constant of its growth; null where it is not told.
        growth_sigma_s: Its standard deviation.
        direction: From the camera; null without a scene.
        growth: Its silhouettes.
    """

    time_s: float
    sigma_s: float
    frame: int
    told_s: float
    statistic: float
    x_px: float
    x_sigma_px: float
    y_px: float
    y_sigma_px: float
    radius_px: float | None
    radius_sigma_px: float | None
    growth_s: float | None
    growth_sigma_s: float | None
    direction: "DirectionSeen | None"
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
class FlashAnswer:
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

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold of it."""
        return {"schema": 1} | entries(self)


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
    digits = min(max(1 - math.floor(math.log10(flash.sigma_s)), 1), 9)
    late = 1e3 * (flash.told_s - flash.time_s)
    lines = [f"Blast {number}"] if number else []
    lines += [
        f"first light  {flash.time_s:.{digits}f} ± {flash.sigma_s:.2g} s, frame "
        f"{flash.frame}, told {late:.3g} ms later",
        f"where        x {flash.x_px:.1f} ± {flash.x_sigma_px:.1f} px, "
        f"y {flash.y_px:.1f} ± {flash.y_sigma_px:.1f} px",
    ]
    if flash.direction is not None:
        east, up = flash.direction.bearing_rad, flash.direction.elevation_rad
        east_sd, up_sd = (
            flash.direction.bearing_sd_rad,
            flash.direction.elevation_sd_rad,
        )
        lines.append(
            f"direction    bearing {math.degrees(east):.2f} ± "
            f"{math.degrees(east_sd):.2g} degrees, elevation {math.degrees(up):.2f} ± "
            f"{math.degrees(up_sd):.2g} degrees"
        )
    if flash.radius_px is not None and flash.growth_s is not None:
        tau, tau_sd = 1e3 * flash.growth_s, 1e3 * (flash.growth_sigma_s or 0.0)
        lines.append(
            f"grew to      {flash.radius_px:.1f} ± {flash.radius_sigma_px:.1f} px, "
            f"time constant {tau:.2f} ± {tau_sd:.2g} ms"
        )
    else:
        last = flash.growth[-1]
        lines.append(
            f"grew to      {last.radius_px:.1f} px at {last.time_s:.6g} s; no growth "
            "could be fitted"
        )
    return lines


@dataclass(frozen=True)
class DirectionSeen:
    """From the camera to the burst, by the scene's pose and lens.

    Attributes:
        bearing_rad: Clockwise from north.
        bearing_sd_rad: Its standard deviation, of the place in the image alone.
        elevation_rad: Above the horizon.
        elevation_sd_rad: Its standard deviation, likewise.
    """

    bearing_rad: float
    bearing_sd_rad: float
    elevation_rad: float
    elevation_sd_rad: float


def flash_answer(
    watched: FlashDetections,
    searched: Searched,
    false_alarms: float,
    directions: "Sequence[Direction]" = (),
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
            _seen(flash, DirectionSeen(*directions[i]) if directions else None)
            for i, flash in enumerate(watched.flashes)
        ),
        warnings=tuple(warnings),
    )


def _arrival(flash: Flash) -> Arrival:
    grown = flash.growth
    decibels = in_decibels(flash.statistic)
    pixel = grown.x_px, grown.y_px
    return Arrival(grown.time_s, decibels, grown.sigma_s, pixel, flash.frame)


def _seen(flash: Flash, direction: DirectionSeen | None) -> FlashSeen:
    grown = flash.growth
    return FlashSeen(
        time_s=grown.time_s,
        sigma_s=grown.sigma_s,
        frame=flash.frame,
        told_s=flash.told_s,
        statistic=flash.statistic,
        x_px=grown.x_px,
        x_sigma_px=grown.x_sigma_px,
        y_px=grown.y_px,
        y_sigma_px=grown.y_sigma_px,
        radius_px=grown.radius_px,
        radius_sigma_px=grown.radius_sigma_px,
        growth_s=grown.growth_s,
        growth_sigma_s=grown.growth_sigma_s,
        direction=direction,
        growth=tuple(
            GrownTo(s.time_s, s.radius_px, s.x_px, s.y_px, s.cut)
            for s in flash.silhouettes
        ),
    )
