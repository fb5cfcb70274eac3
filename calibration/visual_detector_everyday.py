"""False alarms of the visual detector in everyday scenes that it was not set by.

    python -m calibration.visual_detector_everyday [without a blast] [with one]

Sun glitter from the first frame on, a balloon that is blown up, headlights and a
camera's flash, welding, a door that opens to daylight, shadows of clouds and steps of
an automatic exposure: 0.3 s each, 160 x 120 pixels at 1,000 frames a second. Films are
searched from end to end (`detect_flashes`), at the threshold of one false alarm an
hour: alarms as they are raised, and those that are left when what follows has been
looked at (`jblast.signals.flash.search`). Blasts are filmed for 0.09 s after the burst,
so that all checks see them whole. Written to
`results/visual_detector_everyday.txt`.
"""

import argparse
import sys
from pathlib import Path

import jax
import numpy as np
from scipy.stats import chi2

from calibration.films import OTHERS, RATE_HZ, SECONDS, blast, negative
from calibration.visual_detector_fresh import share
from jblast.files import write_text
from jblast.progress import counted
from jblast.report.view import aligned
from jblast.sensors.camera import explosion_views
from jblast.signals.flash import detect_flashes
from jblast.signals.flash.search import Candidate, FlashDetections, flash_threshold

RESULTS = Path(__file__).parent / "results"
FIRST = 3_000_000
"""Seed from which on none was looked at before."""
FILMED_S = 0.09
"""After a burst [s]."""
BLOCK = 16


def searched(times: np.ndarray, frames: np.ndarray) -> FlashDetections:
    """Return what was seen in a film of linear grey values of 8 bits."""
    blocks = (
        (times[a : a + BLOCK], frames[a : a + BLOCK] / np.float32(255))
        for a in range(0, len(times), BLOCK)
    )
    return detect_flashes(blocks, RATE_HZ, flash_threshold(1.0))


def rejected(seen: FlashDetections) -> list[Candidate]:
    """Return the alarms that were not left."""
    return [one for one in seen.candidates if one.cause != "faint"]


def an_hour(count: int, hours: float) -> str:
    """Return a rate with its upper bound at 95 % (Garwood)."""
    return f"{count / hours:.3g} (< {0.5 * chi2.ppf(0.95, 2 * count + 2) / hours:.3g})"


def negatives_table(each: int) -> list[str]:
    """Return the alarms of each kind."""
    rows: list[tuple[str, ...]] = [
        ("kind", "films", "raised", "left", "raised an hour", "left an hour")
    ]
    through, done, total = (
        counted(each * len(OTHERS), "films without a blast"),
        0,
        [0, 0],
    )
    for kind in OTHERS:
        raised = left = 0
        for seed in range(FIRST, FIRST + each):
            seen = searched(*negative(kind, seed))
            left += len(seen.flashes)
            raised += len(seen.flashes) + len(rejected(seen))
            through(done := done + 1)
        hours = each * SECONDS / 3600
        counts = an_hour(raised, hours), an_hour(left, hours)
        rows.append((kind, f"{each}", f"{raised}", f"{left}", *counts))
        total = [total[0] + raised, total[1] + left]
    hours = each * len(OTHERS) * SECONDS / 3600
    counts = (an_hour(count, hours) for count in total)
    films = f"{each * len(OTHERS)}"
    rows.append(("all", films, f"{total[0]}", f"{total[1]}", *counts))
    return aligned(rows, right={1, 2, 3, 4, 5})


def blasts_lines(count: int) -> list[str]:
    """Return how many blasts raise an alarm in time, and how many are left."""
    pictures = explosion_views()
    through, raised, left = counted(count, "blasts"), 0, 0
    for k in range(count):
        film = blast(FIRST + k, pictures=pictures if k % 2 else None, filmed_s=FILMED_S)
        seen = searched(film.times, film.frames)
        soon = film.burst_s, film.burst_s + 0.02
        found = sum(soon[0] <= one.alarm_s <= soon[1] for one in seen.flashes)
        spurned = sum(soon[0] <= one.time_s <= soon[1] for one in rejected(seen))
        raised, left = raised + bool(found + spurned), left + bool(found)
        through(k + 1)
    return [
        f"Blasts seen within 20 ms: {raised} of {count}, {share(raised, count)}",
        f"and left by the checks:   {left} of {count}, {share(left, count)}",
    ]


def main() -> None:
    """Measure, write the table and print it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("without", nargs="?", type=int, default=24, help="of each kind")
    parser.add_argument("blasts", nargs="?", type=int, default=60)
    how = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    lines = [
        f"Threshold {flash_threshold(1.0):.3f}; films of {SECONDS:g} s, seeds from "
        f"{FIRST:,} on; rates with upper bounds at 95 %",
        "",
        *negatives_table(how.without),
        "",
        *blasts_lines(how.blasts),
    ]
    text = "\n".join(lines) + "\n"
    write_text(RESULTS / "visual_detector_everyday.txt", text)
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
