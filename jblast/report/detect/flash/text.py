"""What was seen in a film, in words for a terminal."""

import math
from collections.abc import Sequence

from jblast.detect.flash.search import Rejected
from jblast.report.detect.flash.answer import FlashAnswer, FlashSeen, Searched


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
